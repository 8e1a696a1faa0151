#include "rp_manipulator.h"

#include <math.h>
#include <stddef.h>

double rp_fixed_inertia(const struct rp_parameters *p) {
    return p->m1 * p->lc1 * p->lc1 + p->I1z + p->I2z;
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

/* With L = l1 + q2, (6) reads d11 = J + m2 a^2 where J = m1 lc1^2 + I1z + I2z + m2 L^2. */
static double slide_inertia(const struct rp_parameters *p, double L) {
    return rp_fixed_inertia(p) + p->m2 * L * L;
}

void rp_mass_matrix(const struct rp_parameters *p, const double q[2], double D[2][2]) {
    const double L = p->l1 + q[1];
    D[0][0] = slide_inertia(p, L) + p->m2 * p->a * p->a;
    D[0][1] = -p->a * p->m2;
    D[1][0] = D[0][1];
    D[1][1] = p->m2;
}

void rp_christoffel(const struct rp_parameters *p, const double q[2], double c[2][2][2]) {
    const double m2L = p->m2 * (p->l1 + q[1]);
    c[0][0][0] = 0.0;
    c[0][0][1] = -m2L;
    c[0][1][0] = m2L;
    c[1][0][0] = m2L;
    c[0][1][1] = 0.0;
    c[1][0][1] = 0.0;
    c[1][1][0] = 0.0;
    c[1][1][1] = 0.0;
}

void rp_coriolis_matrix(const struct rp_parameters *p, const double q[2], const double dq[2],
                        double C[2][2]) {
    double c[2][2][2];
    rp_christoffel(p, q, c);

    C[0][0] = c[1][0][0] * dq[1];
    C[0][1] = c[0][1][0] * dq[0];
    C[1][0] = c[0][0][1] * dq[0];
    C[1][1] = 0.0;
}

void rp_coriolis_forces(const struct rp_parameters *p, const double q[2], const double dq[2],
                        double forces[2]) {
    double C[2][2];
    rp_coriolis_matrix(p, q, dq, C);

    forces[0] = C[0][0] * dq[0] + C[0][1] * dq[1];
    forces[1] = C[1][0] * dq[0] + C[1][1] * dq[1];
}

double rp_potential_energy(const struct rp_parameters *p, const double q[2]) {
    const double s1 = sin(q[0]);
    const double c1 = cos(q[0]);
    return p->m1 * p->g * p->lc1 * s1 + p->m2 * p->g * (p->l1 * s1 + p->a * c1 + q[1] * s1);
}

void rp_gravity_forces(const struct rp_parameters *p, const double q[2], double forces[2]) {
    const double s1 = sin(q[0]);
    const double c1 = cos(q[0]);
    forces[0] = p->m1 * p->g * p->lc1 * c1 + p->m2 * p->g * (p->l1 * c1 - p->a * s1 + q[1] * c1);
    forces[1] = p->m2 * p->g * s1;
}

/* dq' D dq / 2 as the sum of squares that shows it is never negative: link 2 moves along the slide
 * at q2' - a q1'. */
double rp_kinetic_energy(const struct rp_parameters *p, const double q[2], const double dq[2]) {
    const double along_slide = dq[1] - p->a * dq[0];
    return 0.5 *
           (slide_inertia(p, p->l1 + q[1]) * dq[0] * dq[0] + p->m2 * along_slide * along_slide);
}

void rp_inverse_dynamics(const struct rp_parameters *p, const double q[2], const double dq[2],
                         const double ddq[2], double tau[2]) {
    double D[2][2];
    double coriolis[2];
    double gravity[2];
    rp_mass_matrix(p, q, D);
    rp_coriolis_forces(p, q, dq, coriolis);
    rp_gravity_forces(p, q, gravity);

    for (int i = 0; i < 2; i++) {
        tau[i] = D[i][0] * ddq[0] + D[i][1] * ddq[1] + coriolis[i] + gravity[i];
    }
}

/* (14) plus a times (15) eliminates q2'' and, in the gravity terms, the offset a:
 *
 *   J q1'' = tau1 + a f2 - 2 m2 L q1' q2' + a m2 L q1'^2 - g c1 (m1 lc1 + m2 L)
 *
 * and (15) divided by m2 is q2'' = f2 / m2 + L q1'^2 - g s1 + a q1''. J > 0 for valid parameters,
 * so no determinant is formed and nothing cancels. */
void rp_forward_dynamics(const struct rp_parameters *p, const double q[2], const double dq[2],
                         const double tau[2], double ddq[2]) {
    const double m2 = p->m2;
    const double a = p->a;
    const double L = p->l1 + q[1];
    const double s1 = sin(q[0]);
    const double c1 = cos(q[0]);

    const double torque = tau[0] + a * tau[1] + m2 * L * dq[0] * (a * dq[0] - 2.0 * dq[1]) -
                          p->g * c1 * (p->m1 * p->lc1 + m2 * L);
    ddq[0] = torque / slide_inertia(p, L);
    ddq[1] = tau[1] / m2 + L * dq[0] * dq[0] - p->g * s1 + a * ddq[0];
}

/* Derivatives of the two equations above rp_forward_dynamics, by the product rule. */
void rp_dynamics_jacobians(const struct rp_parameters *p, const double q[2], const double dq[2],
                           const double tau[2], struct rp_dynamics_jacobians *jacobians) {
    const double m2 = p->m2;
    const double a = p->a;
    const double L = p->l1 + q[1];
    const double s1 = sin(q[0]);
    const double c1 = cos(q[0]);
    const double J = slide_inertia(p, L);
    double ddq[2];
    rp_forward_dynamics(p, q, dq, tau, ddq);

    // by q: q1 enters through gravity alone, q2 through L
    const double torque_q2 = m2 * dq[0] * (a * dq[0] - 2.0 * dq[1]) - p->g * c1 * m2;
    jacobians->q[0][0] = p->g * s1 * (p->m1 * p->lc1 + m2 * L) / J;
    jacobians->q[0][1] = (torque_q2 - 2.0 * m2 * L * ddq[0]) / J;
    jacobians->q[1][0] = -p->g * c1 + a * jacobians->q[0][0];
    jacobians->q[1][1] = dq[0] * dq[0] + a * jacobians->q[0][1];

    // by dq
    jacobians->dq[0][0] = 2.0 * m2 * L * (a * dq[0] - dq[1]) / J;
    jacobians->dq[0][1] = -2.0 * m2 * L * dq[0] / J;
    jacobians->dq[1][0] = 2.0 * L * dq[0] + a * jacobians->dq[0][0];
    jacobians->dq[1][1] = a * jacobians->dq[0][1];

    // by tau
    jacobians->tau[0][0] = 1.0 / J;
    jacobians->tau[0][1] = a / J;
    jacobians->tau[1][0] = a / J;
    jacobians->tau[1][1] = 1.0 / m2 + a * a / J;
}
