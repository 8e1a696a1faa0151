/* What RPPlant calculates of its parameters, inputs, states and modes. */
#pragma once

#include "../rp_manipulator/rp_recursion.h"
#include "rp_plant_equations.h"

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

static inline void write_energies(const struct plant *plant, struct rp_plant_values *values) {
    const struct rp_plant_parameters *p = &values->parameters;
    const real *tau = values->inputs.tau;
    real potential_energy = arm_potential_energy(&plant->arm);
    for (int i = 0; i < 2; i++) {
        if (values->modes.contact[i] != RP_PLANT_APART) {
            potential_energy += plant_stop_energy(p, values->modes.contact[i], i, values->q[i]);
        }
    }
    values->kinetic_energy = plant_kinetic_energy(plant);
    values->potential_energy = potential_energy;
    values->total_energy = values->kinetic_energy + potential_energy;
    values->actuator_power = tau[0] * values->dq[0] + tau[1] * values->dq[1];
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

/* Writes friction and stops with their power and indicators. driven: as in plant_loads. */
static inline void write_joints(const real ddq[2], const real reaction[2],
                                struct rp_plant_values *values, real driven[2]) {
    const struct rp_plant_parameters *p = &values->parameters;
    const struct rp_plant_modes *modes = &values->modes;
    real power = 0.0;
    for (int i = 0; i < 2; i++) {
        const real q = values->q[i], dq = values->dq[i];
        const struct plant_hold hold = plant_hold(p, modes, i, q, dq, reaction[i]);
        const real damped = p->damping[i] * dq;
        const real accelerated = p->armature[i] * ddq[i];
        driven[i] = values->inputs.tau[i] - damped - (hold.friction - hold.stop) - accelerated;
        power += (hold.friction + damped) * dq;
        values->friction[i] = hold.friction;
        values->stop_force[i] = hold.stop;

        real z[PLANT_INDICATORS];
        plant_indicators(p, modes, i, q, dq, reaction[i], z);
        for (int k = 0; k < PLANT_INDICATORS; k++) {
            values->indicators[plant_indicator_index(i, k)] = z[k];
        }
    }
    values->friction_power = power;
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

/* Writes the fields that have no value in rp_plant.toml. */
static inline void rp_plant_calculate(struct rp_plant_values *values) {
    const struct rp_plant_parameters *p = &values->parameters;
    const struct rp_plant_modes *modes = &values->modes;
    const bool attached = modes->payload == RP_PLANT_ATTACHED;
    const struct plant plant = plant_in_state(p, attached, values->q, values->dq);
    real applied[2];
    real efforts[2];
    real ddq[2];
    real reaction[2];
    plant_wrench_forces(&plant, values->inputs.wrench, applied);
    plant_efforts(&plant, p, modes, values->inputs.tau, applied, efforts);
    plant_motion(&plant, modes->joint, efforts, ddq, reaction);
    values->ddq[0] = ddq[0];
    values->ddq[1] = ddq[1];

    real driven[2];
    write_joints(ddq, reaction, values, driven);
    write_end_effector(&plant.hand, ddq, values);
    write_energies(&plant, values);
    write_terms(&plant, values);
    write_loads_of_joints(&plant, driven, ddq, values);
}
