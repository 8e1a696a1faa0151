/* Counts allocations: link with allocations.c and the option --wrap for each function. */
#ifndef ALLOCATIONS_H
#define ALLOCATIONS_H

/* Calls of malloc, calloc and realloc since the program started. */
long allocation_count(void);

#endif
