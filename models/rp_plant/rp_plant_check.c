/* Parameters and start values that do not fit each other; ranges: variables.toml. */
#include "rp_plant_model.h"

#include <stdio.h>

static enum status check_friction(const struct rp_plant_parameters *p, int i, char *text,
                                  size_t size) {
    const double coulomb = p->coulomb_friction[i];
    const double breakaway = p->breakaway_friction[i];
    const int joint = i + 1;
    if (breakaway > 0.0 && breakaway < coulomb) {
        (void)snprintf(text, size,
                       "breakaway_friction%d = %.17g is refused: it must not be below "
                       "coulomb_friction%d = %.17g (0: the same)",
                       joint, breakaway, joint, coulomb);
        return STATUS_INVALID_PARAMETERS;
    }
    if (breakaway > coulomb && p->stribeck_velocity[i] == 0.0) {
        (void)snprintf(text, size,
                       "stribeck_velocity%d = 0 is refused: it must be above 0 where "
                       "breakaway_friction%d = %.17g is above coulomb_friction%d = %.17g",
                       joint, joint, breakaway, joint, coulomb);
        return STATUS_INVALID_PARAMETERS;
    }
    return STATUS_OK;
}

static enum status check_stops(const struct rp_plant_parameters *p, int i, char *text,
                               size_t size) {
    const int joint = i + 1;
    if (p->stops[i] == RP_PLANT_STOPS_COMPLIANT && p->stop_stiffness[i] == 0.0) {
        (void)snprintf(text, size,
                       "stop_stiffness%d = 0 is refused: with compliant stops it must be above 0",
                       joint);
        return STATUS_INVALID_PARAMETERS;
    }
    if (p->stops[i] != RP_PLANT_STOPS_NONE && !(p->lower[i] < p->upper[i])) {
        (void)snprintf(
            text, size,
            "lower%d = %.17g and upper%d = %.17g are refused: with stops lower%d must be "
            "below upper%d",
            joint, p->lower[i], joint, p->upper[i], joint, joint);
        return STATUS_INVALID_PARAMETERS;
    }
    return STATUS_OK;
}

/* A limit that is moved past a joint while it runs takes the joint along; a start outside is a
 * mistake. */
static enum status check_start(const struct rp_plant_values *values, int i, char *text,
                               size_t size) {
    const struct rp_plant_parameters *p = &values->parameters;
    const double q = values->q[i];
    const int joint = i + 1;
    if (values->modes.payload != RP_PLANT_UNDECIDED || p->stops[i] != RP_PLANT_STOPS_RIGID ||
        (q >= p->lower[i] && q <= p->upper[i])) {
        return STATUS_OK;
    }
    (void)snprintf(
        text, size,
        "q%d = %.17g is refused: a start must be within lower%d = %.17g and upper%d = %.17g", joint,
        q, joint, p->lower[i], joint, p->upper[i]);
    return STATUS_INVALID_PARAMETERS;
}

enum status rp_plant_check_parameters(const void *values_pointer, char *text, size_t size) {
    const struct rp_plant_values *values = values_pointer;
    const struct rp_plant_parameters *p = &values->parameters;
    if (!rp_parameters_check(&p->arm, text, size)) {
        return STATUS_INVALID_PARAMETERS;
    }
    enum status status = STATUS_OK;
    for (int i = 0; i < 2 && status == STATUS_OK; i++) {
        status = check_friction(p, i, text, size);
        if (status == STATUS_OK) {
            status = check_stops(p, i, text, size);
        }
        if (status == STATUS_OK) {
            status = check_start(values, i, text, size);
        }
    }
    return status;
}
