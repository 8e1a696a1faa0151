#include "clock.h"

#include <math.h>

double clock_slack(double t, double h) {
    const double relative = fmin(1e-9 * fmax(fabs(t), h), h / 100.0);
    return fmax(relative, clock_spacing(t));
}
