#define _GNU_SOURCE // RTLD_NEXT

#include "allocator.h"

#include <dlfcn.h>
#include <limits.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#define EXPORTED __attribute__((visibility("default")))

static struct {
    void *(*malloc)(size_t size);
    void *(*calloc)(size_t items, size_t size);
    void *(*realloc)(void *memory, size_t size);
    void (*free)(void *memory);
} next;

static long outstanding;
static long calls;
static long failed;
static long until_fault = LONG_MAX;
static enum allocator_fault kind;

void allocator_fail(long first, enum allocator_fault fault) {
    failed = 0;
    kind = fault;
    until_fault = first;
}

long allocator_stop(void) {
    until_fault = LONG_MAX;
    return failed;
}

long allocator_outstanding(void) {
    return outstanding;
}

long allocator_calls(void) {
    return calls;
}

/* ---- In front of the next allocator --------------------------------------------------------- */

/* For the dynamic linker, which may allocate while it looks for the next allocator. */
static max_align_t first_memory[1024];
static size_t first_used;

static void *take_first(size_t size) {
    const size_t count = (size + sizeof first_memory[0] - 1) / sizeof first_memory[0];
    if (count > sizeof first_memory / sizeof first_memory[0] - first_used) {
        return NULL;
    }
    first_used += count;
    return &first_memory[first_used - count];
}

static bool is_first(const void *memory) {
    return (const char *)memory >= (const char *)first_memory &&
           (const char *)memory < (const char *)first_memory + sizeof first_memory;
}

static void find(const char *name, void *function) {
    void *symbol = dlsym(RTLD_NEXT, name);
    // as POSIX has it: a function pointer is the bytes of the object pointer
    memcpy(function, &symbol, sizeof symbol);
}

static bool has_next(void) {
    static bool is_looking;
    if (next.free == NULL && !is_looking) {
        is_looking = true;
        find("malloc", &next.malloc);
        find("calloc", &next.calloc);
        find("realloc", &next.realloc);
        find("free", &next.free);
        is_looking = false;
    }
    return next.free != NULL;
}

static bool is_refused(void) {
    calls++;
    if (until_fault == LONG_MAX || --until_fault > 0 ||
        (until_fault < 0 && kind == ALLOCATOR_ONE)) {
        return false;
    }
    failed++;
    return true;
}

static void *counted(void *memory) {
    outstanding += memory != NULL;
    return memory;
}

EXPORTED void *malloc(size_t size) {
    if (!has_next()) {
        return take_first(size);
    }
    return is_refused() ? NULL : counted(next.malloc(size));
}

EXPORTED void *calloc(size_t items, size_t size) {
    if (!has_next()) {
        return take_first(items * size); // never used before: zeros
    }
    return is_refused() ? NULL : counted(next.calloc(items, size));
}

EXPORTED void *realloc(void *memory, size_t size) {
    if (memory == NULL) {
        return malloc(size);
    }
    return is_first(memory) || is_refused() ? NULL : next.realloc(memory, size);
}

EXPORTED void free(void *memory) {
    if (memory == NULL || is_first(memory)) {
        return;
    }
    outstanding--;
    next.free(memory);
}
