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

/* ---- Moved to another instance --------------------------------------------------------------- */

/* Whether a forged state asks for no more work in a step than this. */
static bool is_quick(struct fuzz_instance *instance, fmi2Integer most) {
    static const char *const limits[] = {"max_internal_steps", "max_events"};
    for (size_t i = 0; i < FUZZ_COUNT(limits); i++) {
        const struct variable *limit = fuzz_find(limits[i]);
        fmi2Integer value = 0;
        if (limit != NULL &&
            (FUZZ_CHECKED(instance, GetInteger, &limit->reference, 1, &value) != fmi2OK ||
             value > most)) {
            return false;
        }
    }
    return true;
}

static void use_forged(struct fuzz_input *input, struct fuzz_instance *other,
                       const struct fuzz_stepping *stepping) {
    const fmi2ValueReference time = 0;
    const double length = stepping->any_length(input);
    struct fuzz_values values;
    if (is_quick(other, stepping->most) &&
        FUZZ_CHECKED(other, GetReal, &time, 1, &other->time) == fmi2OK &&
        fuzz_step(other, length) != fmi2Error) {
        fuzz_read(other, &values);
    }
}

static void use_same(struct fuzz_input *input, struct fuzz_instance *instance,
                     struct fuzz_instance *other, const struct fuzz_stepping *stepping) {
    struct fuzz_values here;
    struct fuzz_values there;
    const double length = stepping->any_length(input);
    const unsigned choices = stepping->has_choices ? fuzz_byte(input) : 0;
    const double begin = instance->time;
    fmi2FMUstate before = fuzz_save(instance);
    other->time = begin;
    const fmi2Status status = stepping->step(instance, length, choices);
    if (stepping->step(other, length, choices) != status) {
        fuzz_fail("a step in another instance has another status than %d", (int)status);
    }
    fuzz_read(instance, &here);
    fuzz_read(other, &there);
    fuzz_assert_same(&here, &there, "a step in another instance");
    fuzz_restore(instance, before, begin);
    fuzz_forget(instance, &before);
}

void fuzz_move_state(struct fuzz_input *input, struct fuzz_instance *instance,
                     const struct fuzz_stepping *stepping) {
    static struct fuzz_bytes bytes;
    const bool is_forged = fuzz_below(input, 2) == 0;
    struct fuzz_instance *other = fuzz_instance_create_variety(
        instance->kind, is_forged ? 0 : instance->variety, true, false);
    fmi2FMUstate state = NULL;
    fuzz_serialize(instance, &bytes);
    if (is_forged) {
        fuzz_forge(input, &bytes);
    }
    const fmi2Status status =
        FUZZ_CHECKED(other, DeSerializeFMUstate, bytes.data, bytes.size, &state);
    if (!is_forged && status != fmi2OK) {
        fuzz_fail("a serialized state is refused: %s", other->text);
    }
    if (status == fmi2OK) {
        fuzz_require(FUZZ_CHECKED(other, SetFMUstate, state), other, "fmi2SetFMUstate");
        is_forged ? use_forged(input, other, stepping) : use_same(input, instance, other, stepping);
    }
    fuzz_instance_free(other);
}
