/* Guesses the next event after an event. */
#pragma once

#include "method.h"

/* Returns about when the next indicator falls, in time scales of the rows of a series, by their
 * first three orders; INFINITY if none seems to fall. Guesses are above `nearest`. */
MUST_CHECK NONNULL double guess_next_event(const struct problem *problem,
                                           double row[][SERIES_LENGTH], double nearest);

/* Length of a step that leads past a guess, over the guess. */
static const double guess_passed = 1.125;
