#include "script.h"

#include "system.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { PLACES = 8, MOST_WORDS = 512, MOST_VALUES = 256, MOST_BYTES = 8192 };

struct bytes {
    size_t size;
    char data[MOST_BYTES];
};

struct run {
    const struct fmi2_functions *fmi;
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

static void mistake(struct run *run, const char *text) {
    if (!run->is_wrong) {
        fprintf(stderr, "line %u: %s\n", run->line, text);
    }
    run->is_wrong = true;
}

/* ---- Transcript ------------------------------------------------------------------------------ */

static const char *const status_names[] = {"OK", "Warning", "Discard", "Error", "Fatal", "Pending"};

static const char *status_name(fmi2Status status) {
    const size_t number = (size_t)status;
    return number < sizeof status_names / sizeof status_names[0] ? status_names[number] : "unknown";
}

static void write_hex(const struct run *run, uint64_t bits, int digits) {
    fputc(' ', run->transcript);
    while (digits-- > 0) {
        fputc("0123456789abcdef"[bits >> 4 * digits & 15], run -> transcript);
    }
}

static void write_line(const struct run *run, const char *name, const char *status) {
    fprintf(run->transcript, "%u %s %s", run->line, name, status);
}

static void write_status(const struct run *run, fmi2Status status) {
    write_line(run, run->words[0], status_name(status));
}

static void write_reals(const struct run *run, const fmi2Real values[], size_t count) {
    for (size_t i = 0; i < count; i++) {
        uint64_t bits = 0;
        memcpy(&bits, &values[i], sizeof bits);
        write_hex(run, bits, 16);
    }
}

static void write_integers(const struct run *run, const fmi2Integer values[], size_t count) {
    for (size_t i = 0; i < count; i++) {
        fprintf(run->transcript, " %d", values[i]);
    }
}

static void log_message(fmi2ComponentEnvironment environment, fmi2String instance,
                        fmi2Status status, fmi2String category, fmi2String message, ...) {
    const struct run *run = environment;
    fprintf(run->transcript, "%u log %s %s %s %s\n", run->line, instance, status_name(status),
            category, message);
}

/* ---- Words ----------------------------------------------------------------------------------- */

static size_t words_left(const struct run *run) {
    return run->word_count - run->at;
}

static const char *read_word(struct run *run) {
    if (words_left(run) == 0) {
        mistake(run, "a word is missing");
        return "0";
    }
    return run->words[run->at++];
}

static bool skip_word(struct run *run, const char *word) {
    const bool found = words_left(run) > 0 && strcmp(run->words[run->at], word) == 0;
    run->at += found;
    return found;
}

static const char *read_text(struct run *run) {
    const char *word = read_word(run);
    return strcmp(word, "-") == 0 ? NULL : word;
}

static int read_integer(struct run *run) {
    char *end = NULL;
    const char *word = read_word(run);
    const long value = strtol(word, &end, 10);
    if (*end != '\0') {
        mistake(run, "an integer is expected");
    }
    return (int)value;
}

static unsigned read_hex(struct run *run, const char *digits, size_t count, uint64_t *bits) {
    static const char all[] = "0123456789abcdef";
    *bits = 0;
    for (size_t i = 0; i < count; i++) {
        const char *digit = digits[i] != '\0' ? strchr(all, digits[i]) : NULL;
        if (digit == NULL) {
            mistake(run, "hex digits are expected");
            return 0;
        }
        *bits = *bits << 4 | (uint64_t)(digit - all);
    }
    return (unsigned)*bits;
}

static double read_real(struct run *run) {
    uint64_t bits = 0;
    double value = 0.0;
    (void)read_hex(run, read_word(run), 16, &bits);
    memcpy(&value, &bits, sizeof value);
    return value;
}

static size_t read_place(struct run *run) {
    const int place = read_integer(run);
    if (place < 0 || place >= PLACES) {
        mistake(run, "places are 0 to 7");
        return 0;
    }
    return (size_t)place;
}

static fmi2Component read_instance(struct run *run) {
    return skip_word(run, "-") ? NULL : run->instances[read_place(run)];
}

static fmi2FMUstate *read_state(struct run *run) {
    return skip_word(run, "-") ? NULL : &run->states[read_place(run)];
}

static struct bytes *read_bytes(struct run *run) {
    return &run->bytes[read_place(run)];
}

/* Value references up to the end of the line or a "/". */
static size_t read_references(struct run *run, fmi2ValueReference references[]) {
    size_t count = 0;
    while (words_left(run) > 0 && count < MOST_VALUES && !skip_word(run, "/")) {
        references[count++] = (fmi2ValueReference)read_integer(run);
    }
    return count;
}

/* What no call writes to stays recognizable in the transcript. */
static void forget_results(struct run *run) {
    memset(run->results, 0xaa, sizeof run->results);
    memset(run->integers, 0x55, sizeof run->integers);
    memset(run->strings, 0, sizeof run->strings);
}

/* ---- Life ------------------------------------------------------------------------------------ */

static void call_GetTypesPlatform(struct run *run) {
    write_line(run, run->words[0], run->fmi->GetTypesPlatform());
}

static void call_GetVersion(struct run *run) {
    write_line(run, run->words[0], run->fmi->GetVersion());
}

/* place, kind, GUID, logging on, name */
static void call_Instantiate(struct run *run) {
    const size_t place = read_place(run);
    const fmi2Type kind = (fmi2Type)read_integer(run);
    const char *guid = read_text(run);
    const fmi2Boolean logging_on = read_integer(run);
    const char *name = read_text(run);
    run->instances[place] =
        run->fmi->Instantiate(name, kind, guid, "", &run->callbacks, fmi2False, logging_on);
    write_line(run, run->words[0], run->instances[place] != NULL ? "OK" : "NULL");
}

static void call_FreeInstance(struct run *run) {
    const size_t place = read_place(run);
    run->fmi->FreeInstance(run->instances[place]);
    run->instances[place] = NULL;
    write_status(run, fmi2OK);
}

static void call_SetDebugLogging(struct run *run) {
    const fmi2Component c = read_instance(run);
    const fmi2Boolean on = read_integer(run);
    size_t count = 0;
    while (words_left(run) > 0 && count < MOST_VALUES) {
        run->strings[count++] = read_text(run);
    }
    write_status(run, run->fmi->SetDebugLogging(c, on, count, run->strings));
}

/* tolerance or "-", start time, stop time or "-" */
static void call_SetupExperiment(struct run *run) {
    const fmi2Component c = read_instance(run);
    const fmi2Boolean has_tolerance = !skip_word(run, "-");
    const double tolerance = has_tolerance ? read_real(run) : 0.0;
    const double start = read_real(run);
    const fmi2Boolean has_stop = !skip_word(run, "-");
    const double stop = has_stop ? read_real(run) : 0.0;
    write_status(run,
                 run->fmi->SetupExperiment(c, has_tolerance, tolerance, start, has_stop, stop));
}

/* Functions with an instance and nothing else. */
#define CALL_WITH_INSTANCE(name)                                                                   \
    static void call_##name(struct run *run) {                                                     \
        write_status(run, run->fmi->name(read_instance(run)));                                     \
    }
CALL_WITH_INSTANCE(EnterInitializationMode)
CALL_WITH_INSTANCE(ExitInitializationMode)
CALL_WITH_INSTANCE(Terminate)
CALL_WITH_INSTANCE(Reset)
CALL_WITH_INSTANCE(EnterEventMode)
CALL_WITH_INSTANCE(EnterContinuousTimeMode)
CALL_WITH_INSTANCE(CancelStep)

/* ---- Values ---------------------------------------------------------------------------------- */

static void call_GetReal(struct run *run) {
    const fmi2Component c = read_instance(run);
    const size_t count = read_references(run, run->references);
    write_status(run, run->fmi->GetReal(c, run->references, count, run->results));
    write_reals(run, run->results, count);
}

static void call_GetInteger(struct run *run) {
    const fmi2Component c = read_instance(run);
    const size_t count = read_references(run, run->references);
    write_status(run, run->fmi->GetInteger(c, run->references, count, run->integers));
    write_integers(run, run->integers, count);
}

static void call_GetBoolean(struct run *run) {
    const fmi2Component c = read_instance(run);
    const size_t count = read_references(run, run->references);
    write_status(run, run->fmi->GetBoolean(c, run->references, count, run->integers));
}

static void call_GetString(struct run *run) {
    const fmi2Component c = read_instance(run);
    const size_t count = read_references(run, run->references);
    write_status(run, run->fmi->GetString(c, run->references, count, run->strings));
}

/* Value references, each with a value. */
static void call_SetReal(struct run *run) {
    const fmi2Component c = read_instance(run);
    size_t count = 0;
    for (; words_left(run) > 0 && count < MOST_VALUES; count++) {
        run->references[count] = (fmi2ValueReference)read_integer(run);
        run->reals[count] = read_real(run);
    }
    write_status(run, run->fmi->SetReal(c, run->references, count, run->reals));
}

static size_t read_integers(struct run *run) {
    size_t count = 0;
    for (; words_left(run) > 0 && count < MOST_VALUES; count++) {
        run->references[count] = (fmi2ValueReference)read_integer(run);
        run->integers[count] = read_integer(run);
    }
    return count;
}

static void call_SetInteger(struct run *run) {
    const fmi2Component c = read_instance(run);
    const size_t count = read_integers(run);
    write_status(run, run->fmi->SetInteger(c, run->references, count, run->integers));
}

static void call_SetBoolean(struct run *run) {
    const fmi2Component c = read_instance(run);
    const size_t count = read_integers(run);
    write_status(run, run->fmi->SetBoolean(c, run->references, count, run->integers));
}

static void call_SetString(struct run *run) {
    const fmi2Component c = read_instance(run);
    size_t count = 0;
    for (; words_left(run) > 0 && count < MOST_VALUES; count++) {
        run->references[count] = (fmi2ValueReference)read_integer(run);
        run->strings[count] = read_text(run);
    }
    write_status(run, run->fmi->SetString(c, run->references, count, run->strings));
}

/* ---- FMU states ------------------------------------------------------------------------------ */

static void call_GetFMUstate(struct run *run) {
    const fmi2Component c = read_instance(run);
    write_status(run, run->fmi->GetFMUstate(c, read_state(run)));
}

static void call_SetFMUstate(struct run *run) {
    const fmi2Component c = read_instance(run);
    const fmi2FMUstate *state = read_state(run);
    write_status(run, run->fmi->SetFMUstate(c, state != NULL ? *state : NULL));
}

static void call_FreeFMUstate(struct run *run) {
    const fmi2Component c = read_instance(run);
    write_status(run, run->fmi->FreeFMUstate(c, read_state(run)));
}

static void call_SerializedFMUstateSize(struct run *run) {
    const fmi2Component c = read_instance(run);
    const fmi2FMUstate state = *read_state(run);
    size_t size = 0;
    write_status(run, run->fmi->SerializedFMUstateSize(c, state, &size));
    write_hex(run, size, 8);
}

/* instance, state, bytes, and where it is wrong, a size */
static void call_SerializeFMUstate(struct run *run) {
    const fmi2Component c = read_instance(run);
    const fmi2FMUstate state = *read_state(run);
    struct bytes *to = read_bytes(run);
    if (words_left(run) > 0) {
        to->size = (size_t)read_integer(run);
    } else if (run->fmi->SerializedFMUstateSize(c, state, &to->size) != fmi2OK ||
               to->size > sizeof to->data) {
        mistake(run, "the state has no size, or too large a one");
        return;
    }
    memset(to->data, 0, sizeof to->data);
    write_status(run, run->fmi->SerializeFMUstate(c, state, to->data, to->size));
    fputc(' ', run->transcript);
    for (size_t i = 0; i < to->size; i++) {
        fprintf(run->transcript, "%02x", (unsigned)(unsigned char)to->data[i]);
    }
}

/* instance, bytes, state */
static void call_DeSerializeFMUstate(struct run *run) {
    const fmi2Component c = read_instance(run);
    const struct bytes *from = read_bytes(run);
    write_status(run, run->fmi->DeSerializeFMUstate(c, from->data, from->size, read_state(run)));
}

static void set_byte(struct run *run, struct bytes *bytes, size_t place, const char *digits) {
    uint64_t value = 0;
    (void)read_hex(run, digits, 2, &value);
    bytes->data[place] = (char)(unsigned char)value;
}

static void call_bytes(struct run *run) {
    struct bytes *to = read_bytes(run);
    const char *digits = read_word(run);
    to->size = strlen(digits) / 2;
    if (to->size > sizeof to->data) {
        mistake(run, "too many bytes");
        return;
    }
    for (size_t i = 0; i < to->size; i++) {
        set_byte(run, to, i, digits + 2 * i);
    }
    write_status(run, fmi2OK);
}

static void call_poke(struct run *run) {
    struct bytes *bytes = read_bytes(run);
    const int place = read_integer(run);
    if (place < 0 || (size_t)place >= bytes->size) {
        mistake(run, "there is no such byte");
        return;
    }
    set_byte(run, bytes, (size_t)place, read_word(run));
    write_status(run, fmi2OK);
}

static void call_cut(struct run *run) {
    struct bytes *bytes = read_bytes(run);
    bytes->size = (size_t)read_integer(run) % sizeof bytes->data;
    write_status(run, fmi2OK);
}

/* ---- Derivatives ----------------------------------------------------------------------------- */

/* Unknowns, "/", knowns, each with a value. */
static void call_GetDirectionalDerivative(struct run *run) {
    const fmi2Component c = read_instance(run);
    const size_t unknowns = read_references(run, run->references);
    size_t knowns = 0;
    for (; words_left(run) > 0 && knowns < MOST_VALUES; knowns++) {
        run->others[knowns] = (fmi2ValueReference)read_integer(run);
        run->reals[knowns] = read_real(run);
    }
    write_status(run, run->fmi->GetDirectionalDerivative(c, run->references, unknowns, run->others,
                                                         knowns, run->reals, run->results));
    write_reals(run, run->results, unknowns);
}

/* Value references, each with an order and a value. */
static void call_SetRealInputDerivatives(struct run *run) {
    const fmi2Component c = read_instance(run);
    size_t count = 0;
    for (; words_left(run) > 0 && count < MOST_VALUES; count++) {
        run->references[count] = (fmi2ValueReference)read_integer(run);
        run->orders[count] = read_integer(run);
        run->reals[count] = read_real(run);
    }
    write_status(
        run, run->fmi->SetRealInputDerivatives(c, run->references, count, run->orders, run->reals));
}

/* Value references, each with an order. */
static void call_GetRealOutputDerivatives(struct run *run) {
    const fmi2Component c = read_instance(run);
    size_t count = 0;
    for (; words_left(run) > 0 && count < MOST_VALUES; count++) {
        run->references[count] = (fmi2ValueReference)read_integer(run);
        run->orders[count] = read_integer(run);
    }
    write_status(run, run->fmi->GetRealOutputDerivatives(c, run->references, count, run->orders,
                                                         run->results));
    write_reals(run, run->results, count);
}

/* ---- Co-Simulation --------------------------------------------------------------------------- */

static void call_DoStep(struct run *run) {
    const fmi2Component c = read_instance(run);
    const double time = read_real(run);
    const double step = read_real(run);
    write_status(run, run->fmi->DoStep(c, time, step, fmi2False));
}

static void call_GetStatus(struct run *run) {
    const fmi2Component c = read_instance(run);
    fmi2Status value = fmi2Pending;
    write_status(run, run->fmi->GetStatus(c, (fmi2StatusKind)read_integer(run), &value));
}

static void call_GetRealStatus(struct run *run) {
    const fmi2Component c = read_instance(run);
    const fmi2StatusKind kind = (fmi2StatusKind)read_integer(run);
    write_status(run, run->fmi->GetRealStatus(c, kind, run->results));
    write_reals(run, run->results, 1);
}

static void call_GetIntegerStatus(struct run *run) {
    const fmi2Component c = read_instance(run);
    const fmi2StatusKind kind = (fmi2StatusKind)read_integer(run);
    write_status(run, run->fmi->GetIntegerStatus(c, kind, run->integers));
}

static void call_GetBooleanStatus(struct run *run) {
    const fmi2Component c = read_instance(run);
    const fmi2StatusKind kind = (fmi2StatusKind)read_integer(run);
    write_status(run, run->fmi->GetBooleanStatus(c, kind, run->integers));
    write_integers(run, run->integers, 1);
}

static void call_GetStringStatus(struct run *run) {
    const fmi2Component c = read_instance(run);
    const fmi2StatusKind kind = (fmi2StatusKind)read_integer(run);
    write_status(run, run->fmi->GetStringStatus(c, kind, run->strings));
}

/* ---- Model Exchange -------------------------------------------------------------------------- */

static void call_NewDiscreteStates(struct run *run) {
    fmi2EventInfo info = {0};
    write_status(run, run->fmi->NewDiscreteStates(read_instance(run), &info));
    const fmi2Integer flags[] = {
        info.newDiscreteStatesNeeded,
        info.terminateSimulation,
        info.nominalsOfContinuousStatesChanged,
        info.valuesOfContinuousStatesChanged,
        info.nextEventTimeDefined,
    };
    write_integers(run, flags, sizeof flags / sizeof flags[0]);
}

static void call_CompletedIntegratorStep(struct run *run) {
    fmi2Boolean flags[2] = {fmi2True, fmi2True};
    write_status(
        run, run->fmi->CompletedIntegratorStep(read_instance(run), fmi2True, &flags[0], &flags[1]));
    write_integers(run, flags, 2);
}

static void call_SetTime(struct run *run) {
    const fmi2Component c = read_instance(run);
    write_status(run, run->fmi->SetTime(c, read_real(run)));
}

static void call_SetContinuousStates(struct run *run) {
    const fmi2Component c = read_instance(run);
    size_t count = 0;
    while (words_left(run) > 0 && count < MOST_VALUES) {
        run->reals[count++] = read_real(run);
    }
    write_status(run, run->fmi->SetContinuousStates(c, run->reals, count));
}

/* Functions that write a given number of values. */
#define CALL_WITH_COUNT(name)                                                                      \
    static void call_##name(struct run *run) {                                                     \
        const fmi2Component c = read_instance(run);                                                \
        const size_t count = (size_t)read_integer(run) % MOST_VALUES;                              \
        write_status(run, run->fmi->name(c, run->results, count));                                 \
        write_reals(run, run->results, count);                                                     \
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
    const fmi2Component c = read_instance(run);
    const size_t count = (size_t)read_integer(run) % MOST_VALUES;
    const double step = read_real(run);
    fmi2Boolean flags[2] = {fmi2True, fmi2True};
    fmi2Status status = run->fmi->GetContinuousStates(c, run->reals, count);
    status = worse(status, run->fmi->GetDerivatives(c, run->results, count));
    for (size_t i = 0; i < count; i++) {
        run->reals[i] += step * run->results[i];
    }
    status = worse(status, run->fmi->SetContinuousStates(c, run->reals, count));
    status = worse(status, run->fmi->CompletedIntegratorStep(c, fmi2True, &flags[0], &flags[1]));
    write_status(run, status);
    write_reals(run, run->reals, count);
    write_integers(run, flags, 2);
}

/* ---- Lines ----------------------------------------------------------------------------------- */

static const struct command {
    const char *name;
    void (*call)(struct run *run);
} commands[] = {
#define COMMAND(name) {#name, call_##name},
    FMI2_FUNCTION_LIST(COMMAND)
#undef COMMAND
        {"bytes", call_bytes},
    {"poke", call_poke},
    {"cut", call_cut},
    {"Euler", call_Euler},
};

static void run_command(struct run *run) {
    for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++) {
        if (strcmp(run->words[0], commands[i].name) == 0) {
            run->at = 1;
            forget_results(run);
            commands[i].call(run);
            fputc('\n', run->transcript);
            if (words_left(run) > 0) {
                mistake(run, "a word too many");
            }
            return;
        }
    }
    mistake(run, "there is no such command");
}

/* "fail", number, "one" or "all", command */
static void run_failing(struct run *run) {
    run->at = 1;
    const long first = read_integer(run);
    const bool all = skip_word(run, "all") || !skip_word(run, "one");
    if (words_left(run) == 0) {
        mistake(run, "a command is expected");
        return;
    }
    memmove(run->words, run->words + run->at, words_left(run) * sizeof run->words[0]);
    run->word_count -= run->at;
    if (!system_fail_allocations(first, all)) {
        mistake(run, "the allocations of this library cannot be made to fail");
        return;
    }
    run_command(run);
    fprintf(run->transcript, "%u failed %ld\n", run->line, system_stop_failing());
}

static void run_line(struct run *run, char *line) {
    run->word_count = 0;
    while (*(line += strspn(line, " \r")) != '\0') {
        if (run->word_count == MOST_WORDS) {
            mistake(run, "too many words");
            return;
        }
        run->words[run->word_count++] = line;
        line += strcspn(line, " \r");
        if (*line != '\0') {
            *line++ = '\0';
        }
    }
    if (run->word_count > 0 && strcmp(run->words[0], "fail") == 0) {
        run_failing(run);
    } else if (run->word_count > 0) {
        run_command(run);
    }
}

bool script_run(const struct fmi2_functions *fmi, char *text, FILE *transcript) {
    struct run *run = calloc(1, sizeof *run);
    if (run == NULL) {
        fprintf(stderr, "out of memory\n");
        return false;
    }
    run->fmi = fmi;
    run->transcript = transcript;
    run->callbacks = (fmi2CallbackFunctions){
        .logger = log_message,
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
