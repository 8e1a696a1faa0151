/* What the host asks of the operating system: libraries, threads, and allocations that fail. */
#ifndef SYSTEM_H
#define SYSTEM_H

#include <stdbool.h>
#include <stddef.h>

/* NULL, and a line on stderr, if the library cannot be loaded. Stays loaded. */
void *system_open(const char *path);

/* Writes the address of the exported function to *function, a pointer to a function of any type.
 * False if the library has none of this name. */
bool system_find(void *library, const char *name, void *function);

/* Calls run(items[i]) for each i in a thread of its own, all at the same time; returns when all
 * have ended. False if a thread could not be started. */
bool system_run_threads(void (*run)(void *item), void *const *items, size_t count);

/* Puts the host in front of what this library calls to allocate, where the host can do that. */
void system_watch_allocations(void *library);

/* Allocation number `first` of the library from now on fails, 1 is the next one; if `all`, the
 * later ones too. For one thread. False if the library is not watched. */
bool system_fail_allocations(long first, bool all);

/* No more faults; how many allocations have failed. */
long system_stop_failing(void);

#endif
