#include "integrator.h"

#include "small_vector.h"
#include "sundials_compat.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

struct integrator {
    struct ode ode;
    struct message_sink sink;
    struct sundials_texts texts;

    SUNContext context;
    void *cvode;
    N_Vector x;
    N_Vector last_x; /* state at reached */
    N_Vector absolute_tolerances;
    SUNNonlinearSolver solver;

    // times in s since the restart
    double span;      /* internal steps must not pass it */
    double reached;   /* where the last advance ended */
    double failed_at; /* the last time that the right-hand side failed at */

    struct integrator_statistics statistics;
    struct integrator_statistics counted; /* what CVODE, which counts from the last restart on, had
                                             counted when statistics was brought up to date */
};

static int evaluate_rhs(sunrealtype t, N_Vector x, N_Vector dx, void *integrator_pointer) {
    struct integrator *integrator = integrator_pointer;
    const struct ode *ode = &integrator->ode;
    const double *x_data = small_vector_data(x);
    double *dx_data = small_vector_data(dx);

    bool valid = ode->rhs(t, x_data, dx_data, ode->context) == STATUS_OK;
    for (size_t i = 0; i < ode->state_count; i++) {
        valid = valid && isfinite(dx_data[i]);
    }
    if (!valid) {
        integrator->failed_at = t;
    }
    return valid ? 0 : 1; // 1: CVODE tries a smaller step
}

static enum status status_of_flag(const struct integrator *integrator, int flag) {
    // stuck in front of a time that the right-hand side cannot be evaluated at
    const bool stuck = integrator->failed_at >= integrator->reached;
    switch (flag) {
    case CV_SUCCESS:
    case CV_TSTOP_RETURN:
        return STATUS_OK;
    case CV_FIRST_RHSFUNC_ERR:
    case CV_REPTD_RHSFUNC_ERR:
    case CV_UNREC_RHSFUNC_ERR:
        return STATUS_NOT_FINITE;
    case CV_TOO_MUCH_WORK:
        return stuck ? STATUS_NOT_FINITE : STATUS_TOO_MANY_STEPS;
    case CV_TOO_MUCH_ACC:
    case CV_ERR_FAILURE:
    case CV_CONV_FAILURE:
    // values so extreme that steps, weights or times underflow or overflow
    case CV_BAD_T:
    case CV_TOO_CLOSE:
    case CV_ILL_INPUT:
        return stuck ? STATUS_NOT_FINITE : STATUS_NO_CONVERGENCE;
    case CV_MEM_FAIL:
        return STATUS_OUT_OF_MEMORY;
    default:
        return STATUS_INTERNAL;
    }
}

static void forward_text(int error_code, const char *text, void *integrator_pointer) {
    const struct integrator *integrator = integrator_pointer;
    message_write(&integrator->sink, status_of_flag(integrator, error_code), "CVODE: %s", text);
}

static enum status setup(struct integrator *integrator) {
    const sunindextype n = (sunindextype)integrator->ode.state_count;

    if (sundials_context_create(&integrator->context) != 0) {
        return STATUS_OUT_OF_MEMORY;
    }
    integrator->x = small_vector_create(n, integrator->context);
    integrator->last_x = small_vector_create(n, integrator->context);
    integrator->absolute_tolerances = small_vector_create(n, integrator->context);
    integrator->cvode = CVodeCreate(CV_ADAMS, integrator->context);
    if (integrator->x == NULL || integrator->last_x == NULL ||
        integrator->absolute_tolerances == NULL || integrator->cvode == NULL) {
        return STATUS_OUT_OF_MEMORY;
    }

    integrator->solver = SUNNonlinSol_FixedPoint(integrator->x, 0, integrator->context);
    if (integrator->solver == NULL) {
        return STATUS_OUT_OF_MEMORY;
    }
    if (sundials_redirect_texts(integrator->context, integrator->cvode, &integrator->texts) != 0 ||
        CVodeInit(integrator->cvode, evaluate_rhs, 0.0, integrator->x) != CV_SUCCESS ||
        CVodeSetUserData(integrator->cvode, integrator) != CV_SUCCESS ||
        // warnings of steps too short to change the time: SUNDIALS 7 prints them
        CVodeSetMaxHnilWarns(integrator->cvode, -1) != CV_SUCCESS ||
        CVodeSetNonlinearSolver(integrator->cvode, integrator->solver) != CV_SUCCESS) {
        return STATUS_OUT_OF_MEMORY;
    }
    return STATUS_OK;
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

    const enum status status = setup(created);
    if (status != STATUS_OK) {
        integrator_destroy(created);
        return status;
    }
    *integrator = created;
    return STATUS_OK;
}

void integrator_destroy(struct integrator *integrator) {
    if (integrator == NULL) {
        return;
    }
    if (integrator->solver != NULL) {
        SUNNonlinSolFree(integrator->solver);
    }
    if (integrator->cvode != NULL) {
        CVodeFree(&integrator->cvode);
    }
    if (integrator->absolute_tolerances != NULL) {
        N_VDestroy(integrator->absolute_tolerances);
    }
    if (integrator->last_x != NULL) {
        N_VDestroy(integrator->last_x);
    }
    if (integrator->x != NULL) {
        N_VDestroy(integrator->x);
    }
    if (integrator->context != NULL) {
        SUNContext_Free(&integrator->context);
    }
    free(integrator);
}

enum status integrator_configure(struct integrator *integrator,
                                 const struct integrator_settings *settings) {
    memcpy(small_vector_data(integrator->absolute_tolerances), settings->absolute_tolerances,
           integrator->ode.state_count * sizeof(double));
    int flag = CVodeSVtolerances(integrator->cvode, settings->relative_tolerance,
                                 integrator->absolute_tolerances);
    if (flag == CV_SUCCESS) {
        flag = CVodeReInit(integrator->cvode, 0.0, integrator->x);
    }
    integrator->statistics = (struct integrator_statistics){0};
    integrator->counted = (struct integrator_statistics){0};
    return status_of_flag(integrator, flag);
}

enum status integrator_restart(struct integrator *integrator, const double x[], double span) {
    integrator->statistics.restarts++;
    integrator->counted = (struct integrator_statistics){0};
    memcpy(small_vector_data(integrator->x), x, integrator->ode.state_count * sizeof(double));
    N_VScale(1.0, integrator->x, integrator->last_x);
    integrator->span = span;
    integrator->reached = 0.0;
    integrator->failed_at = -INFINITY;
    return status_of_flag(integrator, CVodeReInit(integrator->cvode, 0.0, integrator->x));
}

static void update_statistics(struct integrator *integrator) {
    struct integrator_statistics now = {0};
    long iteration_failures = 0;
    // these calls fail only without CVODE's memory
    (void)CVodeGetNumSteps(integrator->cvode, &now.steps);
    (void)CVodeGetNumRhsEvals(integrator->cvode, &now.rhs_evaluations);
    (void)CVodeGetNumErrTestFails(integrator->cvode, &now.failed_steps);
    (void)CVodeGetNumStepSolveFails(integrator->cvode, &iteration_failures);
    now.failed_steps += iteration_failures;

    struct integrator_statistics *totals = &integrator->statistics;
    totals->steps += now.steps - integrator->counted.steps;
    totals->rhs_evaluations += now.rhs_evaluations - integrator->counted.rhs_evaluations;
    totals->failed_steps += now.failed_steps - integrator->counted.failed_steps;
    if (now.steps > 0) {
        (void)CVodeGetLastStep(integrator->cvode, &totals->last_step);
        (void)CVodeGetLastOrder(integrator->cvode, &totals->last_order);
    }
    integrator->counted = now;
}

/* What CVODE left in x can be used: with extreme values it ends with success where its step has
 * underflowed to nothing, or with a state that is not finite. */
static bool has_reached(const struct integrator *integrator, double t) {
    const double *x = small_vector_data(integrator->x);
    double internal_time = 0.0;
    (void)CVodeGetCurrentTime(integrator->cvode, &internal_time);
    for (size_t i = 0; i < integrator->ode.state_count; i++) {
        if (!isfinite(x[i])) {
            return false;
        }
    }
    // at a stop time CVODE may be short of it by its own rounding
    return internal_time >= t * (1.0 - 1e-12);
}

enum status integrator_advance(struct integrator *integrator, double t, long max_steps,
                               double *reached, double x[]) {
    double stopped_at = integrator->reached;
    int flag = CVodeSetMaxNumSteps(integrator->cvode, max_steps);
    if (flag == CV_SUCCESS) {
        // at every call: CVODE forgets a stop time that it has reached and keeps one over restarts
        flag = CVodeSetStopTime(integrator->cvode, integrator->span);
    }
    if (flag == CV_SUCCESS) {
        flag = CVode(integrator->cvode, t, integrator->x, &stopped_at, CV_NORMAL);
    }
    update_statistics(integrator);
    enum status status = status_of_flag(integrator, flag);
    if (status == STATUS_OK) {
        stopped_at = t;
    }
    if (has_reached(integrator, stopped_at)) {
        integrator->reached = stopped_at;
        N_VScale(1.0, integrator->x, integrator->last_x);
    } else if (status == STATUS_OK) {
        status = STATUS_NO_CONVERGENCE;
    }
    *reached = integrator->reached;
    memcpy(x, small_vector_data(integrator->last_x), integrator->ode.state_count * sizeof(double));
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
