/* The equations of the reference motions. README.md derives them. */
#pragma once

#include "motion.h"
#include "rp_trajectory_values.h"

struct trajectory_point {
    struct motion q[2];  /* rad, m */
    struct motion ee[2]; /* m, frame 0 */
};

/* ---- Laws of time --------------------------------------------------------------------------- */

/* Time since the start of the motion. */
static inline struct motion elapsed_time(const struct rp_trajectory_parameters *p, real time) {
    return (struct motion){time - p->start_time, 1.0, 0.0};
}

static inline struct motion fraction(struct motion time, real duration) {
    return (struct motion){time.position / duration, time.velocity / duration, 0.0};
}

/* c0 + x (c1 + x c2) times x^power, power > 0 */
static inline struct motion polynomial(struct motion x, int power, const real c[3]) {
    const struct motion linear = motion_sum(motion_rest(c[1]), motion_scaled(c[2], x));
    struct motion result = motion_sum(motion_rest(c[0]), motion_product(x, linear));
    for (int i = 0; i < power; i++) {
        result = motion_product(x, result);
    }
    return result;
}

/* s(x) = 10 x^3 - 15 x^4 + 6 x^5, of which velocity and acceleration are 0 at 0 and 1. */
static inline struct motion scaling(struct motion x) {
    const real c[3] = {10.0, -15.0, 6.0};
    return polynomial(x, 3, c);
}

/* Integral of s from 0 to x: 2.5 x^4 - 3 x^5 + x^6. */
static inline struct motion scaling_integral(struct motion x) {
    const real c[3] = {2.5, -3.0, 1.0};
    return polynomial(x, 4, c);
}

/* begin + (end - begin) s, counted from the nearer end: s(x) = 1 - s(1 - x). So both ends are
 * exact, and what is small near an end has all its digits. */
static inline struct motion blend(const struct rp_trajectory_parameters *p, real time, real begin,
                                  real end) {
    const struct motion u = elapsed_time(p, time);
    const real way = end - begin;
    if (u.position < 0.0) {
        return motion_rest(begin);
    }
    if (u.position < 0.5 * p->duration) {
        const struct motion done = motion_scaled(way, scaling(fraction(u, p->duration)));
        return motion_sum(motion_rest(begin), done);
    }
    if (u.position < p->duration) {
        const struct motion left = motion_difference(motion_rest(p->duration), u);
        const struct motion to_do = motion_scaled(way, scaling(fraction(left, p->duration)));
        return motion_difference(motion_rest(end), to_do);
    }
    return motion_rest(end);
}

/* tau(t): time at full speed that makes the phase of the circle. Its rate goes from 0 to 1 within
 * ramp_time by s, and back to 0 within the last ramp_time. */
static inline struct motion phase_time(const struct rp_trajectory_parameters *p, real time) {
    const struct motion u = elapsed_time(p, time);
    const real ramp = p->ramp_time;
    const real direction = p->frequency < 0.0 ? -1.0 : 1.0;
    const real total = direction * (p->turns / p->frequency);
    const real end = total + ramp;

    if (u.position < 0.0) {
        return motion_rest(0.0);
    }
    if (u.position < ramp) {
        return motion_scaled(ramp, scaling_integral(fraction(u, ramp)));
    }
    if (u.position < total) {
        return motion_difference(u, motion_rest(0.5 * ramp));
    }
    if (u.position < end) {
        const struct motion left = motion_difference(motion_rest(end), u);
        const struct motion to_do = motion_scaled(ramp, scaling_integral(fraction(left, ramp)));
        return motion_difference(motion_rest(total), to_do);
    }
    return motion_rest(total);
}

/* ---- Kinematics ----------------------------------------------------------------------------- */

/* x1 y2 - y1 x2 */
static inline struct motion cross(const struct motion v[2], const struct motion w[2]) {
    return motion_difference(motion_product(v[0], w[1]), motion_product(v[1], w[0]));
}

/* x1 x2 + y1 y2 */
static inline struct motion dot(const struct motion v[2], const struct motion w[2]) {
    return motion_sum(motion_product(v[0], w[0]), motion_product(v[1], w[1]));
}

/* x = L c1 - a s1, y = L s1 + a c1 */
static inline void forward_kinematics(const struct rp_trajectory_parameters *p,
                                      struct trajectory_point *point) {
    const struct motion L = motion_sum(motion_rest(p->l1), point->q[1]);
    const struct motion s1 = motion_sine(point->q[0]);
    const struct motion c1 = motion_cosine(point->q[0]);
    point->ee[0] = motion_difference(motion_product(L, c1), motion_scaled(p->a, s1));
    point->ee[1] = motion_sum(motion_product(L, s1), motion_scaled(p->a, c1));
}

/* L = +-sqrt(r^2 - a^2) and the angle atan2(a, L) at which link 1 sees the end effector. */
static inline struct motion slide(const struct rp_trajectory_parameters *p,
                                  const struct motion ee[2], struct motion *seen_from_link1) {
    const struct motion a = motion_rest(p->a);
    const struct motion reach =
        motion_square_root(motion_difference(dot(ee, ee), motion_product(a, a)));
    const struct motion L =
        motion_scaled(p->branch == RP_TRAJECTORY_BRANCH_BACKWARD ? -1.0 : 1.0, reach);
    *seen_from_link1 = motion_atan2(a, L);
    return L;
}

/* Whole turns that bring the angle q into (-pi, pi]. */
static inline real turns_to_principal(real q) {
    const real two_pi = 6.28318530717958647693;
    const real turns = -ceil(value_of(q) / two_pi - 0.5);
    return turns * two_pi;
}

/* The joints from the end effector, whose polar angle is given without jumps; q1 starts in (-pi,
 * pi] where the end effector starts at start with the polar angle start_polar. */
static inline void inverse_kinematics(const struct rp_trajectory_parameters *p, struct motion polar,
                                      const real start[2], real start_polar,
                                      struct trajectory_point *point) {
    const struct motion held[2] = {motion_rest(start[0]), motion_rest(start[1])};
    struct motion seen_at_start;
    struct motion seen;
    slide(p, held, &seen_at_start);
    const real shift = turns_to_principal(start_polar - seen_at_start.position);

    const struct motion L = slide(p, point->ee, &seen);
    point->q[0] = motion_sum(motion_difference(polar, seen), motion_rest(shift));
    point->q[1] = motion_difference(L, motion_rest(p->l1));
}

/* ---- Motions -------------------------------------------------------------------------------- */

static inline void point_to_point(const struct rp_trajectory_parameters *p, real time,
                                  struct trajectory_point *point) {
    point->q[0] = blend(p, time, p->q1_from, p->q1_to);
    point->q[1] = blend(p, time, p->q2_from, p->q2_to);
    forward_kinematics(p, point);
}

/* A line that does not meet the axis turns by less than pi about it: the polar angle is counted
 * from the start. */
static inline void line(const struct rp_trajectory_parameters *p, real time,
                        struct trajectory_point *point) {
    const real start[2] = {p->ee_x_from, p->ee_y_from};
    const struct motion from[2] = {motion_rest(start[0]), motion_rest(start[1])};
    point->ee[0] = blend(p, time, p->ee_x_from, p->ee_x_to);
    point->ee[1] = blend(p, time, p->ee_y_from, p->ee_y_to);
    const struct motion start_polar = motion_atan2(from[1], from[0]);
    const struct motion turned = motion_atan2(cross(from, point->ee), dot(from, point->ee));
    inverse_kinematics(p, motion_sum(start_polar, turned), start, start_polar.position, point);
}

/* Polar angle of center + radius e, e = (cos phase, sin phase), without jumps. A circle around the
 * axis is never seen farther than pi/2 from the direction e, any other never farther than pi/2
 * from the center's. */
static inline struct motion polar_on_circle(const struct rp_trajectory_parameters *p,
                                            struct motion phase, const struct motion e[2]) {
    const struct motion center[2] = {motion_rest(p->x_center), motion_rest(p->y_center)};
    const struct motion radius = motion_rest(p->radius);
    const struct motion across = cross(e, center);
    const struct motion along = dot(e, center);
    const struct motion center2 = dot(center, center);

    if (center2.position < p->radius * p->radius) {
        return motion_sum(phase, motion_atan2(across, motion_sum(radius, along)));
    }
    const struct motion from_center =
        motion_atan2(motion_scaled(-1.0, motion_product(radius, across)),
                     motion_sum(center2, motion_product(radius, along)));
    return motion_sum(motion_atan2(center[1], center[0]), from_center);
}

static inline void circle(const struct rp_trajectory_parameters *p, real time,
                          struct trajectory_point *point) {
    const real two_pi = 6.28318530717958647693;
    const real rate = two_pi * p->frequency;
    const struct motion start_phase = motion_rest(p->start_angle);
    const struct motion phase = motion_sum(start_phase, motion_scaled(rate, phase_time(p, time)));
    const struct motion e[2] = {motion_cosine(phase), motion_sine(phase)};
    const struct motion e_start[2] = {motion_cosine(start_phase), motion_sine(start_phase)};

    const real center[2] = {p->x_center, p->y_center};
    real start[2];
    for (int i = 0; i < 2; i++) {
        point->ee[i] = motion_sum(motion_rest(center[i]), motion_scaled(p->radius, e[i]));
        start[i] = center[i] + p->radius * e_start[i].position;
    }
    const struct motion start_polar = polar_on_circle(p, start_phase, e_start);
    inverse_kinematics(p, polar_on_circle(p, phase, e), start, start_polar.position, point);
}

/* The motion at a time (s), with parameters that passed the checks of rp_trajectory.toml. Where two
 * segments of the motion meet, the formulas of the later one hold. */
static inline void trajectory_evaluate(const struct rp_trajectory_parameters *p, real time,
                                       struct trajectory_point *point) {
    if (p->motion == RP_TRAJECTORY_MOTION_POINT_TO_POINT) {
        point_to_point(p, time, point);
    } else if (p->motion == RP_TRAJECTORY_MOTION_LINE) {
        line(p, time, point);
    } else {
        circle(p, time, point);
    }
}
