#include "rp_trajectory_model.h"

#include "rp_trajectory_calculated.h"

#include <math.h>
#include <stdio.h>

static enum status right_hand_side(const void *values, double t, const double x[], const double u[],
                                   double dx[]) {
    return STATUS_OK; // there is no state
}

static enum status outputs(void *values_pointer, double t) {
    struct rp_trajectory_values *v = values_pointer;
    rp_trajectory_calculate(v, t);
    v->payload_attached = v->payload == RP_TRAJECTORY_UNDECIDED
                              ? rp_trajectory_is_attached(&v->parameters, t)
                              : v->payload == RP_TRAJECTORY_ATTACHED;
    return STATUS_OK;
}

static enum status propagate(const void *values, double t, double dt, void *first, void *second) {
    rp_trajectory_derivatives(values, t, first, dt, second, 0.0);
    return STATUS_OK;
}

static enum status check_parameters(const void *values_pointer, char *text, size_t size) {
    const struct rp_trajectory_parameters *p =
        &((const struct rp_trajectory_values *)values_pointer)->parameters;
    double nearest[2];
    double distance;
    switch (rp_trajectory_check(p)) {
    case RP_TRAJECTORY_VALID:
        return STATUS_OK;
    case RP_TRAJECTORY_NO_FREQUENCY:
        (void)snprintf(text, size, "frequency = 0 is refused: a circle needs one above or below 0");
        break;
    case RP_TRAJECTORY_SHORT_TURNS:
        (void)snprintf(
            text, size,
            "turns / |frequency| = %g s is refused: it must be at least ramp_time = %g s "
            "(turns = %g, frequency = %g Hz)",
            p->turns / fabs(p->frequency), p->ramp_time, p->turns, p->frequency);
        break;
    case RP_TRAJECTORY_EARLY_RELEASE:
        (void)snprintf(text, size,
                       "release_time = %g s is refused: it must not be before grasp_time = %g s",
                       p->release_time, p->grasp_time);
        break;
    case RP_TRAJECTORY_OUT_OF_REACH:
        distance = rp_trajectory_distance(p, nearest);
        (void)snprintf(
            text, size,
            "the path to (%g, %g) m is refused: there it is %g m from the axis of joint 1, "
            "and it must stay beyond the smallest reachable distance |a| = %g m",
            nearest[0] + 0.0, nearest[1] + 0.0, distance, fabs(p->a));
        break;
    }
    return STATUS_INVALID_PARAMETERS;
}

/* ---- Events --------------------------------------------------------------------------------- */

static int payload_at(const struct rp_trajectory_parameters *p, double t) {
    if (rp_trajectory_is_attached(p, t)) {
        return RP_TRAJECTORY_ATTACHED;
    }
    return t < p->grasp_time && p->grasp_time < p->release_time ? RP_TRAJECTORY_TO_GRASP
                                                                : RP_TRAJECTORY_RELEASED;
}

static double next_time(const void *values_pointer) {
    const struct rp_trajectory_values *values = values_pointer;
    switch (values->payload) {
    case RP_TRAJECTORY_TO_GRASP:
        return values->parameters.grasp_time;
    case RP_TRAJECTORY_ATTACHED:
        return values->parameters.release_time;
    default:
        return INFINITY;
    }
}

static enum status update(void *values_pointer, const struct event *event) {
    struct rp_trajectory_values *values = values_pointer;
    if (values->payload == RP_TRAJECTORY_UNDECIDED) {
        values->payload = payload_at(&values->parameters, event->t);
    } else if (event->is_timed) {
        values->payload = values->payload == RP_TRAJECTORY_TO_GRASP ? RP_TRAJECTORY_ATTACHED
                                                                    : RP_TRAJECTORY_RELEASED;
    }
    return STATUS_OK;
}

static bool modes_are_possible(const void *values_pointer, bool is_held) {
    const struct rp_trajectory_values *values = values_pointer;
    const bool is_grasped = values->parameters.grasp_time < values->parameters.release_time;
    return values->payload == RP_TRAJECTORY_RELEASED ||
           (is_grasped && (values->payload == RP_TRAJECTORY_TO_GRASP ||
                           values->payload == RP_TRAJECTORY_ATTACHED));
}

static const struct model_events events = {
    .modes = {offsetof(struct rp_trajectory_values, payload), sizeof(int)},
    .modes_are_possible = modes_are_possible,
    .next_time = next_time,
    .update = update,
};

const struct model rp_trajectory_model = {
    .values_size = sizeof(struct rp_trajectory_values),
    .parameters = {offsetof(struct rp_trajectory_values, parameters),
                   sizeof(struct rp_trajectory_parameters)},
    .right_hand_side = right_hand_side,
    .outputs = outputs,
    .propagate = propagate,
    .check_parameters = check_parameters,
    .events = &events,
};
