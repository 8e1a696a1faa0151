#include "rp_curve.h"

#define PARAMETER(name)                                                                            \
    { p[0]->name, p[1]->name, p[2]->name }

struct rp_curve rp_curve_of(const struct rp_parameters *const p[3], const double *const q[3],
                            const double *const dq[3]) {
    struct rp_curve curve = {
        .m1 = PARAMETER(m1),
        .m2 = PARAMETER(m2),
        .I1z = PARAMETER(I1z),
        .I2z = PARAMETER(I2z),
        .l1 = PARAMETER(l1),
        .lc1 = PARAMETER(lc1),
        .a = PARAMETER(a),
        .g = PARAMETER(g),
    };
    for (int i = 0; i < 2; i++) {
        curve.q[i] = (struct taylor){q[0][i], q[1][i], q[2][i]};
        curve.dq[i] = (struct taylor){dq[0][i], dq[1][i], dq[2][i]};
    }

    curve.s1 = taylor_sine(curve.q[0]);
    curve.c1 = taylor_cosine(curve.q[0]);
    curve.L = taylor_sum(curve.l1, curve.q[1]);
    const struct taylor link1 = taylor_product(curve.m1, taylor_square(curve.lc1));
    const struct taylor fixed = taylor_sum(taylor_sum(link1, curve.I1z), curve.I2z);
    curve.J = taylor_sum(fixed, taylor_product(curve.m2, taylor_square(curve.L)));
    return curve;
}

void rp_curve_mass_matrix(const struct rp_curve *curve, struct taylor D[2][2]) {
    D[0][0] = taylor_sum(curve->J, taylor_product(curve->m2, taylor_square(curve->a)));
    D[0][1] = taylor_scaled(-1.0, taylor_product(curve->a, curve->m2));
    D[1][0] = D[0][1];
    D[1][1] = curve->m2;
}

void rp_curve_coriolis_forces(const struct rp_curve *curve, struct taylor forces[2]) {
    const struct taylor c121_dq1 =
        taylor_product(taylor_product(curve->m2, curve->L), curve->dq[0]);
    forces[0] = taylor_scaled(2.0, taylor_product(c121_dq1, curve->dq[1]));
    forces[1] = taylor_scaled(-1.0, taylor_product(c121_dq1, curve->dq[0]));
}

void rp_curve_gravity_forces(const struct rp_curve *curve, struct taylor forces[2]) {
    const struct taylor x1 = taylor_product(curve->lc1, curve->c1);
    const struct taylor x2 =
        taylor_difference(taylor_product(curve->L, curve->c1), taylor_product(curve->a, curve->s1));
    const struct taylor moment =
        taylor_sum(taylor_product(curve->m1, x1), taylor_product(curve->m2, x2));
    forces[0] = taylor_product(curve->g, moment);
    forces[1] = taylor_product(taylor_product(curve->m2, curve->g), curve->s1);
}
