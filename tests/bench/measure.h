/* Clock, order statistics, and the end of a program that cannot measure. */
#ifndef BENCH_MEASURE_H
#define BENCH_MEASURE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

/* s since some point in the past */
double now(void);

/* s that a processor has worked for this thread: what else runs on the machine disturbs it less
 * than it does the time of day. */
double processor_time(void);

/* What two readings of a clock in a row differ by, s. */
double clock_cost(double (*clock)(void));

/* Of count > 0 values, which it sorts; part in [0, 1], 0.5: the median. */
double quantile(double values[], size_t count, double part);
double median(double values[], int count);

/* Ends the program with a line on stderr where the condition does not hold. */
static inline void require(bool condition, const char *what) {
    if (!condition) {
        fprintf(stderr, "bench: %s\n", what);
        exit(1);
    }
}

/* Zeros; ends the program where there is no memory. */
static inline void *allocate(size_t count, size_t size) {
    void *block = calloc(count, size);
    require(block != NULL, "no memory");
    return block;
}

#endif
