/* The equations of the plant in any arithmetic (equation.h): rp_plant.h is these with doubles, and
 * says what they mean. In given modes they are smooth: a joint that slides forward keeps the sign
 * of its friction also where its velocity passes 0. */
#ifndef RP_PLANT_EQUATIONS_LIFTED_H
#define RP_PLANT_EQUATIONS_LIFTED_H

#include "rp_payload_lifted.h"
#include "rp_plant.h"

#include <stdlib.h>

/* The plant in a state, with what many equations share. */
struct plant {
    struct arm hand; /* without payload and armature: where the end effector is */
    struct arm arm;  /* link 2 with the payload, if attached; J with the armature of joint 1 */
    real armature2;  /* kg */
    real offset_x;   /* m: center of mass of link 2 with payload, from that without */
    real offset_z;   /* m */
};

/* ---- Bodies --------------------------------------------------------------------------------- */

EQUATION void plant_attach(struct plant *plant,
                           const struct rp_plant_parameters *const p[SOURCES]) {
    const struct payload payload = {
        .mass = READ(p, payload_mass),
        .inertia = READ(p, payload_inertia),
        .x = READ(p, payload_x),
        .z = READ(p, payload_z),
    };
    real offset[2];
    arm_attach(&plant->arm, &payload, offset);
    plant->offset_x = offset[0];
    plant->offset_z = offset[1];
}

/* The armature of joint 1 turns as I1z does, so that J takes it up; that of joint 2 is the only one
 * that the manipulator's equations have no place for. */
EQUATION struct plant plant_in_state(const struct rp_plant_parameters *const p[SOURCES],
                                     bool attached, const real q[2], const real dq[2]) {
    const struct rp_parameters *const arm[SOURCES] = PARTS(p, arm);
    struct plant plant;
    plant.hand = arm_in_state(arm, q, dq);
    plant.arm = plant.hand;
    plant.armature2 = READ(p, armature[1]);
    plant.offset_x = constant(0.0);
    plant.offset_z = constant(0.0);
    if (attached) {
        plant_attach(&plant, p);
    }
    plant.arm.J = plus(plant.arm.J, READ(p, armature[0]));
    return plant;
}

EQUATION void plant_mass_matrix(const struct plant *plant, real D[2][2]) {
    arm_mass_matrix(&plant->arm, D);
    D[1][1] = plus(D[1][1], plant->armature2);
}

EQUATION real plant_kinetic_energy(const struct plant *plant) {
    const real dq2 = plant->arm.dq[1];
    const real drive2 = times(times(plant->armature2, dq2), dq2);
    return plus(arm_kinetic_energy(&plant->arm), scaled(0.5, drive2));
}

/* ---- Forces --------------------------------------------------------------------------------- */

/* Q = J^T w with the rows of (1) and (3):  Q1 = x fy - y fx + mz,  Q2 = c1 fx + s1 fy */
EQUATION void plant_wrench_forces(const struct plant *plant, const real wrench[3], real forces[2]) {
    const struct arm *hand = &plant->hand;
    real position[2];
    arm_end_effector_position(hand, position);
    const real moment = minus(times(position[0], wrench[1]), times(position[1], wrench[0]));
    forces[0] = plus(moment, wrench[2]);
    forces[1] = plus(times(hand->c1, wrench[0]), times(hand->s1, wrench[1]));
}

/* exp(x): the polynomial of degree 2 about the value of x has its value and its first two
 * derivatives, more than which no arithmetic keeps. */
EQUATION real plant_exponential(real x) {
    const double least = -750.0; // exp is 0 below
    if (value_of(x) < least) {
        return constant(0.0);
    }
    const real d = minus(x, constant(value_of(x)));
    const real polynomial = plus(plus(constant(1.0), d), scaled(0.5, times(d, d)));
    return scaled(exp(value_of(x)), polynomial);
}

EQUATION real plant_breakaway(const struct rp_plant_parameters *const p[SOURCES], int i) {
    const real breakaway = READ(p, breakaway_friction[i]);
    return value_of(breakaway) > 0.0 ? breakaway : READ(p, coulomb_friction[i]);
}

/* What is added to e where a joint has turned back, up to the event that ends its mode: w^8 / (1 +
 * w^8) of w = v / vs, 0 at v = 0 with seven derivatives. Otherwise an internal step from a fast
 * motion forward to one backward would find Fc at both ends, and no trace of what lies between. */
EQUATION real plant_turned_back(real w) {
    const real w2 = times(w, w);
    const real w4 = times(w2, w2);
    const real w8 = times(w4, w4);
    const double most = 1e16; // from there on it is 1
    if (!(value_of(w8) < most)) {
        return constant(1.0);
    }
    return quotient(w8, plus(constant(1.0), w8));
}

/* F(v) = Fc + (Fb - Fc) e with e = exp(-(v / vs)^2), summed up so that F(0) is Fb to the bit; v in
 * the direction of the mode. */
EQUATION real plant_sliding_friction(const struct rp_plant_parameters *const p[SOURCES], int i,
                                     real v) {
    const real coulomb = READ(p, coulomb_friction[i]);
    const real breakaway = READ(p, breakaway_friction[i]);
    const real velocity = READ(p, stribeck_velocity[i]);
    if (!(value_of(breakaway) > 0.0 && value_of(velocity) > 0.0)) {
        return coulomb;
    }
    const real w = quotient(v, velocity);
    // exp(-100) of the difference is left, and rounding leaves Fc
    if (value_of(w) > 10.0 && value_of(breakaway) < 1e20 * value_of(coulomb)) {
        return coulomb;
    }
    real e = plant_exponential(negative(times(w, w)));
    if (value_of(w) < 0.0) {
        e = plus(e, plant_turned_back(w));
    }
    return plus(times(breakaway, e), times(coulomb, minus(constant(1.0), e)));
}

/* Friction of a joint that slides, against its direction; 0 for one that does not. */
EQUATION real plant_friction(const struct rp_plant_parameters *const p[SOURCES], int mode, int i,
                             real dq) {
    if (mode != RP_PLANT_FORWARD && mode != RP_PLANT_BACKWARD) {
        return constant(0.0);
    }
    return scaled(mode, plant_sliding_friction(p, i, scaled(mode, dq)));
}

/* ---- Stops ---------------------------------------------------------------------------------- */

/* As rp_plant_closed_stop, of the position's value. */
EQUATION int plant_closed_stop(const struct rp_plant_parameters *const p[SOURCES], int i, real q) {
    if (p[0]->stops[i] != RP_PLANT_STOPS_RIGID) {
        return 0;
    }
    if (value_of(q) <= p[0]->lower[i]) {
        return 1;
    }
    return value_of(q) >= p[0]->upper[i] ? -1 : 0;
}

/* d of the stop that the joint is in contact with. */
EQUATION real plant_penetration(const struct rp_plant_parameters *const p[SOURCES], int contact,
                                int i, real q) {
    return contact > 0 ? minus(READ(p, lower[i]), q) : minus(q, READ(p, upper[i]));
}

/* 1 + c d': the stop pushes while this is above 0. */
EQUATION real plant_push(const struct rp_plant_parameters *const p[SOURCES], int contact, int i,
                         real dq) {
    const real y = times(READ(p, stop_damping[i]), dq);
    return contact > 0 ? minus(constant(1.0), y) : plus(constant(1.0), y);
}

/* Hunt and Crossley: k d (1 + c d'), on the joint. In a given contact it continues past d = 0, up
 * to the event that ends the contact. */
EQUATION real plant_compliant_force(const struct rp_plant_parameters *const p[SOURCES], int contact,
                                    int i, real q, real dq) {
    if (abs(contact) != RP_PLANT_PUSHED) {
        return constant(0.0);
    }
    const real elastic = times(READ(p, stop_stiffness[i]), plant_penetration(p, contact, i, q));
    const real force = times(elastic, plant_push(p, contact, i, dq));
    return contact > 0 ? force : negative(force);
}

/* k d^2 / 2, also of a stop that the joint leaves behind: what it does not give back is lost. */
EQUATION real plant_stop_energy(const struct rp_plant_parameters *const p[SOURCES], int contact,
                                int i, real q) {
    const real d = plant_penetration(p, contact, i, q);
    return scaled(0.5, times(READ(p, stop_stiffness[i]), times(d, d)));
}

/* ---- Efforts -------------------------------------------------------------------------------- */

/* tau + Q - damping q' - friction of the joint where it slides + force of its compliant stop */
EQUATION real plant_effort(const struct rp_plant_parameters *const p[SOURCES],
                           const struct rp_plant_modes *modes, int i, real q, real dq,
                           real applied) {
    const real damped = minus(applied, times(READ(p, damping[i]), dq));
    const real rubbed = minus(damped, plant_friction(p, modes->joint[i], i, dq));
    const int contact = modes->contact[i];
    return contact == RP_PLANT_APART ? rubbed
                                     : plus(rubbed, plant_compliant_force(p, contact, i, q, dq));
}

EQUATION void plant_efforts(const struct plant *plant,
                            const struct rp_plant_parameters *const p[SOURCES],
                            const struct rp_plant_modes *modes, const real tau[2], const real Q[2],
                            real efforts[2]) {
    const real *q = plant->arm.q;
    const real *dq = plant->arm.dq;
    efforts[0] = plant_effort(p, modes, 0, q[0], dq[0], plus(tau[0], Q[0]));
    efforts[1] = plant_effort(p, modes, 1, q[1], dq[1], plus(tau[1], Q[1]));
}

/* efforts - C q' - g */
EQUATION void plant_forces(const struct plant *plant, const real efforts[2], real forces[2]) {
    real coriolis[2];
    real gravity[2];
    arm_coriolis_forces(&plant->arm, coriolis);
    arm_gravity_forces(&plant->arm, gravity);
    for (int i = 0; i < 2; i++) {
        forces[i] = minus(minus(efforts[i], coriolis[i]), gravity[i]);
    }
}

/* ---- Motion --------------------------------------------------------------------------------- */

/* arm_forward_dynamics with the armature b2 of joint 2. Row 2 of (13) gives, with
 * mu = m2 / (m2 + b2),
 *
 *   q2'' = mu (f2 / m2 + L q1'^2 - g s1 + a q1''),
 *
 * and row 1 plus a mu times row 2 eliminates q2'':
 *
 *   (J + a^2 mu b2) q1'' = tau1 + a mu f2 + m2 L q1' (a mu q1' - 2 q2')
 *                          - g c1 (m1 lc1 + m2 L) + (1 - mu) m2 g a s1
 *
 * At b2 = 0 each operation gives what it gives in arm_forward_dynamics. */
EQUATION void plant_forward_dynamics(const struct plant *plant, const real efforts[2],
                                     real ddq[2]) {
    const struct arm *arm = &plant->arm;
    const real dq1 = arm->dq[0];
    const real dq2 = arm->dq[1];
    const real m2L = times(arm->m2, arm->L);
    const real moved2 = plus(arm->m2, plant->armature2);
    const real mu = quotient(arm->m2, moved2);
    const real a_mu = times(arm->a, mu);

    const real driven = plus(efforts[0], times(a_mu, efforts[1]));
    const real velocities = times(times(m2L, dq1), minus(times(a_mu, dq1), scaled(2.0, dq2)));
    const real weight = times(times(arm->g, arm->c1), plus(times(arm->m1, arm->lc1), m2L));
    const real weight2 = times(times(arm->m2, arm->g), times(arm->a, arm->s1));
    const real borne = times(quotient(plant->armature2, moved2), weight2);
    const real torque = plus(minus(plus(driven, velocities), weight), borne);
    ddq[0] = quotient(torque, plus(arm->J, times(times(arm->a, a_mu), plant->armature2)));

    const real push = quotient(efforts[1], arm->m2);
    const real centrifugal = times(times(arm->L, dq1), dq1);
    const real fall = times(arm->g, arm->s1);
    const real free = plus(minus(plus(push, centrifugal), fall), times(arm->a, ddq[0]));
    ddq[1] = times(mu, free);
}

/* Accelerations, and the reactions of stuck joints: with q_i'' = 0 row i of
 * D q'' = forces is left out, and reaction_i = forces_i - D_ij q_j''. */
EQUATION void plant_motion(const struct plant *plant, const int mode[2], const real efforts[2],
                           real ddq[2], real reaction[2]) {
    const bool stuck[2] = {mode[0] == RP_PLANT_STUCK, mode[1] == RP_PLANT_STUCK};
    const real zero = constant(0.0);
    ddq[0] = zero;
    ddq[1] = zero;
    reaction[0] = zero;
    reaction[1] = zero;
    if (!stuck[0] && !stuck[1]) {
        plant_forward_dynamics(plant, efforts, ddq);
        return;
    }
    real D[2][2];
    real forces[2];
    plant_mass_matrix(plant, D);
    plant_forces(plant, efforts, forces);
    for (int i = 0; i < 2; i++) {
        if (!stuck[i]) {
            ddq[i] = quotient(forces[i], D[i][i]);
        }
    }
    for (int i = 0; i < 2; i++) {
        if (stuck[i]) {
            reaction[i] = minus(forces[i], times(D[i][1 - i], ddq[1 - i]));
        }
    }
}

/* ---- Event indicators ----------------------------------------------------------------------- */

enum { PLANT_INDICATORS = 5, PLANT_PUSH = 4 }; /* of a joint; the last one of them */

/* Its place among all: the fifth ones come last. */
static inline size_t plant_indicator_index(int joint, int k) {
    return k == PLANT_PUSH ? (size_t)(2 * PLANT_PUSH + joint) : (size_t)(PLANT_PUSH * joint + k);
}

/* Those of a stuck joint on its lower and upper side; a closed stop leaves the one that opens. */
EQUATION void plant_stuck_indicators(const struct rp_plant_parameters *const p[SOURCES], int i,
                                     real q, real reaction, real z[2]) {
    const int closed = plant_closed_stop(p, i, q);
    const real breakaway = plant_breakaway(p, i);
    z[0] = closed < 0 ? constant(1.0) : minus(breakaway, reaction);
    z[1] = closed > 0 ? constant(1.0) : plus(breakaway, reaction);
}

/* Those of a moving joint at its stops. In contact with a compliant one it leaves that; whether the
 * stop pushes is a question only if it is damped. */
EQUATION void plant_stop_indicators(const struct rp_plant_parameters *const p[SOURCES], int contact,
                                    int i, real q, real dq, real z[PLANT_INDICATORS]) {
    if (contact == RP_PLANT_APART) {
        z[2] = minus(q, READ(p, lower[i]));
        z[3] = minus(READ(p, upper[i]), q);
        return;
    }
    z[contact > 0 ? 2 : 3] = plant_penetration(p, contact, i, q);
    if (p[0]->stop_damping[i] > 0.0) {
        const real push = plant_push(p, contact, i, dq);
        z[PLANT_PUSH] = abs(contact) == RP_PLANT_PUSHED ? push : negative(push);
    }
}

/* Above 0 while the modes are valid: joint i breaks away forward, or comes to rest if it slides;
 * breaks away backward; reaches its lower stop, or leaves it; its upper stop; the compliant stop
 * that it is in begins or ends to push. 1: unused. */
EQUATION void plant_indicators(const struct rp_plant_parameters *const p[SOURCES],
                               const struct rp_plant_modes *modes, int i, real q, real dq,
                               real reaction, real z[PLANT_INDICATORS]) {
    const int mode = modes->joint[i];
    for (int k = 0; k < PLANT_INDICATORS; k++) {
        z[k] = constant(1.0);
    }
    if (mode == RP_PLANT_STUCK) {
        plant_stuck_indicators(p, i, q, reaction, z);
        return;
    }
    if (mode == RP_PLANT_FORWARD || mode == RP_PLANT_BACKWARD) {
        z[0] = scaled(mode, dq);
    }
    if (p[0]->stops[i] == RP_PLANT_STOPS_RIGID || p[0]->stops[i] == RP_PLANT_STOPS_COMPLIANT) {
        plant_stop_indicators(p, modes->contact[i], i, q, dq, z);
    }
}

#endif
