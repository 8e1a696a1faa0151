/* What others ask about modes and samplers, which changes nothing. */
#include "relations.h"

#include <math.h>

double relations_tick_time(const struct relations *model, struct relations_room room,
                           const void *values, int sampler) {
    const double *discrete = relations_discrete(model, values);
    if (room.every[sampler] == 0.0) {
        return INFINITY;
    }
    return discrete[0] + (room.offset[sampler] + discrete[1 + sampler] * room.every[sampler]);
}

double relations_next_time(const struct relations *model, struct relations_room room,
                           const void *values) {
    const int *modes = relations_modes(model, values);
    double next = INFINITY;
    model->write_times(values, room.times);
    model->write_periods(values, room.every, room.offset);
    for (int i = 0; i < model->sampler_count && modes[0]; i++) {
        next = fmin(next, relations_tick_time(model, room, values, i));
    }
    for (int k = 0; k < model->relation_count && modes[0]; k++) {
        const struct relation *relation = &model->relation[k];
        const bool is_ahead = relation->is_timed && modes[1 + k] != relation->rises;
        next = is_ahead ? fmin(next, room.times[k]) : next;
    }
    return next;
}

void relations_errors(const struct relations *model, struct relations_room room, const void *values,
                      double t, const double state_errors[], const double largest_inputs[],
                      double relative, double errors[]) {
    const struct given given = {state_errors,   relative * fabs(t), relative,
                                largest_inputs, room.zeros,         false};
    model->compare(values, t, &given, room.compared);
    for (int k = 0; k < model->relation_count; k++) {
        if (!model->relation[k].is_timed) {
            const double noise = room.compared[k].noise;
            errors[model->relation[k].indicator] = isfinite(noise) ? noise : 0.0;
        }
    }
    if (model->contacts == NULL) {
        return;
    }
    model->contacts->compare(values, t, &given, room.compared);
    for (int i = 0; i < 2 * model->contacts->contact_count; i++) {
        const double noise = room.compared[i].noise;
        errors[model->contacts->indicator + (size_t)i] = isfinite(noise) ? noise : 0.0;
    }
}

/* True if the number is a count of ticks. */
static bool is_count(double ticks) {
    return ticks >= 0.0 && ticks <= 0x1p53 && ticks == floor(ticks);
}

bool relations_are_plausible(const struct relations *model, const void *values) {
    const int *modes = relations_modes(model, values);
    const int count = (int)(model->modes.size / sizeof *modes);
    const int segments = 1 + model->relation_count + model->event_count + 1;
    const int counts = segments + model->segment_count;
    bool are_fine = modes[0] == 1;
    for (int i = 0; i < count; i++) {
        int first = 0;
        int last = 1;
        if (i >= counts) {
            first = model->count[i - counts].first;
            last = model->count[i - counts].last;
        } else if (i >= segments) {
            first = model->segment[i - segments].first;
            last = model->segment[i - segments].last;
        } else if (i == segments - 1 && model->ends != NULL) {
            last = model->event_count;
        }
        are_fine = are_fine && modes[i] >= first && modes[i] <= last;
    }
    for (int i = 0; i < model->sampler_count; i++) {
        are_fine = are_fine && is_count(relations_discrete(model, values)[1 + i]);
    }
    return are_fine;
}
