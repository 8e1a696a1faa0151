/* The states of the two state machines, by letter, and how an instance gets there; one call of
 * any function, by name. Co-Simulation
 * (FMI 2.0, section 4.2.4): I instantiated, M initialization mode, C step complete, F step failed,
 * T terminated, E error. Model Exchange (section 3.2.3): I, M, V event mode, N continuous-time
 * mode, T, E. FMI 3.0 has neither F nor E: an error leads to T. */
#ifndef FMI_STATES_H
#define FMI_STATES_H

#include "fmu_harness.h"

/* Calls function with arguments that are sound in every state the function is allowed in, and
 * returns its status; functions that return something else give fmi2OK where it is right. now (s)
 * is the communication point and step (s) the step for DoStep. FreeInstance frees the component, of
 * which fmu_tear_down then knows nothing any more; Instantiate makes and frees another one. */
fmi2Status fmu_call(enum fmu_function function, fmi2Component component, double now, double step);

/* The states of a kind of instance. */
const struct fmi_states *fmi_states_of(fmi2Type type);
const struct fmi_state *fmi_state_of(fmi2Type type, char letter);

/* An instance in this state whose simulation has started at 0 s. Messages are cleared. */
fmi2Component fmu_reach(fmi2Type type, const struct fmi_state *state, struct fmu_log *log);

/* Fails the test unless the instance, at time now (s), is in this state. The proof is called: the
 * instance is then where that takes it. */
void fmu_assert_in_state(fmi2Component component, const struct fmi_state *state, double now,
                         struct fmu_log *log, const char *message);

#endif
