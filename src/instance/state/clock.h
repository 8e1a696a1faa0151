/* Time of an instance, kept as an unevaluated sum of two doubles. Communication points far from
 * zero are coarse (1e-10 s apart at 1e6 s) and masters round them again at every step; with the
 * rounding carried along, the time that is integrated is exactly the time that has passed. */
#ifndef CLOCK_H
#define CLOCK_H

#include <float.h>
#include <math.h>

struct clock_time {
    double s;    /* s: the time, rounded to double */
    double rest; /* s: what the rounding left over */
};

/* Exact sum of two doubles (Knuth, The Art of Computer Programming, vol. 2, section 4.2.2). */
static inline struct clock_time clock_two_sum(double x, double y) {
    const double s = x + y;
    const double y_part = s - x;
    const double x_part = s - y_part;
    return (struct clock_time){.s = s, .rest = (x - x_part) + (y - y_part)};
}

/* time + duration */
static inline struct clock_time clock_add(struct clock_time time, double duration) {
    const struct clock_time sum = clock_two_sum(time.s, duration);
    return clock_two_sum(sum.s, sum.rest + time.rest);
}

/* later - earlier in s, rounded once. */
static inline double clock_difference(struct clock_time later, struct clock_time earlier) {
    const struct clock_time difference = clock_two_sum(later.s, -earlier.s);
    return difference.s + (difference.rest + (later.rest - earlier.rest));
}

/* Of doubles at t, at most. */
static inline double clock_spacing(double t) {
    return DBL_EPSILON * fabs(t);
}

/* How far the communication point of a master may be from the time of the instance for a step of
 * length h > 0 to be followed: min(1e-9 max(|t|, h), h / 100), and never less than clock_spacing.
 * s. */
double clock_slack(double t, double h);

#endif
