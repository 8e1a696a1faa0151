#include "rp_trajectory_lifted.h"
#include "rp_trajectory_model.h"

static void put(struct taylor x, double *first, double *second) {
    *first = x.first;
    *second = x.second;
}

enum status rp_trajectory_propagate(const void *values_pointer, double t, double dt,
                                    void *first_pointer, void *second_pointer) {
    const struct rp_trajectory_values *values = values_pointer;
    struct rp_trajectory_values straight = {0};
    struct rp_trajectory_values *first = first_pointer;
    struct rp_trajectory_values *second = second_pointer != NULL ? second_pointer : &straight;
    const struct rp_trajectory_curve curve = {
        &values->parameters, &first->parameters, &second->parameters, {t, dt, 0.0}};
    struct rp_trajectory_point point;
    rp_trajectory_evaluate(&curve, &point);
    for (int i = 0; i < 2; i++) {
        put(point.q[i].position, &first->q[i], &second->q[i]);
        put(point.q[i].velocity, &first->dq[i], &second->dq[i]);
        put(point.q[i].acceleration, &first->ddq[i], &second->ddq[i]);
        put(point.ee[i].position, &first->ee_position[i], &second->ee_position[i]);
        put(point.ee[i].velocity, &first->ee_velocity[i], &second->ee_velocity[i]);
    }
    return STATUS_OK;
}
