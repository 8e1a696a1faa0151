/* Control laws for the joints of the RP manipulator: PD, PD with gravity compensation and computed
 * torque, each with integral action, effort limits and anti-windup by back-calculation.
 *
 * With the errors e = q_ref - q and de = dq_ref - dq and the integral part w of the commanded
 * acceleration, for each joint v = Kp e + Kd de + w, and the efforts that the law asks for are
 *
 *   PD               M v                                       M: inertia
 *   PD with gravity  M v + g(q)
 *   computed torque  D(q) (ddq_ref + v) + C(q, dq) dq + g(q)
 *
 * With a payload that the controller knows of, link 2 has it in D, C and g. Each effort u is
 * brought into [-limit, limit]. The integral part moves by Ki e + (effort - u) / (M tracking_time)
 * where Ki > 0, else it rests. */
#pragma once

#include "../rp_manipulator/rp_payload.h"
#include "rp_controller_values.h"

/* Joint 1: rad, N.m, kg.m2; joint 2: m, N, kg. */
struct joint_law {
    real Kp;      /* 1/s2, >= 0 */
    real Kd;      /* 1/s, >= 0 */
    real Ki;      /* 1/s3, >= 0; 0: the integral part rests */
    real inertia; /* > 0: effective inertia, of the PD modes and the anti-windup */
    real limit;   /* >= 0: largest magnitude of the effort */
    real error, error_rate;
    real integral; /* rad/s2, m/s2 */
};

/* v: the acceleration that PD and the integral part ask for. */
static inline real law_correction(const struct joint_law *joint) {
    return joint->Kp * joint->error + joint->Kd * joint->error_rate + joint->integral;
}

/* Brings an effort into [-limit, limit]. At a limit and beyond it the effort moves with the limit.
 * NaN stays NaN. No event: efforts follow inputs at once. */
static inline real law_limited(real unlimited, real limit) {
    if (value_of(unlimited) >= limit) {
        return limit;
    }
    return value_of(unlimited) <= -limit ? -limit : unlimited;
}

/* Rate of the integral part (rad/s3, m/s3), with anti-windup by back-calculation. */
static inline real law_integral_rate(const struct joint_law *joint, real unlimited,
                                     real tracking_time) {
    if (!(joint->Ki > 0.0)) {
        return 0.0;
    }
    const real excess = unlimited - law_limited(unlimited, joint->limit);
    return joint->Ki * joint->error - excess / (joint->inertia * tracking_time);
}

/* The arm that the controller assumes. */
static inline struct arm law_arm(const struct rp_controller_values *values) {
    const struct rp_controller_parameters *p = &values->parameters;
    const real q[2] = {values->q1, values->q2};
    const real dq[2] = {values->dq1, values->dq2};
    struct arm arm = arm_in_state(&p->arm, q, dq);
    if (values->payload_attached) {
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

/* Efforts that the law asks for, before they are limited. */
static inline void law_unlimited(const struct rp_controller_values *values,
                                 const struct joint_law joints[2], real unlimited[2]) {
    const int mode = values->parameters.mode;
    const real v[2] = {law_correction(&joints[0]), law_correction(&joints[1])};
    real gravity[2] = {0.0, 0.0};

    if (mode != RP_CONTROLLER_MODE_PD) {
        const struct arm arm = law_arm(values);
        if (mode == RP_CONTROLLER_MODE_COMPUTED_TORQUE) {
            const real ddq[2] = {values->ddq1_ref + v[0], values->ddq2_ref + v[1]};
            arm_inverse_dynamics(&arm, ddq, unlimited);
            return;
        }
        arm_gravity_forces(&arm, gravity);
    }
    unlimited[0] = joints[0].inertia * v[0] + gravity[0];
    unlimited[1] = joints[1].inertia * v[1] + gravity[1];
}

/* Writes the fields that have no value in rp_controller.toml. Of the sampled form the integral
 * parts are those that the sample will have; of the continuous one sample_time and rates are 0. */
static inline void rp_controller_calculate(struct rp_controller_values *values) {
    const struct rp_controller_parameters *p = &values->parameters;
    const struct joint_law joints[2] = {
        {
            .Kp = p->Kp1,
            .Kd = p->Kd1,
            .Ki = p->Ki1,
            .inertia = p->inertia1,
            .limit = p->tau1_max,
            .error = values->q1_ref - values->q1,
            .error_rate = values->dq1_ref - values->dq1,
            .integral = values->integral1 + p->sample_time * values->rate1,
        },
        {
            .Kp = p->Kp2,
            .Kd = p->Kd2,
            .Ki = p->Ki2,
            .inertia = p->inertia2,
            .limit = p->f2_max,
            .error = values->q2_ref - values->q2,
            .error_rate = values->dq2_ref - values->dq2,
            .integral = values->integral2 + p->sample_time * values->rate2,
        },
    };
    real unlimited[2];
    law_unlimited(values, joints, unlimited);
    values->tau1_requested = unlimited[0];
    values->f2_requested = unlimited[1];
    values->tau1_law = law_limited(unlimited[0], p->tau1_max);
    values->f2_law = law_limited(unlimited[1], p->f2_max);
    values->rate1_law = law_integral_rate(&joints[0], unlimited[0], p->tracking_time);
    values->rate2_law = law_integral_rate(&joints[1], unlimited[1], p->tracking_time);
}
