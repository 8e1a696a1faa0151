/* Time of an instance, kept as an unevaluated sum of two doubles. Communication points far from
 * zero are coarse (1e-10 s apart at 1e6 s) and masters round them again at every step; with the
 * rounding carried along, the time that is integrated is exactly the time that has passed. */
#ifndef CLOCK_H
#define CLOCK_H

struct clock_time {
    double s;    /* s: the time, rounded to double */
    double rest; /* s: what the rounding left over */
};

/* time + span */
struct clock_time clock_add(struct clock_time time, double span);

/* later - earlier in s, rounded once. */
double clock_difference(struct clock_time later, struct clock_time earlier);

/* How far the communication point of a master may be from the time of the instance for a step of
 * length h > 0 to be followed: min(1e-9 max(|t|, h), h / 100), and never less than the spacing of
 * doubles at t. s. */
double clock_slack(double t, double h);

#endif
