/* Model Exchange as an importer does it: Euler's method, event indicators and time events. */
#ifndef FUZZ_EXCHANGE_H
#define FUZZ_EXCHANGE_H

#include "fuzz_instance.h"

enum { FUZZ_INDICATOR_CAPACITY = 16 };

/* What an importer keeps of a run. */
struct fuzz_exchange {
    struct fuzz_instance *instance;
    double x[FUZZ_STATE_CAPACITY];
    double z[FUZZ_INDICATOR_CAPACITY];
    double next_time; /* s: of the next time event; INFINITY: there is none */
};

/* Reads states and indicators; false: they cannot be computed. */
bool fuzz_exchange_read(struct fuzz_exchange *run);

enum fuzz_outcome { FUZZ_RESUMES, FUZZ_MEETS_EVENT, FUZZ_IS_OVER };

/* Forward Euler to the next time event at most. */
enum fuzz_outcome fuzz_exchange_step(struct fuzz_exchange *run, double length);

/* From a saved state the same step has the same bits; then the run is where it was. */
void fuzz_exchange_repeat(const struct fuzz_exchange *run, double length);

#endif
