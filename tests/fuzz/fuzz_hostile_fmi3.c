/* Calls with hostile arguments that only FMI 3.0 has: values with their number, types that no
 * variable has, adjoint derivatives, steps with all that they say, and what is refused always. */
#include "fuzz_fmi3.h"
#include "fuzz_hostile.h"

#include <math.h>

/* ---- Modes and steps ------------------------------------------------------------------------- */

static void EnterStepMode(struct fuzz_input *input, struct fuzz_instance *instance) {
    if (FUZZ_FMI3_CHECKED_PLAIN(instance, EnterStepMode) == fmi2OK &&
        !(instance->variety & FUZZ_EVENT_MODE)) {
        fuzz_fail("fmi3EnterStepMode succeeds without event mode");
    }
}

static void DoStep(struct fuzz_input *input, struct fuzz_instance *instance) {
    const double point = fuzz_any_point(input, instance);
    const double length = fuzz_any_length(input);
    bool event = true;
    bool terminate = true;
    bool early = true;
    double *reached = fuzz_unwritten(1);
    const fmi2Status status =
        FUZZ_FMI3_CHECKED(instance, DoStep, point, length, fuzz_below(input, 2) == 0, &event,
                          &terminate, &early, reached);
    fuzz_assert_written(status, reached, 1, "fmi3DoStep");
    if (status != fmi2OK) {
        return;
    }
    if (!(length > 0.0) || !isfinite(point + length) || terminate ||
        early != (*reached < point + length) || *reached > point + length) {
        fuzz_fail("a step of %g s from %g s succeeds and reaches %g s; early: %d, end: %d", length,
                  point, *reached, early, terminate);
    }
    instance->time = *reached;
}

#define NUMBER_CALL(name, expected)                                                                \
    static void name(struct fuzz_input *input, struct fuzz_instance *instance) {                   \
        size_t count = 99;                                                                         \
        if (FUZZ_FMI3_CALL(instance, true, name, &count) == fmi2OK && count != (expected)) {       \
            fuzz_fail("fmi3" #name " returns %zu", count);                                         \
        }                                                                                          \
    }
NUMBER_CALL(GetNumberOfEventIndicators, model_description.indicator_count)
NUMBER_CALL(GetNumberOfContinuousStates, fuzz_state_count())

/* ---- Values ---------------------------------------------------------------------------------- */

/* A call succeeds only for types that variables have, and with one value for each variable. */
static void check_values(fmi2Status status, const struct fuzz_references *some, bool exist,
                         const char *name) {
    if (status == fmi2OK && (some->size != some->count || (some->count > 0 && !exist))) {
        fuzz_fail("%s of %zu values of %zu variables succeeds", name, some->size, some->count);
    }
}

#define VALUES(name, type, sets, variables, exist, value)                                          \
    static void name(struct fuzz_input *input, struct fuzz_instance *instance) {                   \
        const struct fuzz_references some = fuzz_any(input, variables, sets);                      \
        fmi3##type *values = fuzz_argument(some.size, sizeof *values);                             \
        for (size_t i = 0; i < some.size; i++) {                                                   \
            values[i] = value;                                                                     \
        }                                                                                          \
        check_values(                                                                              \
            FUZZ_FMI3_CALL(instance, !(sets), name, some.at, some.count, values, some.size),       \
            &some, exist, "fmi3" #name);                                                           \
    }
#define VALUES_OF_TYPE(type, variables, exist, value)                                              \
    VALUES(Get##type, type, false, variables, exist, value)                                        \
    VALUES(Set##type, type, true, variables, exist, value)
VALUES_OF_TYPE(Float32, VARIABLE_FLOAT64, false, 1.0F)
VALUES_OF_TYPE(Float64, VARIABLE_FLOAT64, true, fuzz_likely_real(input))
VALUES_OF_TYPE(Int8, VARIABLE_INT32, false, 1)
VALUES_OF_TYPE(UInt8, VARIABLE_INT32, false, 1)
VALUES_OF_TYPE(Int16, VARIABLE_INT32, false, 1)
VALUES_OF_TYPE(UInt16, VARIABLE_INT32, false, 1)
VALUES_OF_TYPE(Int32, VARIABLE_INT32, true, (fmi3Int32)fuzz_byte(input) - 2)
VALUES_OF_TYPE(UInt32, VARIABLE_INT32, false, 1)
VALUES_OF_TYPE(Int64, VARIABLE_ENUMERATION, true, (fmi3Int64)fuzz_word(input) % 6)
VALUES_OF_TYPE(UInt64, VARIABLE_ENUMERATION, false, 1)
VALUES_OF_TYPE(Boolean, VARIABLE_BOOLEAN, true, fuzz_below(input, 2) != 0)
VALUES_OF_TYPE(String, VARIABLE_FLOAT64, false, "%s%n") // no variable is a String

#define BINARIES(name, sets)                                                                       \
    static void name(struct fuzz_input *input, struct fuzz_instance *instance) {                   \
        const struct fuzz_references some = fuzz_any(input, VARIABLE_FLOAT64, sets);               \
        fmi3Binary *values = fuzz_argument(some.size, sizeof *values);                             \
        size_t *sizes = fuzz_argument(some.size, sizeof *sizes);                                   \
        check_values(FUZZ_FMI3_CALL(instance, !(sets), name, some.at, some.count, sizes, values,   \
                                    some.size),                                                    \
                     &some, false, "fmi3" #name);                                                  \
    }
BINARIES(GetBinary, false)
BINARIES(SetBinary, true)

/* Directional and adjoint: what is seeded, and where the results stand, change places. */
#define DERIVATIVE(name, seeded, derived)                                                          \
    static void name(struct fuzz_input *input, struct fuzz_instance *instance) {                   \
        const struct fuzz_references unknowns = fuzz_any(input, VARIABLE_FLOAT64, false);          \
        const struct fuzz_references knowns = fuzz_any(input, VARIABLE_FLOAT64, false);            \
        const double *seed = fuzz_any_reals(input, (seeded).size);                                 \
        double *result = fuzz_unwritten((derived).size);                                           \
        const fmi2Status status =                                                                  \
            FUZZ_FMI3_CALL(instance, true, name, unknowns.at, unknowns.count, knowns.at,           \
                           knowns.count, seed, (seeded).size, result, (derived).size);             \
        fuzz_assert_written(status, result, (derived).size, "fmi3" #name);                         \
    }
DERIVATIVE(GetDirectionalDerivative, knowns, unknowns)
DERIVATIVE(GetAdjointDerivative, unknowns, knowns)

static void GetOutputDerivatives(struct fuzz_input *input, struct fuzz_instance *instance) {
    const struct fuzz_references some = fuzz_any(input, VARIABLE_FLOAT64, false);
    const fmi2Integer *orders = fuzz_any_orders(input, some.count);
    double *values = fuzz_unwritten(some.size);
    const fmi2Status status = FUZZ_FMI3_CALL(instance, true, GetOutputDerivatives, some.at,
                                             some.count, orders, values, some.size);
    fuzz_assert_written(status, values, some.size, "fmi3GetOutputDerivatives");
}

/* ---- Refused --------------------------------------------------------------------------------- */

/* Room for all that the calls may have to say of clocks. */
enum { CLOCKS = 7 }; /* the most of fuzz_any */
static fmi3Clock active[CLOCKS];
static double times[CLOCKS];
static fmi3UInt64 counters[CLOCKS];
static fmi3UInt64 resolutions[CLOCKS];
static fmi3IntervalQualifier qualifiers[CLOCKS];

#define REFUSED(name, ...)                                                                         \
    static void name(struct fuzz_input *input, struct fuzz_instance *instance) {                   \
        const struct fuzz_references some = fuzz_any(input, VARIABLE_FLOAT64, false);              \
        const fmi2Status status =                                                                  \
            fuzz_check_call(instance, "fmi3" #name, false,                                         \
                            (fmi2Status)FUZZ_CALL(                                                 \
                                fmi3##name(fmu_fmi3_instance(instance->component) __VA_ARGS__)));  \
        if (status != fmi2Error) {                                                                 \
            fuzz_fail("fmi3" #name " of %zu is not refused: status %d", some.count, (int)status);  \
        }                                                                                          \
    }
#define OF_SOME , some.at, some.count
REFUSED(GetClock, OF_SOME, active)
REFUSED(SetClock, OF_SOME, active)
REFUSED(GetIntervalDecimal, OF_SOME, times, qualifiers)
REFUSED(GetIntervalFraction, OF_SOME, counters, resolutions, qualifiers)
REFUSED(GetShiftDecimal, OF_SOME, times)
REFUSED(GetShiftFraction, OF_SOME, counters, resolutions)
REFUSED(SetIntervalDecimal, OF_SOME, times)
REFUSED(SetIntervalFraction, OF_SOME, counters, resolutions)
REFUSED(SetShiftDecimal, OF_SOME, times)
REFUSED(SetShiftFraction, OF_SOME, counters, resolutions)
REFUSED(EvaluateDiscreteStates, )
REFUSED(EnterConfigurationMode, )
REFUSED(ExitConfigurationMode, )
REFUSED(ActivateModelPartition, , fuzz_byte(input), fuzz_real(input))
REFUSED(GetNumberOfVariableDependencies, , fuzz_byte(input), &(size_t){0})
REFUSED(GetVariableDependencies, , fuzz_byte(input), (size_t[1]){0}, (fmi3ValueReference[1]){0},
        (size_t[1]){0}, (fmi3DependencyKind[1]){fmi3Independent}, 1)

#define BOTH(type) Get##type, Set##type
static fuzz_hostile_call *const calls[] = {
    EnterStepMode,
    DoStep,
    DoStep,
    DoStep,
    GetNumberOfEventIndicators,
    GetNumberOfContinuousStates,
    BOTH(Float32),
    BOTH(Float64),
    BOTH(Int8),
    BOTH(UInt8),
    BOTH(Int16),
    BOTH(UInt16),
    BOTH(Int32),
    BOTH(UInt32),
    BOTH(Int64),
    BOTH(UInt64),
    BOTH(Boolean),
    BOTH(String),
    BOTH(Binary),
    GetDirectionalDerivative,
    GetAdjointDerivative,
    GetOutputDerivatives,
    BOTH(Clock),
    BOTH(IntervalDecimal),
    BOTH(IntervalFraction),
    BOTH(ShiftDecimal),
    BOTH(ShiftFraction),
    EvaluateDiscreteStates,
    EnterConfigurationMode,
    ExitConfigurationMode,
    ActivateModelPartition,
    GetNumberOfVariableDependencies,
    GetVariableDependencies,
};
const struct fuzz_hostile_calls fuzz_version_calls = {FUZZ_COUNT(calls), calls};
