/* The arm's outputs, in balls, from the balls of its states. */
#pragma once

#include "step.h"

enum { OUTPUTS = 10 }; /* ddq1 ddq2, position and velocity of the end effector, energies, power */

/* The efforts at a time after the last communication point, which is at `point`. */
static void arm_efforts_at(const struct arm_problem *problem, double point, struct ball after,
                           struct ball found[EFFORTS]) {
    struct ball efforts[EFFORTS][ORDERS];
    const struct step_times when = {
        .length = ball_exact(1.0),
        .within = ball_exact(0.0),
        .elapsed = ball_of_sum(point, -problem->start),
    };
    arm_efforts(problem, &when, after, efforts);
    for (int e = 0; e < EFFORTS; e++) {
        found[e] = efforts[e][0];
    }
}

/* Equation (15) over m2, and the sum of (14) and a times (15), in which ddq2 drops out:
 *     ddq2 - a ddq1 = f2 / m2 + L w^2 - g sin q1
 *     J ddq1        = tau1 + a (f2 + m2 L w^2) - 2 m2 L w v - g (m1 lc1 + m2 L) cos q1 */
static void arm_outputs(const struct arm_problem *problem, const struct ball states[STATES],
                        const struct ball efforts[EFFORTS], struct ball outputs[OUTPUTS]) {
    const struct ball *variables = problem->variables;
    const struct ball w = states[W], v = states[V], tau1 = efforts[0], f2 = efforts[1];
    const struct ball m1 = variables[M1], m2 = variables[M2], lc1 = variables[LC1];
    const struct ball a = variables[A], g = variables[G];
    struct ball s, c;
    ball_sine_and_cosine(states[Q1], &s, &c);

    // J: `fixed` is the part that q2 does not change
    const struct ball length = ball_sum(variables[L1], states[Q2]);
    const struct ball moment1 = ball_product(m1, lc1), moment2 = ball_product(m2, length);
    const struct ball fixed =
        ball_sum(ball_product(moment1, lc1), ball_sum(variables[I1Z], variables[I2Z]));
    const struct ball inertia = ball_sum(fixed, ball_product(moment2, length));

    // accelerations
    const struct ball across = ball_product(length, w);
    const struct ball push = ball_sum(f2, ball_product(m2, ball_product(across, w)));
    const struct ball coriolis = ball_scaled(ball_product(m2, ball_product(across, v)), 2.0);
    const struct ball weight = ball_product(g, ball_product(ball_sum(moment1, moment2), c));
    const struct ball applied = ball_sum(tau1, ball_product(a, push));
    const struct ball moment = ball_difference(ball_difference(applied, coriolis), weight);
    const struct ball ddq1 = ball_quotient(moment, inertia);
    const struct ball slide = ball_difference(ball_quotient(push, m2), ball_product(g, s));
    outputs[0] = ddq1;
    outputs[1] = ball_sum(slide, ball_product(a, ddq1));

    // end effector: frame 2
    const struct ball x = ball_difference(ball_product(length, c), ball_product(a, s));
    const struct ball y = ball_sum(ball_product(length, s), ball_product(a, c));
    const struct ball vx = ball_difference(ball_product(v, c), ball_product(w, y));
    const struct ball vy = ball_sum(ball_product(v, s), ball_product(w, x));
    outputs[2] = x;
    outputs[3] = y;
    outputs[4] = vx;
    outputs[5] = vy;

    // energies and power
    const struct ball speed = ball_sum(ball_product(vx, vx), ball_product(vy, vy));
    const struct ball turning = ball_product(fixed, ball_product(w, w));
    const struct ball kinetic = ball_scaled(ball_sum(turning, ball_product(m2, speed)), 0.5);
    const struct ball heights = ball_sum(ball_product(moment1, s), ball_product(m2, y));
    const struct ball potential = ball_product(g, heights);
    outputs[6] = kinetic;
    outputs[7] = potential;
    outputs[8] = ball_sum(kinetic, potential);
    outputs[9] = ball_sum(ball_product(tau1, w), ball_product(f2, v));
    for (int i = 0; i < OUTPUTS; i++) {
        outputs[i] = ball_widened(outputs[i], outputs[i].radius * LOOSENED);
    }
}
