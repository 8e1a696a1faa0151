/* Memory that is taken once for an instance and given out to SUNDIALS, whose allocations then
 * cannot fail. Where they do, SUNDIALS 6 dereferences many of the null pointers, loses other blocks
 * and prints to stderr.
 *
 * SUNDIALS is compiled with the four functions of the allocator below in place of the standard
 * ones (sundials_allocation.h); nothing else in the program is. */
#ifndef RESERVE_H
#define RESERVE_H

#include "platform.h"

#include <stdbool.h>
#include <stddef.h>

struct reserve {
    char *block; /* NULL: there is none */
    size_t size; /* bytes */
    size_t used;
    size_t slot;           /* of the thread that has entered it */
    struct reserve *outer; /* that the thread had entered before */
};

/* False where memory is short; the reserve is then empty. */
MUST_CHECK NONNULL bool reserve_create(struct reserve *reserve, size_t size);

/* Frees all that was given out. Empty is allowed. */
NONNULL void reserve_destroy(struct reserve *reserve);

/* Between the two, which the same thread calls, the functions below serve it from the reserve.
 * Pairs of different reserves may be nested: the one entered last serves. */
NONNULL void reserve_enter(struct reserve *reserve);
NONNULL void reserve_leave(struct reserve *reserve);

/* Takes back all that was given out since used was as much. */
NONNULL void reserve_cut(struct reserve *reserve, size_t used);

/* Zeroed memory for any type. NULL where no reserve is entered, or there is not enough left. */
MUST_CHECK void *reserve_malloc(size_t size);
MUST_CHECK void *reserve_calloc(size_t items, size_t size);

/* As reserve_malloc, with what is in memory, which comes from the same reserve or is NULL. */
MUST_CHECK void *reserve_realloc(void *memory, size_t size);

/* Does nothing: memory comes back with the whole reserve. */
void reserve_free(void *memory);

#endif
