/* What the file of a method gives to integrator.c, and the initial value problem as a method sees
 * it. States are arrays here: the types of a solver library stay in the files that use it. */
#ifndef METHOD_H
#define METHOD_H

#include "location.h"

/* ---- The problem ---------------------------------------------------------------------------- */

/* The ode with its settings, the limits since the last restart, and a count of evaluations. Times
 * in s since the restart. */
struct problem {
    struct message_sink sink;
    struct ode ode;
    struct integrator_settings settings;
    double origin;            /* time of the simulation at the restart, s: for messages only */
    double horizon;           /* the right-hand side is not evaluated beyond */
    double first_step;        /* length of the first internal step, s; 0: the method finds one */
    bool continues;           /* as in struct integrator_start */
    double reached;           /* where the last advance ended; 0 after a restart */
    double failed_at;         /* last time at which the right-hand side failed; -INFINITY: none */
    int64_t evaluation_count; /* calls of the right-hand side; series begun */
    integrator_observer *observer; /* NULL: none */
    void *observer_context;
    struct location location;
};

/* Whether the observer ends the advance at t, the end of an internal step, where the state is x. */
static inline bool problem_ask_observer(const struct problem *problem, double t, const double x[]) {
    return problem->observer(problem->observer_context, t, x);
}

/* All values are finite: 0 x is 0 for finite values only. */
static inline bool problem_are_finite(const double values[], size_t count) {
    double sum = 0.0;
    for (size_t i = 0; i < count; i++) {
        sum += 0.0 * values[i];
    }
    return sum == 0.0;
}

/* Writes f(t, x) to dx; STATUS_NOT_FINITE if that fails or is not finite. Inline, as these calls
 * are most of a step. */
static inline enum status problem_rhs(struct problem *problem, double t, const double x[],
                                      double dx[]) {
    const struct ode *ode = &problem->ode;
    problem->evaluation_count++;
    if (ode->rhs(t, x, dx, ode->context) == STATUS_OK && problem_are_finite(dx, ode->state_count)) {
        return STATUS_OK;
    }
    problem->failed_at = t;
    return STATUS_NOT_FINITE;
}

/* Writes the Jacobian as in ode.h; fails as problem_rhs. */
static inline enum status problem_jacobian(struct problem *problem, double t, const double x[],
                                           double J[]) {
    const struct ode *ode = &problem->ode;
    if (ode->jacobian(t, x, J, ode->context) == STATUS_OK &&
        problem_are_finite(J, ode->state_count * ode->state_count)) {
        return STATUS_OK;
    }
    problem->failed_at = t;
    return STATUS_NOT_FINITE;
}

/* Writes coefficients as in ode.h; the orders from 0 on count as an evaluation. Fails as
 * problem_rhs; whether they are finite is for the caller to see. */
static inline enum status problem_series(struct problem *problem, double t, double time_scale,
                                         int first, int last, double rows[][SERIES_LENGTH]) {
    const struct ode *ode = &problem->ode;
    problem->evaluation_count += first == 0 ? 1 : 0;
    if (ode->series(t, time_scale, first, last, rows, ode->context) == STATUS_OK) {
        return STATUS_OK;
    }
    problem->failed_at = t;
    return STATUS_NOT_FINITE;
}

/* Stuck in front of a time at which the right-hand side cannot be evaluated. */
static inline bool problem_is_stuck(const struct problem *problem) {
    return problem->failed_at >= problem->reached;
}

/* ---- The method ----------------------------------------------------------------------------- */

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
     * there to x. Where problem->observer is not NULL, asks it (problem_ask_observer) about each
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
