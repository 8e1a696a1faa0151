#include "contacts_work.h"

#include <math.h>
#include <string.h>

void contacts_find_rest(struct work *work) {
    for (int k = 0; k < work->model->direction_count; k++) {
        const bool may_rest = work->friction[k] >= 0 || work->sense[k] != 0;
        work->rests[k] = may_rest && fabs(work->now.velocity[k]) <= least_velocity(work, k);
    }
}

/* ---- Impulses -------------------------------------------------------------------------------- */

/* Changes the states by an impulse of a contact. */
static void push(struct work *work, int contact, double impulse) {
    const double *x = states_of(work);
    const int contacts = work->model->contact_count;
    for (int i = 0; i < work->model->moved_count; i++) {
        const size_t state = work->model->moved[i];
        set_state(work, state, x[state] + work->now.jump[i * contacts + contact] * impulse);
    }
}

/* Applies impulses at stops, P per direction in its sense; the velocities before are in
 * work->before. Velocities that become 0 do so to the last bit. */
static void apply_impulses(struct work *work, const double P[], const int is_struck[],
                           const double restitution[]) {
    if (work->model->strike_gradients != NULL) {
        work->model->strike_gradients(work, P, is_struck, restitution);
    }
    for (int k = 0; k < work->model->direction_count; k++) {
        if (!is_struck[k] || P[k] == 0.0) {
            continue;
        }
        const int e = work->stop[k];
        const struct contact *contact = &work->model->contact[e];
        const double impulse = P[k] / work->now.ratio[e];
        push(work, e, impulse);
        double *of_instant = double_at(work, contact->impulse);
        *of_instant = (work->struck[e] ? *of_instant : 0.0) + impulse;
        *double_at(work, contact->impulses) += impulse;
        *double_at(work, contact->loss) -= 0.5 * P[k] * (1.0 - restitution[k]) * work->before[k];
        work->struck[e] = 1;
    }
    measure(work);
    const int count = work->model->direction_count;
    bool are_plain = true;
    for (int k = 0; k < count; k++) {
        are_plain &= !is_struck[k] || work->model->direction[k].is_plain;
    }
    for (int pass = 0; pass < (are_plain ? 1 : count); pass++) {
        for (int k = 0; k < count; k++) {
            if (is_struck[k] && work->model->direction[k].is_exact) {
                if (!are_plain) {
                    measure(work); // others may have moved where this one rests
                }
                const double velocity = 0.0 - restitution[k] * work->before[k];
                set_state(work, work->model->direction[k].own,
                          work->now.rest[k] + velocity / work->now.factor[k]);
            }
        }
    }
    measure(work);
    contacts_find_rest(work);
}

/* True if a direction on a stop leaves it and comes back from no more than the tolerance of its
 * position: at v^2 / (2 |a|), where the acceleration points into the stop. */
static bool hardly_leaves(const struct work *work, int k) {
    const double velocity = work->now.velocity[k];
    if (!(work->sense[k] * velocity > least_velocity(work, k)) || work->event == NULL) {
        return false;
    }
    const int e = work->stop[k];
    const double ratio = fabs(work->now.ratio[e]);
    const double into = -work->sense[k] * work->acceleration[k];
    const double most = 2.0 * into * fmax(work->event->rest, 1.0) * work->now.tolerance[e];
    return into > 0.0 && ratio * velocity * velocity <= most;
}

void contacts_solve_impulses(const struct work *work, const int is_member[], const double change[],
                             double P[]) {
    for (int block = 0; block < work->model->block_count; block++) {
        int member[CONTACTS_MOST_COUPLED] = {0};
        struct box box;
        struct box_solution found;
        const int count = contacts_members(work, block, is_member, member);
        contacts_write_box(work, member, count, change, &box);
        for (int i = 0; i < count; i++) {
            box.a0[i] = -box.a0[i];
            box.low[i] = -INFINITY;
            box.high[i] = INFINITY;
        }
        box_solve(&box, &found);
        for (int i = 0; i < count; i++) {
            P[member[i]] = found.T[i];
        }
    }
}

void contacts_rest_exactly(struct work *work) {
    const int count = work->model->direction_count;
    bool is_near = true;
    for (int k = 0; k < count; k++) {
        is_near &= !work->rests[k] || work->model->direction[k].is_exact ||
                   fabs(work->now.velocity[k]) <= least_velocity(work, k);
        work->acceleration[k] = -work->now.velocity[k];
    }
    if (!is_near) {
        contacts_solve_impulses(work, work->rests, work->acceleration, work->hold);
        for (int k = 0; k < count; k++) {
            const int friction = work->friction[k];
            if (work->rests[k] && friction >= 0) {
                push(work, friction, -work->hold[k]);
            } else if (work->rests[k]) {
                push(work, work->stop[k], work->hold[k] / work->now.ratio[work->stop[k]]);
            }
        }
        measure(work);
    }
    bool changes = true;
    for (int pass = 0; pass < count && changes; pass++) {
        changes = false;
        for (int k = 0; k < count; k++) {
            const struct direction *direction = &work->model->direction[k];
            if (work->rests[k] && direction->is_exact &&
                states_of(work)[direction->own] != work->now.rest[k]) {
                set_state(work, direction->own, work->now.rest[k]);
                changes = true;
                measure(work);
            }
        }
    }
}

/* Ends bouncing: what hardly leaves its stop stays, with all that rests on stops. */
static void catch_on_stops(struct work *work) {
    const int count = work->model->direction_count;
    bool is_any = false;
    for (int k = 0; k < count; k++) {
        is_any |= work->sense[k] * work->now.velocity[k] > least_velocity(work, k);
    }
    if (!is_any) {
        return;
    }
    (void)contacts_decide(work);
    is_any = false;
    double *P = work->hold, *change = work->acceleration;
    int *caught = work->marked;
    for (int k = 0; k < count; k++) {
        const bool hardly = hardly_leaves(work, k);
        const double speed = fabs(work->now.velocity[k]);
        is_any |= hardly;
        caught[k] = hardly || (work->sense[k] != 0 && speed <= least_velocity(work, k));
    }
    if (!is_any) {
        return;
    }
    for (int k = 0; k < count; k++) {
        change[k] = -work->now.velocity[k];
        work->before[k] = work->now.velocity[k];
        P[k] = 0.0;
    }
    contacts_solve_impulses(work, caught, change, P);
    double *plastic = work->acceleration;
    memset(plastic, 0, (size_t)count * sizeof *plastic);
    apply_impulses(work, P, caught, plastic);
}

static bool moves_into_stop(const struct work *work) {
    bool found = false;
    for (int k = 0; k < work->model->direction_count; k++) {
        found |= work->sense[k] * work->now.velocity[k] < -least_velocity(work, k);
    }
    return found;
}

/* Applies one impact of all stops that are touched: impulses push only, and nothing moves into a
 * stop afterwards. */
static void strike(struct work *work, bool is_elastic) {
    const int count = work->model->direction_count;
    double *P = work->hold, *restitution = work->acceleration;
    int *touches = work->pattern;
    for (int k = 0; k < count; k++) {
        const double velocity = work->now.velocity[k];
        touches[k] = work->sense[k] != 0 && work->sense[k] * velocity <= least_velocity(work, k);
        restitution[k] = touches[k] && is_elastic ? work->now.restitution[work->stop[k]] : 0.0;
        work->before[k] = velocity;
        P[k] = 0.0;
    }
    for (int block = 0; block < work->model->block_count; block++) {
        int member[CONTACTS_MOST_COUPLED] = {0};
        struct box box;
        struct box_solution found;
        const int size = contacts_members(work, block, touches, member);
        contacts_write_box(work, member, size, work->before, &box);
        for (int i = 0; i < size; i++) {
            box.a0[i] *= 1.0 + restitution[member[i]];
            box.low[i] = work->sense[member[i]] > 0 ? 0.0 : -INFINITY;
            box.high[i] = work->sense[member[i]] > 0 ? INFINITY : 0.0;
        }
        box_solve(&box, &found);
        for (int i = 0; i < size; i++) {
            P[member[i]] = found.leaves[i] == 0 ? found.T[i] : 0.0;
            touches[member[i]] = found.leaves[i] == 0;
        }
    }
    apply_impulses(work, P, touches, restitution);
}

void contacts_apply_impacts(struct work *work) {
    enum { MOST_ELASTIC = 8, MOST = 16 };
    catch_on_stops(work);
    for (int count = 0; count < MOST && moves_into_stop(work); count++) {
        strike(work, count < MOST_ELASTIC);
        catch_on_stops(work);
    }
}
