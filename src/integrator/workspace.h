/* Memory that is taken once for an instance and given out to SUNDIALS, whose allocations then
 * cannot fail. If they do, SUNDIALS 6 dereferences many of the null pointers, loses other blocks
 * and prints to stderr.
 *
 * SUNDIALS is compiled with the four functions of the allocator below in place of the standard ones
 * (sundials_allocation.h); nothing else in the program is. */
#pragma once

#include "platform.h"

#include <stdbool.h>
#include <stddef.h>

struct workspace {
    char *block; /* NULL if there is none */
    size_t size; /* bytes */
    size_t used;
    size_t slot;             /* slot of the thread that has entered it */
    struct workspace *outer; /* workspace that the thread had entered before */
};

/* Takes the memory. Returns false if memory is short; the workspace is then empty. */
MUST_CHECK NONNULL bool workspace_create(struct workspace *workspace, size_t size);

/* Frees all memory; an empty workspace is allowed. */
NONNULL void workspace_destroy(struct workspace *workspace);

/* Begin and end a time in which the functions below serve the calling thread from the workspace.
 * Pairs of different workspaces may be nested: the one entered last serves. */
NONNULL void workspace_enter(struct workspace *workspace);
NONNULL void workspace_leave(struct workspace *workspace);

/* Takes back all memory that was given out since `used` had this value. */
NONNULL void workspace_cut(struct workspace *workspace, size_t used);

/* Return zeroed memory for any type; NULL if no workspace is entered, or too little is left. */
MUST_CHECK void *workspace_malloc(size_t size);
MUST_CHECK void *workspace_calloc(size_t items, size_t size);

/* Returns new memory with the content of `memory`, which comes from the same workspace or is NULL.
 */
MUST_CHECK void *workspace_realloc(void *memory, size_t size);

/* Does nothing: memory comes back with the whole workspace. */
void workspace_free(void *memory);
