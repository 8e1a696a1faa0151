#ifndef OPERATIONS_H
#define OPERATIONS_H

#include "text.h"

/* Answers lines `NAME count ball ...` with a line of two balls each, to the end of the file. False:
 * a line is not understood. */
bool operations_answer(FILE *questions, FILE *answers);

#endif
