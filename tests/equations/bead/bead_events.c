#include "bead_model.h"

#include <stdio.h>

const struct bead_values *bead_in_effect(const struct bead_values *values, const double x[],
                                         const double u[], struct bead_values *copy) {
    if (values->mode != UNDECIDED) {
        return values;
    }
    *copy = *values;
    copy->mode = FLIES;
    return copy;
}

bool bead_check(const struct bead_values *values, char *text, size_t size) {
    const bool is_above = values->mode != UNDECIDED || values->motion[0] >= 0.0;
    if (!is_above) {
        (void)snprintf(text, size, "x = %g is refused: it starts above the floor",
                       values->motion[0]);
    }
    return is_above;
}

static bool are_possible(const void *values) {
    return true;
}

static bool is_at_rest(const void *values_pointer) {
    return ((const struct bead_values *)values_pointer)->mode == RESTS;
}

/* It rests on the floor. */
static bool modes_are_possible(const void *values_pointer, bool is_held) {
    const struct bead_values *values = values_pointer;
    const bool can_rest = !is_held || (values->motion[0] == 0.0 && values->motion[1] == 0.0);
    return values->mode == FLIES || (values->mode == RESTS && can_rest);
}

enum { WAY, LOAD, INDICATORS };

static void describe(const void *values_pointer, struct indicator indicators[]) {
    const struct bead_values *values = values_pointer;
    const bool rests = values->mode == RESTS;
    indicators[WAY] = (struct indicator){.kind = rests ? INDICATOR_UNUSED : INDICATOR_OF_STATE,
                                         .factor = 1.0,
                                         .rises = values->motion[1] > 0.0};
    indicators[LOAD] = (struct indicator){.kind = rests ? INDICATOR_OF_MODEL : INDICATOR_UNUSED};
}

static enum status indicators(const void *values_pointer, double t, const double x[],
                              const double u[], double z[]) {
    const struct bead_values *values = values_pointer;
    const bool rests = values->mode == RESTS;
    z[WAY] = rests ? 1.0 : x[0];
    z[LOAD] = rests ? values->parameters.g - u[0] : 1.0;
    return STATUS_OK;
}

static void meet_floor(struct bead_values *values, double pull, double tolerance) {
    double *x = &values->motion[0];
    double *v = &values->motion[1];
    *x = 0.0;
    if (*v <= 0.0) {
        values->impacts++;
        *v *= -values->parameters.restitution;
        if (*v < values->parameters.slow || *v * *v <= 2.0 * pull * tolerance) {
            *v = 0.0;
            values->mode = RESTS;
        }
    }
}

static enum status update(void *values_pointer, const struct event *event) {
    struct bead_values *values = values_pointer;
    const double pull = values->parameters.g - values->lift;
    const bool *triggered = event->triggered;
    const bool hits = triggered != NULL ? triggered[WAY] : values->motion[0] <= 0.0;
    const bool is_lifted = triggered != NULL && triggered[LOAD] && event->du[0] >= 0.0;
    if (values->mode == UNDECIDED) {
        values->mode = FLIES;
    }
    if (hits && values->mode == FLIES) {
        meet_floor(values, pull, event->tolerance[0]);
    }
    if (is_lifted || pull < 0.0 || (pull == 0.0 && event->du[0] > 0.0)) {
        values->mode = FLIES;
    }
    return STATUS_OK;
}

static const char *const names[] = {"way", "load"};

const struct model_events bead_events = {
    .indicator_count = INDICATORS,
    .indicator_names = names,
    .modes = {offsetof(struct bead_values, mode), 2 * sizeof(int)},
    .are_possible = are_possible,
    .modes_are_possible = modes_are_possible,
    .is_at_rest = is_at_rest,
    .describe = describe,
    .indicators = indicators,
    .update = update,
};
