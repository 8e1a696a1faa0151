#include "rp_controller.h"

void rp_controller_unlimited(const struct rp_controller_parameters *p,
                             const struct rp_controller_inputs *inputs, const double w[2],
                             double unlimited[2]) {
    double v[2];
    for (int i = 0; i < 2; i++) {
        v[i] = p->Kp[i] * (inputs->q_ref[i] - inputs->q[i]) +
               p->Kd[i] * (inputs->dq_ref[i] - inputs->dq[i]) + w[i];
    }

    if (p->mode == RP_CONTROLLER_COMPUTED_TORQUE) {
        const double ddq[2] = {inputs->ddq_ref[0] + v[0], inputs->ddq_ref[1] + v[1]};
        rp_inverse_dynamics(&p->arm, inputs->q, inputs->dq, ddq, unlimited);
        return;
    }
    double gravity[2] = {0.0, 0.0};
    if (p->mode == RP_CONTROLLER_PD_GRAVITY) {
        rp_gravity_forces(&p->arm, inputs->q, gravity);
    }
    for (int i = 0; i < 2; i++) {
        unlimited[i] = p->inertia[i] * v[i] + gravity[i];
    }
}

void rp_controller_limited(const struct rp_controller_parameters *p, const double unlimited[2],
                           double effort[2]) {
    for (int i = 0; i < 2; i++) {
        effort[i] = unlimited[i];
        if (unlimited[i] > p->limit[i]) {
            effort[i] = p->limit[i];
        } else if (unlimited[i] < -p->limit[i]) {
            effort[i] = -p->limit[i];
        }
    }
}

void rp_controller_integral_rates(const struct rp_controller_parameters *p,
                                  const struct rp_controller_inputs *inputs,
                                  const double unlimited[2], double rates[2]) {
    double effort[2];
    rp_controller_limited(p, unlimited, effort);
    for (int i = 0; i < 2; i++) {
        const double error = inputs->q_ref[i] - inputs->q[i];
        const double excess = unlimited[i] - effort[i];
        rates[i] =
            p->Ki[i] > 0.0 ? p->Ki[i] * error - excess / (p->inertia[i] * p->tracking_time) : 0.0;
    }
}
