/* Where events are: on each finished internal step, the states are polynomials of time, and what
 * indicators follow from them is searched for falls to 0. So neither the requested times nor the
 * sign at the end of a step decide whether an event is found. */
#ifndef LOCATION_H
#define LOCATION_H

#include "ode.h"
#include "platform.h"
#include "roots.h"

#include <math.h>
#include <stdbool.h>

/* States over an internal step: x_i is the sum of row[i][k] s^k. s: time in lengths of the step,
 * from its begin on (0 to 1) or, where `is_from_end`, from its end on (-1 to 0). */
struct step_polynomial {
    double begin; /* s since the restart */
    double end;
    bool is_from_end;
    int degree;
    double (*row)[SERIES_LENGTH];           /* in `rows` of struct location, or of the method */
    double (*indicator_row)[SERIES_LENGTH]; /* where `has_row` of struct location: indicators of the
                                               model, over s as the states */
};

struct location {
    double time; /* of the event, s since the restart; INFINITY: none. With the indicators, all that
                    a step without them reads */
    const struct indicator *indicators; /* since the restart; NULL: none is searched */
    const struct ode *ode;
    size_t *used; /* those of them that are not INDICATOR_UNUSED */
    size_t used_count;
    const double *absolute_tolerances; /* of the states */
    bool *has_row;    /* by indicator: step.indicator_row has it; else it is interpolated */
    bool *is_armed;   /* by indicator: it has been above 0 since the restart */
    double *noise;    /* by indicator of a state: one that is 0 at the restart
                         may have either sign as long as it is within this */
    double *touch;    /* by indicator, as in struct fall */
    double *rounding; /* by indicator, at the restart; 0: not known */
    bool *triggered;  /* by indicator: it is at 0 at `time` */
    struct step_polynomial step;         /* the last one; methods write it */
    double (*rows)[SERIES_LENGTH];       /* by state: room for its rows */
    double *x;                           /* at one point */
    double *dx;                          /* room for another one */
    double *restart_x;                   /* at the restart */
    double *z;                           /* by indicator, at one point */
    double *first;                       /* by indicator: s of its first root in the step */
    double (*samples)[CHEBYSHEV_LENGTH]; /* by indicator */
};

/* False where memory is short: then nothing has to be freed. absolute_tolerances: of the
 * states, which must stay. */
MUST_CHECK NONNULL bool location_create(const struct ode *ode, const double absolute_tolerances[],
                                        struct location *location);
NONNULL void location_destroy(struct location *location);

/* No event so far; indicators: those in force from now on, at the state x. */
MUST_CHECK NONNULL_ARGUMENTS(1, 3) enum status
    location_restart(struct location *location, const struct indicator *indicators,
                     const double x[]);

static inline bool location_is_active(const struct location *location) {
    return location->indicators != NULL;
}

/* Drops the rows of location->step that are not the indicators that they should be, up to the
 * relative tolerance: of a series that ends before an indicator of fast motion has converged.
 * x: the states at the end of the step. */
NONNULL void location_check_rows(struct location *location, const double x[],
                                 double relative_tolerance);

/* Searches location->step. If there is an event in it, writes its time and what has triggered. */
MUST_CHECK NONNULL enum status location_search(struct location *location);

/* The same for the time from 0 to t, over which the states stay at x. */
MUST_CHECK NONNULL enum status location_search_at_rest(struct location *location, const double x[],
                                                       double t);

/* Writes location->step: the cubic polynomial through the states and their derivatives at the begin
 * and at the end of a step. */
NONNULL void location_write_cubic(struct location *location, double begin, const double begin_x[],
                                  const double begin_dx[], double end, const double x[],
                                  const double dx[]);

/* Writes z, the value of the first indicator that has triggered, and Newton's correction (s) of the
 * event's time, -z / z', from the state x and its derivative dx at the time t. False where it has
 * none. */
MUST_CHECK NONNULL bool location_correction(struct location *location, double t, const double x[],
                                            const double dx[], double *z, double *correction);

/* Where location->step begins at the restart and goes back from its end: leads it through the state
 * there. CVODE's polynomial misses that by about its tolerance, and flights that are lower would
 * begin below their limits. */
NONNULL void location_lead_from_restart(struct location *location);

/* Writes the states at s of location->step, 0 to 1 from its begin on. */
NONNULL void location_write_states(const struct location *location, double s, double x[]);

/* ---- Falls ---------------------------------------------------------------------------------- */

struct fall {
    double error;    /* of p */
    double touch;    /* no fall leads less far below 0 before the indicator rises again */
    double latest;   /* s: falls behind it need not be located */
    bool is_restart; /* p begins at a restart */
    bool *is_armed;  /* the indicator has been above 0 since the restart; set where it rises */
    double *noise;   /* how far from 0 it may be without having risen; grows where it is farther
                        below 0 at the restart */
};

/* The first s in (0, 1] at which an indicator falls to 0; INFINITY: it does not, or it does behind
 * `latest`.
 *
 * p represents it over the step, up to an error. A fall counts only once the indicator is armed:
 * rounding may leave it on either side at a restart. */
MUST_CHECK NONNULL double fall_first(const struct roots_polynomial *p, const struct fall *fall);

#endif
