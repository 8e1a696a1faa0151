#include "runs.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* ---- Model ----------------------------------------------------------------------------------- */

enum { MOST_VALUES = 256, MOST_CHANGES = 64, MOST_BYTES = 8192, VARIANTS = 4 };

struct references {
    size_t count;
    fmi2ValueReference at[MOST_VALUES];
};

/* A parameter or start value of the runs. */
struct change {
    fmi2ValueReference reference;
    bool is_real;
    fmi2Real value;
    fmi2Integer items[VARIANTS]; /* where it is not Real, of each variant */
};

struct model {
    char guid[64];
    char name[64];
    size_t state_count;
    size_t indicator_count;
    struct references reals;
    struct references integers;
    struct references booleans;
    struct references inputs;
    struct references boolean_inputs;
    struct references outputs;    /* with derivatives */
    struct references parameters; /* Real and tunable */
    fmi2ValueReference a_parameter;
    struct references methods; /* solver_method, then its items that can integrate the model */
    struct references limits;  /* max_internal_steps */
    size_t change_count;
    struct change changes[MOST_CHANGES];
};

static void read_word(const char **at, char word[64]) {
    const size_t length = strcspn(*at, "\n");
    memcpy(word, *at, length < 63 ? length : 63);
    *at += length + 1;
}

static uint64_t read_number(const char **at) {
    char *end = NULL;
    const uint64_t number = strtoull(*at, &end, 16);
    *at = end;
    return number;
}

static double double_of(uint64_t bits) {
    double value = 0.0;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static void read_references(const char **at, struct references *references) {
    references->count = (size_t)read_number(at);
    for (size_t i = 0; i < references->count && i < MOST_VALUES; i++) {
        references->at[i] = (fmi2ValueReference)read_number(at);
    }
}

struct model *runs_read_model(const char *path) {
    static char text[1 << 17];
    const char *at = text;
    FILE *file = fopen(path, "rb");
    size_t size = 0;
    if (file != NULL) {
        size = fread(text, 1, sizeof text - 1, file);
        fclose(file);
    }
    struct model *model = size > 0 ? calloc(1, sizeof *model) : NULL;
    if (model == NULL) {
        fprintf(stderr, "%s cannot be read\n", path);
        return NULL;
    }
    read_word(&at, model->guid);
    read_word(&at, model->name);
    model->state_count = (size_t)read_number(&at);
    model->indicator_count = (size_t)read_number(&at);
    model->a_parameter = (fmi2ValueReference)read_number(&at);
    struct references *const lists[] = {
        &model->reals,      &model->integers,       &model->booleans,
        &model->inputs,     &model->boolean_inputs, &model->outputs,
        &model->parameters, &model->methods,        &model->limits,
    };
    for (size_t i = 0; i < sizeof lists / sizeof lists[0]; i++) {
        read_references(&at, lists[i]);
    }
    model->change_count = (size_t)read_number(&at);
    for (size_t i = 0; i < model->change_count && i < MOST_CHANGES; i++) {
        struct change *change = &model->changes[i];
        change->reference = (fmi2ValueReference)read_number(&at);
        change->is_real = read_number(&at) != 0;
        change->value = double_of(change->is_real ? read_number(&at) : 0);
        for (int item = 0; item < VARIANTS && !change->is_real; item++) {
            change->items[item] = (fmi2Integer)(int64_t)read_number(&at);
        }
    }
    return model;
}

/* ---- Transcript ------------------------------------------------------------------------------ */

enum { PLACES = 2 };

struct run {
    const struct fmu_functions *fmi;
    const struct model *model;
    FILE *transcript;
    unsigned call; /* number of the next one */
    bool has_failed;
    fmi2CallbackFunctions callbacks;
    fmi2Component instances[PLACES];
    fmi2Real reals[2 * MOST_VALUES];
    fmi2Integer integers[MOST_VALUES];
};

static const char *status_name(fmi2Status status) {
    static const char *const names[] = {"OK", "Warning", "Discard", "Error", "Fatal", "Pending"};
    const size_t number = (size_t)status;
    return number < sizeof names / sizeof names[0] ? names[number] : "unknown";
}

/* Begins the line of a call; its values follow. */
static void report(struct run *run, const char *name, fmi2Status expected, fmi2Status status) {
    fprintf(run->transcript, "\n%u %s %s", run->call, name, status_name(status));
    if (status != expected) {
        fprintf(stderr, "call %u, %s: %s in place of %s\n", run->call, name, status_name(status),
                status_name(expected));
        run->has_failed = true;
    }
    run->call++;
}

#define CALL_EXPECTING(expected, run, name, ...)                                                   \
    report(run, #name, expected, (run)->fmi->name(__VA_ARGS__))
#define CALL(run, name, ...) CALL_EXPECTING(fmi2OK, run, name, __VA_ARGS__)

static void write_reals(const struct run *run, size_t count) {
    for (size_t i = 0; i < count; i++) {
        uint64_t bits = 0;
        memcpy(&bits, &run->reals[i], sizeof bits);
        fprintf(run->transcript, " %08x%08x", (unsigned)(bits >> 32), (unsigned)bits);
    }
}

static void write_integers(const struct run *run, size_t count) {
    for (size_t i = 0; i < count; i++) {
        fprintf(run->transcript, " %d", run->integers[i]);
    }
}

/* Writes a line with a message of the FMU, whose environment is the run. */
static void log_message(fmi2ComponentEnvironment environment, fmi2String instance,
                        fmi2Status status, fmi2String category, fmi2String message, ...) {
    const struct run *run = environment;
    fprintf(run->transcript, "\n%u log %s %s %s %s", run->call, instance, status_name(status),
            category, message);
}

/* ---- Instances and values -------------------------------------------------------------------- */

static fmi2Component instantiate(struct run *run, int place, fmi2Type kind, const char *name,
                                 fmi2Boolean logging_on) {
    run->instances[place] = run->fmi->Instantiate(name, kind, run->model->guid, "", &run->callbacks,
                                                  fmi2False, logging_on);
    report(run, "Instantiate", fmi2OK, run->instances[place] != NULL ? fmi2OK : fmi2Error);
    return run->instances[place];
}

static void free_instance(struct run *run, int place) {
    run->fmi->FreeInstance(run->instances[place]);
    run->instances[place] = NULL;
}

static void initialize(struct run *run, fmi2Component c, double tolerance, double start) {
    CALL(run, SetupExperiment, c, tolerance > 0.0, tolerance, start, fmi2False, 0.0);
    CALL(run, EnterInitializationMode, c);
    CALL(run, ExitInitializationMode, c);
}

/* Sets start values and parameters; shift is added to the first Real one. */
static void change(struct run *run, fmi2Component c, int variant, double shift) {
    for (size_t i = 0; i < run->model->change_count; i++) {
        const struct change *change = &run->model->changes[i];
        if (change->is_real) {
            const double value = change->value + shift;
            CALL(run, SetReal, c, &change->reference, 1, &value);
            shift = 0.0;
        } else {
            CALL(run, SetInteger, c, &change->reference, 1, &change->items[variant - 1]);
        }
    }
}

/* Values that no call writes to stay recognizable in the transcript. */
static void forget_results(struct run *run) {
    memset(run->reals, 0xaa, sizeof run->reals);
    memset(run->integers, 0x55, sizeof run->integers);
}

static void get_all(struct run *run, fmi2Component c) {
    const struct model *model = run->model;
    forget_results(run);
    CALL(run, GetReal, c, model->reals.at, model->reals.count, run->reals);
    write_reals(run, model->reals.count);
    CALL(run, GetInteger, c, model->integers.at, model->integers.count, run->integers);
    write_integers(run, model->integers.count);
    if (model->booleans.count > 0) {
        CALL(run, GetBoolean, c, model->booleans.at, model->booleans.count, run->integers);
        write_integers(run, model->booleans.count);
    }
}

/* Sets inputs to fractions with small denominators, other ones at every step. */
static void set_inputs(struct run *run, fmi2Component c, int i, int shift) {
    const struct references *inputs = &run->model->inputs;
    double values[MOST_VALUES];
    for (int j = 0; j < (int)inputs->count; j++) {
        values[j] = ((i * (7 + 3 * j) + 5 * j + shift) % 23 - 11) / 8.0;
    }
    if (inputs->count > 0) {
        CALL(run, SetReal, c, inputs->at, inputs->count, values);
    }
}

static void set_booleans(struct run *run, fmi2Component c, fmi2Boolean value) {
    for (size_t j = 0; j < run->model->boolean_inputs.count; j++) {
        CALL(run, SetBoolean, c, &run->model->boolean_inputs.at[j], 1, &value);
    }
}

static void get_directional_derivative(struct run *run, fmi2Component c,
                                       const fmi2ValueReference knowns[], size_t count,
                                       const double seeds[]) {
    const struct references *outputs = &run->model->outputs;
    forget_results(run);
    CALL(run, GetDirectionalDerivative, c, outputs->at, outputs->count, knowns, count, seeds,
         run->reals);
    write_reals(run, outputs->count);
}

/* Derivatives of all outputs by time, twice, and by all inputs. */
static void get_derivatives(struct run *run, fmi2Component c) {
    const struct references *outputs = &run->model->outputs;
    fmi2Integer orders[MOST_VALUES];
    double seeds[MOST_VALUES];
    for (fmi2Integer order = 1; order <= 2; order++) {
        for (size_t j = 0; j < outputs->count; j++) {
            orders[j] = order;
        }
        forget_results(run);
        CALL(run, GetRealOutputDerivatives, c, outputs->at, outputs->count, orders, run->reals);
        write_reals(run, outputs->count);
    }
    for (size_t j = 0; j < run->model->inputs.count; j++) {
        seeds[j] = (3.0 * (double)j + 1.0) / 4.0;
    }
    get_directional_derivative(run, c, run->model->inputs.at, run->model->inputs.count, seeds);
}

/* Serializes a state and writes its bytes; returns their number. */
static size_t serialize(struct run *run, fmi2Component c, fmi2FMUstate state,
                        fmi2Byte bytes[MOST_BYTES]) {
    size_t size = 0;
    CALL(run, SerializedFMUstateSize, c, state, &size);
    if (size > MOST_BYTES) {
        run->has_failed = true;
        return 0;
    }
    CALL(run, SerializeFMUstate, c, state, bytes, size);
    fputc(' ', run->transcript);
    for (size_t i = 0; i < size; i++) {
        fprintf(run->transcript, "%02x", (unsigned)(unsigned char)bytes[i]);
    }
    return size;
}

/* ---- Co-Simulation --------------------------------------------------------------------------- */

enum { STEPS = 200 };

/* Length of a step, s. */
static double length_of(int i) {
    static const double lengths[] = {0.01, 1.0 / 64.0, 0.003, 0.02, 0.01};
    return lengths[i / 7 % 5];
}

/* Makes step number i with its inputs, and reads all values after it; returns the time of its
 * end. */
static double step(struct run *run, fmi2Component c, int i, double time, int shift) {
    const struct references *inputs = &run->model->inputs;
    if (i % 4 != 3) {
        set_inputs(run, c, i, shift);
    }
    if (i % 5 == 0 && inputs->count > 0) {
        fmi2Integer orders[MOST_VALUES];
        double slopes[MOST_VALUES];
        for (int j = 0; j < (int)inputs->count; j++) {
            orders[j] = 1 + (i / 5 + j) % 3;
            slopes[j] = (i % 13 - 6) / 4.0;
        }
        CALL(run, SetRealInputDerivatives, c, inputs->at, inputs->count, orders, slopes);
    }
    if (i % 9 == 4) {
        set_booleans(run, c, 1 - i / 9 % 2);
    }
    CALL(run, DoStep, c, time, length_of(i), fmi2False);
    get_all(run, c);
    return time + length_of(i);
}

/* Makes steps that are undone, and the same steps in the second instance, by serialization. */
static void roll_back(struct run *run, int i, double time) {
    fmi2Byte bytes[MOST_BYTES];
    fmi2FMUstate states[PLACES] = {NULL, NULL};
    CALL(run, GetFMUstate, run->instances[0], &states[0]);
    const size_t size = serialize(run, run->instances[0], states[0], bytes);
    CALL(run, DeSerializeFMUstate, run->instances[1], bytes, size, &states[1]);
    CALL(run, SetFMUstate, run->instances[1], states[1]);
    for (int place = 0; place < PLACES; place++) {
        double later = time;
        for (int k = 0; k < 3; k++) {
            later = step(run, run->instances[place], i + k, later, 9);
        }
    }
    CALL(run, SetFMUstate, run->instances[0], states[0]);
    get_all(run, run->instances[0]);
    for (int place = 0; place < PLACES; place++) {
        CALL(run, FreeFMUstate, run->instances[place], &states[place]);
    }
}

static void co_simulation(struct run *run, int variant, double shift) {
    const struct references *parameters = &run->model->parameters;
    const double one = 1.0;
    const double other = 2.125;
    double time = 0.5;
    instantiate(run, 1, fmi2CoSimulation, "other", fmi2True);
    const fmi2Component c = instantiate(run, 0, fmi2CoSimulation, run->model->name, fmi2True);
    change(run, c, variant, shift);
    CALL(run, SetupExperiment, c, fmi2True, 1e-6, time, fmi2False, 0.0);
    CALL(run, EnterInitializationMode, c);
    get_all(run, c);
    for (size_t i = 0; i < parameters->count; i++) {
        get_directional_derivative(run, c, &parameters->at[i], 1, &one);
    }
    CALL(run, ExitInitializationMode, c);
    get_all(run, c);
    for (int i = 0; i < STEPS; i++) {
        if (i == 80 && parameters->count > 0) {
            CALL(run, SetReal, c, parameters->at, 1, &other);
        }
        if (i % 60 == 59) {
            roll_back(run, i, time);
        }
        time = step(run, c, i, time, 0);
        if (i % 10 == 0) {
            get_derivatives(run, c);
        }
    }
    CALL(run, GetRealStatus, c, fmi2LastSuccessfulTime, run->reals);
    write_reals(run, 1);
    CALL(run, Terminate, c);
    get_all(run, c);
    free_instance(run, 0);
    free_instance(run, 1);
}

/* ---- Model Exchange -------------------------------------------------------------------------- */

static void update(struct run *run, fmi2Component c) {
    fmi2EventInfo info = {0};
    CALL(run, NewDiscreteStates, c, &info);
    fprintf(run->transcript, " %d %d %d %d %d", info.newDiscreteStatesNeeded,
            info.terminateSimulation, info.nominalsOfContinuousStatesChanged,
            info.valuesOfContinuousStatesChanged, info.nextEventTimeDefined);
}

/* Makes a step of Euler's method; its length is a power of two, so that a fused multiply-add gives
 * the same bits. */
static void euler(struct run *run, fmi2Component c, double length) {
    const size_t count = run->model->state_count;
    double states[MOST_VALUES] = {0.0};
    fmi2Boolean flags[2] = {fmi2True, fmi2True};
    CALL(run, GetContinuousStates, c, states, count);
    forget_results(run);
    CALL(run, GetDerivatives, c, run->reals, count);
    write_reals(run, count);
    for (size_t i = 0; i < count; i++) {
        states[i] += length * run->reals[i];
    }
    CALL(run, SetContinuousStates, c, states, count);
    CALL(run, CompletedIntegratorStep, c, fmi2True, &flags[0], &flags[1]);
    fprintf(run->transcript, " %d %d", flags[0], flags[1]);
}

/* Steps by Euler's method with events, and goes back in the end. */
static void model_exchange(struct run *run) {
    const double length = 1.0 / 256.0;
    const size_t count = run->model->state_count;
    fmi2Byte bytes[MOST_BYTES];
    fmi2FMUstate state = NULL;
    const fmi2Component c = instantiate(run, 0, fmi2ModelExchange, run->model->name, fmi2True);
    change(run, c, 1, 0.0);
    initialize(run, c, 0.0, 0.0);
    update(run, c);
    CALL(run, GetNominalsOfContinuousStates, c, run->reals, count);
    write_reals(run, count);
    CALL(run, EnterContinuousTimeMode, c);
    for (int i = 0; i < STEPS; i++) {
        if (i % 50 == 49) {
            CALL(run, EnterEventMode, c);
            set_booleans(run, c, 1 - i / 50 % 2);
            update(run, c);
            CALL(run, EnterContinuousTimeMode, c);
        }
        if (i == 100) {
            CALL(run, GetFMUstate, c, &state);
        }
        CALL(run, SetTime, c, i * length);
        set_inputs(run, c, i, 0);
        forget_results(run);
        CALL(run, GetEventIndicators, c, run->reals, run->model->indicator_count);
        write_reals(run, run->model->indicator_count);
        euler(run, c, length);
        get_all(run, c);
    }
    CALL(run, SetFMUstate, c, state);
    CALL(run, GetContinuousStates, c, run->reals, count);
    write_reals(run, count);
    serialize(run, c, state, bytes);
    CALL(run, Terminate, c);
    free_instance(run, 0);
}

/* ---- Messages -------------------------------------------------------------------------------- */

static void refuse_step(struct run *run, fmi2Component c, double time, double length) {
    initialize(run, c, 0.0, 0.0);
    CALL_EXPECTING(fmi2Error, run, DoStep, c, time, length, fmi2False);
    CALL(run, Reset, c);
}

/* Gives numbers that are refused. */
static void refuse_numbers(struct run *run, fmi2Component c) {
    // quiet and signalling NaN of both signs, and the infinities
    static const uint64_t not_finite[] = {
        UINT64_C(0x7ff8000000000000), UINT64_C(0xfff8000000000000), UINT64_C(0x7ff0000000000001),
        UINT64_C(0xfff8dead0000beef), UINT64_C(0x7ff0000000000000), UINT64_C(0xfff0000000000000),
    };
    static const double extreme[] = {1e300,     -1e300, 5e-324, 1e22,      100000.5,
                                     1000000.5, 2.5,    0.1,    1.0 / 3.0, 123456789.0};
    for (size_t i = 0; i < sizeof not_finite / sizeof not_finite[0]; i++) {
        double value = 0.0;
        memcpy(&value, &not_finite[i], sizeof value);
        CALL_EXPECTING(fmi2Discard, run, SetReal, c, &run->model->a_parameter, 1, &value);
        CALL(run, Reset, c);
        refuse_step(run, c, 0.0, value);
        refuse_step(run, c, value, 0.1);
    }
    for (size_t i = 0; i < sizeof extreme / sizeof extreme[0]; i++) {
        refuse_step(run, c, extreme[i], -fabs(extreme[i]));
    }
}

/* Makes steps of too many internal steps, by each method. */
static void exhaust_methods(struct run *run, fmi2Component c) {
    const struct references *inputs = &run->model->inputs;
    const struct references *methods = &run->model->methods;
    const fmi2Integer limit = 2;
    double values[MOST_VALUES];
    for (size_t j = 0; j < inputs->count; j++) {
        values[j] = 0.3;
    }
    for (size_t i = 1; i < methods->count; i++) {
        const fmi2Integer method = (fmi2Integer)methods->at[i];
        CALL(run, SetInteger, c, run->model->limits.at, 1, &limit);
        CALL(run, SetInteger, c, methods->at, 1, &method);
        initialize(run, c, 0.0, 0.0);
        CALL(run, SetReal, c, inputs->at, inputs->count, values);
        CALL_EXPECTING(fmi2Discard, run, DoStep, c, 0.0, 10.0, fmi2False);
        CALL(run, GetRealStatus, c, fmi2LastSuccessfulTime, run->reals);
        write_reals(run, 1);
        get_all(run, c);
        CALL(run, Reset, c);
    }
}

static void messages(struct run *run) {
    static const char *const names[] = {"plain", "ünïcödé", "100%d#r1#"};
    static const char *const unknown[] = {"logN%sthing#r1#"};
    fmi2Component c = instantiate(run, 0, fmi2CoSimulation, run->model->name, fmi2True);
    refuse_numbers(run, c);
    exhaust_methods(run, c);
    free_instance(run, 0);
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        c = instantiate(run, 0, fmi2CoSimulation, names[i], fmi2True);
        CALL_EXPECTING(fmi2Error, run, SetDebugLogging, c, fmi2True, 1, unknown);
        free_instance(run, 0);
    }
}

/* ---- Runs ------------------------------------------------------------------------------------ */

static void make_run(struct run *run, const char *what) {
    const char *colon = strchr(what, ':');
    const int variant = colon != NULL ? colon[1] - '0' : 1;
    if (what[0] == 's') {
        co_simulation(run, variant, (double)strtol(colon + 3, NULL, 10) / 1024.0);
    } else {
        for (int each = 1; each < VARIANTS; each++) {
            co_simulation(run, each, 0.0);
        }
        model_exchange(run);
        messages(run);
    }
}

bool runs_make(const struct fmu_functions *fmi, const struct model *model, const char *what,
               FILE *transcript) {
    struct run *run = calloc(1, sizeof *run);
    if (run == NULL) {
        return false;
    }
    *run = (struct run){.fmi = fmi, .model = model, .transcript = transcript, .call = 1};
    run->callbacks = (fmi2CallbackFunctions){.logger = log_message,
                                             .allocateMemory = calloc,
                                             .freeMemory = free,
                                             .componentEnvironment = run};
    make_run(run, what);
    const bool has_succeeded = !run->has_failed;
    free(run);
    return has_succeeded;
}
