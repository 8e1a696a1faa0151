/* The control law, which rp_controller.h explains. */
#pragma once

#include "rp_controller.h"
#include "rp_payload.h"

static inline real law_error(const struct rp_controller_inputs *inputs, int i) {
    return inputs->q_ref[i] - inputs->q[i];
}

static inline real law_error_rate(const struct rp_controller_inputs *inputs, int i) {
    return inputs->dq_ref[i] - inputs->dq[i];
}

/* v: the acceleration that PD and the integral part w ask for. */
static inline real law_correction(const struct rp_controller_parameters *p,
                                  const struct rp_controller_inputs *inputs, const real w[2],
                                  int i) {
    return p->Kp[i] * law_error(inputs, i) + p->Kd[i] * law_error_rate(inputs, i) + w[i];
}

/* The arm that the controller assumes. */
static inline struct arm law_arm(const struct rp_controller_parameters *p, bool attached,
                                 const struct rp_controller_inputs *inputs) {
    struct arm arm = arm_in_state(&p->arm, inputs->q, inputs->dq);
    if (attached) {
        const struct payload payload = {
            .mass = p->payload_mass,
            .inertia = p->payload_inertia,
            .x = p->payload_x,
            .z = p->payload_z,
        };
        real offset[2];
        arm_attach(&arm, &payload, offset);
    }
    return arm;
}

/* Efforts (N.m, N) that the law asks for, before they are limited. attached: the controller knows
 * of a payload on link 2. */
static inline void law_unlimited(const struct rp_controller_parameters *p, bool attached,
                                 const struct rp_controller_inputs *inputs, const real w[2],
                                 real unlimited[2]) {
    const real v[2] = {law_correction(p, inputs, w, 0), law_correction(p, inputs, w, 1)};
    real gravity[2] = {0.0, 0.0};

    if (p->mode != RP_CONTROLLER_PD) {
        const struct arm arm = law_arm(p, attached, inputs);
        if (p->mode == RP_CONTROLLER_COMPUTED_TORQUE) {
            const real ddq[2] = {inputs->ddq_ref[0] + v[0], inputs->ddq_ref[1] + v[1]};
            arm_inverse_dynamics(&arm, ddq, unlimited);
            return;
        }
        arm_gravity_forces(&arm, gravity);
    }
    unlimited[0] = p->inertia[0] * v[0] + gravity[0];
    unlimited[1] = p->inertia[1] * v[1] + gravity[1];
}

/* Brings an effort into [-limit, limit]. At a limit and beyond it the effort moves with the limit.
 * NaN stays NaN. */
static inline real law_limited(const struct rp_controller_parameters *p, real unlimited, int i) {
    const real limit = p->limit[i];
    if (unlimited >= limit) {
        return limit;
    }
    return unlimited <= -limit ? -limit : unlimited;
}

/* Rate of the integral part (rad/s3, m/s3), with anti-windup by back-calculation. */
static inline real law_integral_rate(const struct rp_controller_parameters *p,
                                     const struct rp_controller_inputs *inputs, real unlimited,
                                     int i) {
    if (!(p->Ki[i] > 0.0)) {
        return 0.0;
    }
    const real excess = unlimited - law_limited(p, unlimited, i);
    return p->Ki[i] * law_error(inputs, i) - excess / (p->inertia[i] * p->tracking_time);
}

/* Rates of the integral parts w: the right side. */
static inline void law_integral_rates(const struct rp_controller_parameters *p, bool attached,
                                      const struct rp_controller_inputs *inputs, const real w[2],
                                      real rates[2]) {
    real unlimited[2];
    law_unlimited(p, attached, inputs, w, unlimited);
    for (int i = 0; i < 2; i++) {
        rates[i] = law_integral_rate(p, inputs, unlimited[i], i);
    }
}
