/* Single operations on given operands, so that another program can check each by itself. */
#ifndef OPERATIONS_H
#define OPERATIONS_H

#include <stdbool.h>
#include <stdio.h>

/* Answers lines `NAME number ...` with a line of numbers each, to the end of the file. False: a
 * line is not understood. */
bool operations_answer(FILE *questions, FILE *answers);

#endif
