/* All supported functions of FMI 3.0: checks of arguments that only FMI has, conversion of types
 * and status, and nothing else. */
#include "continuous_states.h"
#include "derivatives.h"
#include "fmi3_calls.h"
#include "fmi_snapshot.h"
#include "model_description.h"
#include "stepping.h"
#include "values.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Converts a status of the instance. */
static fmi3Status result(struct fmi_instance *fmi, enum status status) {
    return fmi3_status(fmi_result(fmi, status));
}

/* ---- Version and logging -------------------------------------------------------------------- */

const char *fmi3GetVersion(void) {
    return fmi3Version;
}

static void send_text(const struct fmi_instance *fmi, enum fmi_status status, const char *category,
                      const char *text) {
    const struct fmi3_instance *to = (const struct fmi3_instance *)fmi;
    if (to->logger != NULL) {
        to->logger(to->environment, fmi3_status(status), category, text);
    }
}

/* Categories that are sent with logging off. */
#define ERRORS (1u << LOG_STATUS_ERROR | 1u << LOG_STATUS_FATAL)

static const struct adapter adapter = {
    .version = 3,
    .rules = fmi3_call_rules,
    .states = ~(unsigned)(STATE_STEP_FAILED | STATE_ERROR | STATE_INTERMEDIATE_UPDATE),
    .after_error = STATE_TERMINATED,
    .always_logged = ERRORS,
    .never_silent = ERRORS,
    .doubled = "#", // references to variables: the text is no format
    .send = send_text,
};

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[]) {
    if (fmi_enter_with(instance, CALL_fmi3SetDebugLogging, nCategories, categories, categories) ==
        NULL) {
        return fmi3Error;
    }
    return fmi3_status(fmi_set_logging(instance, loggingOn, nCategories, categories));
}

/* ---- Intermediate updates ------------------------------------------------------------------- */

/* The importer's answer to an intermediate update. */
struct answer {
    fmi3Boolean returns_early;
    fmi3Float64 early_time;
};

/* Calls the importer in intermediate update mode; an error there ends the step. */
static enum status call_importer(struct fmi3_instance *fmi, double time, bool can_return_early,
                                 struct answer *answer) {
    struct fmi_instance *base = &fmi->base;
    *answer = (struct answer){.returns_early = fmi3False, .early_time = time};
    base->state = STATE_INTERMEDIATE_UPDATE;
    base->has_failed_inside = false;
    fmi->update(fmi->environment, time, fmi->can_set, fmi->can_get, fmi->can_get, can_return_early,
                &answer->returns_early, &answer->early_time);
    base->state = STATE_STEP_COMPLETE;
    return base->has_failed_inside ? STATUS_INVALID_ARGUMENT : STATUS_OK;
}

/* Lets the importer set the inputs at this time, before the step. */
static enum status ask_inputs(void *fmi_pointer, double time) {
    struct fmi3_instance *fmi = fmi_pointer;
    struct answer answer;
    fmi->can_set = true;
    fmi->can_get = false;
    return call_importer(fmi, time, false, &answer);
}

/* Lets the importer get outputs after an internal step; it may ask for the end of the step. */
static enum status accept(void *fmi_pointer, double time, double *end) {
    struct fmi3_instance *fmi = fmi_pointer;
    const bool can_return_early = fmi->early_return_allowed && time < *end;
    struct answer answer;
    fmi->can_set = false;
    fmi->can_get = true;
    const enum status status = call_importer(fmi, time, can_return_early, &answer);
    if (can_return_early && answer.returns_early && answer.early_time < *end) {
        *end = answer.early_time;
    }
    return status;
}

/* Prepares steps with these settings. Allocates the snapshot for undoing a step, since steps
 * allocate nothing. */
static enum status prepare_steps(struct fmi3_instance *fmi) {
    fmi->options.context = fmi;
    if (fmi->early_return_allowed) {
        const bool handles_events = fmi->base.kind == KIND_CO_SIMULATION_WITH_EVENTS;
        fmi->options.at_event = handles_events ? EVENTS_LEFT : EVENTS_END;
    }
    if (fmi->update != NULL) {
        fmi->options.ask_inputs = fmi->asks_inputs ? ask_inputs : NULL;
        fmi->options.accept = accept;
    }
    return instance_save(fmi->base.instance, 0, &fmi->options.undo);
}

/* ---- Life ----------------------------------------------------------------------------------- */

/* Returns an FMI instance without an instance, which can log why there is none. */
static struct fmi3_instance begin(enum fmi_kind kind, fmi3Boolean logging_on,
                                  fmi3InstanceEnvironment environment,
                                  fmi3LogMessageCallback logger) {
    struct fmi3_instance fmi = {.logger = logger, .environment = environment};
    fmi_begin(&fmi.base, &adapter, kind, logging_on);
    return fmi;
}

static struct fmi3_instance *instantiate(const char *call, fmi3String name, fmi3String token,
                                         struct fmi3_instance fmi) {
    if (!fmi_check_token(&fmi.base, name, "instantiation token", token, model_token_fmi3)) {
        return NULL;
    }
    struct fmi3_instance *created =
        calloc(1, sizeof *created + model_description.variable_count * sizeof(bool));
    if (created == NULL) {
        fmi_fail(&fmi.base, "%s", status_text(STATUS_OUT_OF_MEMORY));
        return NULL;
    }
    *created = fmi;
    if (fmi_create_instance(&created->base) != FMI_OK) {
        free(created);
        return NULL;
    }
    fmi_log(&created->base, FMI_OK, LOG_ALL, "%s", call);
    return created;
}

static void free_component(struct fmi3_instance *fmi) {
    fmi_end(&fmi->base);
    free(fmi);
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                          fmi3String resourcePath, fmi3Boolean visible,
                                          fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment instanceEnvironment,
                                          fmi3LogMessageCallback logMessage) {
    struct fmi3_instance *created =
        instantiate("fmi3InstantiateModelExchange", instanceName, instantiationToken,
                    begin(KIND_MODEL_EXCHANGE, loggingOn, instanceEnvironment, logMessage));
    if (created != NULL) {
        instance_allow_setting_states(created->base.instance);
    }
    return created;
}

/* True for continuous inputs and outputs, which have intermediateUpdate in modelDescription.xml. */
static bool has_intermediate_update(const struct variable *variable) {
    return variable->type == VARIABLE_FLOAT64 && variable->owner == VARIABLE_OF_MODEL &&
           variable->variability == VARIABILITY_CONTINUOUS &&
           (variable->causality == CAUSALITY_INPUT || variable->causality == CAUSALITY_OUTPUT);
}

static bool note_intermediate(struct fmi3_instance *fmi, const fmi3ValueReference references[],
                              size_t count) {
    if (count > 0 && references == NULL) {
        fmi_fail(&fmi->base, "the array of %zu variables for intermediate updates is NULL", count);
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        const struct variable *variable = variable_find(&model_description, references[i]);
        if (variable == NULL || !has_intermediate_update(variable)) {
            fmi_fail(&fmi->base,
                     "value reference %u is refused for intermediate updates: a continuous "
                     "input or output is expected",
                     references[i]);
            return false;
        }
        fmi->is_intermediate[variable - model_description.variables] = true;
        fmi->asks_inputs |= variable->causality == CAUSALITY_INPUT;
    }
    return true;
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
    fmi3Boolean earlyReturnAllowed, const fmi3ValueReference requiredIntermediateVariables[],
    size_t nRequiredIntermediateVariables, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3IntermediateUpdateCallback intermediateUpdate) {
    const enum fmi_kind kind = eventModeUsed ? KIND_CO_SIMULATION_WITH_EVENTS : KIND_CO_SIMULATION;
    struct fmi3_instance *created =
        instantiate("fmi3InstantiateCoSimulation", instanceName, instantiationToken,
                    begin(kind, loggingOn, instanceEnvironment, logMessage));
    if (created == NULL) {
        return NULL;
    }
    created->update = intermediateUpdate;
    created->early_return_allowed = earlyReturnAllowed;
    if (!note_intermediate(created, requiredIntermediateVariables,
                           nRequiredIntermediateVariables) ||
        prepare_steps(created) != STATUS_OK) {
        free_component(created);
        return NULL;
    }
    return created;
}

fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3ClockUpdateCallback clockUpdate,
    fmi3LockPreemptionCallback lockPreemption, fmi3UnlockPreemptionCallback unlockPreemption) {
    struct fmi3_instance fmi =
        begin(KIND_CO_SIMULATION, loggingOn, instanceEnvironment, logMessage);
    fmi_fail(&fmi.base, "fmi3InstantiateScheduledExecution is refused: this is an FMU "
                        "for Model Exchange and Co-Simulation");
    return NULL;
}

void fmi3FreeInstance(fmi3Instance instance) {
    struct fmi3_instance *fmi = instance;
    if (fmi == NULL || fmi_refuse_in_logger(&fmi->base, "fmi3FreeInstance")) {
        return;
    }
    if (fmi->base.state == STATE_INTERMEDIATE_UPDATE) {
        fmi_fail(&fmi->base, "fmi3FreeInstance is not allowed inside a step: nothing "
                             "is freed");
        return;
    }
    fmi_log(&fmi->base, FMI_OK, LOG_ALL, "fmi3FreeInstance");
    free_component(fmi);
}

/* ---- Modes ---------------------------------------------------------------------------------- */

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined,
                                       fmi3Float64 tolerance, fmi3Float64 startTime,
                                       fmi3Boolean stopTimeDefined, fmi3Float64 stopTime) {
    const struct instance_experiment experiment = {
        .start_time = startTime,
        .stop_time_defined = stopTimeDefined,
        .stop_time = stopTime,
        .tolerance_defined = toleranceDefined,
        .tolerance = tolerance,
    };
    struct instance *entered = fmi_enter(instance, CALL_fmi3EnterInitializationMode);
    if (entered == NULL) {
        return fmi3Error;
    }
    enum status status = instance_setup_experiment(entered, &experiment);
    if (status == STATUS_OK) {
        status = instance_enter_initialization(entered);
    }
    return fmi3_status(fmi_go_to(instance, STATE_INITIALIZATION, status));
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    return fmi3_status(fmi_exit_initialization(instance, CALL_fmi3ExitInitializationMode));
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance) {
    struct instance *entered = fmi_enter(instance, CALL_fmi3EnterEventMode);
    if (entered == NULL) {
        return fmi3Error;
    }
    instance_enter_event_mode(entered);
    return fmi3_status(fmi_go_to(instance, STATE_EVENT, STATUS_OK));
}

/* One update decides all modes. Another one is needed only if the importer has passed several time
 * events. */
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
                                    fmi3Boolean *terminateSimulation,
                                    fmi3Boolean *nominalsOfContinuousStatesChanged,
                                    fmi3Boolean *valuesOfContinuousStatesChanged,
                                    fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime) {
    const enum fmi3_call call = CALL_fmi3UpdateDiscreteStates;
    struct instance *entered =
        fmi_enter_with(instance, call, 1, discreteStatesNeedUpdate, terminateSimulation);
    if (entered == NULL ||
        !fmi_check_arrays(instance, call, 1, nominalsOfContinuousStatesChanged,
                          valuesOfContinuousStatesChanged) ||
        !fmi_check_arrays(instance, call, 1, nextEventTimeDefined, nextEventTime)) {
        return fmi3Error;
    }
    struct discrete_update update;
    const enum status status = instance_update_discrete_states(entered, &update);
    const bool has_next_time = isfinite(update.next_time);
    *discreteStatesNeedUpdate = update.is_incomplete;
    *terminateSimulation = update.has_ended;
    *nominalsOfContinuousStatesChanged = fmi3False;
    *valuesOfContinuousStatesChanged = update.states_changed;
    *nextEventTimeDefined = has_next_time;
    *nextEventTime = has_next_time ? update.next_time : 0.0;
    return result(instance, status);
}

fmi3Status fmi3Terminate(fmi3Instance instance) {
    return fmi3_status(fmi_terminate(instance, CALL_fmi3Terminate));
}

fmi3Status fmi3Reset(fmi3Instance instance) {
    return fmi3_status(fmi_reset(instance, CALL_fmi3Reset));
}

/* ---- Values --------------------------------------------------------------------------------- */

/* Begins a call that reads or sets values. Returns the instance; NULL if the call is refused. */
static struct instance *enter_access(fmi3Instance instance, enum fmi3_call call, bool setting,
                                     const fmi3ValueReference references[], size_t count,
                                     const void *values, size_t value_count) {
    struct instance *entered = fmi3_check_count(instance, call, value_count, count)
                                   ? fmi_enter_with(instance, call, count, references, values)
                                   : NULL;
    return entered != NULL && fmi3_check_access(instance, call, setting, references, count)
               ? entered
               : NULL;
}

/* Defines the function for a type that variables have; verb and type: their names in values.h. */
#define ACCESS(Verb, verb, setting, Type, type, element)                                           \
    fmi3Status fmi3##Verb##Type(fmi3Instance instance, const fmi3ValueReference valueReferences[], \
                                size_t nValueReferences, element values[], size_t nValues) {       \
        struct instance *entered =                                                                 \
            enter_access(instance, CALL_fmi3##Verb##Type, setting, valueReferences,                \
                         nValueReferences, values, nValues);                                       \
        return entered != NULL                                                                     \
                   ? result(instance, instance_##verb##_##type(entered, valueReferences,           \
                                                               nValueReferences, values))          \
                   : fmi3Error;                                                                    \
    }
ACCESS(Get, get, false, Float64, real, fmi3Float64)
ACCESS(Set, set, true, Float64, real, const fmi3Float64)
ACCESS(Get, get, false, Int32, int32, fmi3Int32)
ACCESS(Set, set, true, Int32, int32, const fmi3Int32)
ACCESS(Get, get, false, Int64, enumeration, fmi3Int64)
ACCESS(Set, set, true, Int64, enumeration, const fmi3Int64)
ACCESS(Get, get, false, Boolean, bool, fmi3Boolean)
ACCESS(Set, set, true, Boolean, bool, const fmi3Boolean)

/* Accesses a type that no variable has. */
static fmi3Status access_none(fmi3Instance instance, enum fmi3_call call, bool setting,
                              const char *type, const fmi3ValueReference references[], size_t count,
                              const void *values, size_t value_count) {
    if (enter_access(instance, call, setting, references, count, values, value_count) == NULL) {
        return fmi3Error;
    }
    return fmi3_status(fmi_access_none(instance, type, references, count));
}

#define ACCESS_NONE(Verb, setting, Type, element)                                                  \
    fmi3Status fmi3##Verb##Type(fmi3Instance instance, const fmi3ValueReference valueReferences[], \
                                size_t nValueReferences, element values[], size_t nValues) {       \
        return access_none(instance, CALL_fmi3##Verb##Type, setting, #Type, valueReferences,       \
                           nValueReferences, values, nValues);                                     \
    }
#define OF_NONE(Type)                                                                              \
    ACCESS_NONE(Get, false, Type, fmi3##Type)                                                      \
    ACCESS_NONE(Set, true, Type, const fmi3##Type)
OF_NONE(Float32)
OF_NONE(Int8)
OF_NONE(UInt8)
OF_NONE(Int16)
OF_NONE(UInt16)
OF_NONE(UInt32)
OF_NONE(UInt64)
OF_NONE(String)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                         size_t nValueReferences, size_t valueSizes[], fmi3Binary values[],
                         size_t nValues) {
    return access_none(instance, CALL_fmi3GetBinary, false, "Binary", valueReferences,
                       nValueReferences, values, nValues);
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                         size_t nValueReferences, const size_t valueSizes[],
                         const fmi3Binary values[], size_t nValues) {
    return access_none(instance, CALL_fmi3SetBinary, true, "Binary", valueReferences,
                       nValueReferences, values, nValues);
}

/* ---- FMU state ------------------------------------------------------------------------------ */

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState) {
    return fmi3_status(fmi_snapshot_save(instance, CALL_fmi3GetFMUState, FMUState));
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState) {
    return fmi3_status(fmi_snapshot_restore(instance, CALL_fmi3SetFMUState, FMUState));
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState) {
    return fmi3_status(fmi_snapshot_free(instance, CALL_fmi3FreeFMUState, FMUState));
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size) {
    return fmi3_status(
        fmi_snapshot_size(instance, CALL_fmi3SerializedFMUStateSize, FMUState, size));
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState,
                                 fmi3Byte serializedState[], size_t size) {
    return fmi3_status(fmi_snapshot_serialize(instance, CALL_fmi3SerializeFMUState, FMUState,
                                              serializedState, size));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[],
                                   size_t size, fmi3FMUState *FMUState) {
    return fmi3_status(fmi_snapshot_deserialize(instance, CALL_fmi3DeserializeFMUState,
                                                serializedState, size, FMUState));
}

/* ---- Derivatives with respect to other variables -------------------------------------------- */

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                        size_t nUnknowns, const fmi3ValueReference knowns[],
                                        size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                        fmi3Float64 sensitivity[], size_t nSensitivity) {
    const enum fmi3_call call = CALL_fmi3GetDirectionalDerivative;
    if (!fmi3_check_count(instance, call, nSeed, nKnowns) ||
        !fmi3_check_count(instance, call, nSensitivity, nUnknowns)) {
        return fmi3Error;
    }
    struct instance *entered = fmi_enter_with(instance, call, nUnknowns, unknowns, sensitivity);
    if (entered == NULL || !fmi_check_arrays(instance, call, nKnowns, knowns, seed)) {
        return fmi3Error;
    }
    return result(instance,
                  instance_get_directional_derivative(entered, KNOWN_ARGUMENTS, unknowns, nUnknowns,
                                                      knowns, nKnowns, seed, sensitivity));
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                    size_t nUnknowns, const fmi3ValueReference knowns[],
                                    size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                    fmi3Float64 sensitivity[], size_t nSensitivity) {
    const enum fmi3_call call = CALL_fmi3GetAdjointDerivative;
    if (!fmi3_check_count(instance, call, nSeed, nUnknowns) ||
        !fmi3_check_count(instance, call, nSensitivity, nKnowns)) {
        return fmi3Error;
    }
    struct instance *entered = fmi_enter_with(instance, call, nUnknowns, unknowns, seed);
    if (entered == NULL || !fmi_check_arrays(instance, call, nKnowns, knowns, sensitivity)) {
        return fmi3Error;
    }
    return result(instance,
                  instance_get_adjoint_derivative(entered, KNOWN_ARGUMENTS, unknowns, nUnknowns,
                                                  knowns, nKnowns, seed, sensitivity));
}

/* ---- Co-Simulation (section 4.2) ------------------------------------------------------------ */

fmi3Status fmi3EnterStepMode(fmi3Instance instance) {
    return fmi_enter(instance, CALL_fmi3EnterStepMode) != NULL
               ? fmi3_status(fmi_go_to(instance, STATE_STEP_COMPLETE, STATUS_OK))
               : fmi3Error;
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance,
                                    const fmi3ValueReference valueReferences[],
                                    size_t nValueReferences, const fmi3Int32 orders[],
                                    fmi3Float64 values[], size_t nValues) {
    const enum fmi3_call call = CALL_fmi3GetOutputDerivatives;
    struct instance *entered =
        enter_access(instance, call, false, valueReferences, nValueReferences, values, nValues);
    return entered != NULL && fmi_check_arrays(instance, call, nValueReferences, orders, orders)
               ? result(instance, instance_get_output_derivatives(entered, valueReferences,
                                                                  nValueReferences, orders, values))
               : fmi3Error;
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint,
                      fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                      fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                      fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime) {
    // importers say true, and roll back nevertheless
    const enum fmi3_call call = CALL_fmi3DoStep;
    const struct fmi3_instance *fmi = instance;
    struct instance *entered =
        fmi_enter_with(instance, call, 1, eventHandlingNeeded, terminateSimulation);
    if (entered == NULL || !fmi_check_arrays(instance, call, 1, earlyReturn, lastSuccessfulTime)) {
        return fmi3Error;
    }
    const double end = currentCommunicationPoint + communicationStepSize;
    const enum status status =
        instance_do_step(entered, currentCommunicationPoint, communicationStepSize, &fmi->options);
    if (status != STATUS_OK && status != STATUS_ENDED) {
        return result(instance, status);
    }
    *eventHandlingNeeded =
        fmi->base.kind == KIND_CO_SIMULATION_WITH_EVENTS && instance_met_event(entered);
    *terminateSimulation = status == STATUS_ENDED;
    *lastSuccessfulTime = instance_time(entered);
    *earlyReturn = fmi->early_return_allowed && *lastSuccessfulTime < end;
    return fmi3OK;
}

/* ---- Model Exchange: modes (section 3.2) ---------------------------------------------------- */

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
    struct instance *entered = fmi_enter(instance, CALL_fmi3EnterContinuousTimeMode);
    return entered != NULL ? fmi3_status(fmi_go_to(instance, STATE_CONTINUOUS_TIME,
                                                   instance_enter_continuous_time(entered)))
                           : fmi3Error;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance,
                                       fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi3Boolean *enterEventMode,
                                       fmi3Boolean *terminateSimulation) {
    struct instance *entered = fmi_enter_with(instance, CALL_fmi3CompletedIntegratorStep, 1,
                                              enterEventMode, terminateSimulation);
    if (entered == NULL) {
        return fmi3Error;
    }
    const enum status status = instance_complete_step(entered, enterEventMode);
    *terminateSimulation = instance_has_ended(entered);
    return result(instance, status);
}

/* ---- Model Exchange: time and states -------------------------------------------------------- */

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time) {
    struct instance *entered = fmi_enter(instance, CALL_fmi3SetTime);
    return entered != NULL ? result(instance, instance_set_time(entered, time)) : fmi3Error;
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 continuousStates[],
                                   size_t nContinuousStates) {
    struct instance *entered =
        fmi_enter_with(instance, CALL_fmi3SetContinuousStates, nContinuousStates, continuousStates,
                       continuousStates);
    return entered != NULL
               ? result(instance, instance_set_states(entered, continuousStates, nContinuousStates))
               : fmi3Error;
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 continuousStates[],
                                   size_t nContinuousStates) {
    struct instance *entered =
        fmi_enter_with(instance, CALL_fmi3GetContinuousStates, nContinuousStates, continuousStates,
                       continuousStates);
    return entered != NULL
               ? result(instance, instance_get_states(entered, continuousStates, nContinuousStates))
               : fmi3Error;
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 derivatives[],
                                             size_t nContinuousStates) {
    struct instance *entered = fmi_enter_with(instance, CALL_fmi3GetContinuousStateDerivatives,
                                              nContinuousStates, derivatives, derivatives);
    return entered != NULL
               ? result(instance, instance_get_derivatives(entered, derivatives, nContinuousStates))
               : fmi3Error;
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[],
                                             size_t nContinuousStates) {
    struct instance *entered = fmi_enter_with(instance, CALL_fmi3GetNominalsOfContinuousStates,
                                              nContinuousStates, nominals, nominals);
    return entered != NULL
               ? result(instance, instance_get_nominals(entered, nominals, nContinuousStates))
               : fmi3Error;
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 eventIndicators[],
                                  size_t nEventIndicators) {
    struct instance *entered = fmi_enter_with(instance, CALL_fmi3GetEventIndicators,
                                              nEventIndicators, eventIndicators, eventIndicators);
    return entered != NULL ? result(instance, instance_get_indicators(entered, eventIndicators,
                                                                      nEventIndicators))
                           : fmi3Error;
}

/* ---- Model Exchange: numbers ---------------------------------------------------------------- */

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *nEventIndicators) {
    const struct instance *entered = fmi_enter_with(instance, CALL_fmi3GetNumberOfEventIndicators,
                                                    1, nEventIndicators, nEventIndicators);
    if (entered == NULL) {
        return fmi3Error;
    }
    *nEventIndicators = model_description.indicator_count;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *nContinuousStates) {
    const struct instance *entered = fmi_enter_with(instance, CALL_fmi3GetNumberOfContinuousStates,
                                                    1, nContinuousStates, nContinuousStates);
    if (entered == NULL) {
        return fmi3Error;
    }
    *nContinuousStates = instance_state_count(entered);
    return fmi3OK;
}
