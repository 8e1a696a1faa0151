#include "fuzz_bytes.h"

#include <string.h>

void fuzz_serialize_state(struct fuzz_instance *instance, fmi2FMUstate state,
                          struct fuzz_bytes *bytes) {
    fuzz_require(FUZZ_CHECKED(instance, SerializedFMUstateSize, state, &bytes->size), instance,
                 "fmi2SerializedFMUstateSize");
    if (bytes->size > sizeof bytes->data / 2) {
        fuzz_fail("%zu bytes of a state are too many for struct fuzz_bytes", bytes->size);
    }
    fuzz_require(FUZZ_CHECKED(instance, SerializeFMUstate, state, bytes->data, bytes->size),
                 instance, "fmi2SerializeFMUstate");
}

void fuzz_serialize(struct fuzz_instance *instance, struct fuzz_bytes *bytes) {
    fmi2FMUstate state = fuzz_save(instance);
    fuzz_serialize_state(instance, state, bytes);
    fuzz_forget(instance, &state);
}

bool fuzz_are_same_bytes(const struct fuzz_bytes *one, const struct fuzz_bytes *other) {
    return one->size == other->size && memcmp(one->data, other->data, one->size) == 0;
}

/* ---- Changed fields -------------------------------------------------------------------------- */

/* serialization.h: magic, version, length and length of the GUID in 20 bytes, the GUID, fields of 8
 * bytes, FNV-1a of all that. */
enum { FIELD = 8 };

static void write_field(fmi2Byte *to, uint64_t bits) {
    for (size_t k = 0; k < FIELD; k++) {
        to[k] = (fmi2Byte)(bits >> 8 * k);
    }
}

static void repair_checksum(struct fuzz_bytes *bytes) {
    uint64_t hash = 0xcbf29ce484222325u;
    for (size_t i = 0; i + FIELD < bytes->size; i++) {
        hash = (hash ^ (uint8_t)bytes->data[i]) * 0x100000001b3u;
    }
    write_field(bytes->data + bytes->size - FIELD, hash);
}

void fuzz_forge(struct fuzz_input *input, struct fuzz_bytes *bytes) {
    const size_t begin = 20 + strlen(model_description.guid);
    const size_t count = (bytes->size - begin - FIELD) / FIELD;
    const unsigned changes = 1 + fuzz_below(input, 3);
    for (unsigned i = 0; i < changes; i++) {
        const size_t field = fuzz_byte(input) | (size_t)fuzz_byte(input) << 8;
        const double real = fuzz_real(input);
        uint64_t bits = (uint64_t)(int64_t)fuzz_integer(input);
        if (fuzz_below(input, 2) == 0) {
            memcpy(&bits, &real, sizeof bits);
        }
        write_field(bytes->data + begin + FIELD * (field % count), bits);
    }
    repair_checksum(bytes);
}
