#include "rp_controller_propagation.h"

#include "taylor.h"

#include <stddef.h>

/* A point of the curve with its derivatives along it. */
struct curve {
    const struct rp_controller_values *values;
    const struct rp_controller_values *first;
    const struct rp_controller_values *second;
};

static const struct taylor none = {0.0, 0.0, 0.0};

/* A double of the three structures as one quantity. */
#define ON_CURVE(curve, field)                                                                     \
    ((struct taylor){(curve)->values->field, (curve)->first->field, (curve)->second->field})

static struct taylor product(struct taylor x, struct taylor y, struct taylor z) {
    return taylor_product(taylor_product(x, y), z);
}

static struct taylor error(const struct curve *c, int i) {
    return taylor_difference(ON_CURVE(c, inputs.q_ref[i]), ON_CURVE(c, inputs.q[i]));
}

static struct taylor derror(const struct curve *c, int i) {
    return taylor_difference(ON_CURVE(c, inputs.dq_ref[i]), ON_CURVE(c, inputs.dq[i]));
}

/* v = Kp e + Kd de + w */
static struct taylor correction(const struct curve *c, int i) {
    const struct taylor proportional = taylor_product(ON_CURVE(c, parameters.Kp[i]), error(c, i));
    const struct taylor damping = taylor_product(ON_CURVE(c, parameters.Kd[i]), derror(c, i));
    return taylor_sum(taylor_sum(proportional, damping), ON_CURVE(c, integral[i]));
}

static struct taylor slide_length(const struct curve *c) {
    return taylor_sum(ON_CURVE(c, parameters.arm.l1), ON_CURVE(c, inputs.q[1]));
}

/* g (m1 lc1 c1 + m2 (L c1 - a s1)) and m2 g s1, (11). */
static void gravity_forces(const struct curve *c, struct taylor forces[2]) {
    const struct taylor m2 = ON_CURVE(c, parameters.arm.m2);
    const struct taylor s1 = taylor_sine(ON_CURVE(c, inputs.q[0]));
    const struct taylor c1 = taylor_cosine(ON_CURVE(c, inputs.q[0]));
    const struct taylor g = ON_CURVE(c, parameters.arm.g);

    const struct taylor moment1 =
        product(ON_CURVE(c, parameters.arm.m1), ON_CURVE(c, parameters.arm.lc1), c1);
    const struct taylor x2 = taylor_difference(taylor_product(slide_length(c), c1),
                                               taylor_product(ON_CURVE(c, parameters.arm.a), s1));
    forces[0] = taylor_product(g, taylor_sum(moment1, taylor_product(m2, x2)));
    forces[1] = product(m2, g, s1);
}

/* The left sides of (14) and (15) without gravity:
 *
 *   (J + m2 a^2) ddq1 - a m2 ddq2 + 2 m2 L dq1 dq2,   J = m1 lc1^2 + I1z + I2z + m2 L^2
 *   m2 (ddq2 - a ddq1 - L dq1^2) */
static void motion_forces(const struct curve *c, const struct taylor ddq[2],
                          struct taylor forces[2]) {
    const struct taylor m2 = ON_CURVE(c, parameters.arm.m2);
    const struct taylor a = ON_CURVE(c, parameters.arm.a);
    const struct taylor L = slide_length(c);
    const struct taylor dq1 = ON_CURVE(c, inputs.dq[0]);
    const struct taylor dq2 = ON_CURVE(c, inputs.dq[1]);

    const struct taylor link1 = taylor_product(ON_CURVE(c, parameters.arm.m1),
                                               taylor_square(ON_CURVE(c, parameters.arm.lc1)));
    const struct taylor fixed = taylor_sum(taylor_sum(link1, ON_CURVE(c, parameters.arm.I1z)),
                                           ON_CURVE(c, parameters.arm.I2z));
    const struct taylor reach = taylor_sum(taylor_square(L), taylor_square(a));
    const struct taylor d11 = taylor_sum(fixed, taylor_product(m2, reach));
    const struct taylor coriolis = taylor_scaled(2.0, product(L, dq1, dq2));
    forces[0] =
        taylor_sum(taylor_product(d11, ddq[0]),
                   taylor_product(m2, taylor_difference(coriolis, taylor_product(a, ddq[1]))));

    const struct taylor turning =
        taylor_sum(taylor_product(a, ddq[0]), taylor_product(L, taylor_square(dq1)));
    forces[1] = taylor_product(m2, taylor_difference(ddq[1], turning));
}

static void unlimited_efforts(const struct curve *c, struct taylor efforts[2]) {
    const int mode = c->values->parameters.mode;
    const struct taylor v[2] = {correction(c, 0), correction(c, 1)};
    struct taylor gravity[2] = {none, none};
    if (mode != RP_CONTROLLER_PD) {
        gravity_forces(c, gravity);
    }

    if (mode == RP_CONTROLLER_COMPUTED_TORQUE) {
        const struct taylor ddq[2] = {taylor_sum(ON_CURVE(c, inputs.ddq_ref[0]), v[0]),
                                      taylor_sum(ON_CURVE(c, inputs.ddq_ref[1]), v[1])};
        motion_forces(c, ddq, efforts);
    } else {
        efforts[0] = taylor_product(ON_CURVE(c, parameters.inertia[0]), v[0]);
        efforts[1] = taylor_product(ON_CURVE(c, parameters.inertia[1]), v[1]);
    }
    efforts[0] = taylor_sum(efforts[0], gravity[0]);
    efforts[1] = taylor_sum(efforts[1], gravity[1]);
}

static struct taylor limited(struct taylor effort, struct taylor limit) {
    if (effort.value >= limit.value) {
        return limit;
    }
    return effort.value <= -limit.value ? taylor_scaled(-1.0, limit) : effort;
}

static struct taylor integral_rate(const struct curve *c, int i, struct taylor unlimited,
                                   struct taylor effort) {
    const struct taylor Ki = ON_CURVE(c, parameters.Ki[i]);
    if (!(Ki.value > 0.0)) {
        return none;
    }
    const struct taylor follow =
        taylor_product(ON_CURVE(c, parameters.inertia[i]), ON_CURVE(c, parameters.tracking_time));
    const struct taylor excess = taylor_quotient(taylor_difference(unlimited, effort), follow);
    return taylor_difference(taylor_product(Ki, error(c, i)), excess);
}

static void put(struct taylor x, double *first, double *second) {
    *first = x.first;
    *second = x.second;
}

void rp_controller_propagate(const struct rp_controller_values *values,
                             struct rp_controller_values *first,
                             struct rp_controller_values *second) {
    struct rp_controller_values straight = {0};
    if (second == NULL) {
        second = &straight;
    }

    const struct curve curve = {values, first, second};
    struct taylor unlimited[2];
    unlimited_efforts(&curve, unlimited);
    for (int i = 0; i < 2; i++) {
        const struct taylor effort = limited(unlimited[i], ON_CURVE(&curve, parameters.limit[i]));
        put(unlimited[i], &first->unlimited[i], &second->unlimited[i]);
        put(effort, &first->effort[i], &second->effort[i]);
        put(integral_rate(&curve, i, unlimited[i], effort), &first->dintegral[i],
            &second->dintegral[i]);
        put(error(&curve, i), &first->error[i], &second->error[i]);
        put(derror(&curve, i), &first->derror[i], &second->derror[i]);
    }
}
