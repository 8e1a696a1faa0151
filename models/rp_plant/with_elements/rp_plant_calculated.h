/* What RPPlant calculates, with friction and stops as elements of rp_plant.toml. The equations are
 * those of models/rp_plant; accelerations are affine in the forces of friction and stops. */
#pragma once

#include "../../rp_manipulator/rp_payload.h"
#include "../../rp_manipulator/rp_recursion.h"
#include "rp_plant_values.h"

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
static inline struct plant plant_in_state(const struct rp_plant_parameters *p, int attached,
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

/* Hunt and Crossley: k d (1 + c d') on the joint, and the energy of the spring, also of a stop that
 * the joint leaves behind: what it does not give back is lost. */
static inline void plant_compliant_stop(const struct rp_plant_parameters *p, int i, real q, real dq,
                                        real *force, real *energy) {
    *force = 0.0;
    *energy = 0.0;
    if (p->stops[i] != RP_PLANT_STOPS_COMPLIANT) {
        return;
    }
    if (q < p->lower[i]) {
        const real d = p->lower[i] - q, push = 1.0 - p->stop_damping[i] * dq;
        if (push > 0.0) {
            *force = p->stop_stiffness[i] * d * push;
        }
        *energy = 0.5 * (p->stop_stiffness[i] * (d * d));
    }
    if (q > p->upper[i]) {
        const real d = q - p->upper[i], push = 1.0 + p->stop_damping[i] * dq;
        if (push > 0.0) {
            *force = -(p->stop_stiffness[i] * d * push);
        }
        *energy = 0.5 * (p->stop_stiffness[i] * (d * d));
    }
}

/* ---- Motion --------------------------------------------------------------------------------- */

/* arm_forward_dynamics with the armature b2 of joint 2: see models/rp_plant. */
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

/* ---- Grasp ---------------------------------------------------------------------------------- */

static inline real plant_determinant(const struct plant *plant) {
    const struct arm *arm = &plant->arm;
    const real b2 = plant->armature2;
    return arm->J * (arm->m2 + b2) + arm->m2 * arm->a * arm->a * b2;
}

/* Velocities after a plastic impact with the payload at rest, and the energy that it takes, written
 * as two kinetic energies: of the arm at the velocities it loses, of the payload at those it gets.
 * D+ (q'- - q'+) = (D+ - D-) q'-: no more than the payload changes is calculated. */
static inline void write_grasp(struct rp_plant_values *values) {
    const struct rp_plant_parameters *p = &values->parameters;
    const real *dq = values->dq;
    const struct plant without = plant_in_state(p, 0, values->q, dq);
    const struct plant with = plant_in_state(p, 1, values->q, dq);
    const real determinant = plant_determinant(&with);
    real before[2][2];
    real after[2][2];
    real gained[2];
    plant_mass_matrix(&without, before);
    plant_mass_matrix(&with, after);
    for (int i = 0; i < 2; i++) {
        gained[i] = (after[i][0] - before[i][0]) * dq[0] + (after[i][1] - before[i][1]) * dq[1];
    }
    const real lost[2] = {
        (after[1][1] * gained[0] - after[0][1] * gained[1]) / determinant,
        (after[0][0] * gained[1] - after[1][0] * gained[0]) / determinant,
    };
    for (int i = 0; i < 2; i++) {
        values->grasped[i] = dq[i] - lost[i];
    }
    // the payload turns about z0 and moves with its point of link 2
    const real *gets = values->grasped;
    const real across = p->arm.a + p->payload_x;
    const real L = p->arm.l1 + values->q[1] + p->payload_z;
    const real along_slide = gets[1] - across * gets[0];
    const real along_short_side = L * gets[0];
    const real speed2 = along_slide * along_slide + along_short_side * along_short_side;
    const real payload = 0.5 * (p->payload_mass * speed2 + p->payload_inertia * gets[0] * gets[0]);
    const struct plant of_lost = plant_in_state(p, 0, values->q, lost);
    values->grasp_takes = payload + plant_kinetic_energy(&of_lost);
}

/* ---- Loads of the joints --------------------------------------------------------------------
 *
 * Force and moment that each link receives through its joint, in frames 1 and 2 as in
 * rp_manipulator.h. Drives with their armature, damping, friction and stops act through the joints;
 * the wrench and the payload do not. */

/* Calculates the loads of joint 2. The recursion for link 2 with payload takes moments about a
 * point that lies by the payload's offset from the end of link 1, where (20) has it: the moment of
 * f2 is moved there. The wrench (w, m) at the end effector, r from the end of link 1, carries a
 * part of link 2. */
static inline void plant_link2_loads(const struct plant *plant, const struct link_motion *motion,
                                     const real wrench[3], struct joint_loads *loads) {
    const struct arm *hand = &plant->hand;
    const struct vector offset = {plant->offset_x, 0.0, plant->offset_z};
    const struct vector r = {0.0, 0.0, hand->q[1]};
    const struct vector w = {
        .x = hand->c1 * wrench[1] - hand->s1 * wrench[0],
        .y = 0.0,
        .z = hand->c1 * wrench[0] + hand->s1 * wrench[1],
    };
    const struct vector m = {0.0, wrench[2], 0.0};

    link2_loads(&plant->arm, motion, loads);
    const struct vector moved = vector_minus(loads->tau2, vector_cross(loads->f2, offset));
    loads->tau2 = vector_minus(moved, vector_plus(vector_cross(r, w), m));
    loads->f2 = vector_minus(loads->f2, w);
}

/* driven: efforts of drives, armature, damping, friction and stops on the joints. The loads take
 * their derivatives from there, as the manipulator's do from its efforts. */
static inline struct joint_loads plant_loads(const struct plant *plant, const real wrench[3],
                                             const real driven[2], const real ddq[2]) {
    const struct link_motion motion = link_motion(&plant->arm, ddq);
    struct joint_loads loads;
    plant_link2_loads(plant, &motion, wrench, &loads);
    loads.f2.z = moving_as(loads.f2.z, driven[1]);
    link1_loads(&plant->hand, &motion, &loads);
    loads.tau1.y = moving_as(loads.tau1.y, driven[0]);
    return loads;
}

static inline void write_loads_of_joints(const struct plant *plant, const real driven[2],
                                         const real ddq[2], struct rp_plant_values *values) {
    const struct joint_loads loads = plant_loads(plant, values->inputs.wrench, driven, ddq);
    values->f1_x = loads.f1.x;
    values->f1_z = loads.f1.z;
    values->tau1_y = loads.tau1.y;
    values->f2_x = loads.f2.x;
    values->f2_z = loads.f2.z;
    values->tau2_y = loads.tau2.y;
}

/* ---- Calculated fields ---------------------------------------------------------------------- */

/* (L z1 + a x1)'' with z1' = q1' x1 and x1' = -q1' z1. */
static inline void plant_end_effector_acceleration(const struct arm *hand, const real ddq[2],
                                                   real acceleration[2]) {
    const real dq1 = hand->dq[0], dq2 = hand->dq[1];
    const real along_z1 = ddq[1] - hand->a * ddq[0] - hand->L * dq1 * dq1;
    const real along_x1 = hand->L * ddq[0] + 2.0 * (dq1 * dq2) - hand->a * dq1 * dq1;
    acceleration[0] = along_z1 * hand->c1 - along_x1 * hand->s1;
    acceleration[1] = along_z1 * hand->s1 + along_x1 * hand->c1;
}

static inline void write_end_effector(const struct arm *hand, const real ddq[2],
                                      struct rp_plant_values *values) {
    real position[2];
    real velocity[2];
    real acceleration[2];
    arm_end_effector_position(hand, position);
    arm_end_effector_velocity(hand, velocity);
    plant_end_effector_acceleration(hand, ddq, acceleration);
    values->ee_x = position[0];
    values->ee_y = position[1];
    values->ee_vx = velocity[0];
    values->ee_vy = velocity[1];
    values->ee_ax = acceleration[0];
    values->ee_ay = acceleration[1];
    values->ee_angle = hand->q[0];
    values->ee_rate = hand->dq[0];
}

static inline void write_terms(const struct plant *plant, struct rp_plant_values *values) {
    real D[2][2];
    real coriolis[2];
    plant_mass_matrix(plant, D);
    arm_coriolis_forces(&plant->arm, coriolis);
    arm_gravity_forces(&plant->arm, values->gravity);
    values->D[0][0] = D[0][0];
    values->D[0][1] = D[0][1];
    values->D[1][1] = D[1][1];
    values->coriolis1 = coriolis[0];
    values->coriolis2 = coriolis[1];
}

/* Writes the fields that have no value in rp_plant.toml. */
static inline void rp_plant_calculate(struct rp_plant_values *values) {
    const struct rp_plant_parameters *p = &values->parameters;
    const real *tau = values->inputs.tau;
    const real F[2] = {values->F1, values->F2}, P[2] = {values->P1, values->P2};
    const struct plant plant = plant_in_state(p, values->attached, values->q, values->dq);
    real applied[2];
    real efforts[2];
    real driven[2];
    real ddq[2];
    real energy[2];
    plant_wrench_forces(&plant, values->inputs.wrench, applied);
    values->friction_power = 0.0;
    for (int i = 0; i < 2; i++) {
        const real dq = values->dq[i];
        real buffer;
        plant_compliant_stop(p, i, values->q[i], dq, &buffer, &energy[i]);
        const real damped = p->damping[i] * dq;
        values->stop_force[i] = P[i] + buffer;
        driven[i] = tau[i] - damped - F[i] + values->stop_force[i];
        efforts[i] = tau[i] + applied[i] - damped - F[i] + P[i] + buffer;
        values->friction_power += (F[i] + damped) * dq;
    }
    plant_forward_dynamics(&plant, efforts, ddq);
    for (int i = 0; i < 2; i++) {
        values->ddq[i] = ddq[i];
        driven[i] -= p->armature[i] * ddq[i];
    }
    values->kinetic_energy = plant_kinetic_energy(&plant);
    values->potential_energy = arm_potential_energy(&plant.arm) + energy[0] + energy[1];
    values->total_energy = values->kinetic_energy + values->potential_energy;
    values->actuator_power = tau[0] * values->dq[0] + tau[1] * values->dq[1];
    write_end_effector(&plant.hand, ddq, values);
    write_terms(&plant, values);
    write_loads_of_joints(&plant, driven, ddq, values);
    write_grasp(values);
}
