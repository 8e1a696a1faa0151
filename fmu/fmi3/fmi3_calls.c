#include "fmi3_calls.h"

#include "model_description.h"

/* ---- Rules ---------------------------------------------------------------------------------- */

#define INSTANTIATED        STATE_INSTANTIATED
#define INITIALIZATION      STATE_INITIALIZATION
#define TERMINATED          STATE_TERMINATED
#define STEP                STATE_STEP_COMPLETE
#define EVENT               STATE_EVENT
#define CONTINUOUS_TIME     STATE_CONTINUOUS_TIME
#define INTERMEDIATE_UPDATE STATE_INTERMEDIATE_UPDATE
#define OUTSIDE_STEP        (INSTANTIATED | INITIALIZATION | TERMINATED | STEP | EVENT | CONTINUOUS_TIME)
#define ANY_STATE           (OUTSIDE_STEP | INTERMEDIATE_UPDATE)

#define MODEL_EXCHANGE            KIND_MODEL_EXCHANGE
#define CO_SIMULATION_WITH_EVENTS KIND_CO_SIMULATION_WITH_EVENTS
#define CO_SIMULATION             (KIND_CO_SIMULATION | KIND_CO_SIMULATION_WITH_EVENTS)
#define EVENT_KINDS               (MODEL_EXCHANGE | CO_SIMULATION_WITH_EVENTS)
#define ANY_KIND                  (MODEL_EXCHANGE | CO_SIMULATION)

#define FMI3_CALL_RULE(name, kinds, states) [CALL_fmi3##name] = {"fmi3" #name, kinds, states},
const struct call_rule fmi3_call_rules[FMI3_CALL_COUNT] = {FMI3_FUNCTION_LIST(FMI3_CALL_RULE)};

/* ---- Checks --------------------------------------------------------------------------------- */

bool fmi3_check_count(struct fmi_instance *fmi, enum fmi3_call call, size_t count,
                      size_t expected) {
    if (count == expected || fmi == NULL) {
        return true;
    }
    fmi_fail(fmi, "%s: an array has %zu values: %zu are expected", fmi3_call_rules[call].name,
             count, expected);
    return false;
}

bool fmi3_check_access(struct fmi_instance *fmi, enum fmi3_call call, bool setting,
                       const fmi3ValueReference references[], size_t count) {
    if (fmi->state != STATE_INTERMEDIATE_UPDATE) {
        return true;
    }
    const struct fmi3_instance *inside = (const struct fmi3_instance *)fmi;
    if (!(setting ? inside->can_set : inside->can_get)) {
        fmi_fail(fmi, "%s: this intermediate update does not allow it", fmi3_call_rules[call].name);
        return false;
    }
    for (size_t i = 0; references != NULL && i < count; i++) {
        const struct variable *variable = variable_find(&model_description, references[i]);
        if (variable == NULL || !inside->is_intermediate[variable - model_description.variables] ||
            (setting && variable->causality != CAUSALITY_INPUT)) {
            fmi_fail(fmi,
                     "%s: value reference %u is refused: in an intermediate update %s that "
                     "was named at instantiation is expected",
                     fmi3_call_rules[call].name, references[i],
                     setting ? "an input" : "a variable");
            return false;
        }
    }
    return true;
}

/* ---- Unsupported functions ------------------------------------------------------------------
 * Every FMU exports them, but modelDescription.xml declares nothing that they serve: clocks,
 * configuration mode, dependencies at run time, Scheduled Execution. */

/* Fails with an error that says why the FMU does not support a call. */
static fmi3Status unsupported(fmi3Instance instance, enum fmi3_call call, const char *reason) {
    if (fmi_enter(instance, call) == NULL) {
        return fmi3Error;
    }
    return fmi3_status(
        fmi_fail(instance, "%s is not supported: %s", fmi3_call_rules[call].name, reason));
}

static const char no_clocks[] = "the model has no clocks";
static const char no_structure[] = "the model has no structural parameters";
static const char no_dependencies[] =
    "the dependencies of variables are those in modelDescription.xml";

/* Defines a function with these arguments after the instance. */
#define UNSUPPORTED(name, reason, ...)                                                             \
    fmi3Status fmi3##name(fmi3Instance instance, __VA_ARGS__) {                                    \
        return unsupported(instance, CALL_fmi3##name, reason);                                     \
    }
UNSUPPORTED(GetClock, no_clocks, const fmi3ValueReference valueReferences[],
            size_t nValueReferences, fmi3Clock values[])
UNSUPPORTED(SetClock, no_clocks, const fmi3ValueReference valueReferences[],
            size_t nValueReferences, const fmi3Clock values[])
UNSUPPORTED(GetIntervalDecimal, no_clocks, const fmi3ValueReference valueReferences[],
            size_t nValueReferences, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
UNSUPPORTED(GetIntervalFraction, no_clocks, const fmi3ValueReference valueReferences[],
            size_t nValueReferences, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
            fmi3IntervalQualifier qualifiers[])
UNSUPPORTED(GetShiftDecimal, no_clocks, const fmi3ValueReference valueReferences[],
            size_t nValueReferences, fmi3Float64 shifts[])
UNSUPPORTED(GetShiftFraction, no_clocks, const fmi3ValueReference valueReferences[],
            size_t nValueReferences, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
UNSUPPORTED(SetIntervalDecimal, no_clocks, const fmi3ValueReference valueReferences[],
            size_t nValueReferences, const fmi3Float64 intervals[])
UNSUPPORTED(SetIntervalFraction, no_clocks, const fmi3ValueReference valueReferences[],
            size_t nValueReferences, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
UNSUPPORTED(SetShiftDecimal, no_clocks, const fmi3ValueReference valueReferences[],
            size_t nValueReferences, const fmi3Float64 shifts[])
UNSUPPORTED(SetShiftFraction, no_clocks, const fmi3ValueReference valueReferences[],
            size_t nValueReferences, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
UNSUPPORTED(ActivateModelPartition, no_clocks, fmi3ValueReference clockReference,
            fmi3Float64 activationTime)

/* ---- Discrete states, structure ------------------------------------------------------------- */

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance) {
    return unsupported(instance, CALL_fmi3EvaluateDiscreteStates,
                       "fmi3UpdateDiscreteStates does it all");
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) {
    return unsupported(instance, CALL_fmi3EnterConfigurationMode, no_structure);
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) {
    return unsupported(instance, CALL_fmi3ExitConfigurationMode, no_structure);
}

UNSUPPORTED(GetNumberOfVariableDependencies, no_dependencies, fmi3ValueReference valueReference,
            size_t *nDependencies)
UNSUPPORTED(GetVariableDependencies, no_dependencies, fmi3ValueReference dependent,
            size_t elementIndicesOfDependent[], fmi3ValueReference independents[],
            size_t elementIndicesOfIndependents[], fmi3DependencyKind dependencyKinds[],
            size_t nDependencies)
