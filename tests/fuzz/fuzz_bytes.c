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

size_t fuzz_fields_begin(void) {
    return 20 + strlen(model_description.guid);
}

void fuzz_write_number(fmi2Byte *to, uint64_t number, size_t size) {
    for (size_t k = 0; k < size; k++) {
        to[k] = (fmi2Byte)(number >> 8 * k);
    }
}

void fuzz_write_field(struct fuzz_bytes *bytes, size_t field, uint64_t bits) {
    const size_t count = (bytes->size - fuzz_fields_begin() - FUZZ_FIELD) / FUZZ_FIELD;
    fuzz_write_number(bytes->data + fuzz_fields_begin() + FUZZ_FIELD * (field % count), bits,
                      FUZZ_FIELD);
}

void fuzz_repair_checksum(struct fuzz_bytes *bytes) {
    uint64_t hash = 0xcbf29ce484222325u;
    for (size_t i = 0; i + FUZZ_FIELD < bytes->size; i++) {
        hash = (hash ^ (uint8_t)bytes->data[i]) * 0x100000001b3u;
    }
    fuzz_write_number(bytes->data + bytes->size - FUZZ_FIELD, hash, FUZZ_FIELD);
}

void fuzz_forge(struct fuzz_input *input, struct fuzz_bytes *bytes) {
    const unsigned changes = 1 + fuzz_below(input, 3);
    for (unsigned i = 0; i < changes; i++) {
        const size_t field = fuzz_byte(input) | (size_t)fuzz_byte(input) << 8;
        const double real = fuzz_real(input);
        uint64_t bits = (uint64_t)(int64_t)fuzz_integer(input);
        if (fuzz_below(input, 2) == 0) {
            memcpy(&bits, &real, sizeof bits);
        }
        fuzz_write_field(bytes, field, bits);
    }
    fuzz_repair_checksum(bytes);
}
