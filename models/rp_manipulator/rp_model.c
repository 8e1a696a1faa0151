#include "rp_model.h"

#include "rp_propagation.h"

#include <stdio.h>

static enum status right_hand_side(const void *values_pointer, double t, const double x[],
                                   const double u[], double dx[]) {
    const struct rp_values *values = values_pointer;
    (void)t;
    dx[0] = x[2];
    dx[1] = x[3];
    rp_forward_dynamics(&values->parameters, x, x + 2, u, dx + 2);
    return STATUS_OK;
}

static enum status outputs(void *values_pointer, double t) {
    struct rp_values *v = values_pointer;
    const struct rp_parameters *p = &v->parameters;
    (void)t;

    rp_forward_dynamics(p, v->q, v->dq, v->tau, v->ddq);
    rp_end_effector_position(p, v->q, v->ee_position);
    rp_end_effector_velocity(p, v->q, v->dq, v->ee_velocity);

    v->kinetic_energy = rp_kinetic_energy(p, v->q, v->dq);
    v->potential_energy = rp_potential_energy(p, v->q);
    v->total_energy = v->kinetic_energy + v->potential_energy;
    v->actuator_power = v->tau[0] * v->dq[0] + v->tau[1] * v->dq[1];

    rp_mass_matrix(p, v->q, v->D);
    rp_coriolis_forces(p, v->q, v->dq, v->coriolis);
    rp_gravity_forces(p, v->q, v->gravity);
    rp_newton_euler(p, v->q, v->dq, v->ddq, &v->loads);
    return STATUS_OK;
}

static enum status propagate(const void *values, double t, double dt, void *first, void *second) {
    // no field depends on the time itself
    (void)t;
    (void)dt;
    rp_propagate(values, first, second);
    return STATUS_OK;
}

static enum status check_parameters(const void *values_pointer, char *text, size_t size) {
    const struct rp_parameters *p = &((const struct rp_values *)values_pointer)->parameters;
    if (rp_parameters_check(p)) {
        return STATUS_OK;
    }
    (void)snprintf(text, size,
                   "the inertia m1 lc1^2 + I1z + I2z = %g is refused: it must be above 0 "
                   "(m1 = %g, lc1 = %g, I1z = %g, I2z = %g)",
                   rp_fixed_inertia(p), p->m1, p->lc1, p->I1z, p->I2z);
    return STATUS_INVALID_PARAMETERS;
}

const struct model rp_model = {
    .values_size = sizeof(struct rp_values),
    .parameters = {offsetof(struct rp_values, parameters), sizeof(struct rp_parameters)},
    .inputs = {offsetof(struct rp_values, tau), sizeof(double[2])},
    .states = {offsetof(struct rp_values, q), sizeof(double[4])},
    .derivatives = {offsetof(struct rp_values, dq), sizeof(double[4])},
    .right_hand_side = right_hand_side,
    .outputs = outputs,
    .propagate = propagate,
    .check_parameters = check_parameters,
};

_Static_assert(offsetof(struct rp_values, dq) == offsetof(struct rp_values, q) + sizeof(double[2]),
               "the states are one array: q, then dq");
_Static_assert(offsetof(struct rp_values, ddq) ==
                   offsetof(struct rp_values, dq) + sizeof(double[2]),
               "their derivatives are one array: dq, then ddq");
