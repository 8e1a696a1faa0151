#include "system.h"

#include <limits.h>
#include <stdio.h>
#include <string.h>

/* ---- Allocations that fail ------------------------------------------------------------------- */

static bool is_watched;
static long until_fault = LONG_MAX;
static long failed;
static bool fails_on;

bool system_fail_allocations(long first, bool all) {
    failed = 0;
    fails_on = all;
    until_fault = is_watched ? first : LONG_MAX;
    return is_watched;
}

long system_stop_failing(void) {
    until_fault = LONG_MAX;
    return failed;
}

#if defined(_WIN32) || defined(__linux__)
static bool is_refused(void) {
    if (until_fault == LONG_MAX || --until_fault > 0 || (until_fault < 0 && !fails_on)) {
        return false;
    }
    failed++;
    return true;
}
#endif

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

/* The functions that the library imported, and those that stand in front of them. */
static void *(*next_malloc)(size_t size);
static void *(*next_calloc)(size_t items, size_t size);
static void *(*next_realloc)(void *memory, size_t size);

static void *failing_malloc(size_t size) {
    return is_refused() ? NULL : next_malloc(size);
}

static void *failing_calloc(size_t items, size_t size) {
    return is_refused() ? NULL : next_calloc(items, size);
}

static void *failing_realloc(void *memory, size_t size) {
    return is_refused() ? NULL : next_realloc(memory, size);
}

/* A replacement for the import of this name; the address of the imported function goes to next. */
struct hook {
    const char *name;
    void *next;
    ULONG_PTR replacement;
};

static bool replace(IMAGE_THUNK_DATA *entry, const struct hook *hook) {
    DWORD access = 0;
    if (!VirtualProtect(entry, sizeof *entry, PAGE_READWRITE, &access)) {
        return false;
    }
    memcpy(hook->next, &entry->u1.Function, sizeof entry->u1.Function);
    entry->u1.Function = hook->replacement;
    return VirtualProtect(entry, sizeof *entry, access, &access) != 0;
}

/* Changes the library's table of imported addresses. */
void system_watch_allocations(void *library) {
    const struct hook hooks[] = {
        {"malloc", &next_malloc, (ULONG_PTR)failing_malloc},
        {"calloc", &next_calloc, (ULONG_PTR)failing_calloc},
        {"realloc", &next_realloc, (ULONG_PTR)failing_realloc},
    };
    char *base = library;
    const IMAGE_DOS_HEADER *dos = library;
    const IMAGE_NT_HEADERS *headers = (const void *)(base + dos->e_lfanew);
    const IMAGE_IMPORT_DESCRIPTOR *imports =
        (const void *)(base + headers->OptionalHeader.DataDirectory[IMAGE_DIRECTORY_ENTRY_IMPORT]
                                  .VirtualAddress);
    size_t replaced = 0;
    for (; imports->Name != 0; imports++) {
        const IMAGE_THUNK_DATA *names = (const void *)(base + imports->OriginalFirstThunk);
        IMAGE_THUNK_DATA *addresses = (void *)(base + imports->FirstThunk);
        for (; names->u1.AddressOfData != 0; names++, addresses++) {
            if (IMAGE_SNAP_BY_ORDINAL(names->u1.Ordinal)) {
                continue;
            }
            const IMAGE_IMPORT_BY_NAME *import = (const void *)(base + names->u1.AddressOfData);
            for (size_t i = 0; i < sizeof hooks / sizeof hooks[0]; i++) {
                if (strcmp((const char *)import->Name, hooks[i].name) == 0) {
                    replaced += replace(addresses, &hooks[i]);
                }
            }
        }
    }
    is_watched = replaced >= 2; // malloc and calloc at the least
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

#if defined(__linux__)

/* The loader binds the library's calls to the program's functions of these names; they call
 * glibc's, declared here. */
void *__libc_malloc(size_t size);
void *__libc_calloc(size_t items, size_t size);
void *__libc_realloc(void *memory, size_t size);

#define EXPORTED __attribute__((visibility("default")))

EXPORTED void *malloc(size_t size);
EXPORTED void *calloc(size_t items, size_t size);
EXPORTED void *realloc(void *memory, size_t size);

void *malloc(size_t size) {
    return is_refused() ? NULL : __libc_malloc(size);
}

void *calloc(size_t items, size_t size) {
    return is_refused() ? NULL : __libc_calloc(items, size);
}

void *realloc(void *memory, size_t size) {
    return is_refused() ? NULL : __libc_realloc(memory, size);
}

void system_watch_allocations(void *library) {
    is_watched = true;
}

#else

void system_watch_allocations(void *library) {}

#endif

#endif
