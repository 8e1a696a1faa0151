/* Finds events: on each finished internal step, the states are polynomials of time, and the
 * indicators that follow from them are searched for falls to 0. So neither the requested times nor
 * the sign at the end of a step decide whether an event is found. */
#pragma once

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
    double (*indicator_row)[SERIES_LENGTH]; /* rows of the model's indicators if `has_row` of struct
                                               location, over the same s */
};

/* Values of an indicator that a search writes, before location_try. */
struct location_kept {
    bool is_armed;
    double noise;
    double sample; /* the first of the samples */
};

struct location {
    const struct ode *ode;
    size_t *used; /* indices of the used indicators */
    size_t used_count;
    bool needs_model; /* true if a used indicator is an INDICATOR_OF_MODEL */
    const struct integrator_settings *settings; /* at each restart */
    bool *has_row;  /* by indicator: true if step.indicator_row has it, else interpolated */
    bool *is_armed; /* by indicator: true if it has been above 0 since the restart */
    double *noise; /* by indicator: how far from 0 it may be, with either sign, without having risen
                      since the restart */
    double *touch; /* by indicator, as in struct fall */
    double *rounding; /* by indicator, at the restart; 0 if not known */
    double *error;   /* by indicator of the model: its error by the tolerances of the states, within
                        which modes do not follow it; 0 if not known */
    bool *triggered; /* by indicator: true if it is at 0 at `time` */
    struct step_polynomial step;   /* last internal step; methods write it */
    double (*rows)[SERIES_LENGTH]; /* room for the rows of the states */
    double *x;                     /* states at one point */
    double *dx;                    /* room for states at another point */
    double *restart_x;             /* states at the restart */
    double *z;                     /* indicators at one point */
    double calm;     /* length of the last step if interpolated indicators hardly moved in it, s;
                        otherwise 0 */
    double calm_end; /* its end, or 0 at a restart: samples[][0] are the indicators there */
    double *first;   /* by indicator: s of its first root in the step */
    double (*samples)[CHEBYSHEV_LENGTH]; /* by indicator */
    struct location_kept *kept;          /* by indicator */

    /* A step without events reads only these: the time of the event, s since the restart, INFINITY
     * if there is none, and the indicators since the restart, NULL if none is searched. */
    double time;
    const struct indicator *indicators;
};

/* Allocates all memory. Returns false if memory is short: then nothing has to be freed.
 * settings: must stay, and hold from the first restart on. */
MUST_CHECK NONNULL bool location_create(const struct ode *ode,
                                        const struct integrator_settings *settings,
                                        struct location *location);
NONNULL void location_destroy(struct location *location);

/* Restarts the search from the state x, with the indicators that are in force from now on. */
MUST_CHECK NONNULL enum status
location_restart(struct location *location, const struct integrator_start *start, const double x[]);

/* True if an indicator of the model may be at 0 within its error. */
static inline bool location_errors_matter(const struct location *location) {
    bool found = false;
    for (size_t k = 0; k < location->used_count; k++) {
        const size_t i = location->used[k];
        const struct indicator *indicator = &location->indicators[i];
        found |= indicator->kind == INDICATOR_OF_MODEL &&
                 !(indicator->is_far_above > 0.0 && location->z[i] >= indicator->is_far_above);
    }
    return found;
}

static inline bool location_is_active(const struct location *location) {
    return location->indicators != NULL;
}

/* Drops the rows of location->step that neither represent their indicators up to the relative
 * tolerance nor show the first fall nearly: the series may end before an indicator of fast motion
 * has converged. x: the states at the end of the step. */
NONNULL void location_check_rows(struct location *location, const double x[],
                                 double relative_tolerance);

/* Searches location->step. If it has an event, writes its time and the indicators that have
 * triggered. */
MUST_CHECK NONNULL enum status location_search(struct location *location);

/* Does the same if the step has an event; if not, or on failure, it leaves no trace. */
MUST_CHECK NONNULL enum status location_try(struct location *location);

/* True if indicators of the model are at 0 within their errors, at t and x. Writes t as the time of
 * an event, and which. */
MUST_CHECK NONNULL bool location_touch(struct location *location, double t, const double x[]);

/* Searches the time from 0 to t, over which the states stay at x. */
MUST_CHECK NONNULL enum status location_search_at_rest(struct location *location, const double x[],
                                                       double t);

/* Writes the states at s of location->step, 0 to 1 from its begin on. */
NONNULL void location_write_states(const struct location *location, double s, double x[]);
