/* A script that is being run: its words, what it keeps from one call to the next, and the line of
 * the transcript that is written. */
#ifndef RUN_H
#define RUN_H

#include "../fmi_harness/fmu_library.h"

#include <stdint.h>
#include <stdio.h>

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

/* Says on stderr what is wrong in the line; no further line is run. */
void run_mistake(struct run *run, const char *text);

/* ---- Words ----------------------------------------------------------------------------------- */

size_t run_words_left(const struct run *run);

/* True if the next word is this one, which is then read. */
bool run_skip(struct run *run, const char *word);

/* The next word; a mistake if there is none or it is of another kind. */
const char *run_read_word(struct run *run);
const char *run_read_text(struct run *run); /* NULL for "-" */
int run_read_integer(struct run *run);
double run_read_real(struct run *run); /* 16 hex digits */
uint64_t run_read_hex(struct run *run, const char *digits, size_t count);

/* The number of a place. */
size_t run_read_place(struct run *run);
/* What is in a place; NULL for "-". */
fmi2Component run_read_instance(struct run *run);
fmi2FMUstate *run_read_state(struct run *run);
struct bytes *run_read_bytes(struct run *run);

/* Value references up to the end of the line or a "/"; returns how many. */
size_t run_read_references(struct run *run, fmi2ValueReference references[]);

/* ---- Transcript ------------------------------------------------------------------------------ */

/* Begin a line: number, name of the call, status. */
void run_write_line(const struct run *run, const char *status);
void run_write_status(const struct run *run, fmi2Status status);

/* Go on with the line. */
void run_write_hex(const struct run *run, uint64_t bits, int digits);
void run_write_reals(const struct run *run, const fmi2Real values[], size_t count);
void run_write_integers(const struct run *run, const fmi2Integer values[], size_t count);

/* A line with a message of the FMU; its environment is the run. */
void run_log(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status,
             fmi2String category, fmi2String message, ...);

#endif
