/* What the file of a method gives to integrator.c. States are arrays here: the types of a solver
 * library stay in the files that use it. */
#ifndef METHOD_H
#define METHOD_H

#include "problem.h"

/* What an advance did. */
struct method_work {
    int64_t steps;        /* internal steps */
    int64_t failed_steps; /* attempts that the method refused */
    int last_order;       /* of the last internal step; 0: there was none */
    double last_step;     /* its length, s */
    double internal;      /* where it ended, s since the restart */
    bool is_cut_short;    /* by an event or the observer */
};

struct method {
    /* As in the variable solver_method. */
    const char *name;

    /* The method runs at this fraction of the requested tolerance, because each restart adds an
     * error and thousands of them add up. Larger: faster and less accurate. */
    double tolerance_fraction;

    /* integrator_longest_history */
    int64_t longest_history;
    int64_t longest_history_with_events;

    /* Needs the series of the ode. */
    bool needs_series;

    /* Bytes that create allocates at most. */
    size_t (*memory_size)(const struct ode *ode);

    /* Allocates all that the method needs; nothing is allocated later. problem outlives the memory.
     * On failure *memory is NULL. */
    enum status (*create)(struct problem *problem, void **memory);
    void (*destroy)(void *memory);

    /* Takes over problem->settings. A restart follows. */
    enum status (*configure)(void *memory);

    /* Starts from x at time 0, with what stands in problem. */
    enum status (*restart)(void *memory, const double x[]);

    /* Integrates from problem->reached, where the state is begin_x, to t in max_steps internal
     * steps at most. Writes the last valid time to *stopped_at, also on failure, and the state
     * there to x. Where problem->observer is not NULL, asks it (problem_ends_at) about each
     * internal step that ends between problem->reached and t. Where problem->location is active,
     * searches each internal step, and ends at an event up to t. */
    enum status (*advance)(void *memory, double t, int64_t max_steps, const double begin_x[],
                           double *stopped_at, double x[], struct method_work *work);

    /* Writes the state at t, which the last internal step has passed, to x; false: it cannot, an
     * advance must. NULL with no history. */
    bool (*interpolate)(void *memory, double t, double x[]);

    /* Length of a first internal step after a restart from here, where the state is x, s; 0:
     * unknown.
     */
    double (*next_step)(void *memory, const double x[]);
};

#define METHOD_DECLARATION(code, symbol) extern const struct method symbol;
INTEGRATOR_METHOD_LIST(METHOD_DECLARATION)
#undef METHOD_DECLARATION

#endif
