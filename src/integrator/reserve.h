/* Memory that is taken once for an instance and given out to SUNDIALS, whose allocations then
 * cannot fail. Where they do, SUNDIALS 6 dereferences many of the null pointers, loses other blocks
 * and prints to stderr.
 *
 * It works in what is linked with the library reserved_allocation, as every FMU is; elsewhere a
 * reserve is never asked, and SUNDIALS allocates as usual. */
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

/* Between the two, which the same thread calls, its allocations are served from the reserve. Pairs
 * of different reserves may be nested; within a pair of an empty one, allocations are the program's
 * own again. */
NONNULL void reserve_enter(struct reserve *reserve);
NONNULL void reserve_leave(struct reserve *reserve);

/* Zeroed memory for any type from the reserve that this thread entered last. NULL where none is
 * entered, or there is not enough left. */
void *reserve_take(size_t size);

/* Bytes from memory to the end of the reserve that it lies in, of those that this thread has
 * entered; 0 where it lies elsewhere. A block that a reserve gave out is never freed by itself. */
size_t reserve_rest(const void *memory);

/* Takes back all that was given out since used was as much. */
NONNULL void reserve_cut(struct reserve *reserve, size_t used);

#endif
