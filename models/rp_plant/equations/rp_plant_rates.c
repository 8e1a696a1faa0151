#include "arithmetic_taylor.h"
#include "rp_plant_equations_lifted.h"

/* Along the motion, whose velocities and accelerations are the rates of q and q'. */
void rp_plant_reaction_rates(const struct rp_plant_parameters *p,
                             const struct rp_plant_modes *modes, const double q[2],
                             const double dq[2], const struct rp_plant_inputs *inputs,
                             const struct rp_plant_inputs *du, double rates[2]) {
    static const struct rp_plant_parameters constant_in_time = {0};
    const struct rp_plant_parameters *const sources[SOURCES] = {p, &constant_in_time,
                                                                &constant_in_time};
    struct rp_plant_motion now;
    rp_plant_motion(p, modes, q, dq, inputs, &now);

    const real q_moving[2] = {{q[0], dq[0], 0.0}, {q[1], dq[1], 0.0}};
    const real dq_moving[2] = {{dq[0], now.ddq[0], 0.0}, {dq[1], now.ddq[1], 0.0}};
    const real tau[2] = {{inputs->tau[0], du->tau[0], 0.0}, {inputs->tau[1], du->tau[1], 0.0}};
    const real wrench[3] = {{inputs->wrench[0], du->wrench[0], 0.0},
                            {inputs->wrench[1], du->wrench[1], 0.0},
                            {inputs->wrench[2], du->wrench[2], 0.0}};

    const bool attached = modes->payload == RP_PLANT_ATTACHED;
    const struct plant plant = plant_in_state(sources, attached, q_moving, dq_moving);
    real applied[2];
    real efforts[2];
    real ddq[2];
    real reaction[2];
    plant_wrench_forces(&plant, wrench, applied);
    plant_efforts(&plant, sources, modes, tau, applied, efforts);
    plant_motion(&plant, modes->joint, efforts, ddq, reaction);
    rates[0] = reaction[0].first;
    rates[1] = reaction[1].first;
}
