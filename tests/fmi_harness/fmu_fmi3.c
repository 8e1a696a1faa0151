/* The functions of FMI 2.0 in terms of those of FMI 3.0: fmu_version.h. What has no counterpart:
 * SetupExperiment, which only keeps its arguments for EnterInitializationMode; derivatives of
 * inputs, which intermediate updates give where FMU_UPDATES says so, and which count for nothing
 * otherwise; the status of a step, of which only the time is known. */
#include "fmu_fmi3.h"

#include "fmu_model.h"
#include "fmu_version.h"

#include <stdlib.h>
#include <string.h>

const unsigned fmu_version = 3;

struct fmu3_functions fmu3;

struct fmu_fmi3_options fmu_fmi3_options;

enum { INPUTS = 2, ORDERS = 4 };
static const fmi3ValueReference inputs[INPUTS] = {FMU_INPUTS};

struct adapted {
    fmi3Instance instance;
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
    bool is_model_exchange, has_event_mode;
    fmi3IntermediateUpdateCallback update; /* of the options */
    bool has_tolerance, has_stop;
    double tolerance, start, stop;
    double step_start;            /* s */
    double input[INPUTS][ORDERS]; /* value and derivatives over the next step */
    char name[];
};

static fmi2Status status_of(fmi3Status status) {
    return (fmi2Status)status;
}

/* Functions may be called without an instance. */
static fmi3Instance instance_of(fmi2Component c) {
    return c != NULL ? ((const struct adapted *)c)->instance : NULL;
}

fmi3Instance fmu_fmi3_instance(fmi2Component c) {
    return instance_of(c);
}

/* ---- Callbacks ------------------------------------------------------------------------------ */

static void pass_on(fmi3InstanceEnvironment adapted_pointer, fmi3Status status, fmi3String category,
                    fmi3String message) {
    const struct adapted *adapted = adapted_pointer;
    if (adapted->logger != NULL) {
        adapted->logger(adapted->environment, adapted->name, status_of(status), category, message);
    }
}

static void update(fmi3InstanceEnvironment adapted_pointer, fmi3Float64 time, fmi3Boolean set,
                   fmi3Boolean get, fmi3Boolean finished, fmi3Boolean can_return_early,
                   fmi3Boolean *return_early, fmi3Float64 *early_time) {
    const struct adapted *adapted = adapted_pointer;
    double values[INPUTS];
    if (adapted->update != NULL) {
        adapted->update(adapted->environment, time, set, get, finished, can_return_early,
                        return_early, early_time);
        return;
    }
    for (size_t i = 0; i < INPUTS; i++) {
        const double t = time - adapted->step_start;
        const double *d = adapted->input[i];
        values[i] = d[0] + t * (d[1] + t / 2.0 * (d[2] + t / 3.0 * d[3]));
    }
    if (set) {
        (void)fmu3.SetFloat64(adapted->instance, inputs, INPUTS, values, INPUTS);
    }
}

/* ---- Life ----------------------------------------------------------------------------------- */

static const char *GetTypesPlatform(void) {
    return fmi2TypesPlatform;
}

static const char *GetVersion(void) {
    return strcmp(fmu3.GetVersion(), "3.0") == 0 ? "2.0" : "wrong";
}

static fmi2Component Instantiate(fmi2String name, fmi2Type type, fmi2String guid,
                                 fmi2String location, const fmi2CallbackFunctions *functions,
                                 fmi2Boolean visible, fmi2Boolean logging_on) {
    const char *token = guid;
    if (guid != NULL && strcmp(guid, FMU_GUID) == 0) {
        token = FMU_TOKEN_FMI3;
    }
    struct adapted *adapted = calloc(1, sizeof *adapted + (name != NULL ? strlen(name) : 0) + 1);
    if (adapted == NULL) {
        if (functions != NULL && functions->logger != NULL) {
            functions->logger(functions->componentEnvironment, name, fmi2Error, "logStatusError",
                              "out of memory");
        }
        return NULL;
    }
    strcpy(adapted->name, name != NULL ? name : "");
    if (functions != NULL) {
        adapted->logger = functions->logger;
        adapted->environment = functions->componentEnvironment;
    }
    adapted->is_model_exchange = type == fmi2ModelExchange;
    if (adapted->is_model_exchange) {
        adapted->instance = fmu3.InstantiateModelExchange(name, token, location, visible != 0,
                                                          logging_on != 0, adapted, pass_on);
    } else {
        const struct fmu_fmi3_options *options = &fmu_fmi3_options;
        const bool has_update = options->update != NULL;
        adapted->has_event_mode = options->event_mode;
        adapted->update = options->update;
        adapted->instance = fmu3.InstantiateCoSimulation(
            name, token, location, visible != 0, logging_on != 0, options->event_mode,
            options->early_return, has_update ? options->required : inputs,
            has_update    ? options->required_count
            : FMU_UPDATES ? INPUTS
                          : 0,
            adapted, pass_on, has_update || FMU_UPDATES ? update : NULL);
    }
    if (adapted->instance == NULL) {
        free(adapted);
        return NULL;
    }
    if (!logging_on) { // then FMI 2.0 sends all but events and calls, FMI 3.0 only errors
        static const fmi3String categories[] = {"logStatusWarning", "logStatusDiscard",
                                                "logStatusError", "logStatusFatal"};
        (void)fmu3.SetDebugLogging(adapted->instance, true, 4, categories);
    }
    return adapted;
}

static void FreeInstance(fmi2Component c) {
    fmu3.FreeInstance(instance_of(c));
    free(c);
}

static fmi2Status SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance,
                                  fmi2Real start, fmi2Boolean has_stop, fmi2Real stop) {
    struct adapted *adapted = c;
    if (adapted == NULL) {
        return fmi2Error;
    }
    adapted->has_tolerance = has_tolerance != 0;
    adapted->tolerance = tolerance;
    adapted->start = start;
    adapted->has_stop = has_stop != 0;
    adapted->stop = stop;
    return fmi2OK;
}

static fmi2Status EnterInitializationMode(fmi2Component c) {
    static const struct adapted nothing = {0};
    const struct adapted *adapted = c != NULL ? c : &nothing;
    return status_of(fmu3.EnterInitializationMode(instance_of(c), adapted->has_tolerance,
                                                  adapted->tolerance, adapted->start,
                                                  adapted->has_stop, adapted->stop));
}

static fmi2Status ExitInitializationMode(fmi2Component c) {
    const fmi3Status status = fmu3.ExitInitializationMode(instance_of(c));
    if (status == fmi3OK && ((const struct adapted *)c)->has_event_mode) {
        return status_of(fmu3.EnterStepMode(instance_of(c)));
    }
    return status_of(status);
}

static fmi2Status Reset(fmi2Component c) {
    if (c != NULL) {
        struct adapted *adapted = c;
        memset(adapted->input, 0, sizeof adapted->input);
        (void)SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    }
    return status_of(fmu3.Reset(instance_of(c)));
}

/* ---- Values --------------------------------------------------------------------------------- */

/* Index of an input; INPUTS: it is none. */
static size_t input_index(fmi2ValueReference reference) {
    size_t i = 0;
    while (i < INPUTS && inputs[i] != reference) {
        i++;
    }
    return i;
}

static fmi2Status GetReal(fmi2Component c, const fmi2ValueReference references[], size_t count,
                          fmi2Real values[]) {
    const fmi3Status status = fmu3.GetFloat64(instance_of(c), references, count, values, count);
    for (size_t i = 0; FMU_UPDATES && status == fmi3OK && i < count; i++) {
        if (input_index(references[i]) < INPUTS) { // what was set, not what moved on
            values[i] = ((const struct adapted *)c)->input[input_index(references[i])][0];
        }
    }
    return status_of(status);
}

static fmi2Status SetReal(fmi2Component c, const fmi2ValueReference references[], size_t count,
                          const fmi2Real values[]) {
    const fmi3Status status = fmu3.SetFloat64(instance_of(c), references, count, values, count);
    for (size_t i = 0; status == fmi3OK && i < count; i++) {
        if (input_index(references[i]) < INPUTS) {
            ((struct adapted *)c)->input[input_index(references[i])][0] = values[i];
        }
    }
    return status_of(status);
}

/* Enumerations have functions of their own type. */
static bool has_enumeration(const fmi2ValueReference references[], size_t count,
                            const void *values) {
    bool found = false;
    for (size_t i = 0; references != NULL && values != NULL && count < 8 && i < count; i++) {
        found |= fmu_is_enumeration(references[i]);
    }
    return found;
}

static fmi2Status GetInteger(fmi2Component c, const fmi2ValueReference references[], size_t count,
                             fmi2Integer values[]) {
    if (!has_enumeration(references, count, values)) {
        return status_of(fmu3.GetInt32(instance_of(c), references, count, values, count));
    }
    fmi3Status status = fmi3OK;
    for (size_t i = 0; i < count && status == fmi3OK; i++) {
        fmi3Int64 item = values[i];
        status = fmu_is_enumeration(references[i])
                     ? fmu3.GetInt64(instance_of(c), &references[i], 1, &item, 1)
                     : fmu3.GetInt32(instance_of(c), &references[i], 1, &values[i], 1);
        values[i] = fmu_is_enumeration(references[i]) ? (fmi2Integer)item : values[i];
    }
    return status_of(status);
}

static fmi2Status SetInteger(fmi2Component c, const fmi2ValueReference references[], size_t count,
                             const fmi2Integer values[]) {
    if (!has_enumeration(references, count, values)) {
        return status_of(fmu3.SetInt32(instance_of(c), references, count, values, count));
    }
    fmi3Status status = fmi3OK;
    for (size_t i = 0; i < count && status == fmi3OK; i++) {
        const fmi3Int64 item = values[i];
        status = fmu_is_enumeration(references[i])
                     ? fmu3.SetInt64(instance_of(c), &references[i], 1, &item, 1)
                     : fmu3.SetInt32(instance_of(c), &references[i], 1, &values[i], 1);
    }
    return status_of(status);
}

/* Of another size in FMI 3.0; more of them than any model has are passed on as they are, to be
 * refused. */
enum { MOST_BOOLEANS = 8 };

static fmi2Status GetBoolean(fmi2Component c, const fmi2ValueReference references[], size_t count,
                             fmi2Boolean values[]) {
    fmi3Boolean flags[MOST_BOOLEANS] = {false};
    const bool is_usual = values != NULL && count <= MOST_BOOLEANS;
    const fmi3Status status = fmu3.GetBoolean(instance_of(c), references, count,
                                              is_usual ? flags : (fmi3Boolean *)values, count);
    for (size_t i = 0; is_usual && status == fmi3OK && i < count; i++) {
        values[i] = flags[i];
    }
    return status_of(status);
}

static fmi2Status SetBoolean(fmi2Component c, const fmi2ValueReference references[], size_t count,
                             const fmi2Boolean values[]) {
    fmi3Boolean flags[MOST_BOOLEANS] = {false};
    const bool is_usual = values != NULL && count <= MOST_BOOLEANS;
    for (size_t i = 0; is_usual && i < count; i++) {
        flags[i] = values[i] != fmi2False;
    }
    return status_of(fmu3.SetBoolean(instance_of(c), references, count,
                                     is_usual ? flags : (const fmi3Boolean *)values, count));
}

/* ---- Derivatives ---------------------------------------------------------------------------- */

static fmi2Status SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference references[],
                                          size_t count, const fmi2Integer orders[],
                                          const fmi2Real values[]) {
    struct adapted *adapted = c;
    if (adapted == NULL) {
        return fmi2Error;
    }
    for (size_t i = 0; FMU_UPDATES && i < count; i++) {
        const size_t input = input_index(references[i]);
        if (input == INPUTS || orders[i] < 1 || orders[i] >= ORDERS) {
            return fmi2Error;
        }
        adapted->input[input][orders[i]] = values[i];
    }
    return fmi2OK;
}

/* ---- Steps ---------------------------------------------------------------------------------- */

static fmi2Status DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_rollback) {
    fmi3Boolean event = true;
    fmi3Boolean terminate = true;
    fmi3Boolean early = true;
    fmi3Float64 reached = -1.0;
    struct adapted *adapted = c;
    if (adapted != NULL) {
        adapted->step_start = time;
    }
    const fmi3Status status = fmu3.DoStep(instance_of(c), time, step, no_rollback != 0, &event,
                                          &terminate, &early, &reached);
    if (status != fmi3OK) {
        return status_of(status);
    }
    for (size_t i = 0; i < INPUTS; i++) {
        memset(&adapted->input[i][1], 0, (ORDERS - 1) * sizeof(double));
    }
    // no event, no end, and all of the step
    return event || terminate || early || reached != time + step ? fmi2Fatal : fmi2OK;
}

static fmi2Status GetRealStatus(fmi2Component c, fmi2StatusKind kind, fmi2Real *value) {
    const fmi2ValueReference time = FMU_TIME;
    return kind == fmi2LastSuccessfulTime ? GetReal(c, &time, 1, value) : fmi2Discard;
}

#define NO_STATUS(name, type)                                                                      \
    static fmi2Status name(fmi2Component c, fmi2StatusKind kind, type *value) {                    \
        return c != NULL ? fmi2Discard : fmi2Error;                                                \
    }
NO_STATUS(GetStatus, fmi2Status)
NO_STATUS(GetIntegerStatus, fmi2Integer)
NO_STATUS(GetBooleanStatus, fmi2Boolean)
NO_STATUS(GetStringStatus, fmi2String)

/* ---- Model Exchange ------------------------------------------------------------------------- */

static fmi2Status NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    fmi3Boolean flags[5] = {true, true, true, true, true};
    fmi3Float64 next = 0.0;
    const fmi3Status status =
        fmu3.UpdateDiscreteStates(instance_of(c), info != NULL ? &flags[0] : NULL, &flags[1],
                                  &flags[2], &flags[3], &flags[4], &next);
    if (status == fmi3OK) {
        *info = (fmi2EventInfo){flags[0], flags[1], flags[2], flags[3], flags[4], next};
    }
    return status_of(status);
}

static fmi2Status CompletedIntegratorStep(fmi2Component c, fmi2Boolean no_rollback,
                                          fmi2Boolean *enter_event_mode, fmi2Boolean *terminate) {
    fmi3Boolean event = true;
    fmi3Boolean end = true;
    const fmi3Status status = fmu3.CompletedIntegratorStep(instance_of(c), no_rollback != 0,
                                                           enter_event_mode != NULL ? &event : NULL,
                                                           terminate != NULL ? &end : NULL);
    if (status == fmi3OK) {
        *enter_event_mode = event;
        *terminate = end;
    }
    return status_of(status);
}

/* ---- The same in both versions ----------------------------------------------------------------
 */

#define PLAIN(name, name3)                                                                         \
    static fmi2Status name(fmi2Component c) {                                                      \
        return status_of(fmu3.name3(instance_of(c)));                                              \
    }
PLAIN(Terminate, Terminate)
PLAIN(EnterEventMode, EnterEventMode)
PLAIN(EnterContinuousTimeMode, EnterContinuousTimeMode)
PLAIN(CancelStep, ExitConfigurationMode) // an error in every state

#define ARRAY(name, name3, element)                                                                \
    static fmi2Status name(fmi2Component c, element values[], size_t count) {                      \
        return status_of(fmu3.name3(instance_of(c), values, count));                               \
    }
ARRAY(SetContinuousStates, SetContinuousStates, const fmi2Real)
ARRAY(GetDerivatives, GetContinuousStateDerivatives, fmi2Real)
ARRAY(GetEventIndicators, GetEventIndicators, fmi2Real)
ARRAY(GetContinuousStates, GetContinuousStates, fmi2Real)
ARRAY(GetNominalsOfContinuousStates, GetNominalsOfContinuousStates, fmi2Real)

/* Parameters and arguments stand in parentheses. */
#define SAME(name, name3, parameters, arguments)                                                   \
    static fmi2Status name parameters {                                                            \
        return status_of(fmu3.name3 arguments);                                                    \
    }
SAME(SetTime, SetTime, (fmi2Component c, fmi2Real time), (instance_of(c), time))
SAME(SetDebugLogging, SetDebugLogging,
     (fmi2Component c, fmi2Boolean on, size_t count, const fmi2String categories[]),
     (instance_of(c), on != 0, count, categories))
SAME(GetString, GetString,
     (fmi2Component c, const fmi2ValueReference references[], size_t count, fmi2String values[]),
     (instance_of(c), references, count, values, count))
SAME(SetString, SetString,
     (fmi2Component c, const fmi2ValueReference references[], size_t count,
      const fmi2String values[]),
     (instance_of(c), references, count, values, count))
SAME(GetFMUstate, GetFMUState, (fmi2Component c, fmi2FMUstate *state), (instance_of(c), state))
SAME(SetFMUstate, SetFMUState, (fmi2Component c, fmi2FMUstate state), (instance_of(c), state))
SAME(FreeFMUstate, FreeFMUState, (fmi2Component c, fmi2FMUstate *state), (instance_of(c), state))
SAME(SerializedFMUstateSize, SerializedFMUStateSize,
     (fmi2Component c, fmi2FMUstate state, size_t *size), (instance_of(c), state, size))
SAME(SerializeFMUstate, SerializeFMUState,
     (fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size),
     (instance_of(c), state, (fmi3Byte *)bytes, size))
SAME(DeSerializeFMUstate, DeserializeFMUState,
     (fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state),
     (instance_of(c), (const fmi3Byte *)bytes, size, state))
SAME(GetDirectionalDerivative, GetDirectionalDerivative,
     (fmi2Component c, const fmi2ValueReference unknowns[], size_t unknown_count,
      const fmi2ValueReference knowns[], size_t known_count, const fmi2Real seed[],
      fmi2Real sensitivity[]),
     (instance_of(c), unknowns, unknown_count, knowns, known_count, seed, known_count, sensitivity,
      unknown_count))
SAME(GetRealOutputDerivatives, GetOutputDerivatives,
     (fmi2Component c, const fmi2ValueReference references[], size_t count,
      const fmi2Integer orders[], fmi2Real values[]),
     (instance_of(c), references, count, orders, values, count))

/* ---- Loading -------------------------------------------------------------------------------- */

void *fmu_version_open(struct fmu_functions *functions) {
#define ADAPTED(name, kinds, states) name,
    *functions = (struct fmu_functions){FMI2_FUNCTION_LIST(ADAPTED)};
#undef ADAPTED
    return fmu3_library_open(FMU_LIBRARY, &fmu3);
}

const char *fmu_name_of(enum fmu_function function) {
    static const char *const other_names[FMU_FUNCTION_COUNT] = {
        [FMU_GetReal] = "fmi3GetFloat64",
        [FMU_SetReal] = "fmi3SetFloat64",
        [FMU_GetInteger] = "fmi3GetInt32",
        [FMU_SetInteger] = "fmi3SetInt32",
        [FMU_CancelStep] = "fmi3ExitConfigurationMode",
        [FMU_GetFMUstate] = "fmi3GetFMUState",
        [FMU_SetFMUstate] = "fmi3SetFMUState",
        [FMU_FreeFMUstate] = "fmi3FreeFMUState",
        [FMU_SerializedFMUstateSize] = "fmi3SerializedFMUStateSize",
        [FMU_SerializeFMUstate] = "fmi3SerializeFMUState",
        [FMU_DeSerializeFMUstate] = "fmi3DeserializeFMUState",
        [FMU_GetDerivatives] = "fmi3GetContinuousStateDerivatives",
        [FMU_GetRealOutputDerivatives] = "fmi3GetOutputDerivatives",
        [FMU_NewDiscreteStates] = "fmi3UpdateDiscreteStates",
    };
    return other_names[function] != NULL ? other_names[function]
                                         : fmu_function_names[function] + sizeof "fmi2" - 1;
}

/* ---- States --------------------------------------------------------------------------------- */

static const struct fmi_state of_co_simulation[] = {
    {'I', "instantiated", FMU_EnterInitializationMode},
    {'M', "in initialization mode", FMU_ExitInitializationMode},
    {'C', "between steps", FMU_DoStep},
    {'T', "terminated", FMU_FUNCTION_COUNT},
};

static const struct fmi_state of_model_exchange[] = {
    {'I', "instantiated", FMU_EnterInitializationMode},
    {'M', "in initialization mode", FMU_ExitInitializationMode},
    {'V', "in event mode", FMU_EnterContinuousTimeMode},
    {'N', "in continuous-time mode", FMU_CompletedIntegratorStep},
    {'T', "terminated", FMU_FUNCTION_COUNT},
};

const struct fmi_states fmu_co_simulation_states = {4, of_co_simulation};
const struct fmi_states fmu_model_exchange_states = {5, of_model_exchange};
