/* An integrator that returns at once, in the place of src/integrator: what is left of a step is the
 * time of the instance. The states stay where they are. With inputs that change, the instance calls
 * what it calls for the Taylor method; with constant ones it is always as if an internal step had
 * passed the point. */
#include "integrator.h"

#include <math.h>
#include <stdlib.h>

struct integrator {
    struct integrator_statistics statistics;
};

const char *integrator_method_name(enum integrator_method method) {
    return "idle";
}

double integrator_tolerance_fraction(enum integrator_method method) {
    return 1.0;
}

int64_t integrator_longest_history(enum integrator_method method, bool has_events) {
    return 1;
}

bool integrator_is_possible(enum integrator_method method, const struct ode *ode) {
    return true;
}

enum status integrator_create(const struct ode *ode, const struct message_sink *sink,
                              struct integrator **integrator) {
    *integrator = calloc(1, sizeof **integrator);
    return *integrator != NULL ? STATUS_OK : STATUS_OUT_OF_MEMORY;
}

void integrator_destroy(struct integrator *integrator) {
    free(integrator);
}

enum status integrator_configure(struct integrator *integrator,
                                 const struct integrator_settings *settings) {
    integrator->statistics = (struct integrator_statistics){0};
    return STATUS_OK;
}

enum status integrator_restart(struct integrator *integrator, const double x[],
                               const struct integrator_start *start) {
    return STATUS_OK;
}

double integrator_next_step(const struct integrator *integrator) {
    return 0.0;
}

double integrator_passed_time(const struct integrator *integrator) {
    return INFINITY;
}

void integrator_set_observer(struct integrator *integrator, integrator_observer *observer,
                             void *context) {}

bool integrator_interpolate(struct integrator *integrator, double t, double x[]) {
    return true;
}

enum status integrator_advance(struct integrator *integrator, double t, int64_t max_steps,
                               double *reached, double x[]) {
    *reached = t;
    return STATUS_OK;
}

void integrator_get_statistics(const struct integrator *integrator,
                               struct integrator_statistics *statistics) {
    *statistics = integrator->statistics;
}

void integrator_set_statistics(struct integrator *integrator,
                               const struct integrator_statistics *statistics) {
    integrator->statistics = *statistics;
}

const bool *integrator_event(const struct integrator *integrator) {
    return NULL;
}

enum status integrator_rest(struct integrator *integrator, const double x[],
                            const struct integrator_start *start, double t, double *reached) {
    *reached = t;
    return STATUS_OK;
}
