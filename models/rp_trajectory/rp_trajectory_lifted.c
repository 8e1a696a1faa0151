#include "rp_trajectory_lifted.h"

#include <stddef.h>

static const double two_pi = 6.28318530717958647693;

static struct taylor constant(double value) {
    return (struct taylor){.value = value};
}

/* A parameter on the curve, by its address in curve->value. */
static struct taylor of(const struct rp_trajectory_curve *curve, const double *parameter) {
    const ptrdiff_t offset = (const char *)parameter - (const char *)curve->value;
    return (struct taylor){
        .value = *parameter,
        .first = *(const double *)(const void *)((const char *)curve->first + offset),
        .second = *(const double *)(const void *)((const char *)curve->second + offset),
    };
}

/* ---- Laws of time --------------------------------------------------------------------------- */

/* Time since the start of the motion. */
static struct motion elapsed_time(const struct rp_trajectory_curve *curve) {
    return (struct motion){
        .position = taylor_difference(curve->time, of(curve, &curve->value->start_time)),
        .velocity = constant(1.0),
    };
}

/* time / duration */
static struct motion fraction(struct motion time, struct taylor duration) {
    return (struct motion){
        .position = taylor_quotient(time.position, duration),
        .velocity = taylor_quotient(time.velocity, duration),
    };
}

/* c0 + x (c1 + x c2) times x^power, power > 0 */
static struct motion polynomial(struct motion x, int power, const double c[3]) {
    const struct motion linear =
        motion_sum(motion_rest(constant(c[1])), motion_scaled(constant(c[2]), x));
    struct motion result = motion_sum(motion_rest(constant(c[0])), motion_product(x, linear));
    for (int i = 0; i < power; i++) {
        result = motion_product(x, result);
    }
    return result;
}

/* s(x) = 10 x^3 - 15 x^4 + 6 x^5, of which velocity and acceleration are 0 at 0 and 1. */
static struct motion scaling(struct motion x) {
    return polynomial(x, 3, (const double[]){10.0, -15.0, 6.0});
}

/* Integral of s from 0 to x: 2.5 x^4 - 3 x^5 + x^6. */
static struct motion scaling_integral(struct motion x) {
    return polynomial(x, 4, (const double[]){2.5, -3.0, 1.0});
}

/* from + (to - from) s, counted from the nearer end: s(x) = 1 - s(1 - x). So both ends are exact,
 * and what is small near an end has all its digits. */
static struct motion blend(const struct rp_trajectory_curve *curve, const double *from,
                           const double *to) {
    const struct taylor duration = of(curve, &curve->value->duration);
    const struct motion u = elapsed_time(curve);
    const struct taylor begin = of(curve, from);
    const struct taylor end = of(curve, to);
    const struct taylor way = taylor_difference(end, begin);

    if (u.position.value < 0.0) {
        return motion_rest(begin);
    }
    if (u.position.value < 0.5 * duration.value) {
        const struct motion done = motion_scaled(way, scaling(fraction(u, duration)));
        return motion_sum(motion_rest(begin), done);
    }
    if (u.position.value < duration.value) {
        const struct motion left = motion_difference(motion_rest(duration), u);
        const struct motion to_do = motion_scaled(way, scaling(fraction(left, duration)));
        return motion_difference(motion_rest(end), to_do);
    }
    return motion_rest(end);
}

/* tau(t): time at full speed that makes the phase of the circle. Its rate goes from 0 to 1 within
 * ramp_time by s, and back to 0 within the last ramp_time. */
static struct motion phase_time(const struct rp_trajectory_curve *curve) {
    const struct rp_trajectory_parameters *p = curve->value;
    const struct taylor ramp = of(curve, &p->ramp_time);
    const struct motion u = elapsed_time(curve);
    const double direction = p->frequency < 0.0 ? -1.0 : 1.0;
    const struct taylor total =
        taylor_scaled(direction, taylor_quotient(of(curve, &p->turns), of(curve, &p->frequency)));
    const struct taylor end = taylor_sum(total, ramp);

    if (u.position.value < 0.0) {
        return motion_rest(constant(0.0));
    }
    if (u.position.value < ramp.value) {
        return motion_scaled(ramp, scaling_integral(fraction(u, ramp)));
    }
    if (u.position.value < total.value) {
        return motion_difference(u, motion_rest(taylor_scaled(0.5, ramp)));
    }
    if (u.position.value < end.value) {
        const struct motion left = motion_difference(motion_rest(end), u);
        const struct motion to_do = motion_scaled(ramp, scaling_integral(fraction(left, ramp)));
        return motion_difference(motion_rest(total), to_do);
    }
    return motion_rest(total);
}

/* ---- Kinematics ----------------------------------------------------------------------------- */

/* x1 y2 - y1 x2 and x1 x2 + y1 y2 */
static struct motion cross(const struct motion v[2], const struct motion w[2]) {
    return motion_difference(motion_product(v[0], w[1]), motion_product(v[1], w[0]));
}

static struct motion dot(const struct motion v[2], const struct motion w[2]) {
    return motion_sum(motion_product(v[0], w[0]), motion_product(v[1], w[1]));
}

/* x = L c1 - a s1, y = L s1 + a c1 */
static void forward_kinematics(const struct rp_trajectory_curve *curve,
                               struct rp_trajectory_point *point) {
    const struct taylor a = of(curve, &curve->value->a);
    const struct motion L = motion_sum(motion_rest(of(curve, &curve->value->l1)), point->q[1]);
    const struct motion s1 = motion_sine(point->q[0]);
    const struct motion c1 = motion_cosine(point->q[0]);
    point->ee[0] = motion_difference(motion_product(L, c1), motion_scaled(a, s1));
    point->ee[1] = motion_sum(motion_product(L, s1), motion_scaled(a, c1));
}

/* L = +-sqrt(r^2 - a^2) and the angle atan2(a, L) at which link 1 sees the end effector. */
static struct motion slide(const struct rp_trajectory_curve *curve, const struct motion ee[2],
                           struct motion *seen_from_link1) {
    const struct motion a = motion_rest(of(curve, &curve->value->a));
    const struct motion reach =
        motion_square_root(motion_difference(dot(ee, ee), motion_product(a, a)));
    const double sign = curve->value->branch == RP_TRAJECTORY_BACKWARD ? -1.0 : 1.0;
    const struct motion L = motion_scaled(constant(sign), reach);
    *seen_from_link1 = motion_atan2(a, L);
    return L;
}

/* Whole turns that bring the angle q into (-pi, pi]. */
static double turns_to_principal(double q) {
    const double turns = -ceil(q / two_pi - 0.5);
    return turns * two_pi;
}

/* The joints from the end effector, whose polar angle is given without jumps; q1 starts in (-pi,
 * pi] where the end effector starts at start with the polar angle start_polar. */
static void inverse_kinematics(const struct rp_trajectory_curve *curve, struct motion polar,
                               const double start[2], double start_polar,
                               struct rp_trajectory_point *point) {
    const struct motion held[2] = {motion_rest(constant(start[0])),
                                   motion_rest(constant(start[1]))};
    struct motion seen_at_start;
    struct motion seen;
    slide(curve, held, &seen_at_start);
    const double shift = turns_to_principal(start_polar - seen_at_start.position.value);

    const struct motion L = slide(curve, point->ee, &seen);
    point->q[0] = motion_sum(motion_difference(polar, seen), motion_rest(constant(shift)));
    point->q[1] = motion_difference(L, motion_rest(of(curve, &curve->value->l1)));
}

/* ---- Motions -------------------------------------------------------------------------------- */

static void point_to_point(const struct rp_trajectory_curve *curve,
                           struct rp_trajectory_point *point) {
    for (int i = 0; i < 2; i++) {
        point->q[i] = blend(curve, &curve->value->q_from[i], &curve->value->q_to[i]);
    }
    forward_kinematics(curve, point);
}

/* A line that does not meet the axis turns by less than pi about it: the polar angle is counted
 * from the start. */
static void line(const struct rp_trajectory_curve *curve, struct rp_trajectory_point *point) {
    const struct rp_trajectory_parameters *p = curve->value;
    struct motion from[2];
    for (int i = 0; i < 2; i++) {
        from[i] = motion_rest(of(curve, &p->ee_from[i]));
        point->ee[i] = blend(curve, &p->ee_from[i], &p->ee_to[i]);
    }
    const struct motion start_polar = motion_atan2(from[1], from[0]);
    const struct motion turned = motion_atan2(cross(from, point->ee), dot(from, point->ee));
    inverse_kinematics(curve, motion_sum(start_polar, turned), p->ee_from,
                       start_polar.position.value, point);
}

/* Polar angle of center + radius e, e = (cos phase, sin phase), without jumps. A circle around the
 * axis is never seen farther than pi/2 from the direction e, any other never farther than pi/2
 * from that of the center. */
static struct motion polar_on_circle(const struct rp_trajectory_curve *curve, struct motion phase,
                                     const struct motion e[2]) {
    const struct rp_trajectory_parameters *p = curve->value;
    const struct motion center[2] = {
        motion_rest(of(curve, &p->center[0])),
        motion_rest(of(curve, &p->center[1])),
    };
    const struct motion radius = motion_rest(of(curve, &p->radius));
    const struct motion across = cross(e, center);
    const struct motion along = dot(e, center);
    const struct motion center2 = dot(center, center);

    if (center2.position.value < p->radius * p->radius) {
        return motion_sum(phase, motion_atan2(across, motion_sum(radius, along)));
    }
    const struct motion from_center =
        motion_atan2(motion_scaled(constant(-1.0), motion_product(radius, across)),
                     motion_sum(center2, motion_product(radius, along)));
    return motion_sum(motion_atan2(center[1], center[0]), from_center);
}

static void circle(const struct rp_trajectory_curve *curve, struct rp_trajectory_point *point) {
    const struct rp_trajectory_parameters *p = curve->value;
    const struct taylor rate = taylor_scaled(two_pi, of(curve, &p->frequency));
    const struct motion start_phase = motion_rest(of(curve, &p->start_angle));
    const struct motion phase = motion_sum(start_phase, motion_scaled(rate, phase_time(curve)));
    const struct motion e[2] = {motion_cosine(phase), motion_sine(phase)};
    const struct motion e_start[2] = {motion_cosine(start_phase), motion_sine(start_phase)};

    double start[2];
    for (int i = 0; i < 2; i++) {
        const struct taylor center = of(curve, &p->center[i]);
        const struct taylor radius = of(curve, &p->radius);
        point->ee[i] = motion_sum(motion_rest(center), motion_scaled(radius, e[i]));
        start[i] = p->center[i] + p->radius * e_start[i].position.value;
    }
    const struct motion start_polar = polar_on_circle(curve, start_phase, e_start);
    inverse_kinematics(curve, polar_on_circle(curve, phase, e), start, start_polar.position.value,
                       point);
}

void rp_trajectory_evaluate(const struct rp_trajectory_curve *curve,
                            struct rp_trajectory_point *point) {
    switch ((enum rp_trajectory_motion)curve->value->motion) {
    case RP_TRAJECTORY_POINT_TO_POINT:
        point_to_point(curve, point);
        break;
    case RP_TRAJECTORY_LINE:
        line(curve, point);
        break;
    case RP_TRAJECTORY_CIRCLE:
        circle(curve, point);
        break;
    }
}
