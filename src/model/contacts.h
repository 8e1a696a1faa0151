/* Dry friction and stops of models that are made from their equations (fmu/compiler).
 *
 * A contact acts by a force on a velocity. The contacts of one velocity share a direction: friction
 * comes first, stops follow. A direction at rest is held by a force T in its sense, within bounds:
 * friction gives both, a closed stop takes away one of them. The accelerations of directions are
 * affine in the forces of all contacts, a = a0 + B f.
 *
 * Which directions stay at rest follows from Gauss' principle of least constraint; for a positive
 * definite response there is one answer: Cottle, Pang and Stone, The Linear Complementarity
 * Problem, section 3.3. */
#pragma once

#include "model.h"

struct call;
struct given;
struct compared;
struct work;

enum { CONTACTS_MOST_COUPLED = 8 };

/* Modes of friction and of stops. */
enum { FRICTION_BACKWARD = 1, FRICTION_STUCK, FRICTION_FORWARD };
enum { STOPS_FREE = 1, STOPS_LOWER, STOPS_UPPER };

struct contact {
    const char *name;
    bool is_friction, has_lower, has_upper;
    int direction;
    int count;                      /* of the model that is its mode */
    size_t position;                /* of stops: state that is set where one is reached */
    size_t impulse, impulses, loss; /* of stops: offsets of these in the values */
};

struct direction {
    size_t own;    /* state that follows from the others while it is held */
    bool is_plain; /* true if the velocity is a multiple of that state */
    bool is_exact; /* true if no state that it follows from does so from it in turn */
    int block;     /* directions that are decided together have one number */
};

/* What a state of the model gives, per direction (velocity to factor) and contact. */
struct contacts_measured {
    double *velocity;
    double *size;         /* sum of the magnitudes of the velocity's terms */
    double *slack;        /* likewise of the tolerances of their states */
    double *rest;         /* value of the own state at which the velocity is 0 */
    double *factor;       /* of the own state in the velocity */
    double *acceleration; /* without forces of contacts */
    double *response;     /* of the acceleration of each direction to each contact's force */
    double *jump;         /* of the rate of each moved state to each contact's force */
    double *active;       /* 1 if the contact may hold, else 0 */
    double *ratio;        /* of the contact's velocity to that of its direction */
    double *law;          /* size of sliding friction */
    double *coulomb, *breakaway, *stribeck; /* of friction */
    double *position, *lower, *upper;       /* of stops */
    double *at_lower, *at_upper;            /* values of the state that is set there */
    double *restitution;
    double *tolerance; /* of the position */
};

struct contacts {
    int contact_count, direction_count, block_count, moved_count;
    const struct contact *contact;
    const struct direction *direction;
    const size_t *moved; /* states that impulses move */
    size_t indicator;    /* first one of contacts: each has two */
    /* contacts_update: FMUs whose model does not name it are linked without it. */
    enum status (*update)(const struct call *call, const struct event *event, bool is_first,
                          bool is_start, bool *changes);
    /* Writes all of `to`. tolerance: of each state, in its unit. */
    void (*measure)(const void *values, double t, const double tolerance[],
                    const struct contacts_measured *to);
    /* Writes derivatives of velocities, responses, jumps, ratios, restitutions and of the states at
     * stops by a parameter of gradients, at an event: du and shift as of `change`. NULL without
     * gradients. */
    void (*measure_along)(const void *values, double t, const double du[], const double shift[],
                          int parameter, const struct contacts_measured *to);
    /* Functions below; NULL without gradients. */
    void (*strike_gradients)(const struct work *work, const double P[], const int is_struck[],
                             const double restitution[]);
    void (*hold_gradients)(const struct work *work);
    /* Writes the limits of all contacts, two of each, as `compare` of struct relations does. */
    void (*compare)(const void *values, double t, const struct given *given,
                    struct compared *compared);
};

/* Memory for one call. */
struct contacts_room {
    double *measured;
    double *hold; /* 3 per direction */
    int *found;   /* 7 per direction, 3 per contact */
};

#define CONTACTS_MEASURED(directions, contacts, moved)                                             \
    (6 * (directions) + (directions) * (contacts) + (moved) * (contacts) + 13 * (contacts))

#define CONTACTS_ROOM(directions, contacts, moved)                                                 \
    (struct contacts_room) {                                                                       \
        (double[CONTACTS_MEASURED(directions, contacts, moved)]){0},                               \
            (double[3 * (directions)]){0}, (int[7 * (directions) + 3 * (contacts)]) {              \
            0                                                                                      \
        }                                                                                          \
    }

/* Decides all contacts: places what has reached a stop there, applies impacts, and writes states
 * and modes. is_first: of this event, so that what has triggered counts; is_start: a position
 * outside its stops is refused. event is NULL before the initialization ends. *changes: set if
 * states or modes have changed. */
enum status contacts_update(const struct call *call, const struct event *event, bool is_first,
                            bool is_start, bool *changes);

/* Changes the gradients by impulses P of an impact, one per direction in its sense, before these
 * change the states. */
void contacts_strike_gradients(const struct work *work, const double P[], const int is_struck[],
                               const double restitution[]);

/* Lets gradients stay where contacts hold: no other parameter moves what is held, but with its
 * stop. */
void contacts_hold_gradients(const struct work *work);

/* A linear complementarity problem with bounds: a = a0 + W T where each T is within its bounds and
 * a = 0, or T is low and a > 0, or T is high and a < 0. */
struct box {
    int count;
    double W[CONTACTS_MOST_COUPLED][CONTACTS_MOST_COUPLED];
    double a0[CONTACTS_MOST_COUPLED];
    double low[CONTACTS_MOST_COUPLED],
        high[CONTACTS_MOST_COUPLED]; /* low <= 0 <= high, or infinite */
};

struct box_solution {
    int leaves[CONTACTS_MOST_COUPLED]; /* sign of a; 0 of what stays */
    double T[CONTACTS_MOST_COUPLED], a[CONTACTS_MOST_COUPLED];
    double misfit; /* relative; not above 0 if all conditions hold to the last bit */
};

/* Solves the problem; staying comes first. Up to three unknowns by looking at all answers, more by
 * principal pivoting: Murty's rule of the least index where the worst violation repeats itself. */
void box_solve(const struct box *box, struct box_solution *solution);
