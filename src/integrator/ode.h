/* An initial value problem x' = f(t, x), as the integrator sees it. */
#ifndef ODE_H
#define ODE_H

#include "model.h"
#include "status.h"

#include <stddef.h>
#include <stdint.h>

/* Writes f(t, x) to dx. t: s since the last restart; x, dx: one value per state, in its SI unit.
 * A status other than STATUS_OK, or a dx that is not finite, makes the integrator try a smaller
 * step. context: that of struct ode. */
typedef enum status ode_rhs(double t, const double x[], double dx[], void *context);

/* Writes the derivatives of f by x: J[i + state_count j] is that of f_i by x_j. As ode_rhs else. */
typedef enum status ode_jacobian(double t, const double x[], double J[], void *context);

/* Writes the Taylor coefficients of orders first to last of the solution that is at rows[i][0] at
 * the time t, as struct series does; time_scale: s. */
typedef enum status ode_series(double t, double time_scale, int first, int last,
                               double rows[][SERIES_LENGTH], void *context);

/* Writes all indicators at the time t and the state x to z. As ode_rhs else. */
typedef enum status ode_indicators(double t, const double x[], double z[], void *context);

/* Writes by how much rounding may change each indicator of the model, at a restart. */
typedef void ode_rounding(double rounding[], void *context);

/* Writes how far each state may move from x within an internal step, as struct model_events does.
 */
typedef void ode_reach(const double x[], double reach[], void *context);

/* What each step of `taylor` reads stands last, next to the rest of struct problem. */
struct ode {
    ode_rhs *rhs;
    ode_jacobian *jacobian; /* for INTEGRATOR_CVODE_BDF only */
    ode_indicators *indicators;
    ode_rounding *rounding;         /* NULL: it follows from the limits of the indicators */
    ode_reach *reach;               /* NULL: any way; asked where events are looked for */
    size_t indicator_count;         /* 0: no events */
    const size_t *row_of_indicator; /* as in struct series */
    ode_series *series;             /* for INTEGRATOR_TAYLOR only; NULL: there is none */
    size_t series_row_count;        /* >= state_count, where there is one */
    size_t state_count;             /* > 0 */
    void *context;
};

/* Every method: its code, whose number is the value of solver_method, and the struct method that
 * its file defines. A new method is a file and a line here. */
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
    double max_step;                   /* s: of internal steps; 0: no limit */
};

/* Totals since integrator_configure, and the last internal step. */
struct integrator_statistics {
    int64_t steps;           /* internal steps */
    int64_t rhs_evaluations; /* calls of the right-hand side, or series begun */
    int64_t failed_steps;    /* attempts that were refused */
    int64_t restarts;
    double last_step; /* s: length of the last internal step */
    int last_order;   /* its order */
};

/* Times in s after the restart. */
struct integrator_start {
    double origin;  /* time of the simulation at the restart, s: for messages only */
    double horizon; /* > 0: the right-hand side is not evaluated beyond, nor may integrator_advance
                    go there; INFINITY: no limit */
    double first_step; /* what integrator_next_step gave for a solution like this one; 0: none is
                          known */
    bool continues; /* the solution is the one that was integrated up to here: further advances are
                     likely */
    const struct indicator *indicators; /* those of the ode until the next restart; they must stay.
                                           NULL: no events are looked for */
};

/* Called after each internal step that ends before the t of an advance, with the state x there
 * (t, s since the last restart). True: the advance ends there. */
typedef bool integrator_observer(void *context, double t, const double x[]);

#endif
