#include "contacts_work.h"

#include <math.h>
#include <string.h>

/* ---- Forces that hold ------------------------------------------------------------------------ */

/* Adds what a force in the sense of a direction does to all accelerations. */
static void add_response(const struct work *work, int of, double force, double acceleration[]) {
    for (int k = 0; k < work->model->direction_count; k++) {
        acceleration[k] += response(work, k, of) * force;
    }
}

/* Writes accelerations without what holds directions at rest. */
static void accelerate(const struct work *work, double acceleration[]) {
    const int contacts = work->model->contact_count;
    for (int k = 0; k < work->model->direction_count; k++) {
        acceleration[k] = work->now.acceleration[k];
    }
    for (int e = 0; e < contacts; e++) {
        const struct contact *contact = &work->model->contact[e];
        const int of = contact->direction;
        if (contact->is_friction && work->now.active[e] != 0.0 && !work->rests[of]) {
            const double force =
                work->now.velocity[of] < 0.0 ? -work->now.law[e] : work->now.law[e];
            for (int k = 0; k < work->model->direction_count; k++) {
                acceleration[k] += work->now.response[k * contacts + e] * force;
            }
        }
    }
}

int contacts_members(const struct work *work, int block, const int is_member[], int member[]) {
    int count = 0;
    for (int k = 0; k < work->model->direction_count; k++) {
        if (work->model->direction[k].block == block && is_member[k]) {
            member[count++] = k;
        }
    }
    return count;
}

void contacts_write_box(const struct work *work, const int member[], int count, const double a0[],
                        struct box *box) {
    box->count = count;
    for (int i = 0; i < count; i++) {
        box->a0[i] = a0[member[i]];
        for (int j = 0; j < count; j++) {
            box->W[i][j] = response(work, member[i], member[j]);
        }
    }
}

bool contacts_decide(struct work *work) {
    if (work->is_decided) {
        return work->fits;
    }
    bool fits = true;
    accelerate(work, work->acceleration);
    memset(work->pattern, 0, (size_t)work->model->direction_count * sizeof *work->pattern);
    memset(work->hold, 0, (size_t)work->model->direction_count * sizeof *work->hold);
    for (int block = 0; block < work->model->block_count; block++) {
        int member[CONTACTS_MOST_COUPLED] = {0};
        struct box box;
        struct box_solution found;
        const int count = contacts_members(work, block, work->rests, member);
        if (count == 0) {
            continue;
        }
        contacts_write_box(work, member, count, work->acceleration, &box);
        for (int i = 0; i < count; i++) {
            const int friction = work->friction[member[i]];
            const double limit = friction >= 0 ? work->now.breakaway[friction] : 0.0;
            box.low[i] = work->sense[member[i]] < 0 ? -INFINITY : -limit;
            box.high[i] = work->sense[member[i]] > 0 ? INFINITY : limit;
        }
        box_solve(&box, &found);
        fits &= found.misfit <= 1e-6;
        for (int i = 0; i < count; i++) {
            work->pattern[member[i]] = found.leaves[i];
            work->hold[member[i]] = found.T[i];
            add_response(work, member[i], found.T[i], work->acceleration);
        }
        for (int i = 0; i < count; i++) {
            work->acceleration[member[i]] = found.a[i];
        }
    }
    work->is_decided = true;
    work->fits = fits;
    return fits;
}

/* ---- Breaking away -------------------------------------------------------------------------- */

/* Returns the place of the limit that ends the rest of a direction in a sense. */
static int limit_of(const struct work *work, int k, int sign) {
    const int friction = work->friction[k];
    const int contact = friction >= 0 ? friction : work->stop[k];
    const int is_second = friction >= 0 ? sign < 0 : sense_of(work, contact, STOPS_LOWER) != sign;
    return 2 * contact + is_second;
}

/* Returns the sense in which a direction that stays is at its limit, or 0. */
static int side_at_limit(const struct work *work, int k) {
    const struct compared *compared = work->call->room.compared;
    for (int sign = 1; sign >= -1 && work->rests[k] && work->pattern[k] == 0; sign -= 2) {
        const bool is_open = work->sense[k] == 0 || work->sense[k] == sign;
        const bool may_leave = is_open && (work->friction[k] >= 0 || work->sense[k] == sign);
        const struct compared *limit = &compared[limit_of(work, k, sign)];
        const bool is_near = work->leaves[k] == sign && limit->distance <= limit->noise;
        if (may_leave && (limit->distance <= 0.0 || is_near)) {
            return sign;
        }
    }
    return 0;
}

/* True if the force that holds a direction may be at its limit: seen without errors, as an event or
 * by rounding. */
static bool may_break_away(const struct work *work, int k) {
    const double near = 1e-3; // of the force and of its bound: far above rounding
    if (!work->rests[k] || work->pattern[k] != 0) {
        return false;
    }
    const int friction = work->friction[k];
    const double limit = friction >= 0 ? work->now.breakaway[friction] : 0.0;
    const double force = work->hold[k];
    const double scale = near * (limit + fabs(force));
    const bool is_low = work->sense[k] >= 0 && force + limit <= scale;
    const bool is_high = work->sense[k] <= 0 && limit - force <= scale;
    return work->leaves[k] != 0 || is_low || is_high;
}

/* Writes the members of a block that stay, and the places among them of those at their limits;
 * returns how many there are of both. */
static int staying(const struct work *work, int block, const int side[], int member[], int at[],
                   int *limits) {
    int count = 0;
    *limits = 0;
    const int size = contacts_members(work, block, work->rests, member);
    for (int i = 0; i < size; i++) {
        const int k = member[i];
        if (work->pattern[k] == 0) {
            at[*limits] = count;
            *limits += side[k] != 0;
            member[count++] = k;
        }
    }
    return count;
}

/* Writes the problem of the rates: where a direction leaves at the rate z >= 0 of its acceleration,
 * the distances of all limits get other rates w, which must not be below 0. */
static void write_rates(const struct work *work, const int side[], const int member[], int count,
                        const int at[], int limits, struct box *rates) {
    const struct compared *compared = work->call->room.compared;
    rates->count = limits;
    for (int j = 0; j < limits; j++) {
        const int own = side[member[at[j]]];
        struct box forces; // that hold the others while this one leaves
        struct box_solution found;
        contacts_write_box(work, member, count, work->now.velocity, &forces);
        for (int i = 0; i < count; i++) {
            forces.a0[i] = i == at[j] ? -own : 0.0;
            forces.low[i] = -INFINITY;
            forces.high[i] = INFINITY;
        }
        box_solve(&forces, &found);
        for (int i = 0; i < limits; i++) {
            rates->W[i][j] = side[member[at[i]]] * found.T[at[i]];
        }
        rates->a0[j] = compared[limit_of(work, member[at[j]], own)].slope;
        rates->low[j] = 0.0;
        rates->high[j] = INFINITY;
    }
}

/* Writes the senses in which directions are at their limits; returns false if none is. */
static bool find_sides(const struct work *work, int side[]) {
    bool is_any = false;
    for (int k = 0; k < work->model->direction_count; k++) {
        is_any |= may_break_away(work, k);
    }
    if (!is_any) {
        return false;
    }
    is_any = false;
    modes_compare_limits(work->call, work->call->room.compared);
    for (int k = 0; k < work->model->direction_count; k++) {
        side[k] = side_at_limit(work, k);
        is_any |= side[k] != 0;
    }
    return is_any;
}

bool contacts_break_away(struct work *work) {
    int *side = work->marked;
    if (!find_sides(work, side)) {
        return false;
    }
    const bool is_known = work->event == NULL || work->event->du_is_known;
    bool leaves = false;
    for (int block = 0; block < work->model->block_count; block++) {
        int member[CONTACTS_MOST_COUPLED] = {0}, at[CONTACTS_MOST_COUPLED] = {0};
        int limits;
        struct box rates;
        struct box_solution found;
        const int count = staying(work, block, side, member, at, &limits);
        write_rates(work, side, member, count, at, limits, &rates);
        box_solve(&rates, &found);
        for (int j = 0; j < limits; j++) {
            const int k = member[at[j]];
            const bool falls = found.leaves[j] == 0 && found.T[j] > 0.0;
            const bool rests = rates.a0[j] == 0.0 || !is_known;
            if (falls || (work->leaves[k] == side[k] && rests)) {
                work->pattern[k] = side[k];
                leaves = true;
            }
        }
    }
    return leaves;
}
