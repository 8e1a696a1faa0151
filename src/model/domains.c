#include "domains.h"

#include <math.h>
#include <string.h>

static size_t count_of(struct range range) {
    return range.size / sizeof(double);
}

static double *doubles_in(void *values, struct range range) {
    return (double *)(void *)((char *)values + range.offset);
}

static int *modes_in(const struct domains *model, void *values) {
    return (int *)(void *)((char *)values + model->modes);
}

static const int *modes_of(const struct domains *model, const void *values) {
    return (const int *)(const void *)((const char *)values + model->modes);
}

/* Replaces values that are not finite. */
static void complete(double value[], const double other[], size_t count) {
    for (size_t i = 0; i < count; i++) {
        value[i] = isfinite(value[i]) ? value[i] : other[i];
    }
}

/* Updates the modes of room.values, and the anchors with them, by its states and inputs; a relation
 * that is not defined keeps its mode. Returns false if `values` has the same modes. */
static bool update_modes(const struct domains *model, struct domains_room room, const void *values,
                         double t) {
    int *holds = modes_in(model, room.values);
    bool changes = true;
    if (model->anchor != NULL) {
        model->anchor(room.values, t, doubles_in(room.values, model->states),
                      doubles_in(room.values, model->inputs), SEARCH_FREE,
                      doubles_in(room.values, model->anchors));
    }
    for (int count = 0; changes && count <= model->relation_count; count++) {
        changes = false;
        model->write_distances(room.values, t, room.distance);
        for (int k = 0; k < model->relation_count; k++) {
            const struct relation *relation = &model->relation[k];
            const double distance = room.distance[k];
            const int now = relation->includes_zero ? distance >= 0.0 : distance > 0.0;
            if (!isnan(distance) && holds[k] != now) {
                holds[k] = now;
                changes = true;
            }
        }
    }
    const size_t size = (size_t)model->relation_count * sizeof *holds;
    return memcmp(holds, modes_of(model, values), size) != 0;
}

/* Calls update_modes for values with these states and inputs. */
static bool update_modes_at(const struct domains *model, struct domains_room room,
                            const void *values, double t, const double x[], const double u[]) {
    memcpy(room.values, values, model->values_size);
    memcpy(doubles_in(room.values, model->states), x, model->states.size);
    memcpy(doubles_in(room.values, model->inputs), u, model->inputs.size);
    return update_modes(model, room, values, t);
}

bool domains_follow(const struct domains *model, struct domains_room room, const void *values,
                    double t) {
    memcpy(room.values, values, model->values_size);
    return update_modes(model, room, values, t);
}

enum status domains_right_hand_side(const struct domains *model, struct domains_room room,
                                    const void *values, double t, const double x[],
                                    const double u[], double dx[]) {
    if (!update_modes_at(model, room, values, t, x, u)) {
        return STATUS_OK;
    }
    const enum status status = model->right_hand_side(room.values, t, x, u, room.result);
    complete(dx, room.result, count_of(model->states));
    return status;
}

enum status domains_jacobian(const struct domains *model, struct domains_room room,
                             const void *values, double t, const double x[], const double u[],
                             double J[]) {
    return update_modes_at(model, room, values, t, x, u) ? model->jacobian(room.values, t, x, u, J)
                                                         : STATUS_OK;
}

/* Replaces indicators that are not finite by the indicators of room.values, `other`, with signs for
 * the modes in values. */
static void complete_indicators(const struct domains *model, struct domains_room room,
                                const void *values, double z[], const double other[]) {
    for (int k = 0; k < model->relation_count; k++) {
        const size_t i = model->relation[k].indicator;
        if (model->relation[k].is_timed || isfinite(z[i])) {
            continue;
        }
        const double distance = room.distance[k];
        const double z_held = modes_of(model, values)[k] ? distance : -distance;
        z[i] = isfinite(z_held) ? z_held : other[i];
    }
}

enum status domains_indicators(const struct domains *model, struct domains_room room,
                               const void *values, double t, const double x[], const double u[],
                               double z[]) {
    const bool changes = update_modes_at(model, room, values, t, x, u);
    const enum status status = model->write_indicators(room.values, t, x, u, room.result);
    if (!changes) {
        return status;
    }
    complete_indicators(model, room, values, z, room.result);
    return status;
}

static void complete_calculated(const struct domains *model, void *values, void *other) {
    complete(doubles_in(values, model->calculated), doubles_in(other, model->calculated),
             count_of(model->calculated));
}

static void complete_counts(const struct domains *model, void *values, const void *other) {
    int *count = (int *)(void *)((char *)values + model->counts.offset);
    const int *others = (const int *)(const void *)((const char *)other + model->counts.offset);
    for (size_t i = 0; i < model->counts.size / sizeof *count; i++) {
        count[i] = count[i] == MODEL_NO_INT ? others[i] : count[i];
    }
}

enum status domains_outputs(const struct domains *model, struct domains_room room, void *values,
                            double t) {
    if (!domains_follow(model, room, values, t)) {
        return STATUS_OK;
    }
    const enum status status = model->outputs(room.values, t);
    complete_calculated(model, values, room.values);
    complete_counts(model, values, room.values);
    complete_indicators(model, room, values, doubles_in(values, model->indicators),
                        doubles_in(room.values, model->indicators));
    return status;
}

enum status domains_derivatives(const struct domains *model, struct domains_room room,
                                const void *values, double t, double dt, void *first,
                                void *second) {
    if (!domains_follow(model, room, values, t)) {
        return STATUS_OK;
    }
    memcpy(room.first, first, model->values_size);
    if (second != NULL) {
        memcpy(room.second, second, model->values_size);
    }
    const enum status status =
        model->derivatives(room.values, t, dt, room.first, second != NULL ? room.second : NULL);
    complete_calculated(model, first, room.first);
    if (second != NULL) {
        complete_calculated(model, second, room.second);
    }
    return status;
}

/* Gives indicators whose signs change with the modes the signs of `values`. */
static void keep_signs(const struct domains *model, struct domains_room room, const void *values,
                       int first, int last, double row[][SERIES_LENGTH]) {
    for (int k = 0; k < model->relation_count; k++) {
        const size_t i =
            model->relation[k].is_timed ? 0 : model->row_of_indicator[model->relation[k].indicator];
        const bool turns = modes_of(model, values)[k] != modes_in(model, room.values)[k];
        for (int order = first; i >= count_of(model->states) && turns && order <= last; order++) {
            row[i][order] = -row[i][order];
        }
    }
}

enum status domains_extend(const struct domains *model, struct domains_room room,
                           const struct series_origin *origin, int first, int last,
                           double row[][SERIES_LENGTH]) {
    memcpy(room.values, origin->values, model->values_size);
    for (size_t i = 0; i < count_of(model->states); i++) {
        doubles_in(room.values, model->states)[i] = row[i][0];
    }
    for (size_t i = 0; i < count_of(model->inputs); i++) {
        doubles_in(room.values, model->inputs)[i] = origin->inputs[i][0];
    }
    if (!update_modes(model, room, origin->values, origin->t)) {
        return model->extend(origin, first, last, row);
    }
    struct series_origin here = *origin;
    here.values = room.values;
    const enum status status = model->extend(&here, first, last, row);
    keep_signs(model, room, origin->values, first, last, row);
    return status;
}
