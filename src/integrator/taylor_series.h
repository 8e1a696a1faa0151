/* Taylor series of the solution about the begin of a step: its orders, the step for which they
 * suffice, and its values (Jorba and Zou, A software package for the numerical integration of ODEs
 * by means of high-order Taylor methods, Experimental Mathematics 14, 2005).
 *
 * Steps are in time scales here: the series is one in s = (t - begin) / time_scale. */
#pragma once

#include "method.h"

/* Largest number of rows that are on the stack if no later call reads them: there they are in a
 * cache even if many instances are stepped in turn. */
enum { TAYLOR_FEW_ROWS = 12 };

static inline bool taylor_series_has_few_rows(const struct ode *ode) {
    return ode->series_row_count <= TAYLOR_FEW_ROWS;
}

struct taylor_series {
    struct problem *problem;
    int largest_order;
    bool may_hide;      /* true if there are inner quantities, or a state may vanish */
    bool is_event_near; /* true if the next long step begins at an event, or after a wrong guess */
    bool may_guess;     /* true if it may end soon after a guess of the next event */
    bool is_guessed;    /* true if the step does */
    int order;
    int expected_order; /* order to which a step that lands is expanded at first; the result does
                           not depend on it */
    int guessed_order;  /* the same of a step that ends soon after a guess */
    double begin;       /* s since the restart */
    double time_scale;  /* s */
    double step;        /* step for which the series is good; NaN if a term is not finite */
    double (*row)[SERIES_LENGTH];     /* the coefficients */
    double (*end_row)[SERIES_LENGTH]; /* orders 0 and 1 at the end of a step */
    double end;     /* its time, s since the restart, if the next step can begin with it, or NaN */
    double *weight; /* 1 over the tolerance of each state; then room for three states */
};

/* Returns the largest number of bytes that create allocates. */
NONNULL size_t taylor_series_memory_size(const struct ode *ode);

/* Allocates the rows. Returns false if memory is short. Destroy it in either case. */
MUST_CHECK NONNULL bool taylor_series_create(struct problem *problem, struct taylor_series *series);
NONNULL void taylor_series_destroy(struct taylor_series *series);

/* Writes the largest order, from problem->settings. */
NONNULL void taylor_series_configure(struct taylor_series *series);

/* Expands the solution about the state x at the time t, and writes `step`. If longest > 0, the step
 * is as long as the largest order allows, and at most this long; if an event is near, only
 * as many orders as suffice one time scale ahead, and about half the largest at most. If the next
 * event is guessed within, the step ends soon after it and has the fewest orders. If longest is
 * 0, orders are added until the terms one time scale ahead are within the tolerance; the step is 1,
 * or less if the largest order is not enough. */
MUST_CHECK NONNULL enum status taylor_series_expand(struct taylor_series *series, double t,
                                                    double time_scale, const double x[],
                                                    double longest);

/* Continues the series to the order last. */
MUST_CHECK NONNULL enum status taylor_series_add_orders(struct taylor_series *series, int last);

/* Does the same as taylor_series_evaluate for n states. */
ALWAYS_INLINE void taylor_series_evaluate_of(const struct taylor_series *series, double s, size_t n,
                                             double x[], double dx[]) {
    for (size_t i = 0; i < n; i++) {
        x[i] = series->row[i][series->order];
        if (dx != NULL) {
            dx[i] = 0.0;
        }
    }
    for (int k = series->order - 1; k >= 0; k--) {
        for (size_t i = 0; i < n; i++) {
            if (dx != NULL) {
                dx[i] = dx[i] * s + x[i];
            }
            x[i] = x[i] * s + series->row[i][k];
        }
    }
}

/* Writes the state at s to x and, unless NULL, its derivative by s to dx.
 *
 * If the number of states is a constant, and s = 1 too, values stay in registers and the products
 * are left out: a quarter of a step of two joints. */
static inline void taylor_series_evaluate(const struct taylor_series *series, double s, double x[],
                                          double dx[]) {
    double few_x[4];
    double few_dx[4];
    const size_t n = series->problem->ode.state_count;
    if (n != 3 && n != 4) {
        taylor_series_evaluate_of(series, s, n, x, dx);
        return;
    }
    if (n == 3) {
        taylor_series_evaluate_of(series, s, 3, few_x, dx != NULL ? few_dx : NULL);
    } else if (dx == NULL) {
        taylor_series_evaluate_of(series, s, 4, few_x, NULL);
    } else if (s == 1.0) {
        taylor_series_evaluate_of(series, 1.0, 4, few_x, few_dx);
    } else {
        taylor_series_evaluate_of(series, s, 4, few_x, few_dx);
    }
    for (size_t i = 0; i < n; i++) {
        x[i] = few_x[i];
        if (dx != NULL) {
            dx[i] = few_dx[i];
        }
    }
}

/* Writes the state at s to end_x, the derivative of the polynomial there, by s, to end_dx, and the
 * defect: how much this derivative differs from the equations' there, in tolerances per step. The
 * defect is about the order of the first missing term times its size. Small terms prove nothing,
 * because orders of a series may vanish: a motion from rest can have the orders 3, 4, 11, 12, 19
 * ... and none between. */
MUST_CHECK NONNULL enum status taylor_series_measure_defect(struct taylor_series *series, double s,
                                                            double end_x[], double end_dx[],
                                                            double *defect);

/* True if nothing can come and go within the step to s unseen.
 *
 * The end of a step says nothing of a pulse that is over there. Its begin does, to the tolerance,
 * as long as nothing that the states follow from is far below the tolerance there and grows beyond
 * it: exp(-300) at the begin of a step adds nothing to any coefficient of a state. But its own
 * coefficients grow from order to order, or are 0. So a step hides nothing if each inner quantity
 * (model.h) has converged by its own size, or its argument rests. */
MUST_CHECK NONNULL bool taylor_series_hides_nothing(const struct taylor_series *series, double s);

/* True if the last terms of a state are exactly 0, as from (t (1 - t))^5 at t = 0, unless all
 * states rest for ever. */
MUST_CHECK NONNULL bool taylor_series_vanishes(const struct taylor_series *series);

/* Returns the part of the step to s in which the polynomial fits the equations, as far as so many
 * points at equal distances say: what lasts longer than such a distance is seen. */
MUST_CHECK NONNULL double taylor_series_part_that_fits(struct taylor_series *series, double s,
                                                       int points);

/* Returns about when the next indicator falls, in time scales of the rows of a series, by their
 * first three orders; INFINITY if none seems to fall. Guesses are above `nearest`. */
MUST_CHECK NONNULL double taylor_series_guess_event(const struct problem *problem,
                                                    double row[][SERIES_LENGTH], double nearest);

/* Length of a step that leads past a guess, over the guess. */
static const double taylor_series_guess_passed = 1.125;
