#include "fuzz_instance.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct fmu_functions fuzz_fmu;
void (*fuzz_choose_variety)(unsigned variety);

static const char instance_name[] = "fuzzed";

/* ---- Log ------------------------------------------------------------------------------------- */

static bool is_category(const char *category) {
    static const char *const categories[] = {"logEvents",        "logStatusWarning",
                                             "logStatusDiscard", "logStatusError",
                                             "logStatusFatal",   "logAll"};
    for (size_t i = 0; i < FUZZ_COUNT(categories); i++) {
        if (strcmp(category, categories[i]) == 0) {
            return true;
        }
    }
    return false;
}

/* Whether printf, to which a message of FMI 2.0 goes, does not look for further arguments. */
static bool has_no_formats(const char *text) {
    for (; fmu_version == 2 && *text != '\0'; text++) {
        if (*text == '%' && *++text != '%') {
            return false;
        }
    }
    return true;
}

static void log_text(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                     fmi2String category, fmi2String message, ...) {
    struct fuzz_instance *instance = environment;
    if (instance == NULL || name == NULL || category == NULL || message == NULL ||
        message[0] == '\0' || !has_no_formats(message) || !is_category(category) ||
        status > fmi2Pending) {
        fuzz_fail("malformed text in the log: '%s', category '%s'",
                  message != NULL ? message : "(null)", category != NULL ? category : "(null)");
    }
    instance->told[status]++;
    snprintf(instance->text, sizeof instance->text, "%s", message);
}

/* ---- Life ------------------------------------------------------------------------------------ */

static void choose(unsigned variety) {
    if (fuzz_choose_variety != NULL) {
        fuzz_choose_variety(variety);
    }
}

struct fuzz_instance *fuzz_instance_create(fmi2Type kind, unsigned variety, bool has_logger,
                                           bool logging_on) {
    struct fuzz_instance *instance = fuzz_array(1, sizeof *instance);
    fmi2CallbackFunctions *callbacks = fuzz_array(1, sizeof *callbacks);
    *callbacks = (fmi2CallbackFunctions){
        .logger = has_logger ? log_text : NULL,
        .allocateMemory = calloc,
        .freeMemory = free,
        .componentEnvironment = instance,
    };
    if (fuzz_fmu.Instantiate == NULL && fmu_version_open(&fuzz_fmu) == NULL) {
        fuzz_fail("the functions of the FMU are not found");
    }
    instance->kind = kind;
    instance->variety = variety;
    instance->has_logger = has_logger;
    instance->tells_refusals = has_logger;
    choose(variety);
    instance->component =
        FUZZ_CALL(fuzz_fmu.Instantiate(instance_name, kind, model_description.guid, NULL, callbacks,
                                       fmi2False, logging_on ? fmi2True : fmi2False));
    choose(0);
    free(callbacks); // valid during the call only
    if (instance->component == NULL) {
        fuzz_fail("no instance is made");
    }
    fuzz_instance_count++;
    return instance;
}

void fuzz_instance_free(struct fuzz_instance *instance) {
    if (instance != NULL) {
        fuzz_call_count++;
        fuzz_fmu.FreeInstance(instance->component);
        free(instance);
    }
}

/* ---- Status ---------------------------------------------------------------------------------- */

/* Functions that may still succeed after an fmi2Error: sections 3.2.3 and 4.2.4. In FMI 3.0 they
 * are the same, but some of FMI 2.0 are no call there. */
static bool is_served_in_error(enum fmu_function function) {
    switch (function) {
    case FMU_SetupExperiment:
    case FMU_SetRealInputDerivatives:
        return fmu_version == 3;
    case FMU_SetDebugLogging:
    case FMU_Reset:
    case FMU_GetReal:
    case FMU_GetInteger:
    case FMU_GetBoolean:
    case FMU_GetString:
    case FMU_GetFMUstate:
    case FMU_SetFMUstate:
    case FMU_FreeFMUstate:
    case FMU_SerializedFMUstateSize:
    case FMU_SerializeFMUstate:
    case FMU_DeSerializeFMUstate:
    case FMU_GetDirectionalDerivative:
    case FMU_GetRealOutputDerivatives:
    case FMU_GetDerivatives:
    case FMU_GetEventIndicators:
    case FMU_GetContinuousStates:
    case FMU_GetNominalsOfContinuousStates:
        return true;
    default:
        return false;
    }
}

fmi2Status fuzz_check(struct fuzz_instance *instance, enum fmu_function function,
                      fmi2Status status) {
    return fuzz_check_call(instance, fmu_function_names[function], is_served_in_error(function),
                           status);
}

fmi2Status fuzz_check_call(struct fuzz_instance *instance, const char *name, bool works_in_error,
                           fmi2Status status) {
    if (status != fmi2OK && status != fmi2Discard && status != fmi2Error) {
        fuzz_fail("%s returns the status %d", name, (int)status);
    }
    if (instance->tells_refusals && status != fmi2OK && instance->told[status] == 0) {
        fuzz_fail("%s returns the status %d without a text", name, (int)status);
    }
    if (instance->in_error && status != fmi2Error && !works_in_error) {
        fuzz_fail("%s returns the status %d in the error state", name, (int)status);
    }
    if (status == fmi2Error) {
        instance->in_error = true;
    }
    memset(instance->told, 0, sizeof instance->told);
    return status;
}

void fuzz_require(fmi2Status status, const struct fuzz_instance *instance, const char *what) {
    if (status != fmi2OK) {
        fuzz_fail("%s has the status %d: %s", what, (int)status, instance->text);
    }
}

fmi2FMUstate fuzz_save(struct fuzz_instance *instance) {
    fmi2FMUstate state = NULL;
    fuzz_require(FUZZ_CHECKED(instance, GetFMUstate, &state), instance, "fmi2GetFMUstate");
    return state;
}

void fuzz_restore(struct fuzz_instance *instance, fmi2FMUstate state, double time) {
    fuzz_require(FUZZ_CHECKED(instance, SetFMUstate, state), instance, "fmi2SetFMUstate");
    instance->in_error = false;
    instance->time = time;
}

void fuzz_forget(struct fuzz_instance *instance, fmi2FMUstate *state) {
    fuzz_require(FUZZ_CHECKED(instance, FreeFMUstate, state), instance, "fmi2FreeFMUstate");
}

void fuzz_limit_steps(struct fuzz_instance *instance, fmi2Integer limit) {
    const struct variable *variable = fuzz_find("max_internal_steps");
    if (variable != NULL &&
        FUZZ_CHECKED(instance, SetInteger, &variable->reference, 1, &limit) != fmi2OK) {
        fuzz_fail("max_internal_steps of a new instance cannot be set");
    }
}

void fuzz_reset(struct fuzz_instance *instance) {
    if (FUZZ_CHECKED_PLAIN(instance, Reset) != fmi2OK) {
        fuzz_fail("fmi2Reset fails");
    }
    instance->in_error = false;
    instance->time = 0.0;
    instance->slope = 0.0;
}

/* ---- Saved states as bytes ------------------------------------------------------------------- */

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

/* ---- Values ---------------------------------------------------------------------------------- */

const struct variable *fuzz_find(const char *name) {
    for (size_t i = 0; i < model_description.variable_count; i++) {
        if (strcmp(model_description.variables[i].name, name) == 0) {
            return &model_description.variables[i];
        }
    }
    return NULL;
}

size_t fuzz_state_count(void) {
    return model_description.model->states.size / sizeof(double);
}

void fuzz_assert_written(fmi2Status status, const double values[], size_t count, const char *what) {
    if (status != fmi2OK) {
        if (!fuzz_is_poisoned(values, count)) {
            fuzz_fail("%s writes values though its status is %d", what, (int)status);
        }
        return;
    }
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(values[i])) {
            fuzz_fail("%s returns fmi2OK with the value %g in place %zu", what, values[i], i);
        }
    }
}

static fmi2Status read_real(struct fuzz_instance *instance, fmi2ValueReference reference,
                            double *value) {
    double read;
    fuzz_poison(&read, 1);
    const fmi2Status status = FUZZ_CHECKED(instance, GetReal, &reference, 1, &read);
    fuzz_assert_written(status, &read, 1, "fmi2GetReal");
    if (status == fmi2Error) {
        fuzz_fail("the variable with the reference %u cannot be read", reference);
    }
    *value = status == fmi2OK ? read : 0.0;
    return status;
}

static void read_integer(struct fuzz_instance *instance, const struct variable *variable,
                         fmi2Integer *value) {
    const fmi2Status status =
        variable->type == VARIABLE_BOOLEAN
            ? FUZZ_CHECKED(instance, GetBoolean, &variable->reference, 1, value)
            : FUZZ_CHECKED(instance, GetInteger, &variable->reference, 1, value);
    if (status != fmi2OK) {
        fuzz_fail("%s cannot be read", variable->name);
    }
}

void fuzz_read(struct fuzz_instance *instance, struct fuzz_values *values) {
    fmi2ValueReference references[FUZZ_VARIABLE_CAPACITY];
    double reals[FUZZ_VARIABLE_CAPACITY];
    size_t count = 0;
    memset(values, 0, sizeof *values);
    values->status = fmi2OK;
    if (model_description.variable_count > FUZZ_VARIABLE_CAPACITY ||
        fuzz_state_count() > FUZZ_STATE_CAPACITY) {
        fuzz_fail("more variables or states than this program can hold");
    }
    for (size_t i = 0; i < model_description.variable_count; i++) {
        if (model_description.variables[i].type == VARIABLE_FLOAT64) {
            references[count++] = model_description.variables[i].reference;
        } else {
            read_integer(instance, &model_description.variables[i], &values->integers[i]);
        }
    }
    fuzz_poison(reals, count);
    const fmi2Status status = FUZZ_CHECKED(instance, GetReal, references, count, reals);
    fuzz_assert_written(status, reals, count, "fmi2GetReal");
    count = 0;
    for (size_t i = 0; i < model_description.variable_count; i++) {
        if (model_description.variables[i].type != VARIABLE_FLOAT64) {
            continue;
        }
        if (status == fmi2OK) {
            values->reals[i] = reals[count++];
        } else if (read_real(instance, model_description.variables[i].reference,
                             &values->reals[i]) != fmi2OK) {
            values->status = fmi2Discard;
        }
    }
    if (status != values->status) {
        fuzz_fail("all variables together have the status %d, alone %d", (int)status,
                  (int)values->status);
    }
}

double fuzz_value(const struct fuzz_values *values, fmi2ValueReference reference) {
    return values->reals[model_description.row_of_reference[reference]];
}

void fuzz_assert_same(const struct fuzz_values *expected, const struct fuzz_values *actual,
                      const char *what) {
    for (size_t i = 0; i < model_description.variable_count; i++) {
        if (memcmp(&expected->reals[i], &actual->reals[i], sizeof expected->reals[i]) != 0 ||
            expected->integers[i] != actual->integers[i]) {
            fuzz_fail("%s: %s is %.17g (%d), not %.17g (%d)", what,
                      model_description.variables[i].name, actual->reals[i], actual->integers[i],
                      expected->reals[i], expected->integers[i]);
        }
    }
    if (expected->status != actual->status) {
        fuzz_fail("%s: the status is %d, not %d", what, (int)actual->status, (int)expected->status);
    }
}
