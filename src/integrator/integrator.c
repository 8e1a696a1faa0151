#include "integrator.h"

#include "method.h"
#include "workspace.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* As in struct instance, the fields that each step reads or writes stand together. */
struct integrator {
    struct workspace workspace; /* for the memory of the method */
    struct problem problem;
    const struct method *method; /* NULL if there is none */
    void *memory;                /* of the method */
    double internal_end;         /* end of the last internal step, s since the restart */
    struct integrator_statistics statistics;

    /* parts of values, one per state each, after problem.failed_x */
    double *f; /* room for a derivative */
    double *absolute_tolerances;
    double *reached_x; /* the state at problem.reached */
    double *x;         /* room for the state that the method writes */
    double values[];
};

/* ---- Methods -------------------------------------------------------------------------------- */

#define METHOD_ENTRY(code, symbol) [code] = &(symbol),
static const struct method *const methods[INTEGRATOR_METHODS] = {
    INTEGRATOR_METHOD_LIST(METHOD_ENTRY)};
#undef METHOD_ENTRY

const char *integrator_method_name(enum integrator_method method) {
    return methods[method]->name;
}

double integrator_tolerance_fraction(enum integrator_method method) {
    return methods[method]->tolerance_fraction;
}

int64_t integrator_longest_history(enum integrator_method method, bool has_events) {
    return has_events ? methods[method]->longest_history_with_events
                      : methods[method]->longest_history;
}

bool integrator_is_possible(enum integrator_method method, const struct ode *ode) {
    return !methods[method]->needs_series || ode->series != NULL;
}

/* Returns the largest memory size of all methods. */
static size_t workspace_size(const struct ode *ode) {
    size_t largest = 0;
    for (int i = INTEGRATOR_NO_METHOD + 1; i < INTEGRATOR_METHODS; i++) {
        const size_t size = methods[i]->memory_size(ode);
        largest = size > largest ? size : largest;
    }
    return largest;
}

/* ---- Life ----------------------------------------------------------------------------------- */

enum status integrator_create(const struct ode *ode, const struct message_sink *sink,
                              struct integrator **integrator) {
    const size_t n = ode->state_count;
    *integrator = NULL;
    struct integrator *created = calloc(1, sizeof *created + 5 * n * sizeof(double));
    if (created == NULL) {
        return STATUS_OUT_OF_MEMORY;
    }
    created->problem.ode = *ode;
    created->problem.sink = *sink;
    created->problem.failed_x = created->values;
    created->f = created->values + n;
    created->absolute_tolerances = created->values + 2 * n;
    created->reached_x = created->values + 3 * n;
    created->x = created->values + 4 * n;
    if (!workspace_create(&created->workspace, workspace_size(ode)) ||
        !location_create(&created->problem.ode, &created->problem.settings,
                         &created->problem.location)) {
        integrator_destroy(created);
        return STATUS_OUT_OF_MEMORY;
    }
    *integrator = created;
    return STATUS_OK;
}

static void destroy_method(struct integrator *integrator) {
    if (integrator->method != NULL) {
        integrator->method->destroy(integrator->memory);
        workspace_cut(&integrator->workspace, 0);
    }
    integrator->method = NULL;
    integrator->memory = NULL;
}

void integrator_destroy(struct integrator *integrator) {
    if (integrator == NULL) {
        return;
    }
    destroy_method(integrator);
    workspace_destroy(&integrator->workspace);
    location_destroy(&integrator->problem.location);
    free(integrator);
}

/* Configures the method that is wanted, and creates it if it is another one than before. After a
 * failure there is no method; the next call creates one. */
static enum status configure(struct integrator *integrator, enum integrator_method wanted) {
    const struct method *method = methods[wanted];
    if (integrator->method != method) {
        destroy_method(integrator);
        workspace_enter(&integrator->workspace);
        const enum status status = method->create(&integrator->problem, &integrator->memory);
        workspace_leave(&integrator->workspace);
        if (status != STATUS_OK) {
            workspace_cut(&integrator->workspace, 0);
            return status;
        }
        integrator->method = method;
    }
    const enum status status = method->configure(integrator->memory);
    if (status != STATUS_OK) {
        destroy_method(integrator);
    }
    return status;
}

enum status integrator_configure(struct integrator *integrator,
                                 const struct integrator_settings *settings) {
    struct problem *problem = &integrator->problem;
    memcpy(integrator->absolute_tolerances, settings->absolute_tolerances,
           problem->ode.state_count * sizeof(double));
    problem->settings = *settings;
    problem->settings.absolute_tolerances = integrator->absolute_tolerances;

    const enum status status = configure(integrator, settings->method);
    problem->evaluation_count = 0;
    integrator->statistics = (struct integrator_statistics){0};
    return status;
}

/* ---- Integration ---------------------------------------------------------------------------- */

enum status integrator_restart(struct integrator *integrator, const double x[],
                               const struct integrator_start *start) {
    struct problem *problem = &integrator->problem;
    integrator->statistics.restarts++;
    integrator->internal_end = -INFINITY;
    problem->origin = start->origin;
    problem->horizon = start->horizon;
    problem->first_step = start->first_step;
    problem->continues = start->continues;
    problem->is_after_event = start->is_after_event;
    problem->reached = 0.0;
    problem->failed_at = -INFINITY;
    problem->steps_since_settled = 0;
    memcpy(integrator->reached_x, x, problem->ode.state_count * sizeof(double));
    enum status status = STATUS_OK;
    if (start->indicators != NULL || location_is_active(&problem->location)) {
        status = location_restart(&problem->location, start, x);
    }
    return status == STATUS_OK ? integrator->method->restart(integrator->memory, x) : status;
}

double integrator_next_step(const struct integrator *integrator) {
    return integrator->method->next_step(integrator->memory, integrator->reached_x);
}

double integrator_passed_time(const struct integrator *integrator) {
    return integrator->internal_end;
}

static void add_work(struct integrator *integrator, const struct method_work *work) {
    struct integrator_statistics *totals = &integrator->statistics;
    totals->steps += work->steps;
    totals->failed_steps += work->failed_steps;
    totals->rhs_evaluations += integrator->problem.evaluation_count;
    integrator->problem.evaluation_count = 0;
    if (work->last_order > 0) {
        totals->last_step = work->last_step;
        totals->last_order = work->last_order;
    }
    integrator->internal_end = work->internal;
}

/* Makes the state in x, at t, the one reached. Returns false if it cannot be used: with extreme
 * values a solver reports success although its step has underflowed to nothing, or its state is not
 * finite. */
static bool accept(struct integrator *integrator, double t) {
    double *x = integrator->x;
    // at a stop time the solver may be short of it by its own rounding
    if (!problem_are_finite(x, integrator->problem.ode.state_count) ||
        !(integrator->internal_end >= t * (1.0 - 1e-12))) {
        return false;
    }
    integrator->x = integrator->reached_x;
    integrator->reached_x = x;
    integrator->problem.reached = t;
    return true;
}

/* Goes to t if an internal step has passed t already; returns false if not. */
static bool interpolate(struct integrator *integrator, double t) {
    const struct method *method = integrator->method;
    return integrator->internal_end >= t && method->interpolate != NULL &&
           method->interpolate(integrator->memory, t, integrator->x) && accept(integrator, t);
}

bool integrator_interpolate(struct integrator *integrator, double t, double x[]) {
    if (t >= integrator->problem.location.time || !interpolate(integrator, t)) {
        return false;
    }
    memcpy(x, integrator->reached_x, integrator->problem.ode.state_count * sizeof(double));
    return true;
}

enum status integrator_advance(struct integrator *integrator, double t, int64_t max_steps,
                               double *reached, double x[]) {
    struct problem *problem = &integrator->problem;
    // an event that an internal step has passed already comes first
    const double target = problem->location.time < t ? problem->location.time : t;
    enum status status = STATUS_OK;
    if (!interpolate(integrator, target)) {
        struct method_work work = {0};
        double stopped_at = problem->reached;
        status =
            integrator->method->advance(integrator->memory, target, max_steps,
                                        integrator->reached_x, &stopped_at, integrator->x, &work);
        add_work(integrator, &work);
        if (status == STATUS_OK && !work.is_cut_short) {
            stopped_at = target;
        }
        if (!accept(integrator, stopped_at) && status == STATUS_OK) {
            status = problem_is_stuck(problem) ? STATUS_NOT_FINITE : STATUS_NO_CONVERGENCE;
        }
    }
    memcpy(x, integrator->reached_x, problem->ode.state_count * sizeof(double));
    *reached = problem->reached;
    return status;
}

enum status integrator_rest(struct integrator *integrator, const double x[],
                            const struct integrator_start *start, double t, double *reached) {
    struct problem *problem = &integrator->problem;
    enum status status = location_restart(&problem->location, start, x);
    if (status == STATUS_OK && start->indicators != NULL) {
        status = location_search_at_rest(&problem->location, x, t);
    }
    integrator->internal_end = -INFINITY;
    problem->reached = status == STATUS_OK ? fmin(t, problem->location.time) : 0.0;
    *reached = problem->reached;
    return status;
}

const bool *integrator_event(const struct integrator *integrator) {
    const struct location *location = &integrator->problem.location;
    return location->time == integrator->problem.reached ? location->triggered : NULL;
}

bool integrator_touches(struct integrator *integrator) {
    struct problem *problem = &integrator->problem;
    return location_touch(&problem->location, problem->reached, integrator->reached_x);
}

void integrator_set_observer(struct integrator *integrator, integrator_observer *observer,
                             void *context) {
    integrator->problem.observer = observer;
    integrator->problem.observer_context = context;
}

/* ---- Failures ------------------------------------------------------------------------------- */

const double *integrator_failure(const struct integrator *integrator, double *t) {
    *t = integrator->problem.failed_at;
    return *t > -INFINITY ? integrator->problem.failed_x : NULL;
}

/* Returns the error of a state, in its unit, that the tolerances allow. */
static double allowed_error(const struct integrator *integrator, size_t i) {
    return integrator->problem.settings.relative_tolerance * fabs(integrator->reached_x[i]) +
           integrator->problem.settings.absolute_tolerances[i];
}

/* Writes the right-hand side at the last state to f. Returns the largest rate (1/s) of a state,
 * relative to its size; NaN if f is not finite. */
static double rate_of_motion(const struct integrator *integrator, double f[]) {
    const struct problem *problem = &integrator->problem;
    const struct ode *ode = &problem->ode;
    double rate = 0.0;
    if (ode->rhs(problem->reached, integrator->reached_x, f, ode->context) != STATUS_OK ||
        !problem_are_finite(f, ode->state_count)) {
        return NAN;
    }
    for (size_t i = 0; i < ode->state_count; i++) {
        const double size = allowed_error(integrator, i) / problem->settings.relative_tolerance;
        rate = fmax(rate, fabs(f[i]) / size);
    }
    return rate;
}

/* Returns the fastest rate (1/s) at which deviations from the motion change: power iteration with
 * the Jacobian, whose products are differences of right-hand sides. f: of the last state. */
static double rate_of_deviations(struct integrator *integrator, const double f[]) {
    const struct problem *problem = &integrator->problem;
    const struct ode *ode = &problem->ode;
    double *x = integrator->x;
    double *product = problem->failed_x;
    double rate = 0.0;
    for (size_t i = 0; i < ode->state_count; i++) {
        product[i] = (i % 2 == 0 ? 1.0 : 0.5) * allowed_error(integrator, i);
    }
    for (int count = 0; count < 20; count++) {
        const double factor = count == 0 ? 1.0 : 1.0 / rate;
        for (size_t i = 0; i < ode->state_count; i++) {
            x[i] = integrator->reached_x[i] + factor * product[i];
        }
        if (ode->rhs(problem->reached, x, product, ode->context) != STATUS_OK) {
            return 0.0;
        }
        rate = 0.0;
        for (size_t i = 0; i < ode->state_count; i++) {
            product[i] -= f[i];
            rate = fmax(rate, fabs(product[i]) / allowed_error(integrator, i));
        }
        if (!(rate > 0.0 && rate < INFINITY)) {
            return 0.0;
        }
    }
    return rate;
}

/* In a stiff problem deviations change far faster than the motion does, and no explicit method can
 * make longer steps than their rate allows, however smooth the motion is. */
bool integrator_seems_stiff(struct integrator *integrator) {
    const double of_motion = rate_of_motion(integrator, integrator->f);
    const double of_deviations = rate_of_deviations(integrator, integrator->f);
    return of_deviations > 100.0 * of_motion &&
           of_deviations * integrator->statistics.last_step > 0.01;
}

struct integrator_statistics *integrator_totals(struct integrator *integrator) {
    return &integrator->statistics;
}
