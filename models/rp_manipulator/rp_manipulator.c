#include "rp_equations.h"

#include <stddef.h>

static const double at_rest[2] = {0.0, 0.0};

double rp_fixed_inertia(const struct rp_parameters *p) {
    return arm_fixed_inertia(p);
}

bool rp_parameters_check(const struct rp_parameters *p) {
    const double not_negative[] = {p->m1, p->I1z, p->I2z, p->l1, p->lc1};
    for (size_t i = 0; i < sizeof not_negative / sizeof not_negative[0]; i++) {
        if (!isfinite(not_negative[i]) || not_negative[i] < 0.0) {
            return false;
        }
    }
    return isfinite(p->m2) && p->m2 > 0.0 && isfinite(p->a) && isfinite(p->g) &&
           rp_fixed_inertia(p) > 0.0;
}

void rp_mass_matrix(const struct rp_parameters *p, const double q[2], double D[2][2]) {
    const struct arm arm = arm_in_state(p, q, at_rest);
    arm_mass_matrix(&arm, D);
}

void rp_christoffel(const struct rp_parameters *p, const double q[2], double c[2][2][2]) {
    const struct arm arm = arm_in_state(p, q, at_rest);
    arm_christoffel(&arm, c);
}

void rp_coriolis_matrix(const struct rp_parameters *p, const double q[2], const double dq[2],
                        double C[2][2]) {
    const struct arm arm = arm_in_state(p, q, dq);
    arm_coriolis_matrix(&arm, C);
}

void rp_coriolis_forces(const struct rp_parameters *p, const double q[2], const double dq[2],
                        double forces[2]) {
    const struct arm arm = arm_in_state(p, q, dq);
    arm_coriolis_forces(&arm, forces);
}

double rp_potential_energy(const struct rp_parameters *p, const double q[2]) {
    const struct arm arm = arm_in_state(p, q, at_rest);
    return arm_potential_energy(&arm);
}

void rp_gravity_forces(const struct rp_parameters *p, const double q[2], double forces[2]) {
    const struct arm arm = arm_in_state(p, q, at_rest);
    arm_gravity_forces(&arm, forces);
}

double rp_kinetic_energy(const struct rp_parameters *p, const double q[2], const double dq[2]) {
    const struct arm arm = arm_in_state(p, q, dq);
    return arm_kinetic_energy(&arm);
}

void rp_inverse_dynamics(const struct rp_parameters *p, const double q[2], const double dq[2],
                         const double ddq[2], double tau[2]) {
    const struct arm arm = arm_in_state(p, q, dq);
    arm_inverse_dynamics(&arm, ddq, tau);
}

void rp_forward_dynamics(const struct rp_parameters *p, const double q[2], const double dq[2],
                         const double tau[2], double ddq[2]) {
    const struct arm arm = arm_in_state(p, q, dq);
    arm_forward_dynamics(&arm, tau, ddq);
}

void rp_dynamics_jacobians(const struct rp_parameters *p, const double q[2], const double dq[2],
                           const double tau[2], struct rp_dynamics_jacobians *jacobians) {
    double J[2 * 6];
    arm_accelerations_jacobian(p, q, dq, tau, J);
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            jacobians->q[i][j] = J[i + 2 * j];
            jacobians->dq[i][j] = J[i + 2 * (2 + j)];
            jacobians->tau[i][j] = J[i + 2 * (4 + j)];
        }
    }
}
