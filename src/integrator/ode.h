/* An initial value problem x' = f(t, x), as the integrator sees it. */
#ifndef ODE_H
#define ODE_H

#include "events.h"
#include "series.h"
#include "status.h"

#include <stddef.h>

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

#endif
