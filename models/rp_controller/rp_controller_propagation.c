#include "rp_controller_propagation.h"

#include "rp_curve.h"

#include <stddef.h>

/* A point of the curve with its derivatives along it. */
struct curve {
    const struct rp_controller_values *values;
    const struct rp_controller_values *first;
    const struct rp_controller_values *second;
};

static const struct taylor none = {0.0, 0.0, 0.0};

/* A double of the three structures as one quantity. */
#define ON_CURVE(curve, field)                                                                     \
    ((struct taylor){(curve)->values->field, (curve)->first->field, (curve)->second->field})

static struct taylor error(const struct curve *c, int i) {
    return taylor_difference(ON_CURVE(c, inputs.q_ref[i]), ON_CURVE(c, inputs.q[i]));
}

static struct taylor derror(const struct curve *c, int i) {
    return taylor_difference(ON_CURVE(c, inputs.dq_ref[i]), ON_CURVE(c, inputs.dq[i]));
}

/* v = Kp e + Kd de + w */
static struct taylor correction(const struct curve *c, int i) {
    const struct taylor proportional = taylor_product(ON_CURVE(c, parameters.Kp[i]), error(c, i));
    const struct taylor damping = taylor_product(ON_CURVE(c, parameters.Kd[i]), derror(c, i));
    return taylor_sum(taylor_sum(proportional, damping), ON_CURVE(c, integral[i]));
}

static struct rp_curve arm_on_curve(const struct curve *c) {
    const struct rp_parameters *const parameters[3] = {
        &c->values->parameters.arm, &c->first->parameters.arm, &c->second->parameters.arm};
    const double *const q[3] = {c->values->inputs.q, c->first->inputs.q, c->second->inputs.q};
    const double *const dq[3] = {c->values->inputs.dq, c->first->inputs.dq, c->second->inputs.dq};
    return rp_curve_of(parameters, q, dq);
}

/* D ddq + C dq: the left sides of (14) and (15) without gravity. */
static void motion_forces(const struct rp_curve *arm, const struct taylor ddq[2],
                          struct taylor forces[2]) {
    struct taylor D[2][2];
    struct taylor coriolis[2];
    rp_curve_mass_matrix(arm, D);
    rp_curve_coriolis_forces(arm, coriolis);
    for (int i = 0; i < 2; i++) {
        const struct taylor inertial =
            taylor_sum(taylor_product(D[i][0], ddq[0]), taylor_product(D[i][1], ddq[1]));
        forces[i] = taylor_sum(inertial, coriolis[i]);
    }
}

static void unlimited_efforts(const struct curve *c, struct taylor efforts[2]) {
    const int mode = c->values->parameters.mode;
    const struct rp_curve arm = arm_on_curve(c);
    const struct taylor v[2] = {correction(c, 0), correction(c, 1)};
    struct taylor gravity[2] = {none, none};
    if (mode != RP_CONTROLLER_PD) {
        rp_curve_gravity_forces(&arm, gravity);
    }

    if (mode == RP_CONTROLLER_COMPUTED_TORQUE) {
        const struct taylor ddq[2] = {taylor_sum(ON_CURVE(c, inputs.ddq_ref[0]), v[0]),
                                      taylor_sum(ON_CURVE(c, inputs.ddq_ref[1]), v[1])};
        motion_forces(&arm, ddq, efforts);
    } else {
        efforts[0] = taylor_product(ON_CURVE(c, parameters.inertia[0]), v[0]);
        efforts[1] = taylor_product(ON_CURVE(c, parameters.inertia[1]), v[1]);
    }
    efforts[0] = taylor_sum(efforts[0], gravity[0]);
    efforts[1] = taylor_sum(efforts[1], gravity[1]);
}

static struct taylor limited(struct taylor effort, struct taylor limit) {
    if (effort.value >= limit.value) {
        return limit;
    }
    return effort.value <= -limit.value ? taylor_scaled(-1.0, limit) : effort;
}

static struct taylor integral_rate(const struct curve *c, int i, struct taylor unlimited,
                                   struct taylor effort) {
    const struct taylor Ki = ON_CURVE(c, parameters.Ki[i]);
    if (!(Ki.value > 0.0)) {
        return none;
    }
    const struct taylor follow =
        taylor_product(ON_CURVE(c, parameters.inertia[i]), ON_CURVE(c, parameters.tracking_time));
    const struct taylor excess = taylor_quotient(taylor_difference(unlimited, effort), follow);
    return taylor_difference(taylor_product(Ki, error(c, i)), excess);
}

static void put(struct taylor x, double *first, double *second) {
    *first = x.first;
    *second = x.second;
}

void rp_controller_propagate(const struct rp_controller_values *values,
                             struct rp_controller_values *first,
                             struct rp_controller_values *second) {
    struct rp_controller_values straight = {0};
    if (second == NULL) {
        second = &straight;
    }

    const struct curve curve = {values, first, second};
    struct taylor unlimited[2];
    unlimited_efforts(&curve, unlimited);
    for (int i = 0; i < 2; i++) {
        const struct taylor effort = limited(unlimited[i], ON_CURVE(&curve, parameters.limit[i]));
        put(unlimited[i], &first->unlimited[i], &second->unlimited[i]);
        put(effort, &first->effort[i], &second->effort[i]);
        put(integral_rate(&curve, i, unlimited[i], effort), &first->dintegral[i],
            &second->dintegral[i]);
        put(error(&curve, i), &first->error[i], &second->error[i]);
        put(derror(&curve, i), &first->derror[i], &second->derror[i]);
    }
}
