#include "rp_plant_equations.h"

static const double at_rest[2] = {0.0, 0.0};

static bool is_attached(const struct rp_plant_modes *modes) {
    return modes->payload == RP_PLANT_ATTACHED;
}

static inline void efforts_of_inputs(const struct plant *plant, const struct rp_plant_parameters *p,
                                     const struct rp_plant_modes *modes,
                                     const struct rp_plant_inputs *inputs, double efforts[2]) {
    double Q[2];
    plant_wrench_forces(plant, inputs->wrench, Q);
    plant_efforts(plant, p, modes, inputs->tau, Q, efforts);
}

/* det D = J (m2 + b2) + m2 a^2 b2 */
void rp_plant_inertia(const struct rp_plant_parameters *p, bool attached, double q2,
                      struct rp_plant_inertia *inertia) {
    const double q[2] = {0.0, q2}; // D does not depend on q1
    const struct plant plant = plant_in_state(p, attached, q, at_rest);
    const struct arm *arm = &plant.arm;
    const double b2 = plant.armature2;
    plant_mass_matrix(&plant, inertia->D);
    inertia->determinant = arm->J * (arm->m2 + b2) + arm->m2 * arm->a * arm->a * b2;
}

double rp_plant_kinetic_energy(const struct rp_plant_parameters *p, bool attached,
                               const double q[2], const double dq[2]) {
    const struct plant plant = plant_in_state(p, attached, q, dq);
    return plant_kinetic_energy(&plant);
}

void rp_plant_forces(const struct rp_plant_parameters *p, const struct rp_plant_modes *modes,
                     const double q[2], const double dq[2], const struct rp_plant_inputs *inputs,
                     double forces[2]) {
    const struct plant plant = plant_in_state(p, is_attached(modes), q, dq);
    double efforts[2];
    efforts_of_inputs(&plant, p, modes, inputs, efforts);
    plant_forces(&plant, efforts, forces);
}

void rp_plant_motion(const struct rp_plant_parameters *p, const struct rp_plant_modes *modes,
                     const double q[2], const double dq[2], const struct rp_plant_inputs *inputs,
                     struct rp_plant_motion *motion) {
    const struct plant plant = plant_in_state(p, is_attached(modes), q, dq);
    double efforts[2];
    efforts_of_inputs(&plant, p, modes, inputs, efforts);
    plant_motion(&plant, modes->joint, efforts, motion->ddq, motion->reaction);
}
