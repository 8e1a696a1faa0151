/* The equations of the plant. rp_plant.h says what they mean. In given modes they are smooth: a
 * joint that slides forward keeps the sign of its friction also where its velocity passes 0. */
#pragma once

#include "../rp_manipulator/rp_payload.h"
#include "rp_plant.h"

/* The plant in a state, with what many equations share. */
struct plant {
    struct arm hand; /* without payload and armature: where the end effector is */
    struct arm arm;  /* link 2 with the payload, if attached; J with the armature of joint 1 */
    real armature2;  /* kg */
    real offset_x;   /* m: center of mass of link 2 with payload, from that without */
    real offset_z;   /* m */
};

/* ---- Bodies --------------------------------------------------------------------------------- */

static inline void plant_attach(struct plant *plant, const struct rp_plant_parameters *p) {
    const struct payload payload = {
        .mass = p->payload_mass,
        .inertia = p->payload_inertia,
        .x = p->payload_x,
        .z = p->payload_z,
    };
    real offset[2];
    arm_attach(&plant->arm, &payload, offset);
    plant->offset_x = offset[0];
    plant->offset_z = offset[1];
}

/* The armature of joint 1 turns as I1z does, so that J takes it up; that of joint 2 is the only one
 * that the manipulator's equations have no place for. */
static inline struct plant plant_in_state(const struct rp_plant_parameters *p, bool attached,
                                          const real q[2], const real dq[2]) {
    struct plant plant;
    plant.hand = arm_in_state(&p->arm, q, dq);
    plant.arm = plant.hand;
    plant.armature2 = p->armature[1];
    plant.offset_x = 0.0;
    plant.offset_z = 0.0;
    if (attached) {
        plant_attach(&plant, p);
    }
    plant.arm.J += p->armature[0];
    return plant;
}

static inline void plant_mass_matrix(const struct plant *plant, real D[2][2]) {
    arm_mass_matrix(&plant->arm, D);
    D[1][1] += plant->armature2;
}

static inline real plant_kinetic_energy(const struct plant *plant) {
    const real dq2 = plant->arm.dq[1];
    return arm_kinetic_energy(&plant->arm) + 0.5 * (plant->armature2 * dq2 * dq2);
}

/* ---- Forces --------------------------------------------------------------------------------- */

/* Q = J^T w with the rows of (1) and (3). */
static inline void plant_wrench_forces(const struct plant *plant, const real wrench[3],
                                       real forces[2]) {
    const struct arm *hand = &plant->hand;
    real position[2];
    arm_end_effector_position(hand, position);
    forces[0] = position[0] * wrench[1] - position[1] * wrench[0] + wrench[2];
    forces[1] = hand->c1 * wrench[0] + hand->s1 * wrench[1];
}

/* Largest friction of a joint at rest, N.m (joint 0) or N (joint 1). */
static inline real plant_breakaway(const struct rp_plant_parameters *p, int i) {
    return p->breakaway_friction[i] > 0.0 ? p->breakaway_friction[i] : p->coulomb_friction[i];
}

/* e of Stribeck's law at w = v / vs: exp(-w^2), which is 0 where w^2 is above 750. So are its
 * derivatives there, also where w^2 overflows. */
static inline real plant_stribeck_decay(real w) {
    const real x = -(w * w);
    return x < -750.0 ? 0.0 : exp(x);
}

/* Added to e where a joint has turned back, up to the event that ends its mode, w = v / vs:
 * 0 at v = 0 with seven derivatives. Otherwise an internal step from a fast motion forward to one
 * backward would find Fc at both ends, and no trace of what lies between. */
static inline real plant_turned_back(real w) {
    const real w2 = w * w;
    const real w4 = w2 * w2;
    const real w8 = w4 * w4;
    if (!(w8 < 1e16)) {
        return 1.0; // to the last digit
    }
    return w8 / (1.0 + w8);
}

/* Stribeck's law: F = Fc + (Fb - Fc) e, summed up so that F is Fb to the bit at rest: there is no
 * jump when a joint breaks away. */
static inline real plant_stribeck(real breakaway, real coulomb, real e) {
    return breakaway * e + coulomb * (1.0 - e);
}

/* Friction of a joint that slides at a speed v >= 0. v < 0 is what integrators see past the event
 * that ends the mode. */
static inline real plant_sliding_friction(const struct rp_plant_parameters *p, int i, real v) {
    const real coulomb = p->coulomb_friction[i];
    const real breakaway = p->breakaway_friction[i];
    if (!(breakaway > 0.0 && p->stribeck_velocity[i] > 0.0)) {
        return coulomb;
    }
    const real w = v / p->stribeck_velocity[i];
    // exp(-49) of the difference is left, and rounding leaves Fc
    if (w > 7.0 && breakaway < 1e5 * coulomb) {
        return coulomb;
    }
    real e = plant_stribeck_decay(w);
    if (w < 0.0) {
        e += plant_turned_back(w);
    }
    return plant_stribeck(breakaway, coulomb, e);
}

static inline bool plant_slides(int mode) {
    return mode == RP_PLANT_FORWARD || mode == RP_PLANT_BACKWARD;
}

/* Friction of a joint that slides, against its direction; 0 for one that does not. */
static inline real plant_friction(const struct rp_plant_parameters *p, int mode, int i, real dq) {
    if (!plant_slides(mode)) {
        return 0.0;
    }
    return mode * plant_sliding_friction(p, i, mode * dq);
}

/* ---- Stops ---------------------------------------------------------------------------------- */

/* +1: the joint rests on its lower rigid stop and can only move forward; -1: on its upper one. */
static inline int plant_closed_stop(const struct rp_plant_parameters *p, int i, real q) {
    if (p->stops[i] != RP_PLANT_STOPS_RIGID) {
        return 0;
    }
    if (q <= p->lower[i]) {
        return 1;
    }
    return q >= p->upper[i] ? -1 : 0;
}

/* d of the stop that the joint is in contact with. */
static inline real plant_penetration(int contact, real lower, real upper, real q) {
    return contact > 0 ? lower - q : q - upper;
}

/* 1 + c d': the stop pushes while this is above 0. */
static inline real plant_push(const struct rp_plant_parameters *p, int contact, int i, real dq) {
    const real damping = p->stop_damping[i] * dq;
    return contact > 0 ? 1.0 - damping : 1.0 + damping;
}

/* Hunt and Crossley: k d (1 + c d'), on the joint. In a given contact it continues past d = 0, up
 * to the event that ends the contact. */
static inline real plant_compliant_force(const struct rp_plant_parameters *p, int contact, int i,
                                         real q, real dq) {
    if (abs(contact) != RP_PLANT_PUSHED) {
        return 0.0;
    }
    const real d = plant_penetration(contact, p->lower[i], p->upper[i], q);
    const real force = p->stop_stiffness[i] * d * plant_push(p, contact, i, dq);
    return contact > 0 ? force : -force;
}

/* Also of a stop that the joint leaves behind: what it does not give back is lost. */
static inline real plant_stop_energy(const struct rp_plant_parameters *p, int contact, int i,
                                     real q) {
    const real d = plant_penetration(contact, p->lower[i], p->upper[i], q);
    return 0.5 * (p->stop_stiffness[i] * (d * d));
}

/* What friction and stop of a joint exert. */
struct plant_hold {
    real friction; /* N.m, N: against a positive force on the joint */
    real stop;     /* N.m, N: on the joint, >= 0 of a lower stop, <= 0 of an upper one */
};

/* Splits the reaction of a joint at rest. At a closed stop statics leave open who carries it:
 * friction does as far as it can, the stop the rest. */
static inline struct plant_hold plant_split(real reaction, real breakaway, int closed) {
    if (closed > 0 && reaction < -breakaway) {
        return (struct plant_hold){-breakaway, -breakaway - reaction};
    }
    if (closed < 0 && reaction > breakaway) {
        return (struct plant_hold){breakaway, breakaway - reaction};
    }
    return (struct plant_hold){reaction, 0.0};
}

static inline struct plant_hold plant_hold(const struct rp_plant_parameters *p,
                                           const struct rp_plant_modes *modes, int i, real q,
                                           real dq, real reaction) {
    const int mode = modes->joint[i];
    const int closed = plant_closed_stop(p, i, q);
    if (mode == RP_PLANT_STUCK && closed != 0) {
        return plant_split(reaction, plant_breakaway(p, i), closed);
    }
    return (struct plant_hold){
        .friction = mode == RP_PLANT_STUCK ? reaction : plant_friction(p, mode, i, dq),
        .stop = plant_compliant_force(p, modes->contact[i], i, q, dq),
    };
}

/* ---- Efforts -------------------------------------------------------------------------------- */

/* tau + Q - damping q' - friction + compliant stop; a stuck joint's friction is not in it. */
static inline void plant_efforts(const struct plant *plant, const struct rp_plant_parameters *p,
                                 const struct rp_plant_modes *modes, const real tau[2],
                                 const real Q[2], real efforts[2]) {
    for (int i = 0; i < 2; i++) {
        const real q = plant->arm.q[i], dq = plant->arm.dq[i];
        const real friction = plant_friction(p, modes->joint[i], i, dq);
        const real stop = plant_compliant_force(p, modes->contact[i], i, q, dq);
        efforts[i] = tau[i] + Q[i] - p->damping[i] * dq - friction + stop;
    }
}

/* efforts - C q' - g */
static inline void plant_forces(const struct plant *plant, const real efforts[2], real forces[2]) {
    real coriolis[2];
    real gravity[2];
    arm_coriolis_forces(&plant->arm, coriolis);
    arm_gravity_forces(&plant->arm, gravity);
    for (int i = 0; i < 2; i++) {
        forces[i] = efforts[i] - coriolis[i] - gravity[i];
    }
}

/* ---- Motion --------------------------------------------------------------------------------- */

/* arm_forward_dynamics with the armature b2 of joint 2. Row 2 of (13) gives, with
 * mu = m2 / (m2 + b2),
 *
 *   q2'' = mu (f2 / m2 + L q1'^2 - g s1 + a q1''),
 *
 * and row 1 plus a mu times row 2 eliminates q2''. At b2 = 0 each operation gives what it gives in
 * arm_forward_dynamics. */
static inline void plant_forward_dynamics(const struct plant *plant, const real efforts[2],
                                          real ddq[2]) {
    const struct arm *arm = &plant->arm;
    const real dq1 = arm->dq[0], dq2 = arm->dq[1];
    const real m2L = arm->m2 * arm->L;
    const real b2 = plant->armature2;
    const real mu = arm->m2 / (arm->m2 + b2);
    const real a_mu = arm->a * mu;

    const real driven = efforts[0] + a_mu * efforts[1];
    const real velocities = m2L * dq1 * (a_mu * dq1 - 2.0 * dq2);
    const real weight = arm->g * arm->c1 * (arm->m1 * arm->lc1 + m2L);
    const real weight2 = arm->m2 * arm->g * (arm->a * arm->s1);
    const real borne = b2 / (arm->m2 + b2) * weight2;
    ddq[0] = (driven + velocities - weight + borne) / (arm->J + arm->a * a_mu * b2);

    const real push = efforts[1] / arm->m2;
    const real centrifugal = arm->L * dq1 * dq1;
    const real fall = arm->g * arm->s1;
    ddq[1] = mu * (push + centrifugal - fall + arm->a * ddq[0]);
}

/* Accelerations, and the reactions of stuck joints, whose rows of D q'' = forces are left out of
 * the solution and give the reactions. */
static inline void plant_motion(const struct plant *plant, const int mode[2], const real efforts[2],
                                real ddq[2], real reaction[2]) {
    const bool stuck[2] = {mode[0] == RP_PLANT_STUCK, mode[1] == RP_PLANT_STUCK};
    for (int i = 0; i < 2; i++) {
        ddq[i] = 0.0;
        reaction[i] = 0.0;
    }
    if (!stuck[0] && !stuck[1]) {
        plant_forward_dynamics(plant, efforts, ddq);
        return;
    }
    real D[2][2];
    real forces[2];
    plant_mass_matrix(plant, D);
    plant_forces(plant, efforts, forces);
    for (int i = 0; i < 2; i++) {
        if (!stuck[i] && stuck[1 - i]) {
            ddq[i] = forces[i] / D[i][i];
        }
    }
    for (int i = 0; i < 2; i++) {
        if (stuck[i]) {
            reaction[i] = forces[i] - D[i][1 - i] * ddq[1 - i];
        }
    }
}

/* ---- Event indicators ----------------------------------------------------------------------- */

enum { PLANT_INDICATORS = 5, PLANT_PUSH = 4 }; /* of a joint; the last one of them */

/* Its place among all: the fifth ones come last. */
static inline int plant_indicator_index(int joint, int k) {
    return k == PLANT_PUSH ? 2 * PLANT_PUSH + joint : PLANT_PUSH * joint + k;
}

/* On the lower and the upper side of a stuck joint; a closed stop leaves the one that opens. */
static inline void plant_stuck_indicators(int closed, real breakaway, real reaction, real z[2]) {
    z[0] = closed < 0 ? 1.0 : breakaway - reaction;
    z[1] = closed > 0 ? 1.0 : breakaway + reaction;
}

/* Of a moving joint at its stops. In contact with a compliant one it leaves that; whether the stop
 * pushes is a question only if it is damped. */
static inline void plant_stop_indicators(const struct rp_plant_parameters *p, int contact, int i,
                                         real q, real dq, real z[PLANT_INDICATORS]) {
    if (contact == RP_PLANT_APART) {
        z[2] = q - p->lower[i];
        z[3] = p->upper[i] - q;
        return;
    }
    z[contact > 0 ? 2 : 3] = plant_penetration(contact, p->lower[i], p->upper[i], q);
    if (p->stop_damping[i] > 0.0) {
        const real push = plant_push(p, contact, i, dq);
        z[PLANT_PUSH] = abs(contact) == RP_PLANT_PUSHED ? push : -push;
    }
}

/* Above 0 while the modes are valid: joint i breaks away forward, or comes to rest if it slides;
 * breaks away backward; reaches its lower stop, or leaves it; its upper stop; the compliant stop
 * that it is in begins or ends to push. 1: unused. */
static inline void plant_indicators(const struct rp_plant_parameters *p,
                                    const struct rp_plant_modes *modes, int i, real q, real dq,
                                    real reaction, real z[PLANT_INDICATORS]) {
    const int mode = modes->joint[i];
    for (int k = 0; k < PLANT_INDICATORS; k++) {
        z[k] = 1.0;
    }
    if (mode == RP_PLANT_STUCK) {
        plant_stuck_indicators(plant_closed_stop(p, i, q), plant_breakaway(p, i), reaction, z);
        return;
    }
    if (plant_slides(mode)) {
        z[0] = mode * dq;
    }
    if (p->stops[i] == RP_PLANT_STOPS_RIGID || p->stops[i] == RP_PLANT_STOPS_COMPLIANT) {
        plant_stop_indicators(p, modes->contact[i], i, q, dq, z);
    }
}
