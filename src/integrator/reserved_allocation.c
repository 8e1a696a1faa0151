/* Stands in front of the allocator for all that is linked with it, by the linker's option --wrap,
 * whose names these are. */
#include "reserve.h"

#include <stdint.h>
#include <string.h>

// NOLINTBEGIN(bugprone-reserved-identifier, cert-dcl37-c, cert-dcl51-cpp)
void *__real_malloc(size_t size);
void *__real_calloc(size_t items, size_t size);
void *__real_realloc(void *memory, size_t size);
void __real_free(void *memory);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t items, size_t size);
void *__wrap_realloc(void *memory, size_t size);
void __wrap_free(void *memory);

void *__wrap_malloc(size_t size) {
    void *taken = reserve_take(size);
    return taken != NULL ? taken : __real_malloc(size);
}

void *__wrap_calloc(size_t items, size_t size) {
    void *taken = size == 0 || items <= SIZE_MAX / size ? reserve_take(items * size) : NULL;
    return taken != NULL ? taken : __real_calloc(items, size);
}

void *__wrap_realloc(void *memory, size_t size) {
    const size_t rest = reserve_rest(memory);
    if (memory != NULL && rest == 0) {
        return __real_realloc(memory, size);
    }
    void *taken = __wrap_malloc(size);
    if (taken != NULL && memory != NULL) {
        memmove(taken, memory, size < rest ? size : rest); // the block was not longer than rest
    }
    return taken;
}

void __wrap_free(void *memory) {
    if (reserve_rest(memory) == 0) {
        __real_free(memory);
    }
}
// NOLINTEND(bugprone-reserved-identifier, cert-dcl37-c, cert-dcl51-cpp)
