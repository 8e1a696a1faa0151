/* An initial value problem x' = f(t, x), as the integrator sees it. */
#ifndef ODE_H
#define ODE_H

#include "status.h"

#include <stddef.h>

/* Writes f(t, x) to dx. t: s since the last restart; x, dx: one value per state, in its SI unit.
 * A status other than STATUS_OK, or a dx that is not finite, makes the integrator try a smaller
 * step. context: that of struct ode. */
typedef enum status ode_rhs(double t, const double x[], double dx[], void *context);

struct ode {
    size_t state_count; /* > 0 */
    ode_rhs *rhs;
    void *context;
};

#endif
