#include "fmu_harness.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

struct fmu_functions fmu;

char *fmu_description;
struct fmu_variable fmu_variables[FMU_VARIABLE_CAPACITY];
size_t fmu_variable_count;

struct fmu_log messages;

/* ---- Loading -------------------------------------------------------------------------------- */

static bool load_description(const char *path) {
    enum { SIZE = 1 << 18 };
    FILE *file = fopen(path, "rb");
    fmu_description = calloc(1, SIZE);
    if (file == NULL || fmu_description == NULL) {
        fprintf(stderr, "%s cannot be read\n", path);
        return false;
    }
    const size_t length = fread(fmu_description, 1, SIZE - 1, file);
    fclose(file);

    static const char attribute[] = "valueReference=\"";
    const char *at = strstr(fmu_description, attribute);
    while (at != NULL && fmu_variable_count < FMU_VARIABLE_CAPACITY) {
        at += sizeof attribute - 1;
        const char *next = strstr(at, attribute);
        const char *real = strstr(at, "<Real");
        fmu_variables[fmu_variable_count++] = (struct fmu_variable){
            .reference = (fmi2ValueReference)strtoul(at, NULL, 10),
            .is_real = real != NULL && (next == NULL || real < next),
        };
        at = next;
    }
    if (length == SIZE - 1 || at != NULL || fmu_variable_count == 0) {
        fprintf(stderr, "%s has no variables, or more than the harness has room for\n", path);
        return false;
    }
    return true;
}

void fmu_load(void) {
    // never closed: leak reports need the names of its functions
    if (fmu_version_open(&fmu) == NULL || !load_description(FMU_DESCRIPTION)) {
        exit(2);
    }
}

/* ---- Messages ------------------------------------------------------------------------------- */

static void keep(char *to, size_t size, const char *text) {
    snprintf(to, size, "%s", text != NULL ? text : "");
}

/* Called from within the FMU: it only takes notes, an assertion would jump out of the call. */
static void receive(fmi2ComponentEnvironment environment, fmi2String instance_name,
                    fmi2Status status, fmi2String category, fmi2String message, ...) {
    struct fmu_log *log = environment;
    log->malformed += instance_name == NULL || category == NULL ||
                      !fmu_is_harmless(message, fmu_version == 2 ? "#%" : "#");
    log->count[status]++;
    for (size_t i = 0; category != NULL && i < FMU_COUNT(log->categories); i++) {
        if (log->categories[i].count == 0) {
            keep(log->categories[i].name, sizeof log->categories[i].name, category);
        }
        if (strcmp(log->categories[i].name, category) == 0) {
            log->categories[i].count++;
            break;
        }
    }
    keep(log->text, sizeof log->text, message);
    keep(log->instance_name, sizeof log->instance_name, instance_name);
    const size_t used = strlen(log->texts);
    snprintf(log->texts + used, sizeof log->texts - used, "%s\n", log->text);
}

fmi2CallbackFunctions fmu_callbacks(struct fmu_log *log) {
    return (fmi2CallbackFunctions){
        .logger = receive,
        .allocateMemory = calloc,
        .freeMemory = free,
        .componentEnvironment = log,
    };
}

void fmu_log_clear(struct fmu_log *log) {
    const unsigned malformed = log->malformed; // stays until fmu_tear_down has seen it
    memset(log, 0, sizeof *log);
    log->malformed = malformed;
}

unsigned fmu_log_count(const struct fmu_log *log, const char *category) {
    for (size_t i = 0; i < FMU_COUNT(log->categories); i++) {
        if (strcmp(log->categories[i].name, category) == 0) {
            return log->categories[i].count;
        }
    }
    return 0;
}

unsigned fmu_log_total(const struct fmu_log *log) {
    unsigned total = 0;
    for (size_t i = 0; i < FMU_COUNT(log->count); i++) {
        total += log->count[i];
    }
    return total;
}

void fmu_assert_logged(const struct fmu_log *log, const char *text) {
    char failure[2048];
    snprintf(failure, sizeof failure, "expected '%s' in the messages: %.1500s", text, log->texts);
    TEST_ASSERT_TRUE_MESSAGE(strstr(log->texts, text) != NULL, failure);
}

/* ---- Instances ------------------------------------------------------------------------------ */

static fmi2Component open_instances[128];

fmi2Component fmu_instantiate_as(fmi2Type type, struct fmu_log *log, bool logging_on) {
    const fmi2CallbackFunctions callbacks = fmu_callbacks(log);
    const fmi2Component component =
        fmu.Instantiate("manipulator", type, RP_MANIPULATOR_GUID, "", &callbacks, fmi2False,
                        logging_on ? fmi2True : fmi2False);
    TEST_ASSERT_NOT_NULL_MESSAGE(component, log->text);
    for (size_t i = 0; i < FMU_COUNT(open_instances); i++) {
        if (open_instances[i] == NULL) {
            open_instances[i] = component;
            return component;
        }
    }
    TEST_FAIL_MESSAGE("more instances than the harness has room for");
    return NULL;
}

fmi2Component fmu_instantiate(struct fmu_log *log, bool logging_on) {
    return fmu_instantiate_as(fmi2CoSimulation, log, logging_on);
}

void fmu_free(fmi2Component component) {
    for (size_t i = 0; i < FMU_COUNT(open_instances); i++) {
        if (open_instances[i] == component) {
            open_instances[i] = NULL;
        }
    }
    fmu.FreeInstance(component);
}

void fmu_tear_down(const struct fmu_log *log) {
    for (size_t i = 0; i < FMU_COUNT(open_instances); i++) {
        fmu.FreeInstance(open_instances[i]);
        open_instances[i] = NULL;
    }
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, log->malformed, log->texts);
}

void fmu_enter_initialization(fmi2Component component, double start) {
    ASSERT_OK(fmu.SetupExperiment(component, fmi2False, 0.0, start, fmi2False, 0.0));
    ASSERT_OK(fmu.EnterInitializationMode(component));
}

void fmu_initialize(fmi2Component component, double start, double tolerance) {
    ASSERT_OK(fmu.SetupExperiment(component, tolerance > 0.0, tolerance, start, fmi2False, 0.0));
    ASSERT_OK(fmu.EnterInitializationMode(component));
    ASSERT_OK(fmu.ExitInitializationMode(component));
}

fmi2Component fmu_initialized_with(fmi2Integer method, struct fmu_log *log, double start) {
    const fmi2Component component = fmu_instantiate(log, false);
    fmu_set_integer(component, RP_MANIPULATOR_solver_method, method);
    fmu_initialize(component, start, 0.0);
    return component;
}

fmi2Component fmu_initialized(struct fmu_log *log, double start) {
    const fmi2Component component = fmu_instantiate(log, false);
    fmu_initialize(component, start, 0.0);
    return component;
}

fmi2Status fmu_try_set(fmi2Component component, fmi2ValueReference reference, double value) {
    return fmu.SetReal(component, &reference, 1, &value);
}

void fmu_set(fmi2Component component, fmi2ValueReference reference, double value) {
    ASSERT_OK(fmu_try_set(component, reference, value));
}

double fmu_get(fmi2Component component, fmi2ValueReference reference) {
    double value = 0.0;
    ASSERT_OK(fmu.GetReal(component, &reference, 1, &value));
    return value;
}

void fmu_set_integer(fmi2Component component, fmi2ValueReference reference, fmi2Integer value) {
    ASSERT_OK(fmu.SetInteger(component, &reference, 1, &value));
}

fmi2Integer fmu_get_integer(fmi2Component component, fmi2ValueReference reference) {
    fmi2Integer value = 0;
    ASSERT_OK(fmu.GetInteger(component, &reference, 1, &value));
    return value;
}

const fmi2ValueReference fmu_state_references[FMU_STATES] = {
    RP_MANIPULATOR_q1, RP_MANIPULATOR_q2, RP_MANIPULATOR_dq1, RP_MANIPULATOR_dq2};

void fmu_get_states(fmi2Component component, double x[FMU_STATES]) {
    ASSERT_OK(fmu.GetReal(component, fmu_state_references, FMU_STATES, x));
}

void fmu_assert_motion(fmi2Component c, double tau1, double f2, double tolerance) {
    const double ddq1 = fmu_get(c, RP_MANIPULATOR_ddq1);
    const double ddq2 = fmu_get(c, RP_MANIPULATOR_ddq2);
    const double D12 = fmu_get(c, RP_MANIPULATOR_D12);
    TEST_ASSERT_DOUBLE_WITHIN(tolerance, tau1,
                              fmu_get(c, RP_MANIPULATOR_D11) * ddq1 + D12 * ddq2 +
                                  fmu_get(c, RP_MANIPULATOR_coriolis1) +
                                  fmu_get(c, RP_MANIPULATOR_gravity1));
    TEST_ASSERT_DOUBLE_WITHIN(tolerance, f2,
                              D12 * ddq1 + fmu_get(c, RP_MANIPULATOR_D22) * ddq2 +
                                  fmu_get(c, RP_MANIPULATOR_coriolis2) +
                                  fmu_get(c, RP_MANIPULATOR_gravity2));
    TEST_ASSERT_DOUBLE_WITHIN(
        tolerance, tau1 * fmu_get(c, RP_MANIPULATOR_dq1) + f2 * fmu_get(c, RP_MANIPULATOR_dq2),
        fmu_get(c, RP_MANIPULATOR_actuator_power));
}

static fmi2Status worse(fmi2Status a, fmi2Status b) {
    return a > b ? a : b;
}

fmi2Status fmu_get_all(fmi2Component component, struct fmu_values *values) {
    memset(values, 0, sizeof *values);
    fmi2Status status = fmi2OK;
    for (size_t i = 0; i < fmu_variable_count; i++) {
        const fmi2ValueReference reference = fmu_variables[i].reference;
        status =
            worse(status, fmu_variables[i].is_real
                              ? fmu.GetReal(component, &reference, 1, &values->reals[i])
                              : fmu.GetInteger(component, &reference, 1, &values->integers[i]));
    }
    return status;
}

void fmu_assert_same_values(const struct fmu_values *expected, const struct fmu_values *actual,
                            const char *message) {
    for (size_t i = 0; i < fmu_variable_count; i++) {
        if (memcmp(&expected->reals[i], &actual->reals[i], sizeof(double)) != 0 ||
            expected->integers[i] != actual->integers[i]) {
            char text[512];
            snprintf(text, sizeof text, "%.300s: reference %u: %.17g or %d, expected %.17g or %d",
                     message, fmu_variables[i].reference, actual->reals[i], actual->integers[i],
                     expected->reals[i], expected->integers[i]);
            TEST_FAIL_MESSAGE(text);
        }
    }
}

void fmu_only_in(unsigned version, const char *reason) {
    if (fmu_version != version) {
        TEST_IGNORE_MESSAGE(reason);
    }
}

void fmu_assert_in_error(fmi2Component component) {
    const double time = fmu_get(component, RP_MANIPULATOR_time);
    ASSERT_ERROR(fmu.DoStep(component, time, 0.01, fmi2True));
    ASSERT_ERROR(fmu_try_set(component, RP_MANIPULATOR_tau1, 1.0));
    (void)fmu_get(component, RP_MANIPULATOR_q1);
}

/* ---- Model Exchange -------------------------------------------------------------------------- */

fmi2Status fmu_me_enter_continuous_time(fmi2Component component, double start) {
    fmi2EventInfo info = {.newDiscreteStatesNeeded = fmi2True};
    fmi2Status status = fmu.SetupExperiment(component, fmi2False, 0.0, start, fmi2False, 0.0);
    status = worse(status, fmu.EnterInitializationMode(component));
    status = worse(status, fmu.ExitInitializationMode(component));
    while (status == fmi2OK && info.newDiscreteStatesNeeded) {
        status = fmu.NewDiscreteStates(component, &info);
    }
    return worse(status, fmu.EnterContinuousTimeMode(component));
}

fmi2Component fmu_me_initialized(struct fmu_log *log, double start) {
    const fmi2Component component = fmu_instantiate_as(fmi2ModelExchange, log, false);
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu_me_enter_continuous_time(component, start),
                                  log->texts);
    return component;
}

/* The slope k at time t and state x + h k_before. */
static fmi2Status slope(fmi2Component component, double t, const double x[FMU_STATES], double h,
                        const double k_before[FMU_STATES], double k[FMU_STATES]) {
    double at[FMU_STATES];
    for (int i = 0; i < FMU_STATES; i++) {
        at[i] = x[i] + h * k_before[i];
    }
    fmi2Status status = fmu.SetTime(component, t);
    status = worse(status, fmu.SetContinuousStates(component, at, FMU_STATES));
    return worse(status, fmu.GetDerivatives(component, k, FMU_STATES));
}

fmi2Status fmu_me_step(fmi2Component component, double t, double h) {
    double x[FMU_STATES] = {0};
    double k[4][FMU_STATES] = {0};
    fmi2Status status = fmu.GetContinuousStates(component, x, FMU_STATES);
    status = worse(status, slope(component, t, x, 0.0, x, k[0]));
    status = worse(status, slope(component, t + h / 2.0, x, h / 2.0, k[0], k[1]));
    status = worse(status, slope(component, t + h / 2.0, x, h / 2.0, k[1], k[2]));
    status = worse(status, slope(component, t + h, x, h, k[2], k[3]));
    for (int i = 0; i < FMU_STATES; i++) {
        x[i] += h / 6.0 * (k[0][i] + 2.0 * k[1][i] + 2.0 * k[2][i] + k[3][i]);
    }
    status = worse(status, fmu.SetContinuousStates(component, x, FMU_STATES));

    fmi2Boolean enter_event_mode = fmi2True;
    fmi2Boolean terminate = fmi2True;
    status = worse(status,
                   fmu.CompletedIntegratorStep(component, fmi2True, &enter_event_mode, &terminate));
    return enter_event_mode || terminate ? worse(status, fmi2Warning) : status;
}

/* ---- FMU states ------------------------------------------------------------------------------ */

fmi2FMUstate fmu_save(fmi2Component component) {
    fmi2FMUstate state = NULL;
    ASSERT_OK(fmu.GetFMUstate(component, &state));
    TEST_ASSERT_NOT_NULL(state);
    return state;
}

void fmu_restore(fmi2Component component, fmi2FMUstate state) {
    ASSERT_OK(fmu.SetFMUstate(component, state));
}

void fmu_forget(fmi2Component component, fmi2FMUstate *state) {
    ASSERT_OK(fmu.FreeFMUstate(component, state));
    TEST_ASSERT_NULL(*state);
}

struct fmu_bytes fmu_serialize(fmi2Component component, fmi2FMUstate state) {
    struct fmu_bytes bytes = {0};
    ASSERT_OK(fmu.SerializedFMUstateSize(component, state, &bytes.size));
    TEST_ASSERT_GREATER_THAN_UINT(0, bytes.size);
    bytes.data = malloc(bytes.size); // not cleared: every byte is to be written
    TEST_ASSERT_NOT_NULL(bytes.data);
    ASSERT_OK(fmu.SerializeFMUstate(component, state, bytes.data, bytes.size));
    return bytes;
}

fmi2FMUstate fmu_deserialize(fmi2Component component, const struct fmu_bytes *bytes) {
    int nothing = 0; // the handle is only written: importers leave it uninitialized
    fmi2FMUstate state = &nothing;
    ASSERT_OK(fmu.DeSerializeFMUstate(component, bytes->data, bytes->size, &state));
    TEST_ASSERT_TRUE(state != NULL && state != (void *)&nothing);
    return state;
}

void fmu_bytes_free(struct fmu_bytes *bytes) {
    free(bytes->data);
    *bytes = (struct fmu_bytes){0};
}

struct fmu_bytes fmu_bytes_copy(const struct fmu_bytes *bytes, size_t size) {
    struct fmu_bytes copy = {.data = malloc(size > 0 ? size : 1), .size = size};
    TEST_ASSERT_NOT_NULL(copy.data);
    memset(copy.data, 0, size);
    memcpy(copy.data, bytes->data, size < bytes->size ? size : bytes->size);
    return copy;
}

void fmu_assert_same_bytes(const struct fmu_bytes *expected, const struct fmu_bytes *actual,
                           const char *message) {
    TEST_ASSERT_EQUAL_UINT_MESSAGE(expected->size, actual->size, message);
    TEST_ASSERT_EQUAL_MEMORY_MESSAGE(expected->data, actual->data, expected->size, message);
}

struct fmu_bytes fmu_save_bytes(fmi2Component component) {
    fmi2FMUstate state = fmu_save(component);
    const struct fmu_bytes bytes = fmu_serialize(component, state);
    fmu_forget(component, &state);
    return bytes;
}

void fmu_restore_bytes(fmi2Component component, const struct fmu_bytes *bytes) {
    fmi2FMUstate state = fmu_deserialize(component, bytes);
    fmu_restore(component, state);
    fmu_forget(component, &state);
}

/* ---- An instance to save -------------------------------------------------------------------- */

static const double used_until = 0.625; /* s */

fmi2Component fmu_used(fmi2Integer method, struct fmu_log *log) {
    const fmi2Integer order = 2;
    const fmi2ValueReference f2 = RP_MANIPULATOR_f2;
    const double slope = 3.0;
    const fmi2Component c = fmu_instantiate(log, false);
    fmu_set_integer(c, RP_MANIPULATOR_solver_method, method);
    fmu_set(c, RP_MANIPULATOR_max_step, 0.03125);
    fmu_set(c, RP_MANIPULATOR_q1, 0.25);
    fmu_set(c, RP_MANIPULATOR_m1, 1.5);
    fmu_initialize(c, 0.5, 1e-7);
    fmu_set(c, RP_MANIPULATOR_tau1, -2.0);
    ASSERT_OK(fmu.DoStep(c, 0.5, 0.0625, fmi2True));
    ASSERT_OK(fmu.DoStep(c, 0.5625, 0.0625, fmi2True));
    fmu_set(c, RP_MANIPULATOR_g, 5.0);
    ASSERT_OK(fmu.SetRealInputDerivatives(c, &f2, 1, &order, &slope));
    return c;
}

void fmu_used_step(fmi2Component component, struct fmu_values *values) {
    ASSERT_OK(fmu.DoStep(component, used_until, 0.25, fmi2True));
    ASSERT_OK(fmu_get_all(component, values));
}

/* ---- A run to compare bit for bit ----------------------------------------------------------- */

static const double run_start = 0.5;
static const double run_step = 0.01;

fmi2Status fmu_run_start(fmi2Type type, fmi2Component component, unsigned variant) {
    const fmi2ValueReference references[] = {RP_MANIPULATOR_q1, RP_MANIPULATOR_q2,
                                             RP_MANIPULATOR_dq1, RP_MANIPULATOR_m2};
    const double values[] = {0.3 + 0.01 * variant, 0.1, -0.5, 1.5};
    fmi2Status status = fmu.SetReal(component, references, 4, values);
    if (type == fmi2ModelExchange) {
        return worse(status, fmu_me_enter_continuous_time(component, run_start));
    }
    status = worse(status, fmu.SetupExperiment(component, fmi2False, 0, run_start, fmi2False, 0));
    status = worse(status, fmu.EnterInitializationMode(component));
    return worse(status, fmu.ExitInitializationMode(component));
}

/* The inputs change at every third step: the integrator both continues and restarts. */
fmi2Status fmu_run_step(fmi2Type type, fmi2Component component, unsigned step,
                        struct fmu_run *run) {
    const fmi2ValueReference references[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_f2};
    const double values[] = {step / 3 % 5 - 2.0, 0.5 * (step / 3)};
    const double time = run_start + step * run_step;
    fmi2Status status = fmu.SetReal(component, references, 2, values);
    status =
        worse(status, type == fmi2ModelExchange ? fmu_me_step(component, time, run_step)
                                                : fmu.DoStep(component, time, run_step, fmi2True));
    return worse(status, fmu_get_all(component, &run->after[step]));
}

fmi2Status fmu_run_as(fmi2Type type, fmi2Component component, unsigned variant,
                      struct fmu_run *run) {
    memset(run, 0, sizeof *run);
    fmi2Status status = fmu_run_start(type, component, variant);
    for (unsigned i = 0; i < FMU_RUN_STEPS; i++) {
        status = worse(status, fmu_run_step(type, component, i, run));
    }
    return status;
}

fmi2Status fmu_run(fmi2Component component, unsigned variant, struct fmu_run *run) {
    return fmu_run_as(fmi2CoSimulation, component, variant, run);
}

void fmu_assert_reset_is_fresh_as(fmi2Type type, fmi2Component component, const char *message) {
    static struct fmu_run runs[2];
    static bool are_known[2];
    static struct fmu_run again;
    static struct fmu_log log;
    struct fmu_run *fresh = &runs[type == fmi2CoSimulation];
    if (!are_known[type == fmi2CoSimulation]) { // it is the same every time
        const fmi2Component other = fmu_instantiate_as(type, &log, false);
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu_run_as(type, other, 0, fresh), message);
        fmu_free(other);
        are_known[type == fmi2CoSimulation] = true;
    }

    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu.Reset(component), message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu_run_as(type, component, 0, &again), message);
    TEST_ASSERT_EQUAL_MEMORY_MESSAGE(fresh, &again, sizeof again, message);
}

void fmu_assert_reset_is_fresh(fmi2Component component, const char *message) {
    fmu_assert_reset_is_fresh_as(fmi2CoSimulation, component, message);
}
