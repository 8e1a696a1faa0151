#define _POSIX_C_SOURCE 199309L // clock_gettime

#include "solvers.h"

#include <stdlib.h>
#include <time.h>

double processor_time(void) {
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

double clock_cost(void) {
    double cost[1001];
    for (int i = 0; i < 1001; i++) {
        const double begin = processor_time();
        cost[i] = processor_time() - begin;
    }
    return median(cost, 1001);
}

static int by_value(const void *a, const void *b) {
    const double x = *(const double *)a;
    const double y = *(const double *)b;
    return (x > y) - (x < y);
}

double median(double values[], int count) {
    qsort(values, (size_t)count, sizeof values[0], by_value);
    return values[count / 2];
}
