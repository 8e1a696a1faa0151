/* Runs a script of FMI calls and writes a transcript of what the FMU answers. Numbers are the hex
 * digits of their bits, so that two transcripts are equal if and only if all values, states and
 * messages are.
 *
 * A line of a script is a call: the name of the function without fmi2, the place of the instance,
 * and its arguments. A word "-" is NULL. Places of instances, FMU states and bytes are 0 to 7.
 *
 *     SetReal 0  20 3ff0000000000000  21 4000000000000000     value reference, value, ...
 *     DoStep 0  0000000000000000 3f847ae147ae147b             time, step
 *     SerializeFMUstate 0 2 1                                 instance, state, bytes
 *
 * Further commands: "bytes 1 434f..." fills bytes; "Euler 0 4 h" makes a step of Euler's method
 * with 4 states.
 *
 * A line of the transcript is the number of the line in the script, the name, the status, and the
 * values. Messages stand before the line of their call: number, "log", instance, status, category,
 * text. */
#ifndef SCRIPT_H
#define SCRIPT_H

#include "../fmi_harness/fmu_library.h"

#include <stdio.h>

/* text: the script, which is written to. False, and a line on stderr, if it has a mistake. */
bool script_run(const struct fmu_functions *fmi, char *text, FILE *transcript);

#endif
