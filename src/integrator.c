#include "integrator.h"

#include "sundials_compat.h"

#include <math.h>
#include <nvector/nvector_serial.h>
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
    N_Vector absolute_tolerances;
    SUNNonlinearSolver solver;

    // times in s since the restart
    double span;      /* internal steps must not pass it */
    double reached;   /* where the last advance ended */
    double failed_at; /* the last time that the right-hand side failed at */

    struct integrator_statistics before_restart;
};

static int evaluate_rhs(sunrealtype t, N_Vector x, N_Vector dx, void *integrator_pointer) {
    struct integrator *integrator = integrator_pointer;
    const struct ode *ode = &integrator->ode;
    const double *x_data = N_VGetArrayPointer(x);
    double *dx_data = N_VGetArrayPointer(dx);

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
    case CV_WARNING:
        return STATUS_SOLVER_WARNING;
    case CV_FIRST_RHSFUNC_ERR:
    case CV_REPTD_RHSFUNC_ERR:
    case CV_UNREC_RHSFUNC_ERR:
        return STATUS_NOT_FINITE;
    case CV_TOO_MUCH_WORK:
        return stuck ? STATUS_NOT_FINITE : STATUS_TOO_MANY_STEPS;
    case CV_TOO_MUCH_ACC:
    case CV_ERR_FAILURE:
    case CV_CONV_FAILURE:
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
    integrator->x = N_VNew_Serial(n, integrator->context);
    integrator->absolute_tolerances = N_VNew_Serial(n, integrator->context);
    integrator->cvode = CVodeCreate(CV_ADAMS, integrator->context);
    if (integrator->x == NULL || integrator->absolute_tolerances == NULL ||
        integrator->cvode == NULL) {
        return STATUS_OUT_OF_MEMORY;
    }
    N_VConst(0.0, integrator->x);

    integrator->solver = SUNNonlinSol_FixedPoint(integrator->x, 0, integrator->context);
    if (integrator->solver == NULL) {
        return STATUS_OUT_OF_MEMORY;
    }
    if (sundials_redirect_texts(integrator->context, integrator->cvode, &integrator->texts) != 0 ||
        CVodeInit(integrator->cvode, evaluate_rhs, 0.0, integrator->x) != CV_SUCCESS ||
        CVodeSetUserData(integrator->cvode, integrator) != CV_SUCCESS ||
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
    memcpy(N_VGetArrayPointer(integrator->absolute_tolerances), settings->absolute_tolerances,
           integrator->ode.state_count * sizeof(double));
    int flag = CVodeSVtolerances(integrator->cvode, settings->relative_tolerance,
                                 integrator->absolute_tolerances);
    if (flag == CV_SUCCESS) {
        flag = CVodeSetMaxNumSteps(integrator->cvode, settings->max_steps);
    }
    if (flag == CV_SUCCESS) {
        flag = CVodeReInit(integrator->cvode, 0.0, integrator->x);
    }
    integrator->before_restart = (struct integrator_statistics){0};
    return status_of_flag(integrator, flag);
}

enum status integrator_restart(struct integrator *integrator, const double x[], double span) {
    // CVodeReInit clears CVODE's counters
    integrator_get_statistics(integrator, &integrator->before_restart);
    memcpy(N_VGetArrayPointer(integrator->x), x, integrator->ode.state_count * sizeof(double));
    integrator->span = span;
    integrator->reached = 0.0;
    integrator->failed_at = -INFINITY;
    return status_of_flag(integrator, CVodeReInit(integrator->cvode, 0.0, integrator->x));
}

enum status integrator_advance(struct integrator *integrator, double t, double *reached,
                               double x[]) {
    double *x_data = N_VGetArrayPointer(integrator->x);
    const size_t size = integrator->ode.state_count * sizeof(double);

    // set at every call: CVODE forgets a stop time that it has reached and keeps one across
    // restarts
    integrator->span = fmax(integrator->span, t);
    int flag = CVodeSetStopTime(integrator->cvode, integrator->span);
    if (flag == CV_SUCCESS) {
        double stopped_at = integrator->reached;
        flag = CVode(integrator->cvode, t, integrator->x, &stopped_at, CV_NORMAL);
        const bool has_moved = flag != CV_FIRST_RHSFUNC_ERR && flag != CV_ILL_INPUT;
        if (flag >= 0) {
            integrator->reached = t;
        } else if (has_moved) {
            integrator->reached = stopped_at;
        }
    }
    *reached = integrator->reached;
    memcpy(x, x_data, size);
    return status_of_flag(integrator, flag);
}

void integrator_get_statistics(const struct integrator *integrator,
                               struct integrator_statistics *statistics) {
    long steps = 0;
    long evaluations = 0;
    // both fail only without CVODE's memory
    (void)CVodeGetNumSteps(integrator->cvode, &steps);
    (void)CVodeGetNumRhsEvals(integrator->cvode, &evaluations);
    statistics->steps = integrator->before_restart.steps + steps;
    statistics->rhs_evaluations = integrator->before_restart.rhs_evaluations + evaluations;
}
