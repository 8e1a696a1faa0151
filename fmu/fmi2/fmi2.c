/* All functions of FMI 2.0: checks of arguments that only FMI has, conversion of types and status,
 * and nothing else. */
#include "component.h"
#include "fmi2Functions.h"
#include "fmi2_functions.h"
#include "model_description.h"
#include "shared_calls.h"
#include "stepping.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- Rules of calls ------------------------------------------------------------------------- */

#define FMI2_CALL_CODE(name, kinds, states) CALL_fmi2##name,
enum fmi2_call { FMI2_FUNCTION_LIST(FMI2_CALL_CODE) FMI2_CALL_COUNT };
#undef FMI2_CALL_CODE

#define INSTANTIATED    STATE_INSTANTIATED
#define INITIALIZATION  STATE_INITIALIZATION
#define TERMINATED      STATE_TERMINATED
#define ERROR_STATE     STATE_ERROR
#define STEP_COMPLETE   STATE_STEP_COMPLETE
#define STEP_FAILED     STATE_STEP_FAILED
#define EVENT           STATE_EVENT
#define CONTINUOUS_TIME STATE_CONTINUOUS_TIME
#define ANY_STATE                                                                                  \
    (INSTANTIATED | INITIALIZATION | TERMINATED | ERROR_STATE | STEP_COMPLETE | STEP_FAILED |      \
     EVENT | CONTINUOUS_TIME)

#define MODEL_EXCHANGE KIND_MODEL_EXCHANGE
#define CO_SIMULATION  KIND_CO_SIMULATION
#define ANY_KIND       (MODEL_EXCHANGE | CO_SIMULATION)

#define FMI2_CALL_RULE(name, kinds, states) [CALL_fmi2##name] = {"fmi2" #name, kinds, states},
static const struct call_rule fmi2_call_rules[FMI2_CALL_COUNT] = {
    FMI2_FUNCTION_LIST(FMI2_CALL_RULE)};

/* ---- Component ------------------------------------------------------------------------------ */

/* The structure that an fmi2Component points to. */
struct fmi2_component {
    struct component base;     /* first */
    fmi2CallbackLogger logger; /* NULL for no log */
    fmi2ComponentEnvironment environment;
    char name[];
};

_Static_assert((int)COMPONENT_OK == fmi2OK && (int)COMPONENT_WARNING == fmi2Warning &&
                   (int)COMPONENT_DISCARD == fmi2Discard && (int)COMPONENT_ERROR == fmi2Error &&
                   (int)COMPONENT_FATAL == fmi2Fatal,
               "a component_status is converted by a cast");

static fmi2Status fmi2_status(enum component_status status) {
    return (fmi2Status)status;
}

/* ---- Versions, life and logging ------------------------------------------------------------- */

const char *fmi2GetTypesPlatform(void) {
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void) {
    return fmi2Version;
}

static void send_text(const struct component *component, enum component_status status,
                      const char *category, const char *text) {
    const struct fmi2_component *to = (const struct fmi2_component *)component;
    if (to->logger != NULL) {
        to->logger(to->environment, to->name, fmi2_status(status), category, text);
    }
}

/* Warnings, discards and errors are sent with logging off, too; only events and calls are not. */
static const struct adapter adapter = {
    .version = 2,
    .rules = fmi2_call_rules,
    .states = ~(unsigned)STATE_INTERMEDIATE_UPDATE,
    .after_error = STATE_ERROR,
    .always_logged = ~(1u << LOG_EVENTS | 1u << LOG_ALL),
    .knowns = KNOWN_MOTION,
    .doubled = "#%", // references to variables, formats of printf (section 2.1.5)
    .send = send_text,
};

/* Logs why there is no instance; functions may be NULL. */
PRINTF_FORMAT(3, 4)
static void refuse_instance(const fmi2CallbackFunctions *functions, fmi2String name,
                            const char *format, ...) {
    if (functions == NULL || functions->logger == NULL) {
        return;
    }
    char raw[LOG_TEXT_SIZE];
    char text[LOG_TEXT_SIZE];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(raw, sizeof raw, format, arguments);
    va_end(arguments);
    component_make_harmless(&adapter, raw, text);
    functions->logger(functions->componentEnvironment, name != NULL ? name : "", fmi2Error,
                      component_category_name(LOG_STATUS_ERROR), text);
}

static bool check_instantiation(fmi2String name, fmi2Type type, fmi2String guid,
                                const fmi2CallbackFunctions *functions) {
    char text[LOG_TEXT_SIZE];
    if (!component_check_token(name, "GUID", guid, model_description.guid, text)) {
        refuse_instance(functions, name, "%s", text);
        return false;
    }
    if (type != fmi2CoSimulation && type != fmi2ModelExchange) {
        refuse_instance(functions, name,
                        "FMU type %d is refused: %d for Model Exchange or %d for Co-Simulation is "
                        "expected",
                        (int)type, (int)fmi2ModelExchange, (int)fmi2CoSimulation);
        return false;
    }
    return functions != NULL;
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                              fmi2Boolean loggingOn) {
    if (!check_instantiation(instanceName, fmuType, fmuGUID, functions)) {
        return NULL;
    }
    const enum fmi_kind kind =
        fmuType == fmi2CoSimulation ? KIND_CO_SIMULATION : KIND_MODEL_EXCHANGE;
    const size_t name_size = strlen(instanceName) + 1;
    struct fmi2_component *created = calloc(1, sizeof *created + name_size);
    if (created == NULL) {
        refuse_instance(functions, instanceName, "%s", status_text(STATUS_OUT_OF_MEMORY));
        return NULL;
    }
    created->logger = functions->logger;
    created->environment = functions->componentEnvironment;
    memcpy(created->name, instanceName, name_size);
    if (component_begin(&created->base, &adapter, kind, loggingOn != fmi2False) != COMPONENT_OK) {
        free(created);
        return NULL;
    }
    component_log(&created->base, COMPONENT_OK, LOG_ALL, "fmi2Instantiate");
    return created;
}

void fmi2FreeInstance(fmi2Component c) {
    if (c != NULL && !component_refuse_in_logger(c, "fmi2FreeInstance")) {
        component_log(c, COMPONENT_OK, LOG_ALL, "fmi2FreeInstance");
        component_end(c);
        free(c);
    }
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
    const enum fmi2_call call = CALL_fmi2SetDebugLogging;
    struct component *component = c;
    if (!component_enter(component, call) ||
        !component_check_arrays(component, call, nCategories, categories, categories)) {
        return fmi2Error;
    }
    return fmi2_status(
        component_set_logging(component, loggingOn != fmi2False, nCategories, categories));
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
    const struct instance_experiment experiment = {
        .start_time = startTime,
        .stop_time_defined = stopTimeDefined != fmi2False,
        .stop_time = stopTime,
        .tolerance_defined = toleranceDefined != fmi2False,
        .tolerance = tolerance,
    };
    return fmi2_status(mode_setup_experiment(c, CALL_fmi2SetupExperiment, &experiment));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    return fmi2_status(mode_enter_initialization(c, CALL_fmi2EnterInitializationMode, NULL));
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    return fmi2_status(mode_exit_initialization(c, CALL_fmi2ExitInitializationMode));
}

fmi2Status fmi2Terminate(fmi2Component c) {
    return fmi2_status(mode_terminate(c, CALL_fmi2Terminate));
}

fmi2Status fmi2Reset(fmi2Component c) {
    return fmi2_status(mode_reset(c, CALL_fmi2Reset));
}

/* ---- Values --------------------------------------------------------------------------------- */

#define ACCESS(Verb, verb, Type, type, element)                                                    \
    fmi2Status fmi2##Verb##Type(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,        \
                                element value[]) {                                                 \
        return fmi2_status(access_##verb##_##type(c, CALL_fmi2##Verb##Type, vr, nvr, value));      \
    }
ACCESS(Get, get, Real, real, fmi2Real)
ACCESS(Set, set, Real, real, const fmi2Real)
ACCESS(Get, get, Integer, integer, fmi2Integer)
ACCESS(Set, set, Integer, integer, const fmi2Integer)
ACCESS(Get, get, Boolean, boolean, fmi2Boolean)
ACCESS(Set, set, Boolean, boolean, const fmi2Boolean)

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                         fmi2String value[]) {
    return fmi2_status(access_none(c, CALL_fmi2GetString, "String", vr, nvr, value));
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                         const fmi2String value[]) {
    return fmi2_status(access_none(c, CALL_fmi2SetString, "String", vr, nvr, value));
}

/* ---- FMU state ------------------------------------------------------------------------------ */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    return fmi2_status(fmu_state_save(c, CALL_fmi2GetFMUstate, FMUstate));
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
    return fmi2_status(fmu_state_restore(c, CALL_fmi2SetFMUstate, FMUstate));
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    return fmi2_status(fmu_state_free(c, CALL_fmi2FreeFMUstate, FMUstate));
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
    return fmi2_status(fmu_state_size(c, CALL_fmi2SerializedFMUstateSize, FMUstate, size));
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[],
                                 size_t size) {
    return fmi2_status(fmu_state_serialize(c, CALL_fmi2SerializeFMUstate, FMUstate,
                                           (unsigned char *)serializedState, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate) {
    return fmi2_status(fmu_state_deserialize(
        c, CALL_fmi2DeSerializeFMUstate, (const unsigned char *)serializedState, size, FMUstate));
}

/* ---- Directional derivatives ---------------------------------------------------------------- */

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[],
                                        size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[]) {
    return fmi2_status(access_get_directional_derivative(c, CALL_fmi2GetDirectionalDerivative,
                                                         vUnknown_ref, nUnknown, vKnown_ref, nKnown,
                                                         dvKnown, dvUnknown));
}

/* ---- Model Exchange: modes (section 3.2) ---------------------------------------------------- */

fmi2Status fmi2EnterEventMode(fmi2Component c) {
    return fmi2_status(mode_enter_event(c, CALL_fmi2EnterEventMode));
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *fmi2eventInfo) {
    const enum fmi2_call call = CALL_fmi2NewDiscreteStates;
    struct component *component = c;
    if (!component_enter(component, call) ||
        !component_check_arrays(component, call, 1, fmi2eventInfo, fmi2eventInfo)) {
        return fmi2Error;
    }
    struct discrete_update update;
    const enum component_status status = mode_update_discrete_states(component, &update);
    const bool has_next_time = isfinite(update.next_time);
    *fmi2eventInfo = (fmi2EventInfo){
        .newDiscreteStatesNeeded = update.is_incomplete ? fmi2True : fmi2False,
        .terminateSimulation = fmi2False,
        .nominalsOfContinuousStatesChanged = fmi2False,
        .valuesOfContinuousStatesChanged = update.states_changed ? fmi2True : fmi2False,
        .nextEventTimeDefined = has_next_time ? fmi2True : fmi2False,
        .nextEventTime = has_next_time ? update.next_time : 0.0,
    };
    return fmi2_status(status);
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    return fmi2_status(mode_enter_continuous_time(c, CALL_fmi2EnterContinuousTimeMode));
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c,
                                       fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode,
                                       fmi2Boolean *terminateSimulation) {
    bool is_event = false;
    const enum component_status status = continuous_complete_step(
        c, CALL_fmi2CompletedIntegratorStep, enterEventMode, terminateSimulation, &is_event);
    if (status == COMPONENT_OK) {
        *enterEventMode = is_event;
        *terminateSimulation = fmi2False;
    }
    return fmi2_status(status);
}

/* ---- Model Exchange: time and states -------------------------------------------------------- */

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    return fmi2_status(continuous_set_time(c, CALL_fmi2SetTime, time));
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx) {
    return fmi2_status(continuous_set_states(c, CALL_fmi2SetContinuousStates, x, nx));
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx) {
    return fmi2_status(continuous_get_derivatives(c, CALL_fmi2GetDerivatives, derivatives, nx));
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real eventIndicators[], size_t ni) {
    return fmi2_status(
        continuous_get_indicators(c, CALL_fmi2GetEventIndicators, eventIndicators, ni));
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx) {
    return fmi2_status(continuous_get_states(c, CALL_fmi2GetContinuousStates, x, nx));
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x_nominal[], size_t nx) {
    return fmi2_status(
        continuous_get_nominals(c, CALL_fmi2GetNominalsOfContinuousStates, x_nominal, nx));
}

/* ---- Co-Simulation: derivatives of inputs and outputs (section 4.2) ------------------------- */

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    return fmi2_status(
        access_set_input_derivatives(c, CALL_fmi2SetRealInputDerivatives, vr, nvr, order, value));
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[]) {
    return fmi2_status(
        access_get_output_derivatives(c, CALL_fmi2GetRealOutputDerivatives, vr, nvr, order, value));
}

/* ---- Co-Simulation: steps ------------------------------------------------------------------- */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    // importers say true, and roll back nevertheless
    struct component *component = c;
    if (!component_enter(component, CALL_fmi2DoStep)) {
        return fmi2Error;
    }
    const enum status status = instance_do_step(component->instance, currentCommunicationPoint,
                                                communicationStepSize, NULL);
    if (status_severity(status) == SEVERITY_DISCARD) {
        component->state = STATE_STEP_FAILED;
    }
    return fmi2_status(component_result(component, status));
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    // no state allows it: no step is ever pending
    return component_enter(c, CALL_fmi2CancelStep) ? fmi2OK : fmi2Error;
}

/* ---- Co-Simulation: status ------------------------------------------------------------------ */

static bool begin_query(struct component *component, enum fmi2_call call, const void *value) {
    return component_enter(component, call) &&
           component_check_arrays(component, call, 1, value, value);
}

static fmi2Status no_status(struct component *component, enum fmi2_call call, const void *value) {
    if (!begin_query(component, call, value)) {
        return fmi2Error;
    }
    component_log(component, COMPONENT_DISCARD, LOG_STATUS_DISCARD,
                  "%s: this status cannot be known, no step is ever pending",
                  fmi2_call_rules[call].name);
    return fmi2Discard;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value) {
    return no_status(c, CALL_fmi2GetStatus, value);
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value) {
    struct component *component = c;
    if (s != fmi2LastSuccessfulTime) {
        return no_status(component, CALL_fmi2GetRealStatus, value);
    }
    if (!begin_query(component, CALL_fmi2GetRealStatus, value)) {
        return fmi2Error;
    }
    *value = instance_time(component->instance);
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value) {
    return no_status(c, CALL_fmi2GetIntegerStatus, value);
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value) {
    if (s != fmi2Terminated) {
        return no_status(c, CALL_fmi2GetBooleanStatus, value);
    }
    if (!begin_query(c, CALL_fmi2GetBooleanStatus, value)) {
        return fmi2Error;
    }
    *value = fmi2False; // the FMU never ends a simulation by itself
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value) {
    return no_status(c, CALL_fmi2GetStringStatus, value);
}
