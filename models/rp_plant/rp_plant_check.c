/* Which parameters and start values the plant refuses. */
#include "rp_plant_model.h"

#include <math.h>
#include <stdio.h>

/* One of the numbers that have to be finite and not negative. */
struct not_negative {
    const char *name;
    double value;
};

static enum status check_not_negative(const struct rp_plant_parameters *p, char *text,
                                      size_t size) {
    const struct not_negative all[] = {
        {"armature1", p->armature[0]},
        {"armature2", p->armature[1]},
        {"damping1", p->damping[0]},
        {"damping2", p->damping[1]},
        {"coulomb_friction1", p->coulomb_friction[0]},
        {"coulomb_friction2", p->coulomb_friction[1]},
        {"breakaway_friction1", p->breakaway_friction[0]},
        {"breakaway_friction2", p->breakaway_friction[1]},
        {"stribeck_velocity1", p->stribeck_velocity[0]},
        {"stribeck_velocity2", p->stribeck_velocity[1]},
        {"payload_mass", p->payload_mass},
        {"payload_inertia", p->payload_inertia},
        {"stop_stiffness1", p->stop_stiffness[0]},
        {"stop_stiffness2", p->stop_stiffness[1]},
        {"stop_damping1", p->stop_damping[0]},
        {"stop_damping2", p->stop_damping[1]},
    };
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++) {
        if (isfinite(all[i].value) && all[i].value >= 0.0) {
            continue;
        }
        (void)snprintf(text, size, "%s = %.17g is refused: it must be finite and not below 0",
                       all[i].name, all[i].value);
        return STATUS_INVALID_PARAMETERS;
    }
    return STATUS_OK;
}

static enum status check_payload(const struct rp_plant_parameters *p, char *text, size_t size) {
    if (!isfinite(p->payload_x) || !isfinite(p->payload_z)) {
        (void)snprintf(text, size,
                       "payload_x = %.17g and payload_z = %.17g are refused: they must be finite",
                       p->payload_x, p->payload_z);
        return STATUS_INVALID_PARAMETERS;
    }
    if (p->grasp != RP_PLANT_KEEP_VELOCITY && p->grasp != RP_PLANT_AT_REST) {
        (void)snprintf(text, size, "grasp = %d is refused: it must be %d or %d", p->grasp,
                       RP_PLANT_KEEP_VELOCITY, RP_PLANT_AT_REST);
        return STATUS_INVALID_PARAMETERS;
    }
    return STATUS_OK;
}

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
    if (p->stops[i] < RP_PLANT_STOPS_NONE || p->stops[i] > RP_PLANT_STOPS_COMPLIANT) {
        (void)snprintf(text, size, "stops%d = %d is refused: it must be within %d and %d", joint,
                       p->stops[i], RP_PLANT_STOPS_NONE, RP_PLANT_STOPS_COMPLIANT);
        return STATUS_INVALID_PARAMETERS;
    }
    if (!(p->restitution[i] >= 0.0 && p->restitution[i] <= 1.0)) {
        (void)snprintf(text, size, "restitution%d = %.17g is refused: it must be within 0 and 1",
                       joint, p->restitution[i]);
        return STATUS_INVALID_PARAMETERS;
    }
    if (p->stops[i] == RP_PLANT_STOPS_COMPLIANT &&
        !(isfinite(p->stop_stiffness[i]) && p->stop_stiffness[i] > 0.0)) {
        (void)snprintf(text, size,
                       "stop_stiffness%d = %.17g is refused: with compliant stops it must be "
                       "finite and above 0",
                       joint, p->stop_stiffness[i]);
        return STATUS_INVALID_PARAMETERS;
    }
    if (p->stops[i] != RP_PLANT_STOPS_NONE &&
        !(isfinite(p->lower[i]) && isfinite(p->upper[i]) && p->lower[i] < p->upper[i])) {
        (void)snprintf(text, size,
                       "lower%d = %.17g and upper%d = %.17g are refused: with stops they must be "
                       "finite and lower%d below upper%d",
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
    enum status status = check_not_negative(p, text, size);
    if (status == STATUS_OK) {
        status = check_payload(p, text, size);
    }
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
