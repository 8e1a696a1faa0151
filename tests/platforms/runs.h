/* Runs of FMI calls, and transcripts of what the FMU answers. A run is one of
 *
 *     everything             all that a platform may do differently
 *     steps:VARIANT:SHIFT    Co-Simulation, with derivatives, rollbacks and a second instance
 *
 * where VARIANT is a digit, and SHIFT of the first parameter is in 1/1024.
 *
 * A line of a transcript is the number of the call, the name of the function without fmi2, the
 * status, and the values as the hex digits of their bits: two transcripts are equal if and only if
 * all values, states and messages are. Messages stand before the line of their call: number, "log",
 * instance, status, category, text. */
#ifndef RUNS_H
#define RUNS_H

#include "../fmi_harness/fmu_library.h"

#include <stdio.h>

struct model;

/* Reads a file of model.py; the caller frees the result. NULL, with a line on stderr, if it cannot
 * be read. */
struct model *runs_read_model(const char *path);

/* True if every status is the expected one; else there is a line on stderr. */
bool runs_make(const struct fmu_functions *fmi, const struct model *model, const char *what,
               FILE *transcript);

#endif
