/* The wall in any arithmetic (equation.h). */
#ifndef RP_ENVIRONMENT_EQUATIONS_H
#define RP_ENVIRONMENT_EQUATIONS_H

#ifndef ARITHMETIC_H
#error "include the arithmetic before the equations"
#endif

#include "equation.h"
#include "rp_environment_model.h"

/* The outward normal, and the point that touches; all in frame 0. */
struct contact {
    real normal[2];
    real lever[2]; /* m: of the tip, from the origin of frame 2 */
    real depth;    /* m: of the tip below the surface; negative outside */
    real speed;    /* m/s: of the tip along the normal */
};

EQUATION real contact_dot(const real x[2], const real y[2]) {
    return plus(times(x[0], y[0]), times(x[1], y[1]));
}

/* With z2 = (c, s) and x2 = (-s, c):
 *
 *   r = tip_x x2 + tip_z z2 ,   v_tip = v + rate (-r_y, r_x)
 *   depth = position - n . (p + r) ,   speed = n . v_tip */
EQUATION struct contact contact_of_tip(const struct rp_environment_parameters *const p[SOURCES],
                                       const struct rp_environment_inputs *const inputs[SOURCES]) {
    const real angle = READ(inputs, angle);
    const real rate = READ(inputs, rate);
    const real c = cosine(angle);
    const real s = sine(angle);
    const real x = READ(p, tip_x);
    const real z = READ(p, tip_z);

    struct contact contact = {
        .normal = {cosine(READ(p, angle)), sine(READ(p, angle))},
        .lever = {minus(times(z, c), times(x, s)), plus(times(z, s), times(x, c))},
    };
    const real tip[2] = {plus(READ(inputs, position[0]), contact.lever[0]),
                         plus(READ(inputs, position[1]), contact.lever[1])};
    const real velocity[2] = {
        minus(READ(inputs, velocity[0]), times(rate, contact.lever[1])),
        plus(READ(inputs, velocity[1]), times(rate, contact.lever[0])),
    };
    contact.depth = minus(READ(p, position), contact_dot(contact.normal, tip));
    contact.speed = contact_dot(contact.normal, velocity);
    return contact;
}

/* x, or 0 where x is not above 0; NaN stays NaN. */
EQUATION real contact_positive(real x) {
    return value_of(x) <= 0.0 ? constant(0.0) : x;
}

/* max(0, stiffness depth - damping speed) in the wall, 0 outside and on its surface: the wall
 * pushes and never pulls. */
EQUATION real contact_force(const struct rp_environment_parameters *const p[SOURCES],
                            const struct contact *contact) {
    if (value_of(contact->depth) <= 0.0) {
        return constant(0.0);
    }
    const real spring = times(READ(p, stiffness), contact->depth);
    return contact_positive(minus(spring, times(READ(p, damping), contact->speed)));
}

/* The calculated fields of struct rp_environment_values. */
EQUATION void calculate(const struct rp_environment_values *const from[SOURCES],
                        struct rp_environment_values *const to[TARGETS]) {
    const struct rp_environment_parameters *const p[SOURCES] = PARTS(from, parameters);
    const struct rp_environment_inputs *const inputs[SOURCES] = PARTS(from, inputs);
    const struct contact contact = contact_of_tip(p, inputs);
    const real force = contact_force(p, &contact);
    const real wrench[2] = {times(force, contact.normal[0]), times(force, contact.normal[1])};
    const real moment =
        minus(times(contact.lever[0], wrench[1]), times(contact.lever[1], wrench[0]));
    WRITE(to, penetration, contact_positive(contact.depth));
    WRITE(to, force, force);
    WRITE(to, wrench[0], wrench[0]);
    WRITE(to, wrench[1], wrench[1]);
    WRITE(to, wrench[2], moment);
}

#endif
