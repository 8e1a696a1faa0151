/* The calls of a script, one function each: reads its arguments from the line, calls the FMU and
 * writes a line of the transcript without its end. */
#ifndef CALLS_H
#define CALLS_H

#include "run.h"

typedef void call_function(struct run *run);

/* By its name in a script; NULL if there is none. */
call_function *call_find(const char *name);

#endif
