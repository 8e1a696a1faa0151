/* One call of any function of FMI 3.0, by name: for tables of what is allowed when. */
#ifndef FMU3_CALLS_H
#define FMU3_CALLS_H

#include "fmu3_harness.h"

/* Calls function with arguments that are sound in every state the function is allowed in, and
 * returns its status; functions that return something else give fmi3OK where it is right. now (s)
 * is the communication point for DoStep, whose step is fmu3_calls_step. FreeInstance frees the
 * instance. */
fmi3Status fmu3_call(enum fmu3_function function, fmi3Instance instance, double now);
extern const double fmu3_calls_step; /* s */

#endif
