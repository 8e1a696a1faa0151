/* Frames of sets: nearly orthogonal matrices and coordinates in them (Lohner's method). */
#ifndef FRAME_H
#define FRAME_H

#include "arm_series.h"

/* Orthogonal but for rounding: Householder's Q of the columns of a matrix, each times its size, the
 * longest one first. Any result is good; a set is small in a frame along its longest sides. */
void frame_along(struct ball columns[STATES][STATES], const double sizes[STATES],
                 double frame[STATES][STATES]);

/* Coordinates of a set in a frame: bounds of |frame^-1 (columns c + z)| over all |c_j| <= sizes_j
 * and |z_i| <= rest_i. Returns what bounds the row sums of I - frame^T frame; below 1, or the
 * coordinates are infinite. */
double frame_coordinates(double frame[STATES][STATES], struct ball columns[STATES][STATES],
                         const double sizes[STATES], const double rest[STATES],
                         double coordinates[STATES]);

#endif
