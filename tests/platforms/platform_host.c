/* platform_host LIBRARY SCRIPT TRANSCRIPT [SCRIPT TRANSCRIPT ...]
 *
 * Loads the library of an FMU and runs scripts of FMI calls (script.h), several of them in as many
 * threads. One program for every platform: C17, and what system.h asks of the system. Ends with 0
 * if all scripts ran, whatever the FMU answered. */
#include "script.h"
#include "system.h"

#include <stdlib.h>
#include <string.h>

enum { MOST_SCRIPTS = 64 };

struct job {
    const struct fmu_functions *fmi;
    const char *script;
    const char *transcript;
    bool succeeded;
};

/* The text of a file, which the caller frees, or NULL. */
static char *read_file(const char *path) {
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        return NULL;
    }
    char *text = NULL;
    size_t size = 0;
    size_t capacity = 1 << 16;
    do {
        capacity *= 2;
        char *larger = realloc(text, capacity);
        if (larger == NULL) {
            break;
        }
        text = larger;
        size += fread(text + size, 1, capacity - 1 - size, file);
        text[size] = '\0';
    } while (size == capacity - 1);
    fclose(file);
    return text;
}

static void run_job(void *item) {
    struct job *job = item;
    char *text = read_file(job->script);
    FILE *transcript = fopen(job->transcript, "wb"); // binary: the same ends of lines everywhere
    if (text == NULL || transcript == NULL) {
        fprintf(stderr, "%s or %s cannot be opened\n", job->script, job->transcript);
    } else {
        job->succeeded = script_run(job->fmi, text, transcript) && !ferror(transcript);
    }
    if (transcript != NULL) {
        job->succeeded = fclose(transcript) == 0 && job->succeeded;
    }
    free(text);
}

static bool find_functions(void *library, struct fmu_functions *fmi) {
#define FIND(name, kinds, states)                                                                  \
    if (!system_find(library, "fmi2" #name, &fmi->name)) {                                         \
        fprintf(stderr, "the library has no fmi2%s\n", #name);                                     \
        return false;                                                                              \
    }
    FMI2_FUNCTION_LIST(FIND)
#undef FIND
    return true;
}

int main(int argument_count, char *arguments[]) {
    if (argument_count < 4 || argument_count % 2 != 0 || argument_count > 2 + 2 * MOST_SCRIPTS) {
        fprintf(stderr, "usage: platform_host LIBRARY SCRIPT TRANSCRIPT [SCRIPT TRANSCRIPT ...]\n");
        return 2;
    }
    struct fmu_functions fmi;
    void *library = system_open(arguments[1]);
    if (library == NULL || !find_functions(library, &fmi)) {
        return 2;
    }

    struct job jobs[MOST_SCRIPTS];
    void *items[MOST_SCRIPTS];
    size_t count = 0;
    for (int i = 2; i < argument_count; i += 2) {
        jobs[count] = (struct job){&fmi, arguments[i], arguments[i + 1], false};
        items[count] = &jobs[count];
        count++;
    }
    bool succeeded = system_run_threads(run_job, items, count);
    for (size_t i = 0; i < count; i++) {
        succeeded = succeeded && jobs[i].succeeded;
    }
    return succeeded ? 0 : 1;
}
