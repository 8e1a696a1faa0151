/* The functions of reserve.h without a reserve: what SUNDIALS allocates comes from the program's
 * allocator, and goes back there. */
#include "reserve.h"

#include <stdlib.h>

bool reserve_create(struct reserve *reserve, size_t size) {
    (void)size;
    *reserve = (struct reserve){0};
    return true;
}

void reserve_destroy(struct reserve *reserve) {
    (void)reserve;
}

void reserve_enter(struct reserve *reserve) {
    (void)reserve;
}

void reserve_leave(struct reserve *reserve) {
    (void)reserve;
}

void reserve_cut(struct reserve *reserve, size_t used) {
    (void)reserve;
    (void)used;
}

void *reserve_malloc(size_t size) {
    return malloc(size);
}

void *reserve_calloc(size_t items, size_t size) {
    return calloc(items, size);
}

void *reserve_realloc(void *memory, size_t size) {
    return realloc(memory, size);
}

void reserve_free(void *memory) {
    free(memory);
}
