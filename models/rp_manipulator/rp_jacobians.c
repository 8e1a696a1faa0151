#include "arithmetic_gradient.h"
#include "rp_equations_lifted.h"

void rp_dynamics_jacobians(const struct rp_parameters *p, const double q[2], const double dq[2],
                           const double tau[2], struct rp_dynamics_jacobians *jacobians) {
    enum { Q = 0, DQ = 2, TAU = 4 }; // where their derivatives begin
    const real q_moving[2] = {variable(q[0], Q), variable(q[1], Q + 1)};
    const real dq_moving[2] = {variable(dq[0], DQ), variable(dq[1], DQ + 1)};
    const real tau_moving[2] = {variable(tau[0], TAU), variable(tau[1], TAU + 1)};

    const struct arm arm = arm_in_state(&p, q_moving, dq_moving);
    real ddq[2];
    arm_forward_dynamics(&arm, tau_moving, ddq);
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            jacobians->q[i][j] = ddq[i].by[Q + j];
            jacobians->dq[i][j] = ddq[i].by[DQ + j];
            jacobians->tau[i][j] = ddq[i].by[TAU + j];
        }
    }
}
