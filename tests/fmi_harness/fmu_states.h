/* The states of the two state machines of FMI 2.0, by letter, and how an instance gets there.
 * Co-Simulation (section 4.2.4): I instantiated, M initialization mode, C step complete, F step
 * failed, T terminated, E error. Model Exchange (section 3.2.3): I, M, V event mode, N
 * continuous-time mode, T, E. */
#ifndef FMU_STATES_H
#define FMU_STATES_H

#include "fmu_harness.h"

struct fmu_state {
    char letter;
    const char *name;        /* as messages put it */
    enum fmu_function proof; /* works here, but not in the error state */
};

enum { FMU_STATES_PER_KIND = 6 };
extern const struct fmu_state fmu_co_simulation_states[FMU_STATES_PER_KIND];
extern const struct fmu_state fmu_model_exchange_states[FMU_STATES_PER_KIND];

/* The states of a kind of instance. */
const struct fmu_state *fmu_states_of(fmi2Type type);
const struct fmu_state *fmu_state_of(fmi2Type type, char letter);

/* An instance in this state whose simulation has started at 0 s. Messages are cleared. */
fmi2Component fmu_reach(fmi2Type type, const struct fmu_state *state, struct fmu_log *log);

/* Fails the test unless the instance, at time now (s), is in this state. The proof is called: the
 * instance is then where that takes it. */
void fmu_assert_in_state(fmi2Component component, const struct fmu_state *state, double now,
                         struct fmu_log *log, const char *message);

#endif
