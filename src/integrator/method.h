/* A method of integration: the functions that its file gives to integrator.c, and the initial value
 * problem that it gets. States are arrays here: the types of a solver library stay in the files
 * that use it. */
#pragma once

#include "location.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* ---- The problem ---------------------------------------------------------------------------- */

/* The ode with its settings, the limits since the last restart, and a count of evaluations. Times
 * in s since the restart. */
struct problem {
    struct message_sink sink;
    double *failed_x; /* the state at failed_at */
    void *observer_context;
    struct location location;
    struct ode ode;
    struct integrator_settings settings;
    double origin;     /* time of the simulation at the restart, s: for messages only */
    double horizon;    /* time beyond which the right-hand side is not evaluated */
    double first_step; /* length of the first internal step, s; 0 if the method finds one */
    bool continues, is_after_event; /* as in struct integrator_start */
    double reached;                 /* end of the last advance; 0 after a restart */
    double failed_at; /* last time at which the right-hand side failed; -INFINITY if it never did */
    int steps_since_settled;
    int64_t evaluation_count;      /* calls of the right-hand side, or series begun */
    integrator_observer *observer; /* NULL if there is none */
};

/* Asks the observer whether the advance ends at t, the end of an internal step with the state x. */
static inline bool problem_ask_observer(const struct problem *problem, double t, const double x[]) {
    return problem->observer(problem->observer_context, t, x);
}

/* True if all values are finite: 0 x is 0 for finite values only. Four sums do not wait for each
 * other. */
static inline bool problem_are_finite(const double values[], size_t count) {
    double sum[4] = {0.0};
    size_t i = 0;
    for (; i + 4 <= count; i += 4) {
        for (size_t k = 0; k < 4; k++) {
            sum[k] += 0.0 * values[i + k];
        }
    }
    for (; i < count; i++) {
        sum[0] += 0.0 * values[i];
    }
    return sum[0] + sum[1] + (sum[2] + sum[3]) == 0.0;
}

/* Notes that the equations cannot be evaluated at t and x. */
static inline enum status problem_fail(struct problem *problem, double t, const double x[]) {
    problem->failed_at = t;
    memmove(problem->failed_x, x, problem->ode.state_count * sizeof *x);
    return STATUS_NOT_FINITE;
}

/* Writes f(t, x) to dx. Returns STATUS_NOT_FINITE if that fails or is not finite. Inline, because
 * these calls are most of a step. */
static inline enum status problem_rhs(struct problem *problem, double t, const double x[],
                                      double dx[]) {
    const struct ode *ode = &problem->ode;
    problem->evaluation_count++;
    if (ode->rhs(t, x, dx, ode->context) == STATUS_OK && problem_are_finite(dx, ode->state_count)) {
        return STATUS_OK;
    }
    return problem_fail(problem, t, x);
}

/* Internal steps between calls of settle: one costs as much as a right-hand side. */
enum { PROBLEM_SETTLES = 4 };

/* Tells the ode, now and then, that an internal step has ended at t with the state x. */
static inline void problem_settle(struct problem *problem, double t, const double x[]) {
    if (problem->ode.settle != NULL && ++problem->steps_since_settled == PROBLEM_SETTLES) {
        problem->steps_since_settled = 0;
        problem->ode.settle(t, x, problem->ode.context);
    }
}

/* Distance from the end of a solution that is as good as none, over the time since the restart. */
#define PROBLEM_END 1e-12

/* True if a solution that is known at `begin` and unknown at t ends so near that the end has been
 * found. */
static inline bool problem_has_ended(const struct problem *problem, double begin, double t) {
    const double nearest =
        fmax(PROBLEM_END * begin, 4.0 * DBL_EPSILON * fabs(problem->origin + begin));
    return problem->ode.may_end && t > begin && t - begin <= nearest;
}

/* True if the method is stuck in front of a time at which the right-hand side cannot be evaluated.
 */
static inline bool problem_is_stuck(const struct problem *problem) {
    return problem->failed_at >= problem->reached;
}

/* ---- The method ----------------------------------------------------------------------------- */

/* Work and end of an advance. */
struct method_work {
    int64_t steps;        /* internal steps */
    int64_t failed_steps; /* attempts that the method refused */
    int last_order;       /* order of the last internal step; 0 if there was none */
    double last_step;     /* length of the last internal step, s */
    double internal;      /* end of the last internal step, s since the restart */
    bool is_cut_short;    /* true if an event or the observer ended the advance */
};

struct method {
    /* Name, as in the variable solver_method. */
    const char *name;

    /* Fraction of the requested tolerance at which the method runs, because each restart adds an
     * error and thousands of them add up. Larger: faster and less accurate. */
    double tolerance_fraction;

    /* Results of integrator_longest_history. */
    int64_t longest_history;
    int64_t longest_history_with_events;

    /* True if the method needs the series of the ode. */
    bool needs_series;

    /* Returns the largest number of bytes that create allocates. */
    size_t (*memory_size)(const struct ode *ode);

    /* Allocates all memory of the method; nothing is allocated later. problem outlives the memory.
     * On failure *memory is NULL. */
    enum status (*create)(struct problem *problem, void **memory);
    void (*destroy)(void *memory);

    /* Applies problem->settings. A restart follows. */
    enum status (*configure)(void *memory);

    /* Starts from x at time 0, with the values in problem. */
    enum status (*restart)(void *memory, const double x[]);

    /* Integrates from problem->reached, with the state begin_x there, to t in max_steps internal
     * steps at most. Writes the last valid time to *stopped_at, also on failure, and the state
     * there to x. Asks problem->observer, unless NULL, by problem_ask_observer about each internal
     * step that ends between problem->reached and t. If problem->location is active, searches each
     * internal step, and ends at an event up to t. */
    enum status (*advance)(void *memory, double t, int64_t max_steps, const double begin_x[],
                           double *stopped_at, double x[], struct method_work *work);

    /* Writes the state at t, which the last internal step has passed, to x. Returns false if it
     * cannot, so that an advance must. NULL for a method without history. */
    bool (*interpolate)(void *memory, double t, double x[]);

    /* Returns the length of a first internal step after a restart here with the state x, s; 0 if
     * unknown. */
    double (*next_step)(void *memory, const double x[]);
};

#define METHOD_DECLARATION(code, symbol) extern const struct method symbol;
INTEGRATOR_METHOD_LIST(METHOD_DECLARATION)
#undef METHOD_DECLARATION
