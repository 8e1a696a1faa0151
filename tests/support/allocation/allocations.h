/* Counts allocations of the program and of all that it loads: link with allocations.c. */
#ifndef ALLOCATIONS_H
#define ALLOCATIONS_H

/* Calls of malloc, calloc and realloc since the program started. */
long allocation_count(void);

#endif
