/* What the host asks of the operating system: libraries and threads. */
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

#endif
