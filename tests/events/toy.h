/* The smallest models with events, with tables of variables written by hand: a ball that bounces, a
 * block with dry friction, and a hammer that strikes a mass at given times. */
#ifndef TOY_H
#define TOY_H

#include "instance.h"

/* A ball above a floor, which a lift can carry: h'' = lift - g while it flies. */
struct ball_values {
    double g;           /* m/s2 */
    double restitution; /* 0 to 1 */
    double has_floor;   /* 0: it falls for ever, and there are no events */
    double lift;        /* m/s2, input */
    double h;           /* m */
    double v;           /* m/s */
    double a;           /* m/s2, calculated */
    int is_resting;     /* mode */
    double impulse;     /* m/s: sum over impacts of the change of v */
};

/* A block on a table: m v' = f - direction coulomb while it slides. */
struct block_values {
    double m;         /* kg */
    double coulomb;   /* N */
    double breakaway; /* N, not below coulomb */
    double f;         /* N, input */
    double x;         /* m */
    double v;         /* m/s */
    double a;         /* m/s2, calculated */
    int direction;    /* mode: -1, 0 (it sticks), 1 */
};

/* A mass in front of an elastic wall at x = 0: v' = f. The hammer changes v by `kick` at the times
 * start + first + n period. */
struct hammer_values {
    double period; /* s */
    double first;  /* s */
    double kick;   /* m/s */
    double f;      /* m/s2, input */
    double x;      /* m */
    double v;      /* m/s */
    double a;      /* m/s2, calculated */
    // modes
    int is_started;
    int strokes;
    int hits; /* of the wall */
    // discrete states
    double start; /* s */
    double last;  /* m/s2: f at the last stroke */
};

/* References of all, in the order of the parameters, the input and the states. */
enum toy_reference {
    TOY_TIME,
    TOY_PARAMETER1,
    TOY_PARAMETER2,
    TOY_PARAMETER3,
    TOY_INPUT,
    TOY_POSITION,
    TOY_SPEED,
    TOY_ACCELERATION,
    TOY_METHOD,
    TOY_TOLERANCE,
    TOY_EVENTS,
    TOY_LAST_EVENT,
    TOY_MAX_EVENTS,
    TOY_STEPS,
    TOY_RESTARTS,
    TOY_MAX_STEPS,
    TOY_MAX_STEP,
};

extern const struct model_description ball_description;
extern const struct model_description block_description;
extern const struct model_description hammer_description;

#endif
