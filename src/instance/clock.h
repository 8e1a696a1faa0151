/* Time of an instance, kept as an unevaluated sum of two doubles, and inputs as polynomials of it.
 * Communication points far from zero are coarse (1e-10 s apart at 1e6 s) and masters round them
 * again at every step; with the rounding carried along, the time that is integrated is exactly the
 * time that has passed. */
#pragma once

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>

struct clock_time {
    double s;    /* time, rounded to double, s */
    double rest; /* remainder of this rounding, s */
};

/* Returns the exact sum of two doubles (Knuth, The Art of Computer Programming, vol. 2,
 * section 4.2.2). */
static inline struct clock_time clock_two_sum(double x, double y) {
    const double s = x + y;
    const double y_part = s - x;
    const double x_part = s - y_part;
    return (struct clock_time){.s = s, .rest = (x - x_part) + (y - y_part)};
}

/* Returns time + elapsed (s). */
static inline struct clock_time clock_add(struct clock_time time, double elapsed) {
    const struct clock_time sum = clock_two_sum(time.s, elapsed);
    return clock_two_sum(sum.s, sum.rest + time.rest);
}

/* Returns later - earlier in s, rounded once. */
static inline double clock_difference(struct clock_time later, struct clock_time earlier) {
    const struct clock_time difference = clock_two_sum(later.s, -earlier.s);
    return difference.s + (difference.rest + (later.rest - earlier.rest));
}

/* ---- Rounding -------------------------------------------------------------------------------
 * In s. Times up to a given size (s, the largest magnitude among the start time and the times at
 * hand) are computed in different ways: products, sums, decimal numbers. */

/* Return the larger and the smaller of two numbers: fmax and fmin are calls. */
static inline double clock_larger(double x, double y) {
    return x > y ? x : y;
}
static inline double clock_smaller(double x, double y) {
    return x < y ? x : y;
}

/* Returns the largest distance between neighbouring doubles. */
static inline double clock_spacing(double size) {
    return DBL_EPSILON * fabs(size);
}

/* Returns how far two doubles for the same time may be apart, each after a few operations. */
static inline double clock_rounding(double size) {
    return 4.0 * clock_spacing(size);
}

/* Largest part of a step that counts as a master's rounding. */
#define CLOCK_LARGEST_PART 0.01

/* Returns how far the communication point of a master may be from the time of the instance at the
 * begin of a step of step_size > 0: min(1e-9 max(size, step_size), step_size / 100), and never less
 * than clock_rounding. */
static inline double clock_slack(double size, double step_size) {
    const double part =
        clock_smaller(1e-9 * clock_larger(size, step_size), CLOCK_LARGEST_PART * step_size);
    return clock_larger(part, clock_rounding(size));
}

/* Returns by how much a step adds to the drift of a master: the mismatch that was accepted at its
 * beginning or, if the master hides it, the rounding of a sum of times. */
static inline double clock_step_drift(double size, double mismatch) {
    return clock_larger(fabs(mismatch), 0.5 * clock_spacing(size));
}

/* Returns how far a time event may be from the end of a step of step_size > 0 to happen there: the
 * drift, summed over all steps, up to step_size / 100, and never less than clock_rounding. So a
 * master that adds up its steps meets each event at the intended step, and with exact times no
 * event comes early. */
static inline double clock_tick_slack(double size, double step_size, double drift) {
    const double rounding = clock_rounding(size);
    const double part = clock_smaller(drift + rounding, CLOCK_LARGEST_PART * step_size);
    return clock_larger(part, rounding);
}

/* ---- Polynomials ----------------------------------------------------------------------------
 * An input over a step: a Taylor polynomial of degree 3 from the beginning of the step. */

enum { POLYNOMIAL_DEGREE = 3 };

/* A polynomial; d[k]: the k-th derivative at the origin, in the unit of the input over s^k. */
struct polynomial {
    double d[POLYNOMIAL_DEGREE + 1];
};

/* True if the polynomial is not constant. */
static inline bool polynomial_moves(const struct polynomial *polynomial) {
    const double *d = polynomial->d;
    return fabs(d[1]) + fabs(d[2]) + fabs(d[3]) != 0.0; // a sum has one branch
}

/* True if one of the polynomials is not constant. */
static inline bool polynomials_move(const struct polynomial polynomials[], size_t count) {
    bool found = false;
    for (size_t i = 0; i < count; i++) {
        found |= polynomial_moves(&polynomials[i]);
    }
    return found;
}

/* Returns the value at time t (s) after the origin. */
static inline double polynomial_value(const struct polynomial *polynomial, double t) {
    const double *d = polynomial->d;
    return d[0] + t * (d[1] + t / 2.0 * (d[2] + t / 3.0 * d[3]));
}

/* Returns the polynomial with values[k] at k step_size / (POLYNOMIAL_NODES - 1), step_size > 0 (s).
 * With equal values, all its derivatives are 0. */
enum { POLYNOMIAL_NODES = POLYNOMIAL_DEGREE + 1 };
static inline struct polynomial polynomial_through(const double values[POLYNOMIAL_NODES],
                                                   double step_size) {
    // Newton's forward differences, and their series for the derivatives at the first node
    const double s = step_size / (POLYNOMIAL_NODES - 1);
    const double first[] = {values[1] - values[0], values[2] - values[1], values[3] - values[2]};
    const double second[] = {first[1] - first[0], first[2] - first[1]};
    const double third = second[1] - second[0];
    return (struct polynomial){{
        values[0],
        (first[0] - second[0] / 2.0 + third / 3.0) / s,
        (second[0] - third) / s / s,
        third / s / s / s,
    }};
}

/* Returns the same polynomial with its origin moved by t (s). */
static inline struct polynomial polynomial_shifted(const struct polynomial *polynomial, double t) {
    const double *d = polynomial->d;
    return (struct polynomial){{
        polynomial_value(polynomial, t),
        d[1] + t * (d[2] + t / 2.0 * d[3]),
        d[2] + t * d[3],
        d[3],
    }};
}
