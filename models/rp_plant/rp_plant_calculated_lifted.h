/* The calculated fields of struct rp_plant_values, in any arithmetic (equation.h). */
#ifndef RP_PLANT_CALCULATED_LIFTED_H
#define RP_PLANT_CALCULATED_LIFTED_H

#include "rp_plant_loads_lifted.h"
#include "rp_plant_model.h"
#include "rp_plant_modes.h"
#include "rp_plant_rest.h"

struct rp_plant_hold {
    double friction, stop;
};

static inline struct rp_plant_hold rp_plant_hold(double reaction, double breakaway, int closed) {
    if (closed > 0 && reaction < -breakaway) {
        return (struct rp_plant_hold){-breakaway, -breakaway - reaction};
    }
    if (closed < 0 && reaction > breakaway) {
        return (struct rp_plant_hold){breakaway, breakaway - reaction};
    }
    return (struct rp_plant_hold){reaction, 0.0};
}

/* What friction and stop of a joint exert, as in struct rp_plant_hold. */
struct plant_hold {
    real friction, stop;
};

EQUATION struct plant_hold plant_hold(const struct rp_plant_parameters *const p[SOURCES],
                                      const struct rp_plant_modes *modes, int i, real q, real dq,
                                      real reaction) {
    const int mode = modes->joint[i];
    const real compliant = plant_compliant_force(p, modes->contact[i], i, q, dq);
    if (mode != RP_PLANT_STUCK) {
        return (struct plant_hold){plant_friction(p, mode, i, dq), compliant};
    }
    const real breakaway = plant_breakaway(p, i);
    const int closed = plant_closed_stop(p, i, q);
    const struct rp_plant_hold hold =
        rp_plant_hold(value_of(reaction), value_of(breakaway), closed);
    if (hold.stop == 0.0) {
        return (struct plant_hold){reaction, compliant};
    }
    const real friction = scaled(-closed, breakaway);
    return (struct plant_hold){friction, minus(friction, reaction)};
}

/* (L z1 + a x1)'' with z1' = q1' x1 and x1' = -q1' z1:
 *
 *   (q2'' - a q1'' - L q1'^2) z1 + (L q1'' + 2 q1' q2' - a q1'^2) x1 */
EQUATION void plant_end_effector_acceleration(const struct arm *hand, const real ddq[2],
                                              real acceleration[2]) {
    const real w = hand->dq[0];
    const real along_z1 = minus(minus(ddq[1], times(hand->a, ddq[0])), times(times(hand->L, w), w));
    const real turning = plus(times(hand->L, ddq[0]), scaled(2.0, times(w, hand->dq[1])));
    const real along_x1 = minus(turning, times(times(hand->a, w), w));
    acceleration[0] = minus(times(along_z1, hand->c1), times(along_x1, hand->s1));
    acceleration[1] = plus(times(along_z1, hand->s1), times(along_x1, hand->c1));
}

EQUATION void write_end_effector(struct rp_plant_values *const to[TARGETS], const struct arm *hand,
                                 const real ddq[2]) {
    real position[2];
    real velocity[2];
    real acceleration[2];
    arm_end_effector_position(hand, position);
    arm_end_effector_velocity(hand, velocity);
    plant_end_effector_acceleration(hand, ddq, acceleration);
    for (int i = 0; i < 2; i++) {
        WRITE(to, ee_position[i], position[i]);
        WRITE(to, ee_velocity[i], velocity[i]);
        WRITE(to, ee_acceleration[i], acceleration[i]);
    }
    WRITE(to, ee_angle, hand->q[0]);
    WRITE(to, ee_rate, hand->dq[0]);
}

EQUATION void write_energies(struct rp_plant_values *const to[TARGETS],
                             const struct rp_plant_parameters *const p[SOURCES],
                             const struct rp_plant_modes *modes, const struct plant *plant,
                             const real tau[2]) {
    const real *dq = plant->arm.dq;
    const real kinetic_energy = plant_kinetic_energy(plant);
    real potential_energy = arm_potential_energy(&plant->arm);
    for (int i = 0; i < 2; i++) {
        const int contact = modes->contact[i];
        if (contact != RP_PLANT_APART) {
            const real stored = plant_stop_energy(p, contact, i, plant->arm.q[i]);
            potential_energy = plus(potential_energy, stored);
        }
    }
    WRITE(to, kinetic_energy, kinetic_energy);
    WRITE(to, potential_energy, potential_energy);
    WRITE(to, total_energy, plus(kinetic_energy, potential_energy));
    WRITE(to, actuator_power, plus(times(tau[0], dq[0]), times(tau[1], dq[1])));
}

EQUATION void write_terms(struct rp_plant_values *const to[TARGETS], const struct plant *plant) {
    real D[2][2];
    real coriolis[2];
    real gravity[2];
    plant_mass_matrix(plant, D);
    arm_coriolis_forces(&plant->arm, coriolis);
    arm_gravity_forces(&plant->arm, gravity);
    for (int i = 0; i < 2; i++) {
        WRITE(to, D[i][0], D[i][0]);
        WRITE(to, D[i][1], D[i][1]);
        WRITE(to, coriolis[i], coriolis[i]);
        WRITE(to, gravity[i], gravity[i]);
    }
}

EQUATION void write_loads(struct rp_plant_values *const to[TARGETS],
                          const struct joint_loads *loads) {
    WRITE(to, loads.f1[0], loads->f1.x);
    WRITE(to, loads.f1[1], loads->f1.y);
    WRITE(to, loads.f1[2], loads->f1.z);
    WRITE(to, loads.tau1[0], loads->tau1.x);
    WRITE(to, loads.tau1[1], loads->tau1.y);
    WRITE(to, loads.tau1[2], loads->tau1.z);
    WRITE(to, loads.f2[0], loads->f2.x);
    WRITE(to, loads.f2[1], loads->f2.y);
    WRITE(to, loads.f2[2], loads->f2.z);
    WRITE(to, loads.tau2[0], loads->tau2.x);
    WRITE(to, loads.tau2[1], loads->tau2.y);
    WRITE(to, loads.tau2[2], loads->tau2.z);
}

/* From the parameters, inputs and states, in the modes in effect. */
EQUATION void calculate(const struct rp_plant_values *const from[SOURCES],
                        struct rp_plant_values *const to[TARGETS]) {
    struct rp_plant_modes modes_in_effect;
    rp_plant_modes_in_effect(from[0], from[0]->q, from[0]->dq, &from[0]->inputs, &modes_in_effect);
    const struct rp_plant_modes *modes = &modes_in_effect;
    const struct rp_plant_parameters *const p[SOURCES] = PARTS(from, parameters);
    const real q[2] = {READ(from, q[0]), READ(from, q[1])};
    const real dq[2] = {READ(from, dq[0]), READ(from, dq[1])};
    const real tau[2] = {READ(from, inputs.tau[0]), READ(from, inputs.tau[1])};
    const real wrench[3] = {READ(from, inputs.wrench[0]), READ(from, inputs.wrench[1]),
                            READ(from, inputs.wrench[2])};
    const bool attached = modes->payload == RP_PLANT_ATTACHED;
    const struct plant plant = plant_in_state(p, attached, q, dq);

    real applied[2];
    real efforts[2];
    real ddq[2];
    real reaction[2];
    plant_wrench_forces(&plant, wrench, applied);
    plant_efforts(&plant, p, modes, tau, applied, efforts);
    plant_motion(&plant, modes->joint, efforts, ddq, reaction);
    WRITE(to, ddq[0], ddq[0]);
    WRITE(to, ddq[1], ddq[1]);

    // friction, stops, and what else acts through the joints
    real driven[2];
    real power = constant(0.0);
    for (int i = 0; i < 2; i++) {
        const struct plant_hold hold = plant_hold(p, modes, i, q[i], dq[i], reaction[i]);
        const real damped = times(READ(p, damping[i]), dq[i]);
        const real accelerated = times(READ(p, armature[i]), ddq[i]);
        const real resisted = minus(hold.friction, hold.stop);
        driven[i] = minus(minus(minus(tau[i], damped), resisted), accelerated);
        power = plus(power, times(plus(hold.friction, damped), dq[i]));
        WRITE(to, friction[i], hold.friction);
        WRITE(to, stop_force[i], hold.stop);

        real z[PLANT_INDICATORS];
        plant_indicators(p, modes, i, q[i], dq[i], reaction[i], z);
        for (int k = 0; k < PLANT_INDICATORS; k++) {
            WRITE(to, indicators[plant_indicator_index(i, k)], z[k]);
        }
    }
    WRITE(to, friction_power, power);

    write_end_effector(to, &plant.hand, ddq);
    write_energies(to, p, modes, &plant, tau);
    write_terms(to, &plant);
    const struct joint_loads loads = plant_loads(&plant, wrench, driven, ddq);
    write_loads(to, &loads);
}

#endif
