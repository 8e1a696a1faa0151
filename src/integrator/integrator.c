#include "method.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

int integrator_evaluate_rhs(sunrealtype t, N_Vector x, N_Vector dx, void *integrator_pointer) {
    struct integrator *integrator = integrator_pointer;
    const struct ode *ode = &integrator->ode;
    double *dx_data = small_vector_data(dx);
    integrator->statistics.rhs_evaluations++;
    if (ode->rhs(t, small_vector_data(x), dx_data, ode->context) == STATUS_OK &&
        integrator_are_finite(dx_data, ode->state_count)) {
        return 0;
    }
    integrator->failed_at = t;
    return 1; // a smaller step is tried
}

/* Whoever receives the text may allocate: not from the reserve, which ends with the integrator. */
static void forward_text(int error_code, const char *text, void *integrator_pointer) {
    const struct integrator *integrator = integrator_pointer;
    struct reserve none = {0};
    reserve_enter(&none);
    message_write(&integrator->sink, integrator->method->status_of_flag(integrator, error_code),
                  "%s: %s", integrator->method->name, text);
    reserve_leave(&none);
}

/* Bytes: about twice what SUNDIALS 6.4 allocates for a context and the method that needs most, the
 * one with matrices: 5.7 kB for 4 states, 15 kB for 20 and 185 kB for 100. */
static size_t reserve_size(size_t n) {
    return 12288 + sizeof(double) * (60 * n + 4 * n * n);
}

/* Context and vectors, which stay while methods change. */
static enum status create_common(struct integrator *created) {
    const sunindextype n = (sunindextype)created->ode.state_count;
    const bool is_complete =
        sundials_context_create(&created->context) == 0 &&
        (created->x = small_vector_create(n, created->context)) != NULL &&
        (created->last_x = small_vector_create(n, created->context)) != NULL &&
        (created->absolute_tolerances = small_vector_create(n, created->context)) != NULL &&
        (created->work = small_vector_create(n, created->context)) != NULL;
    created->without_method = created->reserve.used;
    return is_complete ? STATUS_OK : STATUS_OUT_OF_MEMORY;
}

enum status integrator_create(const struct ode *ode, const struct message_sink *sink,
                              struct integrator **integrator) {
    *integrator = NULL;
    struct integrator *created = calloc(1, sizeof *created);
    if (created == NULL) {
        return STATUS_OUT_OF_MEMORY;
    }
    created->ode = *ode;
    created->sink = *sink;
    created->texts = (struct sundials_texts){.handle = forward_text, .context = created};

    enum status status = STATUS_OUT_OF_MEMORY;
    if (reserve_create(&created->reserve, reserve_size(ode->state_count))) {
        reserve_enter(&created->reserve);
        status = create_common(created);
        reserve_leave(&created->reserve);
    }
    if (status != STATUS_OK) {
        integrator_destroy(created);
        return status;
    }
    *integrator = created;
    return STATUS_OK;
}

static void destroy_method(struct integrator *integrator) {
    if (integrator->method != NULL) {
        integrator->method->destroy(integrator);
        reserve_cut(&integrator->reserve, integrator->without_method);
    }
    integrator->method = NULL;
}

void integrator_destroy(struct integrator *integrator) {
    if (integrator == NULL) {
        return;
    }
    reserve_enter(&integrator->reserve);
    destroy_method(integrator);
    N_Vector const vectors[] = {integrator->x, integrator->last_x, integrator->absolute_tolerances,
                                integrator->work};
    for (size_t i = 0; i < sizeof vectors / sizeof vectors[0]; i++) {
        if (vectors[i] != NULL) {
            N_VDestroy(vectors[i]);
        }
    }
    if (integrator->context != NULL) {
        SUNContext_Free(&integrator->context);
    }
    reserve_leave(&integrator->reserve);
    reserve_destroy(&integrator->reserve);
    free(integrator);
}

static enum status rest(double t, const double x[], double dx[], void *state_count) {
    (void)t;
    (void)x;
    memset(dx, 0, *(const size_t *)state_count * sizeof(double));
    return STATUS_OK;
}

static enum status rest_jacobian(double t, const double x[], double J[], void *state_count) {
    const size_t n = *(const size_t *)state_count;
    (void)t;
    (void)x;
    memset(J, 0, n * n * sizeof(double));
    return STATUS_OK;
}

/* Integrates x' = 0: solvers allocate what they need at their first step. With settings of its own:
 * the user's may ask for more steps than are spent here. */
static int warm_up(struct integrator *integrator) {
    const struct ode ode = integrator->ode;
    size_t state_count = ode.state_count;
    double stopped_at = 0.0;
    integrator->settings.relative_tolerance = 1e-3;
    integrator->settings.max_step = 0.0;
    N_VConst(1.0, integrator->absolute_tolerances);
    integrator->span = INFINITY;
    integrator->reached = 0.0;
    integrator->failed_at = -INFINITY;
    integrator->first_step = 0.0;
    integrator->ode.rhs = rest;
    integrator->ode.jacobian = rest_jacobian;
    integrator->ode.context = &state_count;
    // what the last method has left may not be finite
    N_VConst(0.0, integrator->x);
    N_VConst(0.0, integrator->last_x);
    int flag = integrator->method->configure(integrator);
    if (flag >= 0) {
        flag = integrator->method->restart(integrator);
    }
    if (flag >= 0) {
        flag = integrator->method->advance(integrator, 1.0, 100, &stopped_at);
    }
    integrator->ode = ode;
    return flag;
}

static enum status create_method(struct integrator *integrator, const struct method *method) {
    destroy_method(integrator);
    integrator->method = method;
    const enum status status = method->create(integrator);
    return status == STATUS_OK ? method->status_of_flag(integrator, warm_up(integrator)) : status;
}

/* Where this fails there is no method: the next call starts anew. */
static enum status configure(struct integrator *integrator,
                             const struct integrator_settings *settings) {
    static const struct method *const methods[INTEGRATOR_METHODS] = {
        [INTEGRATOR_CVODE_ADAMS] = &integrator_cvode_adams,
        [INTEGRATOR_CVODE_BDF] = &integrator_cvode_bdf,
        [INTEGRATOR_ERK] = &integrator_erk,
    };
    const struct method *method = methods[settings->method];
    enum status status =
        integrator->method == method ? STATUS_OK : create_method(integrator, method);
    if (status == STATUS_OK) {
        integrator->settings = *settings;
        integrator->settings.absolute_tolerances = NULL;
        memcpy(small_vector_data(integrator->absolute_tolerances), settings->absolute_tolerances,
               integrator->ode.state_count * sizeof(double));
        status = method->status_of_flag(integrator, method->configure(integrator));
    }
    if (status != STATUS_OK) {
        destroy_method(integrator);
    }
    return status;
}

enum status integrator_configure(struct integrator *integrator,
                                 const struct integrator_settings *settings) {
    reserve_enter(&integrator->reserve);
    const enum status status = configure(integrator, settings);
    reserve_leave(&integrator->reserve);
    integrator->statistics = (struct integrator_statistics){0};
    integrator->counted = (struct integrator_statistics){0};
    return status;
}

bool integrator_has_history(const struct integrator *integrator) {
    return integrator->method->has_history;
}

enum status integrator_restart(struct integrator *integrator, const double x[], double span,
                               double first_step) {
    const size_t size = integrator->ode.state_count * sizeof(double);
    integrator->statistics.restarts++;
    integrator->counted = (struct integrator_statistics){0};
    memcpy(small_vector_data(integrator->x), x, size);
    memcpy(small_vector_data(integrator->last_x), x, size);
    integrator->span = span;
    integrator->reached = 0.0;
    integrator->failed_at = -INFINITY;
    integrator->internal = -INFINITY;
    integrator->first_step = first_step;
    return integrator->method->status_of_flag(integrator, integrator->method->restart(integrator));
}

double integrator_next_step(const struct integrator *integrator) {
    return integrator->method->next_step(integrator);
}

static void update_statistics(struct integrator *integrator) {
    struct integrator_statistics now = {0};
    integrator->method->count(integrator, &now);

    struct integrator_statistics *totals = &integrator->statistics;
    totals->steps += now.steps - integrator->counted.steps;
    totals->failed_steps += now.failed_steps - integrator->counted.failed_steps;
    if (now.steps > 0) {
        totals->last_step = now.last_step;
        totals->last_order = now.last_order;
    }
    integrator->counted = now;
}

/* What the solver left in x can be used: with extreme values it ends with success where its step
 * has underflowed to nothing, or with a state that is not finite. */
static bool has_reached(const struct integrator *integrator, double t) {
    // at a stop time the solver may be short of it by its own rounding
    return integrator_are_finite(small_vector_data(integrator->x), integrator->ode.state_count) &&
           integrator->internal >= t * (1.0 - 1e-12);
}

/* A point that an internal step has passed already takes no more than a polynomial. */
static bool interpolate(struct integrator *integrator, double t, double x[]) {
    const size_t count = integrator->ode.state_count;
    if (!(integrator->internal >= t) || !integrator->method->has_history ||
        !integrator->method->interpolate(integrator, t) ||
        !integrator_are_finite(small_vector_data(integrator->x), count)) {
        return false;
    }
    integrator->reached = t;
    memcpy(small_vector_data(integrator->last_x), small_vector_data(integrator->x),
           count * sizeof(double));
    memcpy(x, small_vector_data(integrator->x), count * sizeof(double));
    return true;
}

enum status integrator_advance(struct integrator *integrator, double t, long max_steps,
                               double *reached, double x[]) {
    const size_t size = integrator->ode.state_count * sizeof(double);
    if (interpolate(integrator, t, x)) {
        *reached = t;
        return STATUS_OK;
    }
    double stopped_at = integrator->reached;
    const int flag = integrator->method->advance(integrator, t, max_steps, &stopped_at);
    integrator->internal = integrator->method->internal_time(integrator);
    update_statistics(integrator);
    enum status status = integrator->method->status_of_flag(integrator, flag);
    if (status == STATUS_OK) {
        stopped_at = t;
    }
    if (has_reached(integrator, stopped_at)) {
        integrator->reached = stopped_at;
        memcpy(small_vector_data(integrator->last_x), small_vector_data(integrator->x), size);
    } else if (status == STATUS_OK) {
        status = STATUS_NO_CONVERGENCE;
    }
    *reached = integrator->reached;
    memcpy(x, small_vector_data(integrator->last_x), size);
    return status;
}

void integrator_get_statistics(const struct integrator *integrator,
                               struct integrator_statistics *statistics) {
    *statistics = integrator->statistics;
}

void integrator_set_statistics(struct integrator *integrator,
                               const struct integrator_statistics *statistics) {
    integrator->statistics = *statistics;
}
