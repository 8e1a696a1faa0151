/* Values of the types that only FMI 3.0 has, adjoint derivatives, and calls that are refused
 * whatever their arguments are: clocks, configuration, dependencies. */
#include "fuzz_arguments.h"
#include "fuzz_fmi3.h"

#include <math.h>
#include <stdlib.h>

/* Mostly the number that belongs to the references. */
static size_t value_count(struct fuzz_input *input, size_t count) {
    const unsigned selector = fuzz_byte(input);
    return selector < 240 ? count : selector % 8;
}

static void require_refusal(fmi2Status status, const char *name) {
    if (status != fmi2Error) {
        fuzz_fail("%s is not refused: status %d", name, (int)status);
    }
}

/* ---- Values ---------------------------------------------------------------------------------- */

/* No variable has the type: only no value can be had. */
static void check_no_value(fmi2Status status, size_t count, const char *name) {
    if (status == fmi2OK && count > 0) {
        fuzz_fail("%s of %zu variables succeeds", name, count);
    }
}

#define NO_VARIABLES(Verb, type, constant, works_in_error)                                         \
    static void call_##Verb##type(struct fuzz_session *session, struct fuzz_instance *instance) {  \
        const size_t count = fuzz_any_count(session->input);                                       \
        const size_t size = value_count(session->input, count);                                    \
        fmi2ValueReference *references =                                                           \
            fuzz_any_references(session->input, count, VARIABLE_FLOAT64, false);                   \
        constant fmi3##type *values = fuzz_array(size, sizeof *values);                            \
        check_no_value(                                                                            \
            FUZZ_FMI3_CALL(instance, works_in_error, Verb##type, references, count, values, size), \
            count, "fmi3" #Verb #type);                                                            \
        free(references);                                                                          \
        free((void *)values);                                                                      \
    }
#define NO_VARIABLES_OF_TYPE(type)                                                                 \
    NO_VARIABLES(Get, type, , true)                                                                \
    NO_VARIABLES(Set, type, const, false)
NO_VARIABLES_OF_TYPE(Float32)
NO_VARIABLES_OF_TYPE(Int8)
NO_VARIABLES_OF_TYPE(UInt8)
NO_VARIABLES_OF_TYPE(Int16)
NO_VARIABLES_OF_TYPE(UInt16)
NO_VARIABLES_OF_TYPE(UInt32)
NO_VARIABLES_OF_TYPE(UInt64)
NO_VARIABLES_OF_TYPE(Boolean)
NO_VARIABLES_OF_TYPE(String)

#define NO_BINARIES(Verb, works_in_error)                                                          \
    static void call_##Verb##Binary(struct fuzz_session *session,                                  \
                                    struct fuzz_instance *instance) {                              \
        const size_t count = fuzz_any_count(session->input);                                       \
        const size_t size = value_count(session->input, count);                                    \
        fmi2ValueReference *references =                                                           \
            fuzz_any_references(session->input, count, VARIABLE_FLOAT64, false);                   \
        fmi3Binary *values = fuzz_array(size, sizeof *values);                                     \
        size_t *sizes = fuzz_array(size, sizeof *sizes);                                           \
        check_no_value(FUZZ_FMI3_CALL(instance, works_in_error, Verb##Binary, references, count,   \
                                      sizes, values, size),                                        \
                       count, "fmi3" #Verb "Binary");                                              \
        free(references);                                                                          \
        free(values);                                                                              \
        free(sizes);                                                                               \
    }
NO_BINARIES(Get, true)
NO_BINARIES(Set, false)

/* Of enumerations. */
static void call_GetInt64(struct fuzz_session *session, struct fuzz_instance *instance) {
    const size_t count = fuzz_any_count(session->input);
    const size_t size = value_count(session->input, count);
    fmi2ValueReference *references =
        fuzz_any_references(session->input, count, VARIABLE_ENUMERATION, false);
    fmi3Int64 *values = fuzz_array(size, sizeof *values);
    const fmi2Status status =
        FUZZ_FMI3_CALL(instance, true, GetInt64, references, count, values, size);
    for (size_t i = 0; i < size && status == fmi2OK; i++) {
        if (values[i] < 1 || values[i] > FUZZ_METHODS) {
            fuzz_fail("fmi3GetInt64 returns the item %lld", (long long)values[i]);
        }
    }
    free(references);
    free(values);
}

static void call_SetInt64(struct fuzz_session *session, struct fuzz_instance *instance) {
    const size_t count = fuzz_any_count(session->input);
    const size_t size = value_count(session->input, count);
    fmi2ValueReference *references =
        fuzz_any_references(session->input, count, VARIABLE_ENUMERATION, true);
    fmi3Int64 *values = fuzz_array(size, sizeof *values);
    bool are_items = true;
    for (size_t i = 0; i < size; i++) {
        const unsigned selector = fuzz_byte(session->input);
        values[i] =
            selector < 224 ? (fmi3Int64)(selector % 6) : (fmi3Int64)fuzz_word(session->input);
        are_items = are_items && values[i] >= 1 && values[i] <= FUZZ_METHODS;
    }
    if (FUZZ_FMI3_CHECKED(instance, SetInt64, references, count, values, size) == fmi2OK &&
        !are_items) {
        fuzz_fail("fmi3SetInt64 accepts a value that is no item");
    }
    free(references);
    free(values);
}

static void call_GetAdjointDerivative(struct fuzz_session *session,
                                      struct fuzz_instance *instance) {
    const size_t unknowns = fuzz_any_count(session->input);
    const size_t knowns = fuzz_any_count(session->input);
    const size_t seeds = value_count(session->input, unknowns);
    const size_t results = value_count(session->input, knowns);
    fmi2ValueReference *unknown =
        fuzz_any_references(session->input, unknowns, VARIABLE_FLOAT64, false);
    fmi2ValueReference *known =
        fuzz_any_references(session->input, knowns, VARIABLE_FLOAT64, false);
    double *seed = fuzz_any_reals(session->input, seeds);
    double *result = fuzz_unwritten(results);
    const fmi2Status status = FUZZ_FMI3_CALL(instance, true, GetAdjointDerivative, unknown,
                                             unknowns, known, knowns, seed, seeds, result, results);
    fuzz_assert_written(status, result, results, "fmi3GetAdjointDerivative");
    free(unknown);
    free(known);
    free(seed);
    free(result);
}

/* ---- Refused --------------------------------------------------------------------------------- */

enum { CLOCKS = 7 }; /* the most of fuzz_any_count */

/* Clocks that are none, and room for all that the calls may have to say of them. */
static fmi3Clock active[CLOCKS];
static double times[CLOCKS];
static fmi3UInt64 counters[CLOCKS];
static fmi3UInt64 resolutions[CLOCKS];
static fmi3IntervalQualifier qualifiers[CLOCKS];

#define CLOCK_CALL(name, ...)                                                                      \
    static void call_##name(struct fuzz_session *session, struct fuzz_instance *instance) {        \
        const size_t count = fuzz_any_count(session->input);                                       \
        fmi2ValueReference *clocks =                                                               \
            fuzz_any_references(session->input, count, VARIABLE_FLOAT64, false);                   \
        require_refusal(FUZZ_FMI3_CHECKED(instance, name, clocks, count, __VA_ARGS__),             \
                        "fmi3" #name);                                                             \
        free(clocks);                                                                              \
    }
CLOCK_CALL(GetClock, active)
CLOCK_CALL(SetClock, active)
CLOCK_CALL(GetIntervalDecimal, times, qualifiers)
CLOCK_CALL(GetIntervalFraction, counters, resolutions, qualifiers)
CLOCK_CALL(GetShiftDecimal, times)
CLOCK_CALL(GetShiftFraction, counters, resolutions)
CLOCK_CALL(SetIntervalDecimal, times)
CLOCK_CALL(SetIntervalFraction, counters, resolutions)
CLOCK_CALL(SetShiftDecimal, times)
CLOCK_CALL(SetShiftFraction, counters, resolutions)

#define REFUSED(name)                                                                              \
    static void call_##name(struct fuzz_session *session, struct fuzz_instance *instance) {        \
        require_refusal(FUZZ_FMI3_CHECKED_PLAIN(instance, name), "fmi3" #name);                    \
    }
REFUSED(EvaluateDiscreteStates)
REFUSED(EnterConfigurationMode)
REFUSED(ExitConfigurationMode)

static void call_ActivateModelPartition(struct fuzz_session *session,
                                        struct fuzz_instance *instance) {
    const fmi3ValueReference clock = fuzz_byte(session->input);
    require_refusal(
        FUZZ_FMI3_CHECKED(instance, ActivateModelPartition, clock, fuzz_real(session->input)),
        "fmi3ActivateModelPartition");
}

static void call_GetNumberOfVariableDependencies(struct fuzz_session *session,
                                                 struct fuzz_instance *instance) {
    size_t count = 0;
    require_refusal(FUZZ_FMI3_CHECKED(instance, GetNumberOfVariableDependencies,
                                      fuzz_byte(session->input), &count),
                    "fmi3GetNumberOfVariableDependencies");
}

static void call_GetVariableDependencies(struct fuzz_session *session,
                                         struct fuzz_instance *instance) {
    size_t elements[2];
    fmi3ValueReference references[1];
    fmi3DependencyKind kinds[1];
    require_refusal(FUZZ_FMI3_CHECKED(instance, GetVariableDependencies, fuzz_byte(session->input),
                                      &elements[0], references, &elements[1], kinds, 1),
                    "fmi3GetVariableDependencies");
}

#define OPERATION(name) [FMU3_##name] = call_##name
fuzz_operation *const fuzz_access_fmi3[FMU3_FUNCTION_COUNT] = {
    OPERATION(GetFloat32),
    OPERATION(SetFloat32),
    OPERATION(GetInt8),
    OPERATION(SetInt8),
    OPERATION(GetUInt8),
    OPERATION(SetUInt8),
    OPERATION(GetInt16),
    OPERATION(SetInt16),
    OPERATION(GetUInt16),
    OPERATION(SetUInt16),
    OPERATION(GetUInt32),
    OPERATION(SetUInt32),
    OPERATION(GetInt64),
    OPERATION(SetInt64),
    OPERATION(GetUInt64),
    OPERATION(SetUInt64),
    OPERATION(GetBoolean),
    OPERATION(SetBoolean),
    OPERATION(GetString),
    OPERATION(SetString),
    OPERATION(GetBinary),
    OPERATION(SetBinary),
    OPERATION(GetClock),
    OPERATION(SetClock),
    OPERATION(GetAdjointDerivative),
    OPERATION(GetIntervalDecimal),
    OPERATION(GetIntervalFraction),
    OPERATION(GetShiftDecimal),
    OPERATION(GetShiftFraction),
    OPERATION(SetIntervalDecimal),
    OPERATION(SetIntervalFraction),
    OPERATION(SetShiftDecimal),
    OPERATION(SetShiftFraction),
    OPERATION(EvaluateDiscreteStates),
    OPERATION(EnterConfigurationMode),
    OPERATION(ExitConfigurationMode),
    OPERATION(ActivateModelPartition),
    OPERATION(GetNumberOfVariableDependencies),
    OPERATION(GetVariableDependencies),
};
