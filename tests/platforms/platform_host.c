/* platform_host LIBRARY MODEL RUN TRANSCRIPT [RUN TRANSCRIPT ...]
 *
 * Loads the library of an FMU and makes runs of FMI calls (runs.h), several of them in as many
 * threads. One program for every platform: C17, libraries and threads. MODEL is a file about the
 * model, by model.py. Ends with 0 if every status is the expected one. */
#include "runs.h"

#include <stdlib.h>
#include <string.h>

/* Libraries and threads: system_open returns NULL, with a line on stderr, if a library cannot be
 * loaded. system_find writes the address of an exported function to *function; false if there is
 * none. system_run_threads calls run(items[i]) for each i in its own thread, all at the same time,
 * and returns when all have ended; false if a thread could not be started. */

#if defined(_WIN32)

/* ---- Windows --------------------------------------------------------------------------------- */

#define WIN32_LEAN_AND_MEAN
#include <process.h>
#include <windows.h>

static void *system_open(const char *path) {
    const HMODULE library = LoadLibraryA(path);
    if (library == NULL) {
        fprintf(stderr, "%s: error %lu\n", path, GetLastError());
    }
    return (void *)library;
}

static bool system_find(void *library, const char *name, void *function) {
    const FARPROC found = GetProcAddress((HMODULE)library, name);
    memcpy(function, &found, sizeof found);
    return found != NULL;
}

struct thread {
    void (*run)(void *item);
    void *item;
};

static unsigned __stdcall run_thread(void *argument) {
    const struct thread *thread = argument;
    thread->run(thread->item);
    return 0;
}

static bool system_run_threads(void (*run)(void *item), void *const *items, size_t count) {
    enum { MOST = MAXIMUM_WAIT_OBJECTS };
    struct thread threads[MOST];
    HANDLE handles[MOST];
    size_t started = 0;
    for (; started < count && started < MOST; started++) {
        threads[started] = (struct thread){run, items[started]};
        handles[started] = (HANDLE)_beginthreadex(NULL, 0, run_thread, &threads[started], 0, NULL);
        if (handles[started] == NULL) {
            break;
        }
    }
    for (size_t i = 0; i < started; i++) {
        WaitForSingleObject(handles[i], INFINITE);
        CloseHandle(handles[i]);
    }
    return started == count;
}

#else

/* ---- POSIX ----------------------------------------------------------------------------------- */

#include <dlfcn.h>
#include <pthread.h>

static void *system_open(const char *path) {
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) {
        fprintf(stderr, "%s\n", dlerror());
    }
    return library;
}

static bool system_find(void *library, const char *name, void *function) {
    void *found = dlsym(library, name);
    // as POSIX has it: a function pointer is the bytes of the object pointer
    memcpy(function, &found, sizeof found);
    return found != NULL;
}

struct thread {
    void (*run)(void *item);
    void *item;
    pthread_t handle;
};

static void *run_thread(void *argument) {
    const struct thread *thread = argument;
    thread->run(thread->item);
    return NULL;
}

static bool system_run_threads(void (*run)(void *item), void *const *items, size_t count) {
    enum { MOST = 64 };
    struct thread threads[MOST];
    size_t started = 0;
    for (; started < count && started < MOST; started++) {
        threads[started] = (struct thread){.run = run, .item = items[started]};
        if (pthread_create(&threads[started].handle, NULL, run_thread, &threads[started]) != 0) {
            break;
        }
    }
    for (size_t i = 0; i < started; i++) {
        pthread_join(threads[i].handle, NULL);
    }
    return started == count;
}

#endif

/* ---- Jobs ------------------------------------------------------------------------------------ */

enum { MOST_RUNS = 64 };

struct job {
    const struct fmu_functions *fmi;
    const struct model *model;
    const char *run;
    const char *transcript;
    bool has_succeeded;
};

static void run_job(void *item) {
    struct job *job = item;
    FILE *transcript = fopen(job->transcript, "wb"); // binary: the same ends of lines everywhere
    if (transcript == NULL) {
        fprintf(stderr, "%s cannot be written\n", job->transcript);
        return;
    }
    job->has_succeeded = runs_make(job->fmi, job->model, job->run, transcript);
    job->has_succeeded = fclose(transcript) == 0 && job->has_succeeded;
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
    struct model *model = NULL;
    if (argument_count < 5 || argument_count % 2 != 1 || argument_count > 3 + 2 * MOST_RUNS) {
        fprintf(stderr, "usage: platform_host LIBRARY MODEL RUN TRANSCRIPT [RUN TRANSCRIPT ...]\n");
        return 2;
    }
    struct fmu_functions fmi;
    void *library = system_open(arguments[1]);
    if (library == NULL || !find_functions(library, &fmi) ||
        (model = runs_read_model(arguments[2])) == NULL) {
        return 2;
    }

    struct job jobs[MOST_RUNS];
    void *items[MOST_RUNS];
    size_t count = 0;
    for (int i = 3; i < argument_count; i += 2) {
        jobs[count] = (struct job){&fmi, model, arguments[i], arguments[i + 1], false};
        items[count] = &jobs[count];
        count++;
    }
    bool has_succeeded = system_run_threads(run_job, items, count);
    for (size_t i = 0; i < count; i++) {
        has_succeeded = has_succeeded && jobs[i].has_succeeded;
    }
    free(model);
    return has_succeeded ? 0 : 1;
}
