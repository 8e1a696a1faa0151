#include "system.h"

#include <stdio.h>
#include <string.h>

#if defined(_WIN32)

/* ---- Windows --------------------------------------------------------------------------------- */

#define WIN32_LEAN_AND_MEAN
#include <process.h>
#include <windows.h>

void *system_open(const char *path) {
    const HMODULE library = LoadLibraryA(path);
    if (library == NULL) {
        fprintf(stderr, "%s: error %lu\n", path, GetLastError());
    }
    return (void *)library;
}

bool system_find(void *library, const char *name, void *function) {
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

bool system_run_threads(void (*run)(void *item), void *const *items, size_t count) {
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

void *system_open(const char *path) {
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) {
        fprintf(stderr, "%s\n", dlerror());
    }
    return library;
}

bool system_find(void *library, const char *name, void *function) {
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

bool system_run_threads(void (*run)(void *item), void *const *items, size_t count) {
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
