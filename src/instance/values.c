#include "values.h"

#include "failures.h"
#include "modes.h"
#include "state.h"

#include <math.h>
#include <string.h>

/* ---- Calculated values ---------------------------------------------------------------------- */

/* Calculates all values from parameters, inputs, states and modes. */
static enum status calculate(struct instance *instance) {
    const enum status status =
        instance->model->outputs(instance->memory.values, instance->state.time.s);
    instance->outputs_are_valid = status == STATUS_OK;
    if (status != STATUS_OK) {
        message_write(&instance->sink, status, "no outputs at t = %.17g: %s",
                      instance->state.time.s, status_text(status));
    } else if (instance->is_integrated_outside && instance->model->events != NULL) {
        instance_add_bands(instance);
    }
    return status;
}

/* Writes initial_values: ends the initialization for a moment, without a message. If it cannot end,
 * they are the present values. */
static void look_ahead(struct instance *instance) {
    const size_t size = instance->model->values_size;
    const struct message_sink sink = instance->sink;
    char *values = instance->memory.values;
    char *before = instance->second_derivatives;
    memcpy(before, values, size);
    memcpy(instance->initial_values, values, size);
    instance->sink = (struct message_sink){0};
    if (instance_check_parameters(instance) == STATUS_OK &&
        instance_update_modes(instance, NULL) == STATUS_OK) {
        instance_move_anchors(instance);
        (void)calculate(instance);
        memcpy(instance->initial_values, values, size);
    }
    instance->sink = sink;
    instance->outputs_are_valid = false;
    memcpy(values, before, size);
}

enum status instance_update_outputs(struct instance *instance) {
    if (instance->outputs_are_valid) {
        return STATUS_OK;
    }
    const enum status status = calculate(instance);
    if (status == STATUS_OK && instance_shown_values(instance) != instance->memory.values) {
        look_ahead(instance);
        instance->outputs_are_valid = true;
    }
    return status;
}

/* ---- Values by reference -------------------------------------------------------------------- */

/* Type of the elements of an array, and of the variables that it is for. */
#define ARRAY_OF(name, constant, element) ARRAY_OF_##constant,
enum array { VALUE_TYPE_LIST(ARRAY_OF) };
#undef ARRAY_OF

_Static_assert(sizeof(bool) == 1, "a bool is read as a byte");

/* Returns element i as a double: exact for every int, and for every int64_t that is an item of an
 * enumeration. A bool is read as a byte, so that any but 0 and 1 can be refused. */
ALWAYS_INLINE double element(enum array array, const void *values, size_t i) {
    switch (array) {
    case ARRAY_OF_REAL:
        return ((const double *)values)[i];
    case ARRAY_OF_ENUMERATION:
        return (double)((const int64_t *)values)[i];
    case ARRAY_OF_BOOL:
        return ((const unsigned char *)values)[i];
    default:
        return ((const int *)values)[i];
    }
}

/* Returns the type that a variable must have; for ARRAY_OF_INTEGER either of the two. */
ALWAYS_INLINE enum variable_type type_for(const struct instance *instance, enum array array,
                                          unsigned reference) {
    const struct variable *variable;
    switch (array) {
    case ARRAY_OF_REAL:
        return VARIABLE_FLOAT64;
    case ARRAY_OF_INT32:
        return VARIABLE_INT32;
    case ARRAY_OF_ENUMERATION:
        return VARIABLE_ENUMERATION;
    case ARRAY_OF_INTEGER:
        variable = variable_find(instance->description, reference);
        return variable != NULL && variable->type == VARIABLE_ENUMERATION ? VARIABLE_ENUMERATION
                                                                          : VARIABLE_INT32;
    case ARRAY_OF_BOOLEAN:
    case ARRAY_OF_BOOL:
        break;
    }
    return VARIABLE_BOOLEAN;
}

static inline bool is_settable(const struct instance *instance, const struct variable *variable) {
    const enum phase phase = instance->state.phase;
    return variable_is_settable(variable, phase) ||
           (phase == PHASE_STEPPING && instance->is_integrated_outside &&
            instance_is_kept_number(instance, variable)) ||
           ((phase == PHASE_CONTINUOUS_TIME || instance->states_are_settable) &&
            instance_is_state(instance, variable));
}

/* Returns the variable with this reference and type; NULL, with a message, if there is none. */
static inline const struct variable *find(const struct instance *instance, unsigned reference,
                                          enum variable_type type) {
    const struct variable *variable = variable_find(instance->description, reference);
    return variable != NULL && variable->type == type
               ? variable
               : instance_refuse_reference(instance, reference, type);
}

ALWAYS_INLINE const struct variable *find_settable(const struct instance *instance,
                                                   unsigned reference, enum variable_type type) {
    static const char *const when[PHASE_COUNT] = {
        [PHASE_INSTANTIATED] = "at all: only start values and inputs can",
        [PHASE_INITIALIZATION] = "at all: only start values and inputs can",
        [PHASE_STEPPING] = "after initialization: only inputs and tunable parameters can",
        [PHASE_CONTINUOUS_TIME] =
            "while the time is continuous: only continuous inputs and states can",
    };
    const struct variable *variable = find(instance, reference, type);
    if (variable != NULL && !is_settable(instance, variable)) {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "%s (value reference %u) cannot be set %s", variable->name, reference,
                      when[instance->state.phase]);
        return NULL;
    }
    return variable;
}

ALWAYS_INLINE enum status set(struct instance *instance, enum array array,
                              const unsigned references[], size_t count, const void *values) {
    for (size_t i = 0; i < count; i++) {
        const struct variable *variable =
            find_settable(instance, references[i], type_for(instance, array, references[i]));
        if (variable == NULL) {
            return STATUS_INVALID_ARGUMENT;
        }
        const enum status status =
            variable_check_value(variable, element(array, values, i), &instance->sink);
        if (status != STATUS_OK) {
            return status;
        }
    }
    bool is_setting = false;
    for (size_t i = 0; i < count; i++) {
        const struct variable *variable = variable_of(instance->description, references[i]);
        instance_write_field(instance, variable, element(array, values, i));
        is_setting |= variable->owner == VARIABLE_OF_INSTANCE;
    }
    instance->outputs_are_valid = false;
    if (is_setting) {
        instance_update_tolerance(instance);
    }
    return STATUS_OK;
}

#define INSTANCE_SET(name, constant, element)                                                      \
    enum status instance_set_##name(struct instance *instance, const unsigned references[],        \
                                    size_t count, const element values[]) {                        \
        return set(instance, ARRAY_OF_##constant, references, count, values);                      \
    }
VALUE_TYPE_LIST(INSTANCE_SET)

/* Value structures from which values are read. */
struct shown {
    const char *values; /* the instance's own */
    const char *from;   /* instance_shown_values */
};

static inline struct shown shown_in(const struct instance *instance) {
    return (struct shown){instance->memory.values, instance_shown_values(instance)};
}

static inline bool is_shown(const struct shown *shown, const struct instance_real *real) {
    return real->is_calculated || (real->is_kept && shown->from != shown->values);
}

static inline const void *shown_at(const struct shown *shown, const struct instance_real *real,
                                   const void *field) {
    return is_shown(shown, real) ? shown->from + ((const char *)field - shown->values) : field;
}

static inline double shown_real(const struct shown *shown, const struct instance_real *real) {
    return *(const double *)shown_at(shown, real, real->value);
}

/* Brings the value up to date. Modes and discrete states need no calculation. */
static enum status prepare(struct instance *instance, const struct instance_real *real) {
    if (real->is_kept) {
        look_ahead(instance);
        return STATUS_OK;
    }
    return instance_update_outputs(instance);
}

enum status instance_get_real(struct instance *instance, const unsigned references[], size_t count,
                              double values[]) {
    const struct model_description *description = instance->description;
    const struct instance_real *reals = instance->reals;
    const struct shown shown = shown_in(instance);
    for (size_t i = 0; i < count; i++) {
        const unsigned reference = references[i];
        if (reference >= description->reference_count || reals[reference].value == NULL) {
            (void)instance_refuse_reference(instance, reference, VARIABLE_FLOAT64);
            return STATUS_INVALID_ARGUMENT;
        }
        if (is_shown(&shown, &reals[reference]) && !instance->outputs_are_valid) {
            const enum status status = prepare(instance, &reals[reference]);
            if (status != STATUS_OK) {
                return status;
            }
        }
        if (!isfinite(shown_real(&shown, &reals[reference]))) {
            return instance_field_not_finite(instance, variable_of(description, reference)->offset);
        }
    }
    for (size_t i = 0; i < count; i++) {
        values[i] = shown_real(&shown, &reals[references[i]]);
    }
    return STATUS_OK;
}

static int read_int(struct instance *instance, unsigned reference) {
    const struct shown shown = shown_in(instance);
    const void *field = instance_field(instance, variable_of(instance->description, reference));
    return *(const int *)shown_at(&shown, &instance->reals[reference], field);
}

/* Checks that all variables can be read, and brings their values up to date. */
static enum status prepare_ints(struct instance *instance, enum array array,
                                const unsigned references[], size_t count) {
    const struct shown shown = shown_in(instance);
    for (size_t i = 0; i < count; i++) {
        const unsigned reference = references[i];
        if (find(instance, reference, type_for(instance, array, reference)) == NULL) {
            return STATUS_INVALID_ARGUMENT;
        }
        if (is_shown(&shown, &instance->reals[reference])) {
            const enum status status = prepare(instance, &instance->reals[reference]);
            if (status != STATUS_OK) {
                return status;
            }
        }
        const bool is_calculated = instance->reals[reference].is_calculated;
        if (is_calculated && read_int(instance, reference) == MODEL_NO_INT) {
            return instance_field_not_finite(instance,
                                             variable_of(instance->description, reference)->offset);
        }
    }
    return STATUS_OK;
}

/* In the conversion to bool an int that is not 0 gives true. */
#define INSTANCE_GET(name, constant, element)                                                      \
    enum status instance_get_##name(struct instance *instance, const unsigned references[],        \
                                    size_t count, element values[]) {                              \
        const enum status status = prepare_ints(instance, ARRAY_OF_##constant, references, count); \
        for (size_t i = 0; status == STATUS_OK && i < count; i++) {                                \
            values[i] = read_int(instance, references[i]);                                         \
        }                                                                                          \
        return status;                                                                             \
    }
INTEGER_TYPE_LIST(INSTANCE_GET)
