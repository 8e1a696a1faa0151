#include "contacts_work.h"

/* Returns the derivative of a / ratio of a contact. */
static double over_ratio(const struct work *work, const struct contacts_measured *along, int e,
                         double a, double of_a) {
    const double ratio = work->now.ratio[e];
    return (of_a - a * along->ratio[e] / ratio) / ratio;
}

/* Writes the change of velocities that the derivative of the impulses makes: of W P = -(1 + e) v,
 * without W dP. */
static void write_change(const struct work *work, const struct contacts_measured *along,
                         const double P[], const int is_struck[], const double restitution[],
                         double change[]) {
    const int count = work->model->direction_count;
    const int contacts = work->model->contact_count;
    for (int k = 0; k < count; k++) {
        const int own = work->stop[k];
        const bool is_elastic = is_struck[k] && restitution[k] == work->now.restitution[own];
        const double of_restitution = is_elastic ? along->restitution[own] : 0.0;
        change[k] = -(1.0 + restitution[k]) * along->velocity[k] - of_restitution * work->before[k];
        for (int l = 0; is_struck[k] && l < count; l++) {
            const int place = k * contacts + work->stop[l];
            if (is_struck[l]) {
                change[k] -= P[l] * over_ratio(work, along, work->stop[l],
                                               work->now.response[place], along->response[place]);
            }
        }
    }
}

void contacts_strike_gradients(const struct work *work, const double P[], const int is_struck[],
                               const double restitution[]) {
    const struct call *call = work->call;
    const struct contacts *model = work->model;
    const struct gradients *gradients = call->model->gradients;
    const int count = model->direction_count;
    double *change = call->room.gradients.contacts, *of_P = change + count;
    const struct contacts_measured along = contacts_measured_in(model, of_P + count);
    for (int j = 0; j < gradients->count; j++) {
        double *gradient = states_of(work) + (ptrdiff_t)(1 + j) * gradients->state_count;
        model->measure_along(call->values, call->t, call->du, call->room.gradients.shift, j,
                             &along);
        write_change(work, &along, P, is_struck, restitution, change);
        contacts_solve_impulses(work, is_struck, change, of_P);
        for (int i = 0; i < model->moved_count; i++) {
            for (int k = 0; k < count; k++) {
                const int e = work->stop[k];
                const int place = i * model->contact_count + e;
                if (is_struck[k]) {
                    gradient[model->moved[i]] +=
                        P[k] *
                            over_ratio(work, &along, e, work->now.jump[place], along.jump[place]) +
                        of_P[k] * work->now.jump[place] / work->now.ratio[e];
                }
            }
        }
    }
}

/* Moves the states by impulses, as push of contacts_impacts.c does. */
static void push(const struct work *work, int k, double impulse, double gradient[]) {
    const int friction = work->friction[k];
    const int e = friction >= 0 ? friction : work->stop[k];
    const double own = friction >= 0 ? -impulse : impulse / work->now.ratio[e];
    for (int i = 0; i < work->model->moved_count; i++) {
        gradient[work->model->moved[i]] += work->now.jump[i * work->model->contact_count + e] * own;
    }
}

void contacts_hold_gradients(const struct work *work) {
    const struct call *call = work->call;
    const struct contacts *model = work->model;
    const struct gradients *gradients = call->model->gradients;
    const int count = model->direction_count;
    double *change = call->room.gradients.contacts, *of_P = change + count;
    const struct contacts_measured along = contacts_measured_in(model, of_P + count);
    for (int k = 0; k < count; k++) {
        work->marked[k] = work->rests[k] && work->pattern[k] == 0;
    }
    for (int j = 0; j < gradients->count; j++) {
        double *gradient = states_of(work) + (ptrdiff_t)(1 + j) * gradients->state_count;
        model->measure_along(call->values, call->t, call->du, call->room.gradients.shift, j,
                             &along);
        for (int k = 0; k < count; k++) {
            change[k] = -along.velocity[k];
        }
        contacts_solve_impulses(work, work->marked, change, of_P);
        for (int k = 0; k < count; k++) {
            if (work->marked[k]) {
                push(work, k, of_P[k], gradient);
            }
        }
        for (int e = 0; e < model->contact_count; e++) {
            const int mode = *mode_of(work, e);
            if (!model->contact[e].is_friction && mode != STOPS_FREE) {
                gradient[model->contact[e].position] =
                    mode == STOPS_LOWER ? along.at_lower[e] : along.at_upper[e];
            }
        }
    }
}
