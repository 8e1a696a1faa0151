#include "clock.h"

#include <float.h>
#include <math.h>

/* Exact sum of two doubles (Knuth, The Art of Computer Programming, vol. 2, section 4.2.2). */
static struct clock_time two_sum(double x, double y) {
    const double s = x + y;
    const double y_part = s - x;
    const double x_part = s - y_part;
    return (struct clock_time){.s = s, .rest = (x - x_part) + (y - y_part)};
}

struct clock_time clock_add(struct clock_time time, double span) {
    const struct clock_time sum = two_sum(time.s, span);
    return two_sum(sum.s, sum.rest + time.rest);
}

double clock_difference(struct clock_time later, struct clock_time earlier) {
    const struct clock_time difference = two_sum(later.s, -earlier.s);
    return difference.s + (difference.rest + (later.rest - earlier.rest));
}

double clock_slack(double t, double h) {
    const double relative = fmin(1e-9 * fmax(fabs(t), h), h / 100.0);
    return fmax(relative, DBL_EPSILON * fabs(t));
}
