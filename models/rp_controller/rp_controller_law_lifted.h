/* The law in any arithmetic (equation.h): rp_controller.h is this with doubles, and says what it
 * means. */
#ifndef RP_CONTROLLER_LAW_LIFTED_H
#define RP_CONTROLLER_LAW_LIFTED_H

#include "rp_controller.h"
#include "rp_payload_lifted.h"

/* e = q_ref - q and its rate. */
EQUATION real law_error(const struct rp_controller_inputs *const inputs[SOURCES], int i) {
    return minus(READ(inputs, q_ref[i]), READ(inputs, q[i]));
}

EQUATION real law_error_rate(const struct rp_controller_inputs *const inputs[SOURCES], int i) {
    return minus(READ(inputs, dq_ref[i]), READ(inputs, dq[i]));
}

/* v = Kp e + Kd de + w */
EQUATION real law_correction(const struct rp_controller_parameters *const p[SOURCES],
                             const struct rp_controller_inputs *const inputs[SOURCES],
                             const real w[2], int i) {
    const real proportional = times(READ(p, Kp[i]), law_error(inputs, i));
    const real damping = times(READ(p, Kd[i]), law_error_rate(inputs, i));
    return plus(plus(proportional, damping), w[i]);
}

/* The arm that the controller assumes. */
EQUATION struct arm law_arm(const struct rp_controller_parameters *const p[SOURCES], bool attached,
                            const struct rp_controller_inputs *const inputs[SOURCES]) {
    const struct rp_parameters *const parameters[SOURCES] = PARTS(p, arm);
    const real q[2] = {READ(inputs, q[0]), READ(inputs, q[1])};
    const real dq[2] = {READ(inputs, dq[0]), READ(inputs, dq[1])};
    struct arm arm = arm_in_state(parameters, q, dq);
    if (attached) {
        const struct payload payload = {
            .mass = READ(p, payload_mass),
            .inertia = READ(p, payload_inertia),
            .x = READ(p, payload_x),
            .z = READ(p, payload_z),
        };
        real offset[2];
        arm_attach(&arm, &payload, offset);
    }
    return arm;
}

EQUATION void law_unlimited(const struct rp_controller_parameters *const p[SOURCES], bool attached,
                            const struct rp_controller_inputs *const inputs[SOURCES],
                            const real w[2], real unlimited[2]) {
    const int mode = p[0]->mode;
    const real v[2] = {law_correction(p, inputs, w, 0), law_correction(p, inputs, w, 1)};
    real gravity[2] = {constant(0.0), constant(0.0)};

    if (mode != RP_CONTROLLER_PD) {
        const struct arm arm = law_arm(p, attached, inputs);
        if (mode == RP_CONTROLLER_COMPUTED_TORQUE) {
            const real ddq[2] = {plus(READ(inputs, ddq_ref[0]), v[0]),
                                 plus(READ(inputs, ddq_ref[1]), v[1])};
            arm_inverse_dynamics(&arm, ddq, unlimited);
            return;
        }
        arm_gravity_forces(&arm, gravity);
    }
    unlimited[0] = plus(times(READ(p, inertia[0]), v[0]), gravity[0]);
    unlimited[1] = plus(times(READ(p, inertia[1]), v[1]), gravity[1]);
}

/* At a limit and beyond it the effort moves with the limit. */
EQUATION real law_limited(const struct rp_controller_parameters *const p[SOURCES], real unlimited,
                          int i) {
    const real limit = READ(p, limit[i]);
    if (value_of(unlimited) >= value_of(limit)) {
        return limit;
    }
    return value_of(unlimited) <= -value_of(limit) ? negative(limit) : unlimited;
}

/* w' = Ki e - (unlimited - effort) / (M tracking_time) where Ki > 0, else 0 */
EQUATION real law_integral_rate(const struct rp_controller_parameters *const p[SOURCES],
                                const struct rp_controller_inputs *const inputs[SOURCES],
                                real unlimited, int i) {
    const real Ki = READ(p, Ki[i]);
    if (!(value_of(Ki) > 0.0)) {
        return constant(0.0);
    }
    const real excess = minus(unlimited, law_limited(p, unlimited, i));
    const real followed = times(READ(p, inertia[i]), READ(p, tracking_time));
    return minus(times(Ki, law_error(inputs, i)), quotient(excess, followed));
}

#endif
