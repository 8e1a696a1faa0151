/* An initial value problem x' = f(t, x), with the settings of its integration: all that a method
 * and its caller share. */
#pragma once

#include "model.h"
#include "status.h"

#include <stddef.h>
#include <stdint.h>

/* Writes f(t, x) to dx. t: s since the last restart; x, dx: one value per state, in its SI unit.
 * After a status other than STATUS_OK, or a dx that is not finite, the integrator tries a smaller
 * step. context: the pointer in struct ode. */
typedef enum status ode_rhs(double t, const double x[], double dx[], void *context);

/* Writes the Jacobian of f without gradients: J[i + n j] is the derivative of f_i by x_j, or as a
 * band (model.h). n: ode_count_without_gradients. Otherwise like ode_rhs. */
typedef enum status ode_jacobian(double t, const double x[], double J[], void *context);

/* Writes the Taylor coefficients of orders first to last of the solution through rows[i][0] at the
 * time t, like `extend` of struct series; time_scale: s. */
typedef enum status ode_series(double t, double time_scale, int first, int last,
                               double rows[][SERIES_LENGTH], void *context);

/* Writes all indicators at the time t and the state x to z. Otherwise like ode_rhs. */
typedef enum status ode_indicators(double t, const double x[], double z[], void *context);

/* Writes a bound of each indicator's error at a restart, from errors of the states. */
typedef void ode_rounding(const double state_errors[], double errors[], void *context);

/* Writes how far each state may move from x within an internal step, like `reach` of struct
 * model_events. */
typedef void ode_reach(const double x[], double reach[], void *context);

/* Tells that the solution has come to x at the time t: later calls are near to it. */
typedef void ode_settle(double t, const double x[], void *context);

/* The fields that each step of `taylor` reads stand last, next to the rest of struct problem. */
struct ode {
    ode_rhs *rhs;
    ode_jacobian *jacobian;  /* for INTEGRATOR_CVODE_BDF only */
    const struct band *band; /* of the Jacobian; NULL: a full one */
    ode_indicators *indicators;
    ode_rounding *rounding;    /* NULL if it follows from the limits of the indicators */
    ode_reach *reach;          /* called if events are searched; NULL if any distance is allowed */
    size_t indicator_count;    /* 0 without events */
    const struct series *rows; /* what its rows are; NULL if they are states only */
    ode_series *series;        /* for INTEGRATOR_TAYLOR only; NULL if the model has none */
    size_t series_row_count;   /* >= state_count if there is a series */
    ode_settle *settle;        /* called after some internal steps; NULL if nothing depends on it */
    bool may_end; /* true if solutions may end: then a method does not creep up to such an end */
    unsigned gradient_count; /* copies of the states behind them, as in struct model */
    size_t state_count;      /* > 0, with all copies */
    void *context;
};

/* Returns the number of states that are no gradients of others. */
static inline size_t ode_count_without_gradients(const struct ode *ode) {
    return ode->state_count / (1 + ode->gradient_count);
}

/* Returns the number of elements of J. */
static inline size_t ode_jacobian_size(const struct ode *ode) {
    const struct band *band = ode->band;
    const size_t n = ode_count_without_gradients(ode);
    return n * (band == NULL ? n : 2 * band->lower + band->upper + 1);
}

/* List of all methods: the code, whose number is the value of solver_method, and the struct method
 * that its file defines. A new method is a file and a line here. */
#define INTEGRATOR_METHOD_LIST(X)                                                                  \
    /* CVODE, multistep of orders 1 to 12, fixed-point iteration */                                \
    X(INTEGRATOR_CVODE_ADAMS, integrator_cvode_adams)                                              \
    /* CVODE, for stiff equations: orders 1 to 5, Newton with the Jacobian */                      \
    X(INTEGRATOR_CVODE_BDF, integrator_cvode_bdf)                                                  \
    /* explicit Runge-Kutta of order 5 (ARKODE's ERKStep) */                                       \
    X(INTEGRATOR_ERK, integrator_erk)                                                              \
    /* Taylor series of orders 5 to 25 */                                                          \
    X(INTEGRATOR_TAYLOR, integrator_taylor)

#define INTEGRATOR_METHOD_CODE(code, symbol) code,
enum integrator_method {
    INTEGRATOR_NO_METHOD,
    INTEGRATOR_METHOD_LIST(INTEGRATOR_METHOD_CODE) INTEGRATOR_METHODS,
};
#undef INTEGRATOR_METHOD_CODE

struct integrator_settings {
    enum integrator_method method;
    double relative_tolerance;         /* > 0, of every internal step */
    const double *absolute_tolerances; /* > 0, one per state in its unit; copied */
    double max_step;                   /* longest internal step, s; 0 without limit */
};

/* Totals since integrator_configure, and the last internal step. */
struct integrator_statistics {
    int64_t steps;           /* internal steps */
    int64_t rhs_evaluations; /* calls of the right-hand side, or series begun */
    int64_t failed_steps;    /* attempts that were refused */
    int64_t restarts;
    double last_step; /* length of the last internal step, s */
    int last_order;   /* order of the last internal step */
};

/* Start of an integration. Times in s since the restart. */
struct integrator_start {
    double origin;       /* time of the simulation at the restart, s: for messages only */
    double horizon;      /* > 0: neither the right-hand side is evaluated beyond it, nor may
                            integrator_advance go there; INFINITY without limit */
    double first_step;   /* integrator_next_step of a solution like this one; 0 if unknown */
    bool continues;      /* true if the solution is the one that was integrated up to here: further
                            advances are likely */
    bool is_after_event; /* true if it continues after an event: the next one may be near */
    const struct indicator *indicators; /* indicators of the ode until the next restart; they must
                                           stay. NULL to search no events */
    bool keeps_indicators;              /* true if they are as at the last restart */
};

/* Observes each internal step that ends before the t of an advance; x: the state at its end t (s
 * since the last restart). Returns true to end the advance there. */
typedef bool integrator_observer(void *context, double t, const double x[]);
