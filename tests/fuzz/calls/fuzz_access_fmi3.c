/* Values of the types that only FMI 3.0 has, adjoint derivatives, and calls that are refused
 * whatever their arguments are: clocks, configuration, dependencies. */
#include "fuzz_arguments.h"
#include "fuzz_fmi3.h"
#include "fuzz_session.h"

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

#define NO_VARIABLES(name, type, works_in_error)                                                   \
    void fuzz3_call_##name(struct fuzz_session *session, struct fuzz_instance *instance) {         \
        const struct fuzz_references some =                                                        \
            fuzz_any_sized(session->input, VARIABLE_FLOAT64, false);                               \
        fmi3##type *values = fuzz_argument(some.size, sizeof *values);                             \
        check_no_value(FUZZ_FMI3_CALL(instance, works_in_error, name, some.at, some.count, values, \
                                      some.size),                                                  \
                       some.count, "fmi3" #name);                                                  \
    }
#define NO_VARIABLES_OF_TYPE(type)                                                                 \
    NO_VARIABLES(Get##type, type, true)                                                            \
    NO_VARIABLES(Set##type, type, false)
NO_VARIABLES_OF_TYPE(Float32)
NO_VARIABLES_OF_TYPE(Int8)
NO_VARIABLES_OF_TYPE(UInt8)
NO_VARIABLES_OF_TYPE(Int16)
NO_VARIABLES_OF_TYPE(UInt16)
NO_VARIABLES_OF_TYPE(UInt32)
NO_VARIABLES_OF_TYPE(UInt64)
NO_VARIABLES_OF_TYPE(Boolean)
NO_VARIABLES_OF_TYPE(String)

#define NO_BINARIES(name, works_in_error)                                                          \
    void fuzz3_call_##name(struct fuzz_session *session, struct fuzz_instance *instance) {         \
        const struct fuzz_references some =                                                        \
            fuzz_any_sized(session->input, VARIABLE_FLOAT64, false);                               \
        fmi3Binary *values = fuzz_argument(some.size, sizeof *values);                             \
        size_t *sizes = fuzz_argument(some.size, sizeof *sizes);                                   \
        check_no_value(FUZZ_FMI3_CALL(instance, works_in_error, name, some.at, some.count, sizes,  \
                                      values, some.size),                                          \
                       some.count, "fmi3" #name);                                                  \
    }
NO_BINARIES(GetBinary, true)
NO_BINARIES(SetBinary, false)

/* Of enumerations. */
void fuzz3_call_GetInt64(struct fuzz_session *session, struct fuzz_instance *instance) {
    const struct fuzz_references some = fuzz_any_sized(session->input, VARIABLE_ENUMERATION, false);
    fmi3Int64 *values = fuzz_argument(some.size, sizeof *values);
    const fmi2Status status =
        FUZZ_FMI3_CALL(instance, true, GetInt64, some.at, some.count, values, some.size);
    for (size_t i = 0; i < some.size && status == fmi2OK; i++) {
        if (values[i] < 1 || values[i] > FUZZ_METHODS) {
            fuzz_fail("fmi3GetInt64 returns the item %lld", (long long)values[i]);
        }
    }
}

void fuzz3_call_SetInt64(struct fuzz_session *session, struct fuzz_instance *instance) {
    const struct fuzz_references some = fuzz_any_sized(session->input, VARIABLE_ENUMERATION, true);
    fmi3Int64 *values = fuzz_argument(some.size, sizeof *values);
    bool are_items = true;
    for (size_t i = 0; i < some.size; i++) {
        const unsigned selector = fuzz_byte(session->input);
        values[i] =
            selector < 224 ? (fmi3Int64)(selector % 6) : (fmi3Int64)fuzz_word(session->input);
        are_items = are_items && values[i] >= 1 && values[i] <= FUZZ_METHODS;
    }
    if (FUZZ_FMI3_CHECKED(instance, SetInt64, some.at, some.count, values, some.size) == fmi2OK &&
        !are_items) {
        fuzz_fail("fmi3SetInt64 accepts a value that is no item");
    }
}

void fuzz3_call_GetAdjointDerivative(struct fuzz_session *session, struct fuzz_instance *instance) {
    struct fuzz_references unknowns;
    struct fuzz_references knowns;
    fuzz_any_pair(session->input, true, &unknowns, &knowns);
    const double *seed = fuzz_any_reals(session->input, unknowns.size);
    double *result = fuzz_unwritten(knowns.size);
    const fmi2Status status =
        FUZZ_FMI3_CALL(instance, true, GetAdjointDerivative, unknowns.at, unknowns.count, knowns.at,
                       knowns.count, seed, unknowns.size, result, knowns.size);
    fuzz_assert_written(status, result, knowns.size, "fmi3GetAdjointDerivative");
}

/* ---- Refused --------------------------------------------------------------------------------- */

/* Room for all that the calls may have to say of clocks. */
enum { CLOCKS = 7 }; /* the most of fuzz_any */
static fmi3Clock active[CLOCKS];
static double times[CLOCKS];
static fmi3UInt64 counters[CLOCKS];
static fmi3UInt64 resolutions[CLOCKS];
static fmi3IntervalQualifier qualifiers[CLOCKS];

/* Of clocks that are none. */
#define CLOCK_CALL(name, ...)                                                                      \
    void fuzz3_call_##name(struct fuzz_session *session, struct fuzz_instance *instance) {         \
        const struct fuzz_references clocks = fuzz_any(session->input, VARIABLE_FLOAT64, false);   \
        require_refusal(FUZZ_FMI3_CHECKED(instance, name, clocks.at, clocks.count, __VA_ARGS__),   \
                        "fmi3" #name);                                                             \
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
    void fuzz3_call_##name(struct fuzz_session *session, struct fuzz_instance *instance) {         \
        require_refusal(FUZZ_FMI3_CHECKED_PLAIN(instance, name), "fmi3" #name);                    \
    }
REFUSED(EvaluateDiscreteStates)
REFUSED(EnterConfigurationMode)
REFUSED(ExitConfigurationMode)

void fuzz3_call_ActivateModelPartition(struct fuzz_session *session,
                                       struct fuzz_instance *instance) {
    const fmi3ValueReference clock = fuzz_byte(session->input);
    require_refusal(
        FUZZ_FMI3_CHECKED(instance, ActivateModelPartition, clock, fuzz_real(session->input)),
        "fmi3ActivateModelPartition");
}

void fuzz3_call_GetNumberOfVariableDependencies(struct fuzz_session *session,
                                                struct fuzz_instance *instance) {
    size_t count = 0;
    require_refusal(FUZZ_FMI3_CHECKED(instance, GetNumberOfVariableDependencies,
                                      fuzz_byte(session->input), &count),
                    "fmi3GetNumberOfVariableDependencies");
}

void fuzz3_call_GetVariableDependencies(struct fuzz_session *session,
                                        struct fuzz_instance *instance) {
    size_t elements[2];
    fmi3ValueReference references[1];
    fmi3DependencyKind kinds[1];
    require_refusal(FUZZ_FMI3_CHECKED(instance, GetVariableDependencies, fuzz_byte(session->input),
                                      &elements[0], references, &elements[1], kinds, 1),
                    "fmi3GetVariableDependencies");
}
