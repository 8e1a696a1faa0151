/* The allocator of the whole program, the loaded FMU included, which fails on demand and counts.
 * Linked into a program it stands in front of the C library's, or of a sanitizer's: every block
 * still comes from there. For programs of one thread. */
#ifndef ALLOCATOR_H
#define ALLOCATOR_H

#include <stdbool.h>

enum allocator_fault {
    ALLOCATOR_ONE, /* a single allocation fails */
    ALLOCATOR_ALL, /* and all later ones */
};

/* Allocation number first from now on fails, 1 is the next one. */
void allocator_fail(long first, enum allocator_fault fault);

/* No more faults; how many allocations have failed since allocator_fail. */
long allocator_stop(void);

/* Blocks that are allocated and not freed. */
long allocator_outstanding(void);

/* Allocations that were given or refused since the program started. */
long allocator_calls(void);

#endif
