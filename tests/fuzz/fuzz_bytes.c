#include "fuzz_bytes.h"

#include <string.h>

static void require(fmi2Status status, const struct fuzz_instance *instance, const char *what) {
    if (status != fmi2OK) {
        fuzz_fail("%s has the status %d: %s", what, (int)status, instance->text);
    }
}

void fuzz_serialize(struct fuzz_instance *instance, struct fuzz_bytes *bytes) {
    fmi2FMUstate state = NULL;
    require(FUZZ_CHECKED(instance, GetFMUstate, &state), instance, "fmi2GetFMUstate");
    require(FUZZ_CHECKED(instance, SerializedFMUstateSize, state, &bytes->size), instance,
            "fmi2SerializedFMUstateSize");
    if (bytes->size > sizeof bytes->data) {
        fuzz_fail("%zu bytes of a state are too many for struct fuzz_bytes", bytes->size);
    }
    require(FUZZ_CHECKED(instance, SerializeFMUstate, state, bytes->data, bytes->size), instance,
            "fmi2SerializeFMUstate");
    require(FUZZ_CHECKED(instance, FreeFMUstate, &state), instance, "fmi2FreeFMUstate");
}

/* src/instance/snapshot/serialization.h: magic, version, lengths, GUID, fields of 8 bytes, FNV-1a
 * of it. */
enum { BEFORE_GUID = 20, FIELD = 8 };

static void write_number(fmi2Byte to[FIELD], uint64_t number) {
    for (int k = 0; k < FIELD; k++) {
        to[k] = (fmi2Byte)(number >> 8 * k);
    }
}

static void repair_checksum(struct fuzz_bytes *bytes) {
    uint64_t hash = 0xcbf29ce484222325u;
    for (size_t i = 0; i + FIELD < bytes->size; i++) {
        hash = (hash ^ (uint8_t)bytes->data[i]) * 0x100000001b3u;
    }
    write_number(bytes->data + bytes->size - FIELD, hash);
}

void fuzz_forge(struct fuzz_input *input, struct fuzz_bytes *bytes) {
    const size_t begin = BEFORE_GUID + strlen(model_description.guid);
    const size_t count = (bytes->size - begin - FIELD) / FIELD;
    const unsigned changes = 1 + fuzz_below(input, 3);
    for (unsigned i = 0; i < changes; i++) {
        const size_t field = (fuzz_byte(input) | (size_t)fuzz_byte(input) << 8) % count;
        const double real = fuzz_real(input);
        uint64_t bits = (uint64_t)(int64_t)fuzz_integer(input);
        if (fuzz_below(input, 2) == 0) {
            memcpy(&bits, &real, sizeof bits);
        }
        write_number(bytes->data + begin + FIELD * field, bits);
    }
    repair_checksum(bytes);
}
