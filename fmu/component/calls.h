/* Rules of calls: which function may be called in which state, by an instance of which kind. Each
 * FMI version has a table of them in its own folder. */
#ifndef CALLS_H
#define CALLS_H

/* States of an instance in FMI, one bit each. */
enum fmi_state {
    STATE_INSTANTIATED = 1 << 0,
    STATE_INITIALIZATION = 1 << 1,
    STATE_TERMINATED = 1 << 2,
    STATE_ERROR = 1 << 3,
    // Co-Simulation
    STATE_STEP_COMPLETE = 1 << 4,
    STATE_STEP_FAILED = 1 << 5,
    // Model Exchange, and Co-Simulation with event mode
    STATE_EVENT = 1 << 6,
    // Model Exchange
    STATE_CONTINUOUS_TIME = 1 << 7,
    // Co-Simulation, inside a step
    STATE_INTERMEDIATE_UPDATE = 1 << 8,
};

enum fmi_kind {
    KIND_MODEL_EXCHANGE = 1 << 0,
    KIND_CO_SIMULATION = 1 << 1,
    KIND_CO_SIMULATION_WITH_EVENTS = 1 << 2, /* the importer handles events, in event mode */
};

struct call_rule {
    const char *name;
    unsigned kinds;  /* bits of enum fmi_kind */
    unsigned states; /* bits of enum fmi_state */
};

#endif
