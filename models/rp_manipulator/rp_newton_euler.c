#include "rp_manipulator.h"

#include <math.h>

/* out = x cross y */
static void cross(const double x[3], const double y[3], double out[3]) {
    out[0] = x[1] * y[2] - x[2] * y[1];
    out[1] = x[2] * y[0] - x[0] * y[2];
    out[2] = x[0] * y[1] - x[1] * y[0];
}

/* out = domega x r + omega x (omega x r): acceleration of a point fixed to a body whose origin does
 * not accelerate */
static void rigid_acceleration(const double omega[3], const double domega[3], const double r[3],
                               double out[3]) {
    double tangential[3];
    double velocity[3];
    double centripetal[3];
    cross(domega, r, tangential);
    cross(omega, r, velocity);
    cross(omega, velocity, centripetal);
    for (int i = 0; i < 3; i++) {
        out[i] = tangential[i] + centripetal[i];
    }
}

void rp_newton_euler_forward(const struct rp_parameters *p, const double q[2], const double dq[2],
                             const double ddq[2], struct rp_link_motion *motion) {
    // both links turn about y1 = y2 = z0
    const double omega[3] = {0.0, dq[0], 0.0};
    const double domega[3] = {0.0, ddq[0], 0.0};
    for (int i = 0; i < 3; i++) {
        motion->omega[i] = omega[i];
        motion->domega[i] = domega[i];
    }

    // link 1: (16), (17)
    const double r_1_c1[3] = {0.0, 0.0, p->lc1};
    const double r_1_2[3] = {p->a, 0.0, p->l1};
    rigid_acceleration(omega, domega, r_1_c1, motion->ac1);
    rigid_acceleration(omega, domega, r_1_2, motion->ae1);

    // link 2: (18), the sliding speed entering through 2 omega x q2' z1
    const double r_2_c2[3] = {0.0, 0.0, q[1]};
    const double slide_velocity[3] = {0.0, 0.0, dq[1]};
    const double slide_acceleration[3] = {0.0, 0.0, ddq[1]};
    double relative[3];
    double half_coriolis[3];
    rigid_acceleration(omega, domega, r_2_c2, relative);
    cross(omega, slide_velocity, half_coriolis);
    for (int i = 0; i < 3; i++) {
        motion->ac2[i] =
            motion->ae1[i] + relative[i] + slide_acceleration[i] + 2.0 * half_coriolis[i];
    }
}

void rp_newton_euler_backward(const struct rp_parameters *p, const double q[2],
                              const struct rp_link_motion *motion, struct rp_joint_loads *loads) {
    const double gravity[3] = {-p->g * cos(q[0]), 0.0, -p->g * sin(q[0])};
    const double r_1_c1[3] = {0.0, 0.0, p->lc1};
    const double r_2_c1[3] = {-p->a, 0.0, p->lc1 - p->l1};
    const double r_2_c2[3] = {0.0, 0.0, q[1]};

    // link 2: (19), (20); omega x I omega vanishes because omega lies along y
    double moment[3];
    for (int i = 0; i < 3; i++) {
        loads->f2[i] = p->m2 * (motion->ac2[i] - gravity[i]);
    }
    cross(loads->f2, r_2_c2, moment);
    for (int i = 0; i < 3; i++) {
        loads->tau2[i] = -moment[i] + p->I2z * motion->domega[i];
    }

    // link 1: (21), (22)
    double moment_f1[3];
    double moment_f2[3];
    for (int i = 0; i < 3; i++) {
        loads->f1[i] = loads->f2[i] + p->m1 * (motion->ac1[i] - gravity[i]);
    }
    cross(loads->f1, r_1_c1, moment_f1);
    cross(loads->f2, r_2_c1, moment_f2);
    for (int i = 0; i < 3; i++) {
        loads->tau1[i] = loads->tau2[i] - moment_f1[i] + moment_f2[i] + p->I1z * motion->domega[i];
    }
}

void rp_newton_euler(const struct rp_parameters *p, const double q[2], const double dq[2],
                     const double ddq[2], struct rp_joint_loads *loads) {
    struct rp_link_motion motion;
    rp_newton_euler_forward(p, q, dq, ddq, &motion);
    rp_newton_euler_backward(p, q, &motion, loads);
}
