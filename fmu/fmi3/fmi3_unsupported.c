/* Functions that every FMU exports and that serve what modelDescription.xml does not declare here:
 * clocks, configuration mode, dependencies at run time, Scheduled Execution. */
#include "fmi3_component.h"

static const char no_clocks[] = "the model has no clocks";
static const char no_structure[] = "the model has no structural parameters";
static const char no_dependencies[] =
    "the dependencies of variables are those in modelDescription.xml";

/* ---- Clocks --------------------------------------------------------------------------------- */

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                        size_t nValueReferences, fmi3Clock values[]) {
    return fmi3_unsupported(instance, CALL_fmi3GetClock, no_clocks);
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                        size_t nValueReferences, const fmi3Clock values[]) {
    return fmi3_unsupported(instance, CALL_fmi3SetClock, no_clocks);
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                  size_t nValueReferences, fmi3Float64 intervals[],
                                  fmi3IntervalQualifier qualifiers[]) {
    return fmi3_unsupported(instance, CALL_fmi3GetIntervalDecimal, no_clocks);
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance instance,
                                   const fmi3ValueReference valueReferences[],
                                   size_t nValueReferences, fmi3UInt64 counters[],
                                   fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]) {
    return fmi3_unsupported(instance, CALL_fmi3GetIntervalFraction, no_clocks);
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                               size_t nValueReferences, fmi3Float64 shifts[]) {
    return fmi3_unsupported(instance, CALL_fmi3GetShiftDecimal, no_clocks);
}

fmi3Status fmi3GetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                size_t nValueReferences, fmi3UInt64 counters[],
                                fmi3UInt64 resolutions[]) {
    return fmi3_unsupported(instance, CALL_fmi3GetShiftFraction, no_clocks);
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                  size_t nValueReferences, const fmi3Float64 intervals[]) {
    return fmi3_unsupported(instance, CALL_fmi3SetIntervalDecimal, no_clocks);
}

fmi3Status fmi3SetIntervalFraction(fmi3Instance instance,
                                   const fmi3ValueReference valueReferences[],
                                   size_t nValueReferences, const fmi3UInt64 counters[],
                                   const fmi3UInt64 resolutions[]) {
    return fmi3_unsupported(instance, CALL_fmi3SetIntervalFraction, no_clocks);
}

fmi3Status fmi3SetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                               size_t nValueReferences, const fmi3Float64 shifts[]) {
    return fmi3_unsupported(instance, CALL_fmi3SetShiftDecimal, no_clocks);
}

fmi3Status fmi3SetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                size_t nValueReferences, const fmi3UInt64 counters[],
                                const fmi3UInt64 resolutions[]) {
    return fmi3_unsupported(instance, CALL_fmi3SetShiftFraction, no_clocks);
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clockReference,
                                      fmi3Float64 activationTime) {
    return fmi3_unsupported(instance, CALL_fmi3ActivateModelPartition, no_clocks);
}

/* ---- Discrete states, structure -------------------------------------------------------------- */

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance) {
    return fmi3_unsupported(instance, CALL_fmi3EvaluateDiscreteStates,
                            "fmi3UpdateDiscreteStates does it all");
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) {
    return fmi3_unsupported(instance, CALL_fmi3EnterConfigurationMode, no_structure);
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) {
    return fmi3_unsupported(instance, CALL_fmi3ExitConfigurationMode, no_structure);
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance,
                                               fmi3ValueReference valueReference,
                                               size_t *nDependencies) {
    return fmi3_unsupported(instance, CALL_fmi3GetNumberOfVariableDependencies, no_dependencies);
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent,
                                       size_t elementIndicesOfDependent[],
                                       fmi3ValueReference independents[],
                                       size_t elementIndicesOfIndependents[],
                                       fmi3DependencyKind dependencyKinds[], size_t nDependencies) {
    return fmi3_unsupported(instance, CALL_fmi3GetVariableDependencies, no_dependencies);
}
