#include "arithmetic_gradient.h"
#include "rp_plant_equations_lifted.h"

void rp_plant_jacobians(const struct rp_plant_parameters *p, const struct rp_plant_modes *modes,
                        const double q[2], const double dq[2], const struct rp_plant_inputs *inputs,
                        struct rp_plant_jacobians *jacobians) {
    enum { Q = 0, DQ = 2 }; // where their derivatives begin
    const real q_moving[2] = {variable(q[0], Q), variable(q[1], Q + 1)};
    const real dq_moving[2] = {variable(dq[0], DQ), variable(dq[1], DQ + 1)};
    const real tau[2] = {constant(inputs->tau[0]), constant(inputs->tau[1])};
    const real wrench[3] = {constant(inputs->wrench[0]), constant(inputs->wrench[1]),
                            constant(inputs->wrench[2])};

    const bool attached = modes->payload == RP_PLANT_ATTACHED;
    const struct plant plant = plant_in_state(&p, attached, q_moving, dq_moving);
    real applied[2];
    real efforts[2];
    real ddq[2];
    real reaction[2];
    plant_wrench_forces(&plant, wrench, applied);
    plant_efforts(&plant, &p, modes, tau, applied, efforts);
    plant_motion(&plant, modes->joint, efforts, ddq, reaction);
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            jacobians->q[i][j] = ddq[i].by[Q + j];
            jacobians->dq[i][j] = ddq[i].by[DQ + j];
        }
    }
}
