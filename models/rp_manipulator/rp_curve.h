/* The arm's terms with their derivatives along a curve of parameters, positions and velocities: for
 * what passes derivatives on, the arm itself and a controller that computes with the same terms. */
#ifndef RP_CURVE_H
#define RP_CURVE_H

#include "rp_manipulator.h"
#include "taylor.h"

struct rp_curve {
    struct taylor m1, m2, I1z, I2z, l1, lc1, a, g;
    struct taylor q[2], dq[2];

    struct taylor s1, c1;
    struct taylor L; /* l1 + q2 */
    struct taylor J; /* m1 lc1^2 + I1z + I2z + m2 L^2 */
};

/* Each argument: the values, their first and their second derivatives. */
struct rp_curve rp_curve_of(const struct rp_parameters *const parameters[3],
                            const double *const q[3], const double *const dq[3]);

/* D (6)-(8), C dq of (14) and (15), g(q) (11). */
void rp_curve_mass_matrix(const struct rp_curve *curve, struct taylor D[2][2]);
void rp_curve_coriolis_forces(const struct rp_curve *curve, struct taylor forces[2]);
void rp_curve_gravity_forces(const struct rp_curve *curve, struct taylor forces[2]);

#endif
