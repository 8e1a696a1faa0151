/* Drives of the RP manipulator: a motor without inertia at each joint, with gear, current loop, and
 * limits of current and voltage.
 *
 * Arrays have one element per joint: torques and angles of joint 1 (N.m, rad), forces and
 * displacements of joint 2 (N, m). A gear ratio is motor angle over joint variable (1, rad/m). All
 * functions are pure and take their arguments as they are. */
#ifndef RP_ACTUATOR_H
#define RP_ACTUATOR_H

struct rp_actuator_parameters {
    double torque_constant[2]; /* N.m/A, > 0; the back-EMF constant in V.s/rad is the same number */
    double gear_ratio[2];      /* 1, rad/m; not 0; < 0: motor and joint turn opposite ways */
    double resistance[2];      /* ohm, > 0 */
    double current_max[2];     /* A, > 0 */
    double voltage_max[2];     /* V, > 0 */
    double time_constant[2];   /* s, > 0: of the current loop */
};

struct rp_actuator_inputs {
    double effort_cmd[2]; /* N.m, N */
    double dq[2];         /* rad/s, m/s */
};

/* Currents (A) that the loops follow. The command cmd / (n k) is clipped to the currents that the
 * voltage allows, |R i + n k dq| <= voltage_max, and then to |i| <= current_max. The second limit
 * holds at any speed. The first one cannot where |n k dq| > voltage_max + R current_max: there the
 * result is the allowed current nearest to its range. */
void rp_actuator_limited_currents(const struct rp_actuator_parameters *p,
                                  const struct rp_actuator_inputs *inputs, double limited[2]);

/* Rates of the currents (A/s): (limited - i) / time_constant. */
void rp_actuator_current_rates(const struct rp_actuator_parameters *p,
                               const struct rp_actuator_inputs *inputs, const double current[2],
                               double rates[2]);

/* Efforts on the joints (N.m, N): n k i. */
void rp_actuator_efforts(const struct rp_actuator_parameters *p, const double current[2],
                         double effort[2]);

/* Voltages at the motors (V): R i + n k dq. */
void rp_actuator_voltages(const struct rp_actuator_parameters *p,
                          const struct rp_actuator_inputs *inputs, const double current[2],
                          double voltage[2]);

#endif
