#include "clock.h"

#include <math.h>

/* Of a step: what a master may call rounding at most. */
static const double largest_part = 0.01;

double clock_slack(double size, double h) {
    return fmax(fmin(1e-9 * fmax(size, h), largest_part * h), clock_rounding(size));
}

double clock_tick_slack(double size, double h, double drift) {
    const double rounding = clock_rounding(size);
    return fmax(fmin(drift + rounding, largest_part * h), rounding);
}
