/* All functions of FMI 2.0: checks of arguments that only FMI has, conversion of types and status,
 * and nothing else. */
#include "continuous_states.h"
#include "derivatives.h"
#include "fmi2Functions.h"
#include "fmi2_functions.h"
#include "fmi_snapshot.h"
#include "model_description.h"
#include "stepping.h"
#include "values.h"

#include <math.h>
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
struct fmi2_instance {
    struct fmi_instance base;  /* first */
    fmi2CallbackLogger logger; /* NULL for no log */
    fmi2ComponentEnvironment environment;
    const char *name;
};

_Static_assert((int)FMI_OK == fmi2OK && (int)FMI_WARNING == fmi2Warning &&
                   (int)FMI_DISCARD == fmi2Discard && (int)FMI_ERROR == fmi2Error &&
                   (int)FMI_FATAL == fmi2Fatal,
               "a fmi_status is converted by a cast");

static fmi2Status fmi2_status(enum fmi_status status) {
    return (fmi2Status)status;
}

/* Converts a status of the instance. */
static fmi2Status result(struct fmi_instance *fmi, enum status status) {
    return fmi2_status(fmi_result(fmi, status));
}

/* ---- Versions, life and logging ------------------------------------------------------------- */

const char *fmi2GetTypesPlatform(void) {
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void) {
    return fmi2Version;
}

static void send_text(const struct fmi_instance *fmi, enum fmi_status status, const char *category,
                      const char *text) {
    const struct fmi2_instance *to = (const struct fmi2_instance *)fmi;
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
    .doubled = "#%", // references to variables, formats of printf (section 2.1.5)
    .send = send_text,
};

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                              fmi2Boolean loggingOn) {
    if (functions == NULL) {
        return NULL;
    }
    struct fmi2_instance fmi = {.logger = functions->logger,
                                .environment = functions->componentEnvironment,
                                .name = instanceName != NULL ? instanceName : ""};
    const enum fmi_kind kind =
        fmuType == fmi2CoSimulation ? KIND_CO_SIMULATION : KIND_MODEL_EXCHANGE;
    fmi_begin(&fmi.base, &adapter, kind, loggingOn != fmi2False);
    if (!fmi_check_token(&fmi.base, instanceName, "GUID", fmuGUID, model_description.guid)) {
        return NULL;
    }
    if (fmuType != fmi2CoSimulation && fmuType != fmi2ModelExchange) {
        fmi_fail(&fmi.base,
                 "FMU type %d is refused: %d for Model Exchange or %d for Co-Simulation is "
                 "expected",
                 (int)fmuType, (int)fmi2ModelExchange, (int)fmi2CoSimulation);
        return NULL;
    }
    // the name behind the FMI instance
    const size_t name_size = strlen(fmi.name) + 1;
    struct fmi2_instance *created = malloc(sizeof *created + name_size);
    if (created == NULL) {
        fmi_fail(&fmi.base, "%s", status_text(STATUS_OUT_OF_MEMORY));
        return NULL;
    }
    *created = fmi;
    created->name = memcpy(created + 1, fmi.name, name_size);
    if (fmi_create_instance(&created->base) != FMI_OK) {
        free(created);
        return NULL;
    }
    fmi_log(&created->base, FMI_OK, LOG_ALL, "fmi2Instantiate");
    return created;
}

void fmi2FreeInstance(fmi2Component c) {
    if (c != NULL && !fmi_refuse_in_logger(c, "fmi2FreeInstance")) {
        fmi_log(c, FMI_OK, LOG_ALL, "fmi2FreeInstance");
        fmi_end(c);
        free(c);
    }
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
    const enum fmi2_call call = CALL_fmi2SetDebugLogging;
    if (fmi_enter_with(c, call, nCategories, categories, categories) == NULL) {
        return fmi2Error;
    }
    return fmi2_status(fmi_set_logging(c, loggingOn != fmi2False, nCategories, categories));
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
    struct instance *instance = fmi_enter(c, CALL_fmi2SetupExperiment);
    return instance != NULL ? result(c, instance_setup_experiment(instance, &experiment))
                            : fmi2Error;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    struct instance *instance = fmi_enter(c, CALL_fmi2EnterInitializationMode);
    return instance != NULL ? fmi2_status(fmi_go_to(c, STATE_INITIALIZATION,
                                                    instance_enter_initialization(instance)))
                            : fmi2Error;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    return fmi2_status(fmi_exit_initialization(c, CALL_fmi2ExitInitializationMode));
}

fmi2Status fmi2Terminate(fmi2Component c) {
    return fmi2_status(fmi_terminate(c, CALL_fmi2Terminate));
}

fmi2Status fmi2Reset(fmi2Component c) {
    return fmi2_status(fmi_reset(c, CALL_fmi2Reset));
}

/* ---- Values --------------------------------------------------------------------------------- */

#define ACCESS(Verb, verb, Type, type, element)                                                    \
    fmi2Status fmi2##Verb##Type(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,        \
                                element value[]) {                                                 \
        struct instance *instance = fmi_enter_with(c, CALL_fmi2##Verb##Type, nvr, vr, value);      \
        return instance != NULL ? result(c, instance_##verb##_##type(instance, vr, nvr, value))    \
                                : fmi2Error;                                                       \
    }
ACCESS(Get, get, Real, real, fmi2Real)
ACCESS(Set, set, Real, real, const fmi2Real)
ACCESS(Get, get, Integer, integer, fmi2Integer)
ACCESS(Set, set, Integer, integer, const fmi2Integer)
ACCESS(Get, get, Boolean, boolean, fmi2Boolean)
ACCESS(Set, set, Boolean, boolean, const fmi2Boolean)

/* Accesses a type that no variable has. */
static fmi2Status access_none(fmi2Component c, enum fmi2_call call, const fmi2ValueReference vr[],
                              size_t nvr, const void *value) {
    return fmi_enter_with(c, call, nvr, vr, value) != NULL
               ? fmi2_status(fmi_access_none(c, "String", vr, nvr))
               : fmi2Error;
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                         fmi2String value[]) {
    return access_none(c, CALL_fmi2GetString, vr, nvr, value);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                         const fmi2String value[]) {
    return access_none(c, CALL_fmi2SetString, vr, nvr, value);
}

/* ---- FMU state ------------------------------------------------------------------------------ */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    return fmi2_status(fmi_snapshot_save(c, CALL_fmi2GetFMUstate, FMUstate));
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
    return fmi2_status(fmi_snapshot_restore(c, CALL_fmi2SetFMUstate, FMUstate));
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    return fmi2_status(fmi_snapshot_free(c, CALL_fmi2FreeFMUstate, FMUstate));
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
    return fmi2_status(fmi_snapshot_size(c, CALL_fmi2SerializedFMUstateSize, FMUstate, size));
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[],
                                 size_t size) {
    return fmi2_status(fmi_snapshot_serialize(c, CALL_fmi2SerializeFMUstate, FMUstate,
                                              (unsigned char *)serializedState, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate) {
    return fmi2_status(fmi_snapshot_deserialize(
        c, CALL_fmi2DeSerializeFMUstate, (const unsigned char *)serializedState, size, FMUstate));
}

/* ---- Directional derivatives ---------------------------------------------------------------- */

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[],
                                        size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[]) {
    const enum fmi2_call call = CALL_fmi2GetDirectionalDerivative;
    struct instance *instance = fmi_enter_with(c, call, nUnknown, vUnknown_ref, dvUnknown);
    if (instance == NULL || !fmi_check_arrays(c, call, nKnown, vKnown_ref, dvKnown)) {
        return fmi2Error;
    }
    return result(c, instance_get_directional_derivative(instance, KNOWN_MOTION, vUnknown_ref,
                                                         nUnknown, vKnown_ref, nKnown, dvKnown,
                                                         dvUnknown));
}

/* ---- Model Exchange: modes (section 3.2) ---------------------------------------------------- */

fmi2Status fmi2EnterEventMode(fmi2Component c) {
    struct instance *instance = fmi_enter(c, CALL_fmi2EnterEventMode);
    if (instance == NULL) {
        return fmi2Error;
    }
    instance_enter_event_mode(instance);
    return fmi2_status(fmi_go_to(c, STATE_EVENT, STATUS_OK));
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *fmi2eventInfo) {
    struct instance *instance =
        fmi_enter_with(c, CALL_fmi2NewDiscreteStates, 1, fmi2eventInfo, fmi2eventInfo);
    if (instance == NULL) {
        return fmi2Error;
    }
    struct discrete_update update;
    const enum status status = instance_update_discrete_states(instance, &update);
    const bool has_next_time = isfinite(update.next_time);
    *fmi2eventInfo = (fmi2EventInfo){
        .newDiscreteStatesNeeded = update.is_incomplete ? fmi2True : fmi2False,
        .terminateSimulation = update.has_ended ? fmi2True : fmi2False,
        .nominalsOfContinuousStatesChanged = fmi2False,
        .valuesOfContinuousStatesChanged = update.states_changed ? fmi2True : fmi2False,
        .nextEventTimeDefined = has_next_time ? fmi2True : fmi2False,
        .nextEventTime = has_next_time ? update.next_time : 0.0,
    };
    return result(c, status);
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    struct instance *instance = fmi_enter(c, CALL_fmi2EnterContinuousTimeMode);
    return instance != NULL ? fmi2_status(fmi_go_to(c, STATE_CONTINUOUS_TIME,
                                                    instance_enter_continuous_time(instance)))
                            : fmi2Error;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c,
                                       fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode,
                                       fmi2Boolean *terminateSimulation) {
    struct instance *instance =
        fmi_enter_with(c, CALL_fmi2CompletedIntegratorStep, 1, enterEventMode, terminateSimulation);
    if (instance == NULL) {
        return fmi2Error;
    }
    bool has_event;
    const enum status status = instance_complete_step(instance, &has_event);
    *enterEventMode = has_event;
    *terminateSimulation = instance_has_ended(instance) ? fmi2True : fmi2False;
    return result(c, status);
}

/* ---- Model Exchange: time and states -------------------------------------------------------- */

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    struct instance *instance = fmi_enter(c, CALL_fmi2SetTime);
    return instance != NULL ? result(c, instance_set_time(instance, time)) : fmi2Error;
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx) {
    struct instance *instance = fmi_enter_with(c, CALL_fmi2SetContinuousStates, nx, x, x);
    return instance != NULL ? result(c, instance_set_states(instance, x, nx)) : fmi2Error;
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx) {
    struct instance *instance =
        fmi_enter_with(c, CALL_fmi2GetDerivatives, nx, derivatives, derivatives);
    return instance != NULL ? result(c, instance_get_derivatives(instance, derivatives, nx))
                            : fmi2Error;
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real eventIndicators[], size_t ni) {
    struct instance *instance =
        fmi_enter_with(c, CALL_fmi2GetEventIndicators, ni, eventIndicators, eventIndicators);
    return instance != NULL ? result(c, instance_get_indicators(instance, eventIndicators, ni))
                            : fmi2Error;
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx) {
    struct instance *instance = fmi_enter_with(c, CALL_fmi2GetContinuousStates, nx, x, x);
    return instance != NULL ? result(c, instance_get_states(instance, x, nx)) : fmi2Error;
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x_nominal[], size_t nx) {
    struct instance *instance =
        fmi_enter_with(c, CALL_fmi2GetNominalsOfContinuousStates, nx, x_nominal, x_nominal);
    return instance != NULL ? result(c, instance_get_nominals(instance, x_nominal, nx)) : fmi2Error;
}

/* ---- Co-Simulation: derivatives of inputs and outputs (section 4.2) ------------------------- */

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    const enum fmi2_call call = CALL_fmi2SetRealInputDerivatives;
    struct instance *instance = fmi_enter_with(c, call, nvr, vr, value);
    return instance != NULL && fmi_check_arrays(c, call, nvr, order, order)
               ? result(c, instance_set_input_derivatives(instance, vr, nvr, order, value))
               : fmi2Error;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[]) {
    const enum fmi2_call call = CALL_fmi2GetRealOutputDerivatives;
    struct instance *instance = fmi_enter_with(c, call, nvr, vr, value);
    return instance != NULL && fmi_check_arrays(c, call, nvr, order, order)
               ? result(c, instance_get_output_derivatives(instance, vr, nvr, order, value))
               : fmi2Error;
}

/* ---- Co-Simulation: steps ------------------------------------------------------------------- */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    // importers say true, and roll back nevertheless
    struct fmi_instance *fmi = c;
    struct instance *instance = fmi_enter(fmi, CALL_fmi2DoStep);
    if (instance == NULL) {
        return fmi2Error;
    }
    const enum status status =
        instance_do_step(instance, currentCommunicationPoint, communicationStepSize, NULL);
    if (status == STATUS_OK) {
        return fmi2OK;
    }
    if (status_severity(status) == SEVERITY_DISCARD) {
        fmi->state = STATE_STEP_FAILED;
    }
    return result(fmi, status);
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    // no state allows it: no step is ever pending
    return fmi_enter(c, CALL_fmi2CancelStep) != NULL ? fmi2OK : fmi2Error;
}

/* ---- Co-Simulation: status ------------------------------------------------------------------ */

static fmi2Status no_status(fmi2Component c, enum fmi2_call call, const void *value) {
    if (fmi_enter_with(c, call, 1, value, value) == NULL) {
        return fmi2Error;
    }
    fmi_log(c, FMI_DISCARD, LOG_STATUS_DISCARD,
            "%s: this status cannot be known, no step is ever pending", fmi2_call_rules[call].name);
    return fmi2Discard;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value) {
    return no_status(c, CALL_fmi2GetStatus, value);
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value) {
    if (s != fmi2LastSuccessfulTime) {
        return no_status(c, CALL_fmi2GetRealStatus, value);
    }
    const struct instance *instance = fmi_enter_with(c, CALL_fmi2GetRealStatus, 1, value, value);
    if (instance == NULL) {
        return fmi2Error;
    }
    *value = instance_time(instance);
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value) {
    return no_status(c, CALL_fmi2GetIntegerStatus, value);
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value) {
    if (s != fmi2Terminated) {
        return no_status(c, CALL_fmi2GetBooleanStatus, value);
    }
    const struct instance *instance = fmi_enter_with(c, CALL_fmi2GetBooleanStatus, 1, value, value);
    if (instance == NULL) {
        return fmi2Error;
    }
    *value = instance_has_ended(instance) ? fmi2True : fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value) {
    return no_status(c, CALL_fmi2GetStringStatus, value);
}
