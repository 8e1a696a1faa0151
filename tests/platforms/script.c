#include "script.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { PLACES = 8, MOST_WORDS = 512, MOST_VALUES = 256, MOST_BYTES = 8192 };

struct bytes {
    size_t size;
    char data[MOST_BYTES];
};

struct run {
    const struct fmu_functions *fmi;
    FILE *transcript;
    unsigned line;
    bool is_wrong; /* the script has a mistake */

    /* words of the line, and the one to read next */
    char *words[MOST_WORDS];
    size_t word_count;
    size_t at;

    fmi2CallbackFunctions callbacks;
    fmi2Component instances[PLACES];
    fmi2FMUstate states[PLACES];
    struct bytes bytes[PLACES];

    /* arguments and results of a call */
    fmi2ValueReference references[MOST_VALUES];
    fmi2ValueReference others[MOST_VALUES];
    fmi2Integer orders[MOST_VALUES];
    fmi2Real reals[MOST_VALUES];
    fmi2Real results[MOST_VALUES];
    fmi2Integer integers[MOST_VALUES];
    fmi2String strings[MOST_VALUES];
};

static const char hex_digits[] = "0123456789abcdef";

/* Says on stderr what is wrong in the line; no further line is run. */
static void run_mistake(struct run *run, const char *text) {
    if (!run->is_wrong) {
        fprintf(stderr, "line %u: %s\n", run->line, text);
    }
    run->is_wrong = true;
}

/* ---- Words ----------------------------------------------------------------------------------- */

static size_t run_words_left(const struct run *run) {
    return run->word_count - run->at;
}

/* Returns the next word; a mistake if there is none. So do the readers below, of their kinds. */
static const char *run_read_word(struct run *run) {
    if (run_words_left(run) == 0) {
        run_mistake(run, "a word is missing");
        return "0";
    }
    return run->words[run->at++];
}

/* True if the next word is this one, which is then read. */
static bool run_skip(struct run *run, const char *word) {
    const bool found = run_words_left(run) > 0 && strcmp(run->words[run->at], word) == 0;
    run->at += found;
    return found;
}

/* Returns NULL for "-". */
static const char *run_read_text(struct run *run) {
    const char *word = run_read_word(run);
    return strcmp(word, "-") == 0 ? NULL : word;
}

static int run_read_integer(struct run *run) {
    char *end = NULL;
    const char *word = run_read_word(run);
    const long value = strtol(word, &end, 10);
    if (*end != '\0') {
        run_mistake(run, "an integer is expected");
    }
    return (int)value;
}

static uint64_t run_read_hex(struct run *run, const char *digits, size_t count) {
    uint64_t bits = 0;
    for (size_t i = 0; i < count; i++) {
        const char *digit = digits[i] != '\0' ? strchr(hex_digits, digits[i]) : NULL;
        if (digit == NULL) {
            run_mistake(run, "hex digits are expected");
            return 0;
        }
        bits = bits << 4 | (uint64_t)(digit - hex_digits);
    }
    return bits;
}

static double run_read_real(struct run *run) {
    const uint64_t bits = run_read_hex(run, run_read_word(run), 16);
    double value = 0.0;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static size_t run_read_place(struct run *run) {
    const int place = run_read_integer(run);
    if (place < 0 || place >= PLACES) {
        run_mistake(run, "places are 0 to 7");
        return 0;
    }
    return (size_t)place;
}

/* Returns the instance in a place; NULL for "-". */
static fmi2Component run_read_instance(struct run *run) {
    return run_skip(run, "-") ? NULL : run->instances[run_read_place(run)];
}

static fmi2FMUstate *run_read_state(struct run *run) {
    return run_skip(run, "-") ? NULL : &run->states[run_read_place(run)];
}

static struct bytes *run_read_bytes(struct run *run) {
    return &run->bytes[run_read_place(run)];
}

/* Reads value references up to the end of the line or a "/"; returns how many. */
static size_t run_read_references(struct run *run, fmi2ValueReference references[]) {
    size_t count = 0;
    while (run_words_left(run) > 0 && count < MOST_VALUES && !run_skip(run, "/")) {
        references[count++] = (fmi2ValueReference)run_read_integer(run);
    }
    return count;
}

/* ---- Transcript ------------------------------------------------------------------------------ */

static const char *const status_names[] = {"OK", "Warning", "Discard", "Error", "Fatal", "Pending"};

static const char *status_name(fmi2Status status) {
    const size_t number = (size_t)status;
    return number < sizeof status_names / sizeof status_names[0] ? status_names[number] : "unknown";
}

static void run_write_hex(const struct run *run, uint64_t bits, int digits) {
    fputc(' ', run->transcript);
    while (digits-- > 0) {
        const char digit = hex_digits[bits >> 4 * digits & 15];
        fputc(digit, run->transcript);
    }
}

/* Begins a line: number, name of the call, status. */
static void run_write_line(const struct run *run, const char *status) {
    fprintf(run->transcript, "%u %s %s", run->line, run->words[0], status);
}

static void run_write_status(const struct run *run, fmi2Status status) {
    run_write_line(run, status_name(status));
}

static void run_write_reals(const struct run *run, const fmi2Real values[], size_t count) {
    for (size_t i = 0; i < count; i++) {
        uint64_t bits = 0;
        memcpy(&bits, &values[i], sizeof bits);
        run_write_hex(run, bits, 16);
    }
}

static void run_write_integers(const struct run *run, const fmi2Integer values[], size_t count) {
    for (size_t i = 0; i < count; i++) {
        fprintf(run->transcript, " %d", values[i]);
    }
}

/* Writes a line with a message of the FMU; its environment is the run. */
static void run_log(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status,
                    fmi2String category, fmi2String message, ...) {
    const struct run *run = environment;
    fprintf(run->transcript, "%u log %s %s %s %s\n", run->line, instance, status_name(status),
            category, message);
}

/* ---- Life ------------------------------------------------------------------------------------ */

static void call_GetTypesPlatform(struct run *run) {
    run_write_line(run, run->fmi->GetTypesPlatform());
}

static void call_GetVersion(struct run *run) {
    run_write_line(run, run->fmi->GetVersion());
}

/* place, kind, GUID, logging on, name */
static void call_Instantiate(struct run *run) {
    const size_t place = run_read_place(run);
    const fmi2Type kind = (fmi2Type)run_read_integer(run);
    const char *guid = run_read_text(run);
    const fmi2Boolean logging_on = run_read_integer(run);
    const char *name = run_read_text(run);
    run->instances[place] =
        run->fmi->Instantiate(name, kind, guid, "", &run->callbacks, fmi2False, logging_on);
    run_write_line(run, run->instances[place] != NULL ? "OK" : "NULL");
}

static void call_FreeInstance(struct run *run) {
    const size_t place = run_read_place(run);
    run->fmi->FreeInstance(run->instances[place]);
    run->instances[place] = NULL;
    run_write_status(run, fmi2OK);
}

static void call_SetDebugLogging(struct run *run) {
    const fmi2Component c = run_read_instance(run);
    const fmi2Boolean on = run_read_integer(run);
    size_t count = 0;
    while (run_words_left(run) > 0 && count < MOST_VALUES) {
        run->strings[count++] = run_read_text(run);
    }
    run_write_status(run, run->fmi->SetDebugLogging(c, on, count, run->strings));
}

/* tolerance or "-", start time, stop time or "-" */
static void call_SetupExperiment(struct run *run) {
    const fmi2Component c = run_read_instance(run);
    const fmi2Boolean has_tolerance = !run_skip(run, "-");
    const double tolerance = has_tolerance ? run_read_real(run) : 0.0;
    const double start = run_read_real(run);
    const fmi2Boolean has_stop = !run_skip(run, "-");
    const double stop = has_stop ? run_read_real(run) : 0.0;
    run_write_status(run,
                     run->fmi->SetupExperiment(c, has_tolerance, tolerance, start, has_stop, stop));
}

/* Functions with an instance and nothing else. */
#define CALL_WITH_INSTANCE(name)                                                                   \
    static void call_##name(struct run *run) {                                                     \
        run_write_status(run, run->fmi->name(run_read_instance(run)));                             \
    }
CALL_WITH_INSTANCE(EnterInitializationMode)
CALL_WITH_INSTANCE(ExitInitializationMode)
CALL_WITH_INSTANCE(Terminate)
CALL_WITH_INSTANCE(Reset)
CALL_WITH_INSTANCE(EnterEventMode)
CALL_WITH_INSTANCE(EnterContinuousTimeMode)
CALL_WITH_INSTANCE(CancelStep)

/* ---- Values ---------------------------------------------------------------------------------- */

/* Value references. */
#define GET_CALL(name, to, WRITE)                                                                  \
    static void call_##name(struct run *run) {                                                     \
        const fmi2Component c = run_read_instance(run);                                            \
        const size_t count = run_read_references(run, run->references);                            \
        run_write_status(run, run->fmi->name(c, run->references, count, run->to));                 \
        WRITE(run, run->to, count);                                                                \
    }
#define WRITE_NOTHING(run, to, count)
GET_CALL(GetReal, results, run_write_reals)
GET_CALL(GetInteger, integers, run_write_integers)
GET_CALL(GetBoolean, integers, run_write_integers)
GET_CALL(GetString, strings, WRITE_NOTHING)

/* Value references, each with a value. */
#define SET_CALL(name, values, read)                                                               \
    static void call_##name(struct run *run) {                                                     \
        const fmi2Component c = run_read_instance(run);                                            \
        size_t count = 0;                                                                          \
        for (; run_words_left(run) > 0 && count < MOST_VALUES; count++) {                          \
            run->references[count] = (fmi2ValueReference)run_read_integer(run);                    \
            run->values[count] = read(run);                                                        \
        }                                                                                          \
        run_write_status(run, run->fmi->name(c, run->references, count, run->values));             \
    }
SET_CALL(SetReal, reals, run_read_real)
SET_CALL(SetInteger, integers, run_read_integer)
SET_CALL(SetBoolean, integers, run_read_integer)
SET_CALL(SetString, strings, run_read_text)

/* ---- FMU states ------------------------------------------------------------------------------ */

static void call_GetFMUstate(struct run *run) {
    const fmi2Component c = run_read_instance(run);
    run_write_status(run, run->fmi->GetFMUstate(c, run_read_state(run)));
}

static void call_SetFMUstate(struct run *run) {
    const fmi2Component c = run_read_instance(run);
    const fmi2FMUstate *state = run_read_state(run);
    run_write_status(run, run->fmi->SetFMUstate(c, state != NULL ? *state : NULL));
}

static void call_FreeFMUstate(struct run *run) {
    const fmi2Component c = run_read_instance(run);
    run_write_status(run, run->fmi->FreeFMUstate(c, run_read_state(run)));
}

static void call_SerializedFMUstateSize(struct run *run) {
    const fmi2Component c = run_read_instance(run);
    const fmi2FMUstate state = run->states[run_read_place(run)];
    size_t size = 0;
    run_write_status(run, run->fmi->SerializedFMUstateSize(c, state, &size));
    run_write_hex(run, size, 8);
}

/* instance, state, bytes */
static void call_SerializeFMUstate(struct run *run) {
    const fmi2Component c = run_read_instance(run);
    const fmi2FMUstate state = run->states[run_read_place(run)];
    struct bytes *to = run_read_bytes(run);
    if (run->fmi->SerializedFMUstateSize(c, state, &to->size) != fmi2OK ||
        to->size > sizeof to->data) {
        run_mistake(run, "the state has no size, or too large a one");
        return;
    }
    memset(to->data, 0, sizeof to->data);
    run_write_status(run, run->fmi->SerializeFMUstate(c, state, to->data, to->size));
    fputc(' ', run->transcript);
    for (size_t i = 0; i < to->size; i++) {
        fprintf(run->transcript, "%02x", (unsigned)(unsigned char)to->data[i]);
    }
}

/* instance, bytes, state */
static void call_DeSerializeFMUstate(struct run *run) {
    const fmi2Component c = run_read_instance(run);
    const struct bytes *from = run_read_bytes(run);
    run_write_status(run,
                     run->fmi->DeSerializeFMUstate(c, from->data, from->size, run_read_state(run)));
}

static void call_bytes(struct run *run) {
    struct bytes *to = run_read_bytes(run);
    const char *digits = run_read_word(run);
    to->size = strlen(digits) / 2;
    if (to->size > sizeof to->data) {
        run_mistake(run, "too many bytes");
        return;
    }
    for (size_t i = 0; i < to->size; i++) {
        to->data[i] = (char)(unsigned char)run_read_hex(run, digits + 2 * i, 2);
    }
    run_write_status(run, fmi2OK);
}

/* ---- Derivatives ----------------------------------------------------------------------------- */

/* Unknowns, "/", knowns, each with a value. */
static void call_GetDirectionalDerivative(struct run *run) {
    const fmi2Component c = run_read_instance(run);
    const size_t unknowns = run_read_references(run, run->references);
    size_t knowns = 0;
    for (; run_words_left(run) > 0 && knowns < MOST_VALUES; knowns++) {
        run->others[knowns] = (fmi2ValueReference)run_read_integer(run);
        run->reals[knowns] = run_read_real(run);
    }
    run_write_status(run,
                     run->fmi->GetDirectionalDerivative(c, run->references, unknowns, run->others,
                                                        knowns, run->reals, run->results));
    run_write_reals(run, run->results, unknowns);
}

/* Value references, each with an order and a value. */
static void call_SetRealInputDerivatives(struct run *run) {
    const fmi2Component c = run_read_instance(run);
    size_t count = 0;
    for (; run_words_left(run) > 0 && count < MOST_VALUES; count++) {
        run->references[count] = (fmi2ValueReference)run_read_integer(run);
        run->orders[count] = run_read_integer(run);
        run->reals[count] = run_read_real(run);
    }
    run_write_status(
        run, run->fmi->SetRealInputDerivatives(c, run->references, count, run->orders, run->reals));
}

/* Value references, each with an order. */
static void call_GetRealOutputDerivatives(struct run *run) {
    const fmi2Component c = run_read_instance(run);
    size_t count = 0;
    for (; run_words_left(run) > 0 && count < MOST_VALUES; count++) {
        run->references[count] = (fmi2ValueReference)run_read_integer(run);
        run->orders[count] = run_read_integer(run);
    }
    run_write_status(run, run->fmi->GetRealOutputDerivatives(c, run->references, count, run->orders,
                                                             run->results));
    run_write_reals(run, run->results, count);
}

/* ---- Co-Simulation --------------------------------------------------------------------------- */

static void call_DoStep(struct run *run) {
    const fmi2Component c = run_read_instance(run);
    const double time = run_read_real(run);
    const double step = run_read_real(run);
    run_write_status(run, run->fmi->DoStep(c, time, step, fmi2False));
}

#define STATUS_CALL(name, to, WRITE)                                                               \
    static void call_##name(struct run *run) {                                                     \
        const fmi2Component c = run_read_instance(run);                                            \
        const fmi2StatusKind kind = (fmi2StatusKind)run_read_integer(run);                         \
        run_write_status(run, run->fmi->name(c, kind, to));                                        \
        WRITE(run, to, 1);                                                                         \
    }
STATUS_CALL(GetStatus, &(fmi2Status){fmi2Pending}, WRITE_NOTHING)
STATUS_CALL(GetRealStatus, run->results, run_write_reals)
STATUS_CALL(GetIntegerStatus, run->integers, WRITE_NOTHING)
STATUS_CALL(GetBooleanStatus, run->integers, run_write_integers)
STATUS_CALL(GetStringStatus, run->strings, WRITE_NOTHING)

/* ---- Model Exchange -------------------------------------------------------------------------- */

static void call_NewDiscreteStates(struct run *run) {
    fmi2EventInfo info = {0};
    run_write_status(run, run->fmi->NewDiscreteStates(run_read_instance(run), &info));
    const fmi2Integer flags[] = {
        info.newDiscreteStatesNeeded,
        info.terminateSimulation,
        info.nominalsOfContinuousStatesChanged,
        info.valuesOfContinuousStatesChanged,
        info.nextEventTimeDefined,
    };
    run_write_integers(run, flags, sizeof flags / sizeof flags[0]);
}

static void call_CompletedIntegratorStep(struct run *run) {
    fmi2Boolean flags[2] = {fmi2True, fmi2True};
    run_write_status(run, run->fmi->CompletedIntegratorStep(run_read_instance(run), fmi2True,
                                                            &flags[0], &flags[1]));
    run_write_integers(run, flags, 2);
}

static void call_SetTime(struct run *run) {
    const fmi2Component c = run_read_instance(run);
    run_write_status(run, run->fmi->SetTime(c, run_read_real(run)));
}

static void call_SetContinuousStates(struct run *run) {
    const fmi2Component c = run_read_instance(run);
    size_t count = 0;
    while (run_words_left(run) > 0 && count < MOST_VALUES) {
        run->reals[count++] = run_read_real(run);
    }
    run_write_status(run, run->fmi->SetContinuousStates(c, run->reals, count));
}

/* Functions that write a given number of values. */
#define CALL_WITH_COUNT(name)                                                                      \
    static void call_##name(struct run *run) {                                                     \
        const fmi2Component c = run_read_instance(run);                                            \
        const size_t count = (size_t)run_read_integer(run) % MOST_VALUES;                          \
        run_write_status(run, run->fmi->name(c, run->results, count));                             \
        run_write_reals(run, run->results, count);                                                 \
    }
CALL_WITH_COUNT(GetDerivatives)
CALL_WITH_COUNT(GetEventIndicators)
CALL_WITH_COUNT(GetContinuousStates)
CALL_WITH_COUNT(GetNominalsOfContinuousStates)

static fmi2Status worse(fmi2Status a, fmi2Status b) {
    return a > b ? a : b;
}

/* A step of Euler's method; its length is a power of two, so that a fused multiply-add of the host
 * gives the same bits. */
static void call_Euler(struct run *run) {
    const fmi2Component c = run_read_instance(run);
    const size_t count = (size_t)run_read_integer(run) % MOST_VALUES;
    const double step = run_read_real(run);
    fmi2Boolean flags[2] = {fmi2True, fmi2True};
    fmi2Status status = run->fmi->GetContinuousStates(c, run->reals, count);
    status = worse(status, run->fmi->GetDerivatives(c, run->results, count));
    for (size_t i = 0; i < count; i++) {
        run->reals[i] += step * run->results[i];
    }
    status = worse(status, run->fmi->SetContinuousStates(c, run->reals, count));
    status = worse(status, run->fmi->CompletedIntegratorStep(c, fmi2True, &flags[0], &flags[1]));
    run_write_status(run, status);
    run_write_reals(run, run->reals, count);
    run_write_integers(run, flags, 2);
}

/* ---- All of them ----------------------------------------------------------------------------- */

typedef void call_function(struct run *run);

static const struct {
    const char *name;
    call_function *call;
} all[] = {
#define COMMAND(name, kinds, states) {#name, call_##name},
    FMI2_FUNCTION_LIST(COMMAND)
#undef COMMAND
        {"bytes", call_bytes},
    {"Euler", call_Euler},
};

/* Returns NULL if there is no call of this name. */
static call_function *call_find(const char *name) {
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++) {
        if (strcmp(name, all[i].name) == 0) {
            return all[i].call;
        }
    }
    return NULL;
}

/* ---- A script -------------------------------------------------------------------------------- */

/* What no call writes to stays recognizable in the transcript. */
static void forget_results(struct run *run) {
    memset(run->results, 0xaa, sizeof run->results);
    memset(run->integers, 0x55, sizeof run->integers);
    memset(run->strings, 0, sizeof run->strings);
}

static void run_command(struct run *run) {
    call_function *call = call_find(run->words[0]);
    if (call == NULL) {
        run_mistake(run, "there is no such command");
        return;
    }
    run->at = 1;
    forget_results(run);
    call(run);
    fputc('\n', run->transcript);
    if (run_words_left(run) > 0) {
        run_mistake(run, "a word too many");
    }
}

static void run_line(struct run *run, char *line) {
    run->word_count = 0;
    while (*(line += strspn(line, " \r")) != '\0') {
        if (run->word_count == MOST_WORDS) {
            run_mistake(run, "too many words");
            return;
        }
        run->words[run->word_count++] = line;
        line += strcspn(line, " \r");
        if (*line != '\0') {
            *line++ = '\0';
        }
    }
    if (run->word_count > 0) {
        run_command(run);
    }
}

bool script_run(const struct fmu_functions *fmi, char *text, FILE *transcript) {
    struct run *run = calloc(1, sizeof *run);
    if (run == NULL) {
        fprintf(stderr, "out of memory\n");
        return false;
    }
    run->fmi = fmi;
    run->transcript = transcript;
    run->callbacks = (fmi2CallbackFunctions){
        .logger = run_log,
        .allocateMemory = calloc,
        .freeMemory = free,
        .componentEnvironment = run,
    };
    for (char *next = NULL; text != NULL && !run->is_wrong; text = next) {
        next = strchr(text, '\n');
        if (next != NULL) {
            *next++ = '\0';
        }
        run->line++;
        run_line(run, text);
    }
    const bool is_right = !run->is_wrong;
    free(run);
    return is_right;
}
