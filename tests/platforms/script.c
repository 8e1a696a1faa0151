#include "script.h"

#include "calls.h"

#include <stdlib.h>
#include <string.h>

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
