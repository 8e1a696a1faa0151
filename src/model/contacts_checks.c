#include "contacts_work.h"

#include <stdio.h>

/* Refuses a value; limit: of what `wanted` ends with, or NULL. */
static enum status refuse(const struct work *work, const char *name, const char *what, double value,
                          const char *wanted, const double *limit) {
    if (work->event != NULL && work->event->reason != NULL) {
        char more[40] = "";
        if (limit != NULL) {
            (void)snprintf(more, sizeof more, " = %.9g", *limit);
        }
        (void)snprintf(work->event->reason, work->event->reason_size,
                       "%s: %s = %.9g is refused: %s%s", name, what, value, wanted, more);
    }
    return STATUS_INVALID_PARAMETERS;
}

static enum status check_friction(const struct work *work, int e) {
    const struct contacts_measured *now = &work->now;
    const char *name = work->model->contact[e].name;
    if (!(now->coulomb[e] >= 0.0)) {
        return refuse(work, name, "coulomb", now->coulomb[e], "it must be 0 or more", NULL);
    }
    if (!(now->breakaway[e] >= now->coulomb[e])) {
        return refuse(work, name, "breakaway", now->breakaway[e], "it must not be below coulomb",
                      &now->coulomb[e]);
    }
    if (now->breakaway[e] > now->coulomb[e] && !(now->stribeck[e] > 0.0)) {
        return refuse(work, name, "stribeck", now->stribeck[e],
                      "it must be above 0 where breakaway is above coulomb", &now->coulomb[e]);
    }
    return STATUS_OK;
}

static enum status check_stops(const struct work *work, int e, bool is_start) {
    const struct contacts_measured *now = &work->now;
    const struct contact *contact = &work->model->contact[e];
    if (!(now->restitution[e] >= 0.0 && now->restitution[e] <= 1.0)) {
        return refuse(work, contact->name, "restitution", now->restitution[e],
                      "it must be from 0 to 1", NULL);
    }
    if (contact->has_lower && contact->has_upper && !(now->lower[e] < now->upper[e])) {
        return refuse(work, contact->name, "lower", now->lower[e], "it must be below upper",
                      &now->upper[e]);
    }
    if (is_start && contact->has_lower && now->position[e] < now->lower[e]) {
        return refuse(work, contact->name, "position", now->position[e],
                      "a start must not be below lower", &now->lower[e]);
    }
    if (is_start && contact->has_upper && now->position[e] > now->upper[e]) {
        return refuse(work, contact->name, "position", now->position[e],
                      "a start must not be above upper", &now->upper[e]);
    }
    return STATUS_OK;
}

/* Checks that the force of friction slows its velocity down, and that of stops speeds it up. */
static enum status check_response(const struct work *work, int e) {
    const struct contact *contact = &work->model->contact[e];
    const double own = work->now.ratio[e] *
                       work->now.response[contact->direction * work->model->contact_count + e];
    if (contact->is_friction ? own < 0.0 : own > 0.0) {
        return STATUS_OK;
    }
    return refuse(work, contact->name, "der(velocity) by force", own,
                  contact->is_friction ? "friction acts against its velocity, so below 0"
                                       : "the force of stops acts along their velocity, so above 0",
                  NULL);
}

enum status contacts_check(const struct work *work, bool is_start) {
    enum status status = STATUS_OK;
    for (int e = 0; e < work->model->contact_count && status == STATUS_OK; e++) {
        if (work->now.active[e] != 0.0) {
            status = work->model->contact[e].is_friction ? check_friction(work, e)
                                                         : check_stops(work, e, is_start);
            status = status == STATUS_OK ? check_response(work, e) : status;
        }
    }
    return status;
}
