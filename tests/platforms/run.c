#include "run.h"

#include <stdlib.h>
#include <string.h>

static const char hex_digits[] = "0123456789abcdef";

void run_mistake(struct run *run, const char *text) {
    if (!run->is_wrong) {
        fprintf(stderr, "line %u: %s\n", run->line, text);
    }
    run->is_wrong = true;
}

/* ---- Words ----------------------------------------------------------------------------------- */

size_t run_words_left(const struct run *run) {
    return run->word_count - run->at;
}

const char *run_read_word(struct run *run) {
    if (run_words_left(run) == 0) {
        run_mistake(run, "a word is missing");
        return "0";
    }
    return run->words[run->at++];
}

bool run_skip(struct run *run, const char *word) {
    const bool found = run_words_left(run) > 0 && strcmp(run->words[run->at], word) == 0;
    run->at += found;
    return found;
}

const char *run_read_text(struct run *run) {
    const char *word = run_read_word(run);
    return strcmp(word, "-") == 0 ? NULL : word;
}

int run_read_integer(struct run *run) {
    char *end = NULL;
    const char *word = run_read_word(run);
    const long value = strtol(word, &end, 10);
    if (*end != '\0') {
        run_mistake(run, "an integer is expected");
    }
    return (int)value;
}

uint64_t run_read_hex(struct run *run, const char *digits, size_t count) {
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

double run_read_real(struct run *run) {
    const uint64_t bits = run_read_hex(run, run_read_word(run), 16);
    double value = 0.0;
    memcpy(&value, &bits, sizeof value);
    return value;
}

size_t run_read_place(struct run *run) {
    const int place = run_read_integer(run);
    if (place < 0 || place >= PLACES) {
        run_mistake(run, "places are 0 to 7");
        return 0;
    }
    return (size_t)place;
}

fmi2Component run_read_instance(struct run *run) {
    return run_skip(run, "-") ? NULL : run->instances[run_read_place(run)];
}

fmi2FMUstate *run_read_state(struct run *run) {
    return run_skip(run, "-") ? NULL : &run->states[run_read_place(run)];
}

struct bytes *run_read_bytes(struct run *run) {
    return &run->bytes[run_read_place(run)];
}

size_t run_read_references(struct run *run, fmi2ValueReference references[]) {
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

void run_write_hex(const struct run *run, uint64_t bits, int digits) {
    fputc(' ', run->transcript);
    while (digits-- > 0) {
        const char digit = hex_digits[bits >> 4 * digits & 15];
        fputc(digit, run->transcript);
    }
}

void run_write_line(const struct run *run, const char *status) {
    fprintf(run->transcript, "%u %s %s", run->line, run->words[0], status);
}

void run_write_status(const struct run *run, fmi2Status status) {
    run_write_line(run, status_name(status));
}

void run_write_reals(const struct run *run, const fmi2Real values[], size_t count) {
    for (size_t i = 0; i < count; i++) {
        uint64_t bits = 0;
        memcpy(&bits, &values[i], sizeof bits);
        run_write_hex(run, bits, 16);
    }
}

void run_write_integers(const struct run *run, const fmi2Integer values[], size_t count) {
    for (size_t i = 0; i < count; i++) {
        fprintf(run->transcript, " %d", values[i]);
    }
}

void run_log(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status,
             fmi2String category, fmi2String message, ...) {
    const struct run *run = environment;
    fprintf(run->transcript, "%u log %s %s %s %s\n", run->line, instance, status_name(status),
            category, message);
}
