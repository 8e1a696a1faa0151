#include "wheel.h"

#include <math.h>

static const double full_turn = 6.283185307179586; /* rad */

enum indicator_index { TO_STOP, PUSH, INDICATORS };

static enum status right_hand_side(const void *values_pointer, double t, const double x[],
                                   const double u[], double dx[]) {
    const struct wheel_values *values = values_pointer;
    dx[0] = values->is_caught ? 0.0 : u[0];
    return STATUS_OK;
}

static enum status jacobian(const void *values, double t, const double x[], const double u[],
                            double J[]) {
    J[0] = 0.0;
    return STATUS_OK;
}

/* ---- Events --------------------------------------------------------------------------------- */

static bool are_possible(const void *values_pointer) {
    const struct wheel_values *values = values_pointer;
    return values->stop > 0.0;
}

/* Only a stop catches a wheel. */
static bool modes_are_possible(const void *values_pointer, bool is_held) {
    const struct wheel_values *values = values_pointer;
    return (values->is_caught == 0 || values->is_caught == 1) && values->catches >= 0 &&
           (!is_held || !values->is_caught || are_possible(values));
}

static bool is_at_rest(const void *values_pointer) {
    const struct wheel_values *values = values_pointer;
    return values->is_caught;
}

static bool can_be_caught(const struct wheel_values *values) {
    return are_possible(values) && !values->is_caught;
}

static void describe(const void *values_pointer, struct indicator indicators[]) {
    const struct wheel_values *values = values_pointer;
    indicators[TO_STOP] = (struct indicator){.kind = INDICATOR_UNUSED};
    indicators[PUSH] = (struct indicator){.kind = INDICATOR_UNUSED};
    if (can_be_caught(values)) {
        indicators[TO_STOP] = (struct indicator){
            .kind = INDICATOR_OF_STATE, .state = 0, .factor = -1.0, .offset = values->stop};
    }
    if (values->is_caught) {
        indicators[PUSH].kind = INDICATOR_OF_MODEL;
    }
}

static enum status indicators(const void *values_pointer, double t, const double x[],
                              const double u[], double z[]) {
    const struct wheel_values *values = values_pointer;
    z[TO_STOP] = can_be_caught(values) ? values->stop - x[0] : 1.0;
    z[PUSH] = values->is_caught ? u[0] : 1.0;
    return STATUS_OK;
}

/* The stop catches a wheel that reaches it, and lets go of one that turns back. */
static enum status update(void *values_pointer, const struct event *event) {
    struct wheel_values *values = values_pointer;
    const bool *triggered = event->triggered;
    if (values->is_caught) {
        const bool ends = triggered != NULL && triggered[PUSH];
        values->is_caught = are_possible(values) && values->speed >= 0.0 && !ends;
        return STATUS_OK;
    }
    const bool arrives = values->angle >= values->stop || (triggered != NULL && triggered[TO_STOP]);
    if (are_possible(values) && arrives && values->speed > 0.0) {
        values->is_caught = 1;
        values->catches++;
        values->lost_speed += values->speed;
        values->angle = values->stop;
    }
    return STATUS_OK;
}

static const char *const indicator_names[INDICATORS] = {"to_stop", "push"};

static const struct model_events events = {
    .indicator_count = INDICATORS,
    .indicator_names = indicator_names,
    .modes = {offsetof(struct wheel_values, is_caught), 2 * sizeof(int)},
    .discrete_states = {offsetof(struct wheel_values, lost_speed), sizeof(double)},
    .discrete_inputs = {offsetof(struct wheel_values, is_counting), sizeof(int)},
    .are_possible = are_possible,
    .modes_are_possible = modes_are_possible,
    .is_at_rest = is_at_rest,
    .describe = describe,
    .indicators = indicators,
    .update = update,
};

/* ---- Calculated values ---------------------------------------------------------------------- */

static enum status outputs(void *values_pointer, double t) {
    struct wheel_values *values = values_pointer;
    const double turns = floor(values->angle / full_turn);
    double z[INDICATORS];
    if (!(fabs(turns) < 1e9)) {
        return STATUS_NOT_FINITE; // no int
    }
    const int counted = values->is_counting ? (int)turns : 0;
    values->turns = values->is_reversed ? -counted : counted;
    right_hand_side(values, t, &values->angle, &values->speed, &values->rate);
    values->is_turning = values->rate != 0.0;
    indicators(values, t, &values->angle, &values->speed, z);
    values->to_stop = z[TO_STOP];
    values->push = z[PUSH];
    return STATUS_OK;
}

/* All of it is linear while the modes stay as they are. */
static void propagate_linearly(const struct wheel_values *values, struct wheel_values *d) {
    d->rate = values->is_caught ? 0.0 : d->speed;
    d->to_stop = can_be_caught(values) ? d->stop - d->angle : 0.0;
    d->push = values->is_caught ? d->speed : 0.0;
}

static enum status derivatives(const void *values, double t, double dt, void *first, void *second) {
    propagate_linearly(values, first);
    if (second != NULL) {
        propagate_linearly(values, second);
    }
    return STATUS_OK;
}

static enum status check_parameters(const void *values, char *text, size_t size) {
    return STATUS_OK; // the limits of each are all that they need
}

const struct model wheel_model = {
    .values_size = sizeof(struct wheel_values),
    .parameters = {offsetof(struct wheel_values, stop), sizeof(double) + sizeof(int)},
    .inputs = {offsetof(struct wheel_values, speed), sizeof(double)},
    .states = {offsetof(struct wheel_values, angle), sizeof(double)},
    .dx = {offsetof(struct wheel_values, rate), sizeof(double)},
    .right_hand_side = right_hand_side,
    .jacobian = jacobian,
    .outputs = outputs,
    .derivatives = derivatives,
    .check_parameters = check_parameters,
    .events = &events,
};
