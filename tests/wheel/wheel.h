/* A wheel that turns at the given speed, counts its turns and may be caught by a stop: the smallest
 * model with a discrete input, modes, sums and event indicators. */
#ifndef WHEEL_H
#define WHEEL_H

#include "model.h"

struct wheel_values {
    double stop;     /* rad; 0: there is none */
    int is_reversed; /* turns count downwards */

    double speed;    /* rad/s */
    int is_counting; /* discrete input */

    double angle; /* rad */

    // calculated
    double rate; /* rad/s */
    double to_stop;
    double push;
    int turns; /* whole ones; 0 while the wheel does not count */
    int is_turning;

    // modes
    int is_caught; /* by the stop, which the speed pushes it against */
    int catches;   /* so far */

    // sums over events
    double lost_speed; /* rad/s: speeds at which it was caught */
};

extern const struct model wheel_model;

#endif
