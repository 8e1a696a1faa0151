/* The functions that Model Exchange and Co-Simulation share (FMI 3.0, section 2.3), but for values:
 * checks of arguments that only FMI has, conversion of types and status, and nothing else. */
#include "fmi3_component.h"
#include "fmu_state.h"
#include "model_description.h"
#include "modes.h"
#include "variable_access.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- Version and logging --------------------------------------------------------------------- */

const char *fmi3GetVersion(void) {
    return fmi3Version;
}

static void send_text(const struct component *component, enum component_status status,
                      const char *category, const char *text) {
    const struct fmi3_component *to = (const struct fmi3_component *)component;
    if (to->logger != NULL) {
        to->logger(to->environment, fmi3_status(status), category, text);
    }
}

/* With logging off, errors alone are sent. */
#define ERRORS (1u << LOG_STATUS_ERROR | 1u << LOG_STATUS_FATAL)

static const struct adapter adapter = {
    .version = 3,
    .rules = fmi3_call_rules,
    .states = ~(unsigned)(STATE_STEP_FAILED | STATE_ERROR | STATE_INTERMEDIATE_UPDATE),
    .after_error = STATE_TERMINATED,
    .always_logged = ERRORS,
    .never_silent = ERRORS,
    .knowns = KNOWN_ARGUMENTS,
    .doubled = "#", // references to variables: the text is no format
    .may_access = fmi3_may_access,
    .send = send_text,
};

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[]) {
    const enum fmi3_call call = CALL_fmi3SetDebugLogging;
    struct component *component = instance;
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, nCategories, categories, categories)) {
        return fmi3Error;
    }
    return fmi3_status(component_set_logging(component, loggingOn, nCategories, categories));
}

fmi3Status fmi3_unsupported(fmi3Instance instance, enum fmi3_call call, const char *reason) {
    struct component *component = instance;
    if (!component_enter(component, call)) {
        return fmi3Error;
    }
    return fmi3_status(
        component_fail(component, "%s is not supported: %s", fmi3_call_rules[call].name, reason));
}

/* ---- Life ----------------------------------------------------------------------------------- */

/* Where texts go while there is no instance. */
struct receiver {
    fmi3LogMessageCallback logger;
    fmi3InstanceEnvironment environment;
};

PRINTF_FORMAT(2, 3)
static fmi3Instance refuse_instance(const struct receiver *receiver, const char *format, ...) {
    if (receiver->logger != NULL) {
        char raw[LOG_TEXT_SIZE];
        char text[LOG_TEXT_SIZE];
        va_list arguments;
        va_start(arguments, format);
        (void)vsnprintf(raw, sizeof raw, format, arguments);
        va_end(arguments);
        component_make_harmless(&adapter, raw, text);
        receiver->logger(receiver->environment, fmi3Error,
                         component_category_name(LOG_STATUS_ERROR), text);
    }
    return NULL;
}

static struct fmi3_component *instantiate(const char *call, fmi3String name, fmi3String token,
                                          enum fmi_kind kind, bool logging_on,
                                          const struct receiver *receiver) {
    char text[LOG_TEXT_SIZE];
    if (!component_may_begin(name, "instantiation token", token, model_token_fmi3, text)) {
        return refuse_instance(receiver, "%s", text);
    }
    struct fmi3_component *created =
        calloc(1, sizeof *created + model_description.variable_count * sizeof(bool));
    if (created == NULL) {
        return refuse_instance(receiver, "%s", status_text(STATUS_OUT_OF_MEMORY));
    }
    created->logger = receiver->logger;
    created->environment = receiver->environment;
    if (component_begin(&created->base, &adapter, kind, logging_on) != COMPONENT_OK) {
        free(created);
        return NULL;
    }
    component_log(&created->base, COMPONENT_OK, LOG_ALL, "%s", call);
    return created;
}

static void free_component(struct fmi3_component *component) {
    component_end(&component->base);
    free(component);
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                          fmi3String resourcePath, fmi3Boolean visible,
                                          fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment instanceEnvironment,
                                          fmi3LogMessageCallback logMessage) {
    const struct receiver receiver = {logMessage, instanceEnvironment};
    struct fmi3_component *created =
        instantiate("fmi3InstantiateModelExchange", instanceName, instantiationToken,
                    KIND_MODEL_EXCHANGE, loggingOn, &receiver);
    if (created != NULL) {
        instance_allow_setting_states(created->base.instance);
    }
    return created;
}

/* Continuous inputs and outputs: those with intermediateUpdate in modelDescription.xml. */
static bool has_intermediate_update(const struct variable *variable) {
    return variable->type == VARIABLE_FLOAT64 && variable->owner == VARIABLE_OF_MODEL &&
           variable->variability == VARIABILITY_CONTINUOUS &&
           (variable->causality == CAUSALITY_INPUT || variable->causality == CAUSALITY_OUTPUT);
}

static bool note_intermediate(struct fmi3_component *component,
                              const fmi3ValueReference references[], size_t count) {
    if (count > 0 && references == NULL) {
        component_fail(&component->base,
                       "the array of %zu variables for intermediate updates is NULL", count);
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        const struct variable *variable = variable_find(&model_description, references[i]);
        if (variable == NULL || !has_intermediate_update(variable)) {
            component_fail(&component->base,
                           "value reference %u is refused for intermediate updates: a continuous "
                           "input or output is expected",
                           references[i]);
            return false;
        }
        component->is_intermediate[variable - model_description.variables] = true;
        component->asks_inputs |= variable->causality == CAUSALITY_INPUT;
    }
    return true;
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
    fmi3Boolean earlyReturnAllowed, const fmi3ValueReference requiredIntermediateVariables[],
    size_t nRequiredIntermediateVariables, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3IntermediateUpdateCallback intermediateUpdate) {
    const struct receiver receiver = {logMessage, instanceEnvironment};
    struct fmi3_component *created = instantiate(
        "fmi3InstantiateCoSimulation", instanceName, instantiationToken,
        eventModeUsed ? KIND_CO_SIMULATION_WITH_EVENTS : KIND_CO_SIMULATION, loggingOn, &receiver);
    if (created == NULL) {
        return NULL;
    }
    created->update = intermediateUpdate;
    created->early_return_allowed = earlyReturnAllowed;
    if (!note_intermediate(created, requiredIntermediateVariables,
                           nRequiredIntermediateVariables) ||
        fmi3_prepare_steps(created) != STATUS_OK) {
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
    const struct receiver receiver = {logMessage, instanceEnvironment};
    return refuse_instance(&receiver,
                           "fmi3InstantiateScheduledExecution is refused: this is an FMU for Model "
                           "Exchange and Co-Simulation");
}

void fmi3FreeInstance(fmi3Instance instance) {
    struct fmi3_component *component = instance;
    if (component == NULL || component_is_logging(&component->base, "fmi3FreeInstance")) {
        return;
    }
    if (component->base.state == STATE_INTERMEDIATE_UPDATE) {
        component_fail(&component->base, "fmi3FreeInstance is not allowed inside a step: nothing "
                                         "is freed");
        return;
    }
    component_log(&component->base, COMPONENT_OK, LOG_ALL, "fmi3FreeInstance");
    free_component(component);
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
    return fmi3_status(
        mode_enter_initialization(instance, CALL_fmi3EnterInitializationMode, &experiment));
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    return fmi3_status(mode_exit_initialization(instance, CALL_fmi3ExitInitializationMode));
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance) {
    return fmi3_status(mode_enter_event(instance, CALL_fmi3EnterEventMode));
}

/* One update settles all modes. Another one is needed only if the importer has passed several time
 * events. */
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
                                    fmi3Boolean *terminateSimulation,
                                    fmi3Boolean *nominalsOfContinuousStatesChanged,
                                    fmi3Boolean *valuesOfContinuousStatesChanged,
                                    fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime) {
    const enum fmi3_call call = CALL_fmi3UpdateDiscreteStates;
    struct component *component = instance;
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, 1, discreteStatesNeedUpdate, terminateSimulation) ||
        !component_has_arrays(component, call, 1, nominalsOfContinuousStatesChanged,
                              valuesOfContinuousStatesChanged) ||
        !component_has_arrays(component, call, 1, nextEventTimeDefined, nextEventTime)) {
        return fmi3Error;
    }
    struct discrete_update update;
    const enum component_status status = mode_update_discrete_states(component, &update);
    const bool has_next_time = isfinite(update.next_time);
    *discreteStatesNeedUpdate = update.is_incomplete;
    *terminateSimulation = fmi3False;
    *nominalsOfContinuousStatesChanged = fmi3False;
    *valuesOfContinuousStatesChanged = update.states_changed;
    *nextEventTimeDefined = has_next_time;
    *nextEventTime = has_next_time ? update.next_time : 0.0;
    return fmi3_status(status);
}

fmi3Status fmi3Terminate(fmi3Instance instance) {
    return fmi3_status(mode_terminate(instance, CALL_fmi3Terminate));
}

fmi3Status fmi3Reset(fmi3Instance instance) {
    return fmi3_status(mode_reset(instance, CALL_fmi3Reset));
}

/* ---- FMU state ------------------------------------------------------------------------------ */

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState) {
    return fmi3_status(fmu_state_save(instance, CALL_fmi3GetFMUState, FMUState));
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState) {
    return fmi3_status(fmu_state_restore(instance, CALL_fmi3SetFMUState, FMUState));
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState) {
    return fmi3_status(fmu_state_free(instance, CALL_fmi3FreeFMUState, FMUState));
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size) {
    return fmi3_status(fmu_state_size(instance, CALL_fmi3SerializedFMUStateSize, FMUState, size));
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState,
                                 fmi3Byte serializedState[], size_t size) {
    return fmi3_status(
        fmu_state_serialize(instance, CALL_fmi3SerializeFMUState, FMUState, serializedState, size));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[],
                                   size_t size, fmi3FMUState *FMUState) {
    return fmi3_status(fmu_state_deserialize(instance, CALL_fmi3DeserializeFMUState,
                                             serializedState, size, FMUState));
}

/* ---- Derivatives with respect to other variables --------------------------------------------- */

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                        size_t nUnknowns, const fmi3ValueReference knowns[],
                                        size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                        fmi3Float64 sensitivity[], size_t nSensitivity) {
    const enum fmi3_call call = CALL_fmi3GetDirectionalDerivative;
    if (!fmi3_has_count(instance, call, nSeed, nKnowns) ||
        !fmi3_has_count(instance, call, nSensitivity, nUnknowns)) {
        return fmi3Error;
    }
    return fmi3_status(access_get_directional_derivative(instance, call, unknowns, nUnknowns,
                                                         knowns, nKnowns, seed, sensitivity));
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                    size_t nUnknowns, const fmi3ValueReference knowns[],
                                    size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                    fmi3Float64 sensitivity[], size_t nSensitivity) {
    const enum fmi3_call call = CALL_fmi3GetAdjointDerivative;
    if (!fmi3_has_count(instance, call, nSeed, nUnknowns) ||
        !fmi3_has_count(instance, call, nSensitivity, nKnowns)) {
        return fmi3Error;
    }
    return fmi3_status(access_get_adjoint_derivative(instance, call, unknowns, nUnknowns, knowns,
                                                     nKnowns, seed, sensitivity));
}
