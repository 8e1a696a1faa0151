/* Drives of the RP manipulator: a motor without inertia at each joint, with gear, current loop, and
 * limits of current and voltage. README.md derives the equations.
 *
 * Efforts and velocities are N.m and rad/s at joint 1, N and m/s at joint 2; a gear ratio is motor
 * angle over joint variable. */
#pragma once

#include "../real.h"
#include "rp_actuator_values.h"

struct drive {
    real k; /* N.m/A, > 0: torque constant; the back-EMF constant in V.s/rad is the same */
    real n; /* 1 or rad/m; not 0; < 0: motor and joint turn opposite ways */
    real R; /* ohm, > 0 */
    real current_max; /* A, > 0 */
    real voltage_max; /* V, > 0 */
    real T;           /* s, > 0: time constant of the current loop */
};

/* What a drive does, at an effort that is commanded, a velocity and a current. */
struct drive_state {
    real limited; /* A: the current that the loop follows */
    real rate;    /* A/s: of the current */
    real effort;  /* N.m, N */
    real voltage; /* V */
};

/* n k: effort per current, and back-EMF per velocity of the joint. */
static inline real drive_constant(const struct drive *drive) {
    return drive->n * drive->k;
}

/* At a limit and beyond it the result moves with the limit. NaN stays NaN. */
static inline real drive_clipped(real x, real lowest, real highest) {
    if (x >= highest) {
        return highest;
    }
    return x <= lowest ? lowest : x;
}

/* The current (A) that the loop follows. The command cmd / (n k) is clipped to the currents that
 * the voltage allows, |R i + n k dq| <= voltage_max, and then to |i| <= current_max. The second
 * limit holds at any speed. The first one cannot where |n k dq| > voltage_max + R current_max:
 * there the result is the allowed current nearest to its range. */
static inline real drive_limited_current(const struct drive *drive, real command, real dq) {
    const real back_emf = drive_constant(drive) * dq;
    const real lowest = (-drive->voltage_max - back_emf) / drive->R;
    const real highest = (drive->voltage_max - back_emf) / drive->R;

    const real commanded = command / drive_constant(drive);
    const real possible = drive_clipped(commanded, lowest, highest);
    return drive_clipped(possible, -drive->current_max, drive->current_max);
}

static inline struct drive_state drive_state(const struct drive *drive, real command, real dq,
                                             real current) {
    const real limited = drive_limited_current(drive, command, dq);
    return (struct drive_state){
        .limited = limited,
        .rate = (limited - current) / drive->T,
        .effort = drive_constant(drive) * current,
        .voltage = drive->R * current + drive_constant(drive) * dq,
    };
}

/* Writes the fields that have no value in rp_actuator.toml. */
static inline void rp_actuator_calculate(struct rp_actuator_values *values) {
    const struct rp_actuator_parameters *p = &values->parameters;
    const struct drive drive1 = {
        .k = p->torque_constant1,
        .n = p->gear_ratio1,
        .R = p->resistance1,
        .current_max = p->current_max1,
        .voltage_max = p->voltage_max1,
        .T = p->time_constant1,
    };
    const struct drive drive2 = {
        .k = p->torque_constant2,
        .n = p->gear_ratio2,
        .R = p->resistance2,
        .current_max = p->current_max2,
        .voltage_max = p->voltage_max2,
        .T = p->time_constant2,
    };
    const struct drive_state joint1 =
        drive_state(&drive1, values->tau1_cmd, values->dq1, values->current1);
    const struct drive_state joint2 =
        drive_state(&drive2, values->f2_cmd, values->dq2, values->current2);
    values->current1_limited = joint1.limited;
    values->current2_limited = joint2.limited;
    values->dcurrent1 = joint1.rate;
    values->dcurrent2 = joint2.rate;
    values->tau1 = joint1.effort;
    values->f2 = joint2.effort;
    values->voltage1 = joint1.voltage;
    values->voltage2 = joint2.voltage;
}
