/* The functions that Model Exchange and Co-Simulation share (FMI 2.0, section 2.1): checks of
 * arguments that only FMI has, conversion of types and status, and nothing else. */
#include "component.h"
#include "derivatives.h"
#include "model_description.h"
#include "serialization.h"
#include "snapshot.h"
#include "values.h"

#include <string.h>

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
    if (type != fmi2CoSimulation && type != fmi2ModelExchange) {
        component_log_refusal(
            functions, name,
            "FMU type %d is refused: Model Exchange, %d, or co-simulation, %d, is "
            "expected",
            (int)type, (int)fmi2ModelExchange, (int)fmi2CoSimulation);
        return false;
    }
    if (guid == NULL || strcmp(guid, model_description.guid) != 0) {
        component_log_refusal(
            functions, name,
            "the GUID '%.100s' is refused: '%s' is expected, the model description "
            "belongs to another build",
            guid != NULL ? guid : "", model_description.guid);
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
    struct component *component =
        component_create(instanceName, fmuType, functions, loggingOn != fmi2False);
    if (component == NULL) {
        component_log_refusal(functions, instanceName, "%s", status_text(STATUS_OUT_OF_MEMORY));
        return NULL;
    }
    component_log(component, fmi2OK, LOG_ALL, "fmi2Instantiate");
    return component;
}

void fmi2FreeInstance(fmi2Component c) {
    if (c != NULL) {
        component_log(c, fmi2OK, LOG_ALL, "fmi2FreeInstance");
    }
    component_destroy(c);
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
    struct component *component = component_enter(c, CALL_fmi2SetDebugLogging);
    if (component == NULL || !component_has_arrays(component, CALL_fmi2SetDebugLogging, nCategories,
                                                   categories, categories)) {
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
    struct component *component = component_enter(c, CALL_fmi2SetupExperiment);
    if (component == NULL) {
        return fmi2Error;
    }
    const struct instance_experiment experiment = {
        .start_time = startTime,
        .stop_time_defined = stopTimeDefined != fmi2False,
        .stop_time = stopTime,
        .tolerance_defined = toleranceDefined != fmi2False,
        .tolerance = tolerance,
    };
    return component_status(component, instance_setup_experiment(component->instance, &experiment));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    struct component *component = component_enter(c, CALL_fmi2EnterInitializationMode);
    if (component == NULL) {
        return fmi2Error;
    }
    const enum status status = instance_enter_initialization(component->instance);
    if (status == STATUS_OK) {
        component->state = STATE_INITIALIZATION;
    }
    return component_status(component, status);
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    struct component *component = component_enter(c, CALL_fmi2ExitInitializationMode);
    if (component == NULL) {
        return fmi2Error;
    }
    const enum status status = instance_exit_initialization(component->instance);
    if (status == STATUS_OK) {
        component->state = component->kind == fmi2CoSimulation ? STATE_STEP_COMPLETE : STATE_EVENT;
        component_log(component, fmi2OK, LOG_EVENTS, "initialized at t = %.17g",
                      instance_time(component->instance));
    }
    return component_status(component, status);
}

fmi2Status fmi2Terminate(fmi2Component c) {
    struct component *component = component_enter(c, CALL_fmi2Terminate);
    if (component == NULL) {
        return fmi2Error;
    }
    component->state = STATE_TERMINATED;
    component_log(component, fmi2OK, LOG_EVENTS, "terminated at t = %.17g",
                  instance_time(component->instance));
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    struct component *component = component_enter(c, CALL_fmi2Reset);
    if (component == NULL) {
        return fmi2Error;
    }
    instance_reset(component->instance);
    component->state = STATE_INSTANTIATED;
    component_log(component, fmi2OK, LOG_EVENTS, "reset to the start values");
    return fmi2OK;
}

/* ---- Values --------------------------------------------------------------------------------- */

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       fmi2Real value[]) {
    struct component *component = component_enter(c, CALL_fmi2GetReal);
    if (component == NULL || !component_has_arrays(component, CALL_fmi2GetReal, nvr, vr, value)) {
        return fmi2Error;
    }
    return component_status(component, instance_get_real(component->instance, vr, nvr, value));
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Integer value[]) {
    struct component *component = component_enter(c, CALL_fmi2GetInteger);
    if (component == NULL ||
        !component_has_arrays(component, CALL_fmi2GetInteger, nvr, vr, value)) {
        return fmi2Error;
    }
    return component_status(component, instance_get_integer(component->instance, vr, nvr, value));
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       const fmi2Real value[]) {
    struct component *component = component_enter(c, CALL_fmi2SetReal);
    if (component == NULL || !component_has_arrays(component, CALL_fmi2SetReal, nvr, vr, value)) {
        return fmi2Error;
    }
    return component_status(component, instance_set_real(component->instance, vr, nvr, value));
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Integer value[]) {
    struct component *component = component_enter(c, CALL_fmi2SetInteger);
    if (component == NULL ||
        !component_has_arrays(component, CALL_fmi2SetInteger, nvr, vr, value)) {
        return fmi2Error;
    }
    return component_status(component, instance_set_integer(component->instance, vr, nvr, value));
}

/* Units have no Boolean and no String variables: only an access to none of them succeeds. */
static fmi2Status access_none(fmi2Component c, enum call call, const char *type,
                              const fmi2ValueReference vr[], size_t nvr, const void *value) {
    struct component *component = component_enter(c, call);
    if (component == NULL || !component_has_arrays(component, call, nvr, vr, value)) {
        return fmi2Error;
    }
    if (nvr > 0) {
        return component_fail(component,
                              "value reference %u is accessed as %s: %s has no variable "
                              "of that type",
                              vr[0], type, model_description.name);
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

/* ---- FMU state ------------------------------------------------------------------------------ */

/* A saved state carries the FMI state and the kind of its instance. */
enum { TAG_KIND_SHIFT = 16, TAG_STATE_MASK = 0xffff };

static unsigned tag_of(const struct component *component) {
    return (unsigned)component->state | (unsigned)component->kind << TAG_KIND_SHIFT;
}

/* FMI states that an instance of a kind can be in while its instance is in a phase. */
static unsigned states_of(fmi2Type kind, enum phase phase) {
    const bool steps = kind == fmi2CoSimulation;
    switch (phase) {
    case PHASE_INSTANTIATED:
        return STATE_INSTANTIATED | STATE_ERROR;
    case PHASE_INITIALIZATION:
        return STATE_INITIALIZATION | STATE_ERROR;
    case PHASE_STEPPING:
        return STATE_TERMINATED | STATE_ERROR |
               (steps ? STATE_STEP_COMPLETE | STATE_STEP_FAILED : STATE_EVENT);
    case PHASE_CONTINUOUS_TIME:
        return steps ? 0 : STATE_CONTINUOUS_TIME | STATE_TERMINATED | STATE_ERROR;
    case PHASE_COUNT:
        break;
    }
    return 0;
}

/* The FMI state of a snapshot, where an instance of this kind can be in it; otherwise 0. */
static unsigned state_in(const struct component *component, unsigned tag, enum phase phase) {
    const unsigned state = tag & TAG_STATE_MASK;
    const bool is_one_bit = state != 0 && (state & (state - 1)) == 0;
    const bool is_same_kind = tag >> TAG_KIND_SHIFT == (unsigned)component->kind;
    return is_one_bit && is_same_kind ? state & states_of(component->kind, phase) : 0;
}

static fmi2Status refuse_kind(struct component *component, enum call call) {
    return component_fail(component,
                          "%s: the saved state is refused: it is none of an instance for %s",
                          call_rules[call].name,
                          component->kind == fmi2CoSimulation ? "Co-Simulation" : "Model Exchange");
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    struct component *component = component_enter(c, CALL_fmi2GetFMUstate);
    if (component == NULL ||
        !component_has_arrays(component, CALL_fmi2GetFMUstate, 1, FMUstate, FMUstate)) {
        return fmi2Error;
    }
    struct instance_snapshot *snapshot = *FMUstate;
    const enum status status = instance_save(component->instance, tag_of(component), &snapshot);
    *FMUstate = snapshot;
    return component_status(component, status);
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
    struct component *component = component_enter(c, CALL_fmi2SetFMUstate);
    if (component == NULL ||
        !component_has_arrays(component, CALL_fmi2SetFMUstate, 1, FMUstate, FMUstate)) {
        return fmi2Error;
    }
    unsigned tag = 0;
    enum phase phase = PHASE_COUNT;
    enum status status = instance_snapshot_tag(component->instance, FMUstate, &tag, &phase);
    if (status != STATUS_OK) {
        return component_status(component, status);
    }
    const unsigned state = state_in(component, tag, phase);
    if (state == 0) {
        return refuse_kind(component, CALL_fmi2SetFMUstate);
    }
    status = instance_restore(component->instance, FMUstate);
    if (status == STATUS_OK) {
        component->state = (enum fmi_state)state;
    }
    return component_status(component, status);
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    struct component *component = component_enter(c, CALL_fmi2FreeFMUstate);
    if (component == NULL) {
        return fmi2Error;
    }
    if (FMUstate == NULL || *FMUstate == NULL) {
        return fmi2OK;
    }
    struct instance_snapshot *snapshot = *FMUstate;
    const enum status status = instance_forget(component->instance, &snapshot);
    *FMUstate = snapshot;
    return component_status(component, status);
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
    struct component *component = component_enter(c, CALL_fmi2SerializedFMUstateSize);
    if (component == NULL ||
        !component_has_arrays(component, CALL_fmi2SerializedFMUstateSize, 1, FMUstate, size)) {
        return fmi2Error;
    }
    unsigned tag = 0;
    enum phase phase = PHASE_COUNT;
    const enum status status = instance_snapshot_tag(component->instance, FMUstate, &tag, &phase);
    if (status == STATUS_OK) {
        *size = instance_serialized_size(component->instance);
    }
    return component_status(component, status);
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[],
                                 size_t size) {
    struct component *component = component_enter(c, CALL_fmi2SerializeFMUstate);
    if (component == NULL || !component_has_arrays(component, CALL_fmi2SerializeFMUstate, 1,
                                                   FMUstate, serializedState)) {
        return fmi2Error;
    }
    return component_status(component, instance_serialize(component->instance, FMUstate,
                                                          (unsigned char *)serializedState, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate) {
    struct component *component = component_enter(c, CALL_fmi2DeSerializeFMUstate);
    if (component == NULL || !component_has_arrays(component, CALL_fmi2DeSerializeFMUstate, 1,
                                                   serializedState, FMUstate)) {
        return fmi2Error;
    }
    struct instance_snapshot *snapshot = NULL;
    enum status status = instance_deserialize(
        component->instance, (const unsigned char *)serializedState, size, &snapshot);
    if (status != STATUS_OK) {
        return component_status(component, status);
    }
    unsigned tag = 0;
    enum phase phase = PHASE_COUNT;
    status = instance_snapshot_tag(component->instance, snapshot, &tag, &phase);
    if (status != STATUS_OK || state_in(component, tag, phase) == 0) {
        instance_forget(component->instance, &snapshot);
        return refuse_kind(component, CALL_fmi2DeSerializeFMUstate);
    }
    *FMUstate = snapshot;
    return fmi2OK;
}

/* ---- Directional derivatives ----------------------------------------------------------------- */

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[],
                                        size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[]) {
    const enum call call = CALL_fmi2GetDirectionalDerivative;
    struct component *component = component_enter(c, call);
    if (component == NULL ||
        !component_has_arrays(component, call, nUnknown, vUnknown_ref, dvUnknown) ||
        !component_has_arrays(component, call, nKnown, vKnown_ref, dvKnown)) {
        return fmi2Error;
    }
    return component_status(
        component, instance_get_directional_derivative(component->instance, vUnknown_ref, nUnknown,
                                                       vKnown_ref, nKnown, dvKnown, dvUnknown));
}
