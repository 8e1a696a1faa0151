/* The functions of FMI 2.0 for co-simulation: checks of arguments that only FMI has, conversion of
 * types and status, and nothing else. What each does is told in the specification, section 4.2. */
#include "component.h"
#include "unit.h"

#include <string.h>

/* The component, or NULL where the call is refused: the caller then returns fmi2Error. */
static struct component *enter(fmi2Component c, enum call call) {
    struct component *component = c;
    return component_enter(component, call) ? component : NULL;
}

static bool has_arrays(struct component *component, enum call call, size_t count,
                       const void *references, const void *values) {
    if (count > 0 && (references == NULL || values == NULL)) {
        component_fail(component, "%s: an array is NULL, %zu values are expected",
                       call_rules[call].name, count);
        return false;
    }
    return true;
}

/* ---- Versions, life and logging -------------------------------------------------------------- */

const char *fmi2GetTypesPlatform(void) {
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void) {
    return fmi2Version;
}

/* Says in the log why there is no instance; functions may be NULL. */
static bool may_instantiate(fmi2String name, fmi2Type type, fmi2String guid,
                            const fmi2CallbackFunctions *functions) {
    if (name == NULL || name[0] == '\0') {
        component_log_refusal(functions, name,
                              "the instance name is missing: a name that is not empty is expected");
        return false;
    }
    if (type != fmi2CoSimulation) {
        component_log_refusal(functions, name,
                              "FMU type %d is refused: co-simulation, %d, is expected", (int)type,
                              (int)fmi2CoSimulation);
        return false;
    }
    if (guid == NULL || strcmp(guid, unit.guid) != 0) {
        component_log_refusal(
            functions, name,
            "the GUID '%.100s' is refused: '%s' is expected, the model description "
            "belongs to another build",
            guid != NULL ? guid : "", unit.guid);
        return false;
    }
    return functions != NULL;
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                              fmi2Boolean loggingOn) {
    (void)fmuResourceLocation;
    (void)visible;
    if (!may_instantiate(instanceName, fmuType, fmuGUID, functions)) {
        return NULL;
    }
    struct component *component = component_create(instanceName, functions, loggingOn != fmi2False);
    if (component == NULL) {
        component_log_refusal(functions, instanceName, "%s", status_text(STATUS_OUT_OF_MEMORY));
    }
    return component;
}

void fmi2FreeInstance(fmi2Component c) {
    component_destroy(c);
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
    struct component *component = enter(c, CALL_fmi2SetDebugLogging);
    if (component == NULL ||
        !has_arrays(component, CALL_fmi2SetDebugLogging, nCategories, categories, categories)) {
        return fmi2Error;
    }

    const bool on = loggingOn != fmi2False;
    bool is_logged[LOG_CATEGORY_COUNT];
    memcpy(is_logged, component->is_logged, sizeof is_logged);
    if (on || nCategories == 0) {
        for (int i = 0; i < LOG_CATEGORY_COUNT; i++) {
            component->is_logged[i] = on && nCategories == 0;
        }
    }
    for (size_t i = 0; i < nCategories; i++) {
        if (categories[i] == NULL || !component_set_logged(component, categories[i], on)) {
            memcpy(component->is_logged, is_logged, sizeof is_logged);
            return component_fail(component,
                                  "log category '%s' is unknown: the model description "
                                  "lists those there are",
                                  categories[i] != NULL ? categories[i] : "");
        }
    }
    return fmi2OK;
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
    struct component *component = enter(c, CALL_fmi2SetupExperiment);
    if (component == NULL) {
        return fmi2Error;
    }
    const struct slave_experiment experiment = {
        .start_time = startTime,
        .stop_time_defined = stopTimeDefined != fmi2False,
        .stop_time = stopTime,
        .tolerance_defined = toleranceDefined != fmi2False,
        .tolerance = tolerance,
    };
    return component_status(component, slave_setup_experiment(component->slave, &experiment));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    struct component *component = enter(c, CALL_fmi2EnterInitializationMode);
    if (component == NULL) {
        return fmi2Error;
    }
    const enum status status = slave_enter_initialization(component->slave);
    if (status == STATUS_OK) {
        component->state = STATE_INITIALIZATION;
    }
    return component_status(component, status);
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    struct component *component = enter(c, CALL_fmi2ExitInitializationMode);
    if (component == NULL) {
        return fmi2Error;
    }
    const enum status status = slave_exit_initialization(component->slave);
    if (status == STATUS_OK) {
        component->state = STATE_STEP_COMPLETE;
        component_log(component, fmi2OK, LOG_EVENTS, "initialized at t = %.17g",
                      slave_time(component->slave));
    }
    return component_status(component, status);
}

fmi2Status fmi2Terminate(fmi2Component c) {
    struct component *component = enter(c, CALL_fmi2Terminate);
    if (component == NULL) {
        return fmi2Error;
    }
    component->state = STATE_TERMINATED;
    component_log(component, fmi2OK, LOG_EVENTS, "terminated at t = %.17g",
                  slave_time(component->slave));
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    struct component *component = enter(c, CALL_fmi2Reset);
    if (component == NULL) {
        return fmi2Error;
    }
    slave_reset(component->slave);
    component->state = STATE_INSTANTIATED;
    component_log(component, fmi2OK, LOG_EVENTS, "reset to the start values");
    return fmi2OK;
}

/* ---- Values --------------------------------------------------------------------------------- */

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       fmi2Real value[]) {
    struct component *component = enter(c, CALL_fmi2GetReal);
    if (component == NULL || !has_arrays(component, CALL_fmi2GetReal, nvr, vr, value)) {
        return fmi2Error;
    }
    return component_status(component, slave_get_real(component->slave, vr, nvr, value));
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Integer value[]) {
    struct component *component = enter(c, CALL_fmi2GetInteger);
    if (component == NULL || !has_arrays(component, CALL_fmi2GetInteger, nvr, vr, value)) {
        return fmi2Error;
    }
    return component_status(component, slave_get_integer(component->slave, vr, nvr, value));
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       const fmi2Real value[]) {
    struct component *component = enter(c, CALL_fmi2SetReal);
    if (component == NULL || !has_arrays(component, CALL_fmi2SetReal, nvr, vr, value)) {
        return fmi2Error;
    }
    return component_status(component, slave_set_real(component->slave, vr, nvr, value));
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Integer value[]) {
    struct component *component = enter(c, CALL_fmi2SetInteger);
    if (component == NULL || !has_arrays(component, CALL_fmi2SetInteger, nvr, vr, value)) {
        return fmi2Error;
    }
    return component_status(component, slave_set_integer(component->slave, vr, nvr, value));
}

/* Units have no Boolean and no String variables: only an access to none of them succeeds. */
static fmi2Status access_none(fmi2Component c, enum call call, const char *type,
                              const fmi2ValueReference vr[], size_t nvr, const void *value) {
    struct component *component = enter(c, call);
    if (component == NULL || !has_arrays(component, call, nvr, vr, value)) {
        return fmi2Error;
    }
    if (nvr > 0) {
        return component_fail(component,
                              "value reference %u is accessed as %s: %s has no variable "
                              "of that type",
                              vr[0], type, unit.name);
    }
    return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Boolean value[]) {
    return access_none(c, CALL_fmi2GetBoolean, "Boolean", vr, nvr, value);
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                         fmi2String value[]) {
    return access_none(c, CALL_fmi2GetString, "String", vr, nvr, value);
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Boolean value[]) {
    return access_none(c, CALL_fmi2SetBoolean, "Boolean", vr, nvr, value);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                         const fmi2String value[]) {
    return access_none(c, CALL_fmi2SetString, "String", vr, nvr, value);
}

/* ---- Steps ---------------------------------------------------------------------------------- */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    (void)noSetFMUStatePriorToCurrentPoint; // importers say true and roll back all the same
    struct component *component = enter(c, CALL_fmi2DoStep);
    if (component == NULL) {
        return fmi2Error;
    }
    const enum status status =
        slave_do_step(component->slave, currentCommunicationPoint, communicationStepSize);
    if (status_severity(status) == SEVERITY_DISCARD) {
        component->state = STATE_STEP_FAILED;
    }
    return component_status(component, status);
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    enter(c, CALL_fmi2CancelStep);
    return fmi2Error;
}

static fmi2Status status_unknown(struct component *component, enum call call) {
    component_log(component, fmi2Discard, LOG_STATUS_DISCARD,
                  "%s: this status cannot be known, no step is ever pending",
                  call_rules[call].name);
    return fmi2Discard;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value) {
    (void)s;
    struct component *component = enter(c, CALL_fmi2GetStatus);
    if (component == NULL || !has_arrays(component, CALL_fmi2GetStatus, 1, value, value)) {
        return fmi2Error;
    }
    return status_unknown(component, CALL_fmi2GetStatus);
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value) {
    struct component *component = enter(c, CALL_fmi2GetRealStatus);
    if (component == NULL || !has_arrays(component, CALL_fmi2GetRealStatus, 1, value, value)) {
        return fmi2Error;
    }
    if (s != fmi2LastSuccessfulTime) {
        return status_unknown(component, CALL_fmi2GetRealStatus);
    }
    *value = slave_time(component->slave);
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value) {
    (void)s;
    struct component *component = enter(c, CALL_fmi2GetIntegerStatus);
    if (component == NULL || !has_arrays(component, CALL_fmi2GetIntegerStatus, 1, value, value)) {
        return fmi2Error;
    }
    return status_unknown(component, CALL_fmi2GetIntegerStatus);
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value) {
    struct component *component = enter(c, CALL_fmi2GetBooleanStatus);
    if (component == NULL || !has_arrays(component, CALL_fmi2GetBooleanStatus, 1, value, value)) {
        return fmi2Error;
    }
    if (s != fmi2Terminated) {
        return status_unknown(component, CALL_fmi2GetBooleanStatus);
    }
    *value = fmi2False; // the unit never ends a simulation by itself
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value) {
    (void)s;
    struct component *component = enter(c, CALL_fmi2GetStringStatus);
    if (component == NULL || !has_arrays(component, CALL_fmi2GetStringStatus, 1, value, value)) {
        return fmi2Error;
    }
    return status_unknown(component, CALL_fmi2GetStringStatus);
}
