#include "rp_equations.h"

#include <string.h>

static const double half_pi = 1.57079632679489661923;
static const double at_rest[2] = {0.0, 0.0};

void rp_dh_table(const struct rp_parameters *p, const double q[2], struct rp_dh_row rows[2]) {
    rows[0] = (struct rp_dh_row){.a = p->a, .alpha = half_pi, .d = 0.0, .theta = half_pi + q[0]};
    rows[1] = (struct rp_dh_row){.a = 0.0, .alpha = 0.0, .d = p->l1 + q[1], .theta = 0.0};
}

void rp_dh_transform(const struct rp_dh_row *row, double A[4][4]) {
    const double st = sin(row->theta);
    const double ct = cos(row->theta);
    const double sa = sin(row->alpha);
    const double ca = cos(row->alpha);
    const double transform[4][4] = {
        {ct, -st * ca, st * sa, row->a * ct},
        {st, ct * ca, -ct * sa, row->a * st},
        {0.0, sa, ca, row->d},
        {0.0, 0.0, 0.0, 1.0},
    };
    memcpy(A, transform, sizeof transform);
}

void rp_forward_kinematics(const struct rp_parameters *p, const double q[2], double T[4][4]) {
    struct rp_dh_row rows[2];
    double A1[4][4];
    double A2[4][4];
    rp_dh_table(p, q, rows);
    rp_dh_transform(&rows[0], A1);
    rp_dh_transform(&rows[1], A2);

    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            T[i][j] = 0.0;
            for (int k = 0; k < 4; k++) {
                T[i][j] += A1[i][k] * A2[k][j];
            }
        }
    }
}

void rp_end_effector_position(const struct rp_parameters *p, const double q[2],
                              double position[2]) {
    const struct arm arm = arm_in_state(p, q, at_rest);
    arm_end_effector_position(&arm, position);
}

void rp_end_effector_velocity(const struct rp_parameters *p, const double q[2], const double dq[2],
                              double velocity[2]) {
    const struct arm arm = arm_in_state(p, q, dq);
    arm_end_effector_velocity(&arm, velocity);
}

/* Length of a vector, without overflow or underflow in between. Not hypot: since glibc 2.35 that is
 * a symbol which older systems lack. */
static double length(const double v[2]) {
    const double larger = fmax(fabs(v[0]), fabs(v[1]));
    const double smaller = fmin(fabs(v[0]), fabs(v[1]));
    if (larger == 0.0) {
        return 0.0;
    }
    const double ratio = smaller / larger;
    return larger * sqrt(1.0 + ratio * ratio);
}

/* The end effector is at distance r with r^2 = L^2 + a^2, seen from link 1 at the angle
 * atan2(a, L), so that q1 is the target's polar angle less that one. */
bool rp_inverse_kinematics(const struct rp_parameters *p, const double position[2],
                           enum rp_branch branch, double q[2]) {
    const double r = length(position);
    const double offset = fabs(p->a);
    if (!isfinite(position[0]) || !isfinite(position[1]) || !isfinite(r) || r < offset) {
        return false;
    }

    const double reach = sqrt(r - offset) * sqrt(r + offset);
    const double L = branch == RP_BRANCH_FORWARD ? reach : -reach;
    const double angle = r == 0.0 ? 0.0 : atan2(position[1], position[0]) - atan2(p->a, L);
    q[0] = remainder(angle, 4.0 * half_pi);
    if (q[0] <= -2.0 * half_pi) {
        q[0] = 2.0 * half_pi;
    }
    q[1] = L - p->l1;
    return true;
}

void rp_jacobian_angular(double J[3][2]) {
    const double about_z0[3][2] = {{0.0, 0.0}, {0.0, 0.0}, {1.0, 0.0}};
    memcpy(J, about_z0, sizeof about_z0);
}

void rp_jacobian_linear_link1(const struct rp_parameters *p, const double q[2], double J[3][2]) {
    const double jacobian[3][2] = {
        {-p->lc1 * sin(q[0]), 0.0},
        {p->lc1 * cos(q[0]), 0.0},
        {0.0, 0.0},
    };
    memcpy(J, jacobian, sizeof jacobian);
}

void rp_jacobian_linear_link2(const struct rp_parameters *p, const double q[2], double J[3][2]) {
    const struct arm arm = arm_in_state(p, q, at_rest);
    arm_end_effector_jacobian(&arm, J);
    J[2][0] = J[2][1] = 0.0;
}
