#include "allocations.h"

#include <stdlib.h>

static long count;

long allocation_count(void) {
    return count;
}

#ifdef __SANITIZE_ADDRESS__

// the sanitizer's own functions stay; declared as in its allocator_interface.h, which not every gcc
// comes with
int __sanitizer_install_malloc_and_free_hooks(void (*allocated)(const volatile void *, size_t),
                                              void (*freed)(const volatile void *));

static void count_one(const volatile void *memory, size_t size) {
    count++;
}

static void ignore(const volatile void *memory) {}

__attribute__((constructor)) static void install(void) {
    (void)__sanitizer_install_malloc_and_free_hooks(count_one, ignore);
}

#else

// glibc, and all that the program loads, calls the program's functions of these names; they in turn
// call glibc's, declared here
void *__libc_malloc(size_t size);
void *__libc_calloc(size_t items, size_t size);
void *__libc_realloc(void *memory, size_t size);

#define EXPORTED __attribute__((visibility("default")))

EXPORTED void *malloc(size_t size) {
    count++;
    return __libc_malloc(size);
}

EXPORTED void *calloc(size_t items, size_t size) {
    count++;
    return __libc_calloc(items, size);
}

EXPORTED void *realloc(void *memory, size_t size) {
    count++;
    return __libc_realloc(memory, size);
}

#endif
