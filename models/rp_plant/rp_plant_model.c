#include "rp_plant_model.h"

#include "rp_plant_calculated.h"
#include "rp_plant_modes.h"

#include <stdio.h>
#include <string.h>

_Static_assert(sizeof(struct rp_plant_inputs) == sizeof(double[5]),
               "the inputs are one array of doubles");
_Static_assert(sizeof(struct rp_plant_modes) == sizeof(int[5]), "the modes are one array of ints");
_Static_assert(sizeof(struct rp_plant_sums) == sizeof(double[4]),
               "the sums are one array of doubles");
_Static_assert(offsetof(struct rp_plant_values, dq) ==
                   offsetof(struct rp_plant_values, q) + sizeof(double[2]),
               "the states are one array: q, then dq");
_Static_assert(offsetof(struct rp_plant_values, ddq) ==
                   offsetof(struct rp_plant_values, dq) + sizeof(double[2]),
               "their derivatives are one array: dq, then ddq");
_Static_assert((int)RP_PLANT_INDICATORS == 2 * (int)PLANT_INDICATORS, "five of each joint");

static enum status right_hand_side(const void *values_pointer, double t, const double x[],
                                   const double u[], double dx[]) {
    const struct rp_plant_values *values = values_pointer;
    struct rp_plant_inputs inputs;
    memcpy(&inputs, u, sizeof inputs);
    struct rp_plant_modes modes;
    rp_plant_modes_in_effect(values, x, x + 2, &inputs, &modes);
    struct rp_plant_motion motion;
    rp_plant_motion(&values->parameters, &modes, x, x + 2, &inputs, &motion);
    dx[0] = x[2];
    dx[1] = x[3];
    dx[2] = motion.ddq[0];
    dx[3] = motion.ddq[1];
    return STATUS_OK;
}

/* Derivatives by the state of a stuck joint are left out: it does not move, and an elimination that
 * exchanges rows would mix the rounding of the other joint into it. */
static enum status jacobian(const void *values_pointer, double t, const double x[],
                            const double u[], double J[]) {
    const struct rp_plant_values *values = values_pointer;
    struct rp_plant_inputs inputs;
    memcpy(&inputs, u, sizeof inputs);
    struct rp_plant_modes modes;
    rp_plant_modes_in_effect(values, x, x + 2, &inputs, &modes);
    double ddq_by[2 * 4];
    plant_accelerations_jacobian(&values->parameters, &modes, x, x + 2, &inputs, ddq_by);
    for (size_t j = 0; j < 2; j++) {
        double *by_q = J + 4 * j;
        double *by_dq = J + 4 * (2 + j);
        const bool is_stuck = modes.joint[j] == RP_PLANT_STUCK;
        for (size_t i = 0; i < 2; i++) {
            by_q[i] = 0.0;
            by_q[2 + i] = is_stuck ? 0.0 : ddq_by[i + 2 * j];
            by_dq[i] = i == j ? 1.0 : 0.0;
            by_dq[2 + i] = is_stuck ? 0.0 : ddq_by[i + 2 * (2 + j)];
        }
    }
    return STATUS_OK;
}

static enum status outputs(void *values_pointer, double t) {
    struct rp_plant_values *values = values_pointer;
    struct rp_plant_modes modes;
    rp_plant_modes_in_effect(values, values->q, values->dq, &values->inputs, &modes);
    rp_plant_calculate(values, &modes);
    return STATUS_OK;
}

static enum status derivatives(const void *values_pointer, double t, double dt, void *first,
                               void *second) {
    const struct rp_plant_values *values = values_pointer;
    struct rp_plant_modes modes;
    rp_plant_modes_in_effect(values, values->q, values->dq, &values->inputs, &modes);
    rp_plant_derivatives(values, &modes, first, second);
    return STATUS_OK;
}

/* ---- Parameters and start values that do not fit each other; ranges: variables.toml ---------- */

static bool check_friction(const struct rp_plant_parameters *p, int i, char *text, size_t size) {
    const double coulomb = p->coulomb_friction[i];
    const double breakaway = p->breakaway_friction[i];
    const int joint = i + 1;
    if (breakaway > 0.0 && breakaway < coulomb) {
        (void)snprintf(text, size,
                       "breakaway_friction%d = %.17g is refused: it must not be below "
                       "coulomb_friction%d = %.17g (0: the same)",
                       joint, breakaway, joint, coulomb);
        return false;
    }
    if (breakaway > coulomb && p->stribeck_velocity[i] == 0.0) {
        (void)snprintf(text, size,
                       "stribeck_velocity%d = 0 is refused: it must be above 0 where "
                       "breakaway_friction%d = %.17g is above coulomb_friction%d = %.17g",
                       joint, joint, breakaway, joint, coulomb);
        return false;
    }
    return true;
}

static bool check_stops(const struct rp_plant_parameters *p, int i, char *text, size_t size) {
    const int joint = i + 1;
    if (p->stops[i] == RP_PLANT_STOPS_COMPLIANT && p->stop_stiffness[i] == 0.0) {
        (void)snprintf(text, size,
                       "stop_stiffness%d = 0 is refused: with compliant stops it must be above 0",
                       joint);
        return false;
    }
    if (p->stops[i] != RP_PLANT_STOPS_NONE && !(p->lower[i] < p->upper[i])) {
        (void)snprintf(
            text, size,
            "lower%d = %.17g and upper%d = %.17g are refused: with stops lower%d must be "
            "below upper%d",
            joint, p->lower[i], joint, p->upper[i], joint, joint);
        return false;
    }
    return true;
}

/* A limit that is moved past a joint while it runs takes the joint along; a start outside is a
 * mistake. */
static bool check_start(const struct rp_plant_values *values, int i, char *text, size_t size) {
    const struct rp_plant_parameters *p = &values->parameters;
    const double q = values->q[i];
    const int joint = i + 1;
    if (values->modes.payload != RP_PLANT_UNDECIDED || p->stops[i] != RP_PLANT_STOPS_RIGID ||
        (q >= p->lower[i] && q <= p->upper[i])) {
        return true;
    }
    (void)snprintf(
        text, size,
        "q%d = %.17g is refused: a start must be within lower%d = %.17g and upper%d = %.17g", joint,
        q, joint, p->lower[i], joint, p->upper[i]);
    return false;
}

static enum status check_parameters(const void *values_pointer, char *text, size_t size) {
    const struct rp_plant_values *values = values_pointer;
    const struct rp_plant_parameters *p = &values->parameters;
    bool fits = rp_parameters_check(&p->arm, text, size);
    for (int i = 0; i < 2 && fits; i++) {
        fits = check_friction(p, i, text, size) && check_stops(p, i, text, size) &&
               check_start(values, i, text, size);
    }
    return fits ? STATUS_OK : STATUS_INVALID_PARAMETERS;
}

const struct model rp_plant_model = {
    .values_size = sizeof(struct rp_plant_values),
    .parameters = {offsetof(struct rp_plant_values, parameters),
                   sizeof(struct rp_plant_parameters)},
    .inputs = {offsetof(struct rp_plant_values, inputs), sizeof(struct rp_plant_inputs)},
    .states = {offsetof(struct rp_plant_values, q), sizeof(double[4])},
    .dx = {offsetof(struct rp_plant_values, dq), sizeof(double[4])},
    .right_hand_side = right_hand_side,
    .jacobian = jacobian,
    .series = &rp_plant_series,
    .outputs = outputs,
    .derivatives = derivatives,
    .check_parameters = check_parameters,
    .events = &rp_plant_events,
};
