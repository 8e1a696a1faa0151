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
    const bool is_above = values->mode != UNDECIDED || values->motion[0] > 0.0;
    if (!is_above) {
        (void)snprintf(text, size, "x = %g is refused: it starts above the floor",
                       values->motion[0]);
    }
    return is_above;
}

static bool are_possible(const void *values) {
    return true;
}

static bool modes_are_possible(const void *values_pointer, bool is_held) {
    const struct bead_values *values = values_pointer;
    return values->mode == FLIES || values->mode == RESTS;
}

static bool is_at_rest(const void *values_pointer) {
    return ((const struct bead_values *)values_pointer)->mode == RESTS;
}

static void describe(const void *values_pointer, struct indicator indicators[]) {
    const struct bead_values *values = values_pointer;
    const bool rests = values->mode == RESTS;
    indicators[0] = (struct indicator){.kind = rests ? INDICATOR_UNUSED : INDICATOR_OF_STATE,
                                       .factor = 1.0,
                                       .rises = values->motion[1] > 0.0};
}

static enum status indicators(const void *values, double t, const double x[], const double u[],
                              double z[]) {
    z[0] = ((const struct bead_values *)values)->mode == RESTS ? 1.0 : x[0];
    return STATUS_OK;
}

static enum status update(void *values_pointer, const struct event *event) {
    struct bead_values *values = values_pointer;
    if (values->mode == UNDECIDED) {
        values->mode = FLIES;
    }
    if (event->triggered != NULL && event->triggered[0]) {
        values->impacts++;
        values->motion[0] = 0.0;
        values->motion[1] *= -values->parameters.restitution;
        if (values->motion[1] < values->parameters.slow) {
            values->motion[1] = 0.0;
            values->mode = RESTS;
        }
    }
    return STATUS_OK;
}

static const char *const names[] = {"way"};

const struct model_events bead_events = {
    .indicator_count = 1,
    .indicator_names = names,
    .modes = {offsetof(struct bead_values, mode), 2 * sizeof(int)},
    .are_possible = are_possible,
    .modes_are_possible = modes_are_possible,
    .is_at_rest = is_at_rest,
    .describe = describe,
    .indicators = indicators,
    .update = update,
};
