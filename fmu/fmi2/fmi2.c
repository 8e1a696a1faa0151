/* The functions that Model Exchange and Co-Simulation share (FMI 2.0, section 2.1): checks of
 * arguments that only FMI has, conversion of types and status, and nothing else. */
#include "fmi2_component.h"
#include "fmu_state.h"
#include "model_description.h"
#include "modes.h"
#include "variable_access.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- Versions, life and logging -------------------------------------------------------------- */

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

static bool may_instantiate(fmi2String name, fmi2Type type, fmi2String guid,
                            const fmi2CallbackFunctions *functions) {
    char text[LOG_TEXT_SIZE];
    if (!component_may_begin(name, "GUID", guid, model_description.guid, text)) {
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
    if (!may_instantiate(instanceName, fmuType, fmuGUID, functions)) {
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
    if (c != NULL && !component_is_logging(c, "fmi2FreeInstance")) {
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
        !component_has_arrays(component, call, nCategories, categories, categories)) {
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

/* ---- Directional derivatives ----------------------------------------------------------------- */

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[],
                                        size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[]) {
    return fmi2_status(access_get_directional_derivative(c, CALL_fmi2GetDirectionalDerivative,
                                                         vUnknown_ref, nUnknown, vKnown_ref, nKnown,
                                                         dvKnown, dvUnknown));
}
