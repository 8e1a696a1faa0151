/* One call of any function of the FMU, by name: for tables of what is allowed when. */
#ifndef FMU_CALLS_H
#define FMU_CALLS_H

#include "fmu_harness.h"

/* Calls function with arguments that are sound in every state the function is allowed in, and
 * returns its status; functions that return something else give fmi2OK where it is right. now (s)
 * is the communication point and step (s) the step for DoStep. FreeInstance frees the component, of
 * which fmu_tear_down then knows nothing any more; Instantiate makes and frees another one. */
fmi2Status fmu_call(enum fmu_function function, fmi2Component component, double now, double step);

#endif
