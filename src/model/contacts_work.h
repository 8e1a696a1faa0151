/* What the parts of contacts.c share: one call of contacts_update. */
#pragma once

#include "contacts.h"
#include "relations_modes.h"

#include <float.h>
#include <math.h>

#define CONTACTS_ROUNDING (16.0 * DBL_EPSILON) /* of a velocity at rest, over its terms */
#define CONTACTS_SLACK    1e-3                 /* likewise of its tolerance */

/* Arguments of all functions, and what has been found. */
struct work {
    const struct call *call;
    const struct contacts *model;
    const struct event *event; // or NULL
    struct contacts_measured now;
    double *hold, *acceleration, *before; // per direction
    int *friction;                        // that may hold it, or -1
    int *sense;                           // of a closed stop's force; 0 if there is none
    int *stop;                            // contact that is closed
    int *marked;                          // for one step of a function
    int *rests;                           // 1 if the velocity is 0
    int *pattern;                         // sign in which a direction at rest begins to move
    int *leaves;                          // sense in which one has triggered that it leaves
    int *hit;                             // per contact: stop that has triggered; or 1: has halted
    int *struck;                          // per contact: 1 if it had an impact at this instant
    int *modes;                           // per contact, before
    bool jumps;
    bool is_decided; // since values were measured
    bool fits;       // as decided
};

static inline void measure(struct work *work) {
    work->is_decided = false;
    const struct call *call = work->call;
    const double *tolerance = work->event != NULL ? work->event->tolerance : call->room.zeros;
    work->model->measure(call->values, call->t, tolerance, &work->now);
}

static inline double *states_of(const struct work *work) {
    return (double *)(void *)((char *)work->call->values + work->call->model->states);
}

/* Sets a state, from then on without an error. */
static inline void set_state(struct work *work, size_t i, double value) {
    states_of(work)[i] = value;
    work->call->room.tolerance[i] = 0.0;
    work->jumps = true;
}

static inline int *mode_of(const struct work *work, int contact) {
    const struct call *call = work->call;
    return &call->segments[call->model->segment_count + work->model->contact[contact].count];
}

static inline double *double_at(const struct work *work, size_t offset) {
    return (double *)(void *)((char *)work->call->values + offset);
}

static inline int sign_of(double x) {
    return (x > 0.0) - (x < 0.0);
}

/* Returns the sense in which closed stops push. */
static inline int sense_of(const struct work *work, int contact, int mode) {
    return (mode == STOPS_LOWER ? 1 : -1) * sign_of(work->now.ratio[contact]);
}

/* Returns the response of a direction's acceleration to the force that holds another one. */
static inline double response(const struct work *work, int to, int of) {
    const int friction = work->friction[of];
    const int contact = friction >= 0 ? friction : work->stop[of];
    const double own = work->now.response[to * work->model->contact_count + contact];
    return friction >= 0 ? -own : own / work->now.ratio[contact];
}

/* Returns up to which speed a velocity counts as 0, which has been one of several that are. */
static inline double least_velocity(const struct work *work, int k) {
    const double least =
        fmax(CONTACTS_ROUNDING * work->now.size[k], CONTACTS_SLACK * work->now.slack[k]);
    return work->model->direction[k].is_plain ? 0.0 : least;
}

/* Writes the members of a block; returns how many there are. */
int contacts_members(const struct work *work, int block, const int is_member[], int member[]);

/* Writes the response of the members to forces that hold them, and what a is without. */
void contacts_write_box(const struct work *work, const int member[], int count, const double a0[],
                        struct box *box);

/* Returns where a room has what is measured. */
struct contacts_measured contacts_measured_in(const struct contacts *model, double *room);

/* Solves for impulses that change velocities by as much as wanted, of members of all blocks. */
void contacts_solve_impulses(const struct work *work, const int is_member[], const double change[],
                             double P[]);

/* Refuses values that are impossible, with the reason. is_start: a position, too. */
enum status contacts_check(const struct work *work, bool is_start);

/* Writes which of the directions at rest begin to move, with all accelerations. Returns false if no
 * motion fits. */
bool contacts_decide(struct work *work);

/* Decides what is at its limit by the rates of the forces: they fall below it, or what holds has
 * triggered and they rest. Returns true if something begins to move. */
bool contacts_break_away(struct work *work);

/* Finds which velocities are 0 now, of directions that something may hold. */
void contacts_find_rest(struct work *work);

/* Lets velocities be 0 that are nearly so: by impulses between them, if they follow from each
 * other; then to the last bit, where one state of each follows from the others. */
void contacts_rest_exactly(struct work *work);

/* Applies impacts until nothing moves into its stop: one may drive into its stop what was leaving
 * another. From some number on they are plastic, and one or two more end them. */
void contacts_apply_impacts(struct work *work);
