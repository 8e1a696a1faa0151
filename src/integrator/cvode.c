/* The multistep methods of CVODE. */
#include "method.h"

#include <math.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>
#include <sunnonlinsol/sunnonlinsol_newton.h>

/* Error that Adams' corrector iteration may leave, over that of the error test. CVODE's own 0.1
 * costs a second evaluation of the right-hand side in most steps. Measured over steps of 1 ms, 10
 * ms and 2 s at tolerances from 2e-8 to 2e-14, 0.2 saves a sixth of the evaluations for the same
 * number of steps and the same error; 0.5 saves a quarter, but takes 30 % more steps and makes
 * three times the error where steps are long. */
static const double adams_iteration_error = 0.2;

/* The first step after a restart is of order 1, over the step at which its error estimate would be
 * the tolerance. CVODE's own choice is 0.5 and takes two evaluations to find. The errors of first
 * steps all have the same sign and add up from restart to restart: measured over 2000 steps of 1
 * ms, the error of the trajectory at 0.1 is a third of that at 0.5, for as many internal steps. */
static const double first_step_fraction = 0.1;

static enum status status_of_flag(const struct integrator *integrator, int flag) {
    const bool stuck = integrator_is_stuck(integrator);
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
    // of the Newton iteration
    case CV_LSETUP_FAIL:
    case CV_LSOLVE_FAIL:
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

static int evaluate_jacobian(sunrealtype t, N_Vector x, N_Vector dx, SUNMatrix jacobian,
                             void *integrator_pointer, N_Vector work1, N_Vector work2,
                             N_Vector work3) {
    struct integrator *integrator = integrator_pointer;
    const struct ode *ode = &integrator->ode;
    double *J = SUNDenseMatrix_Data(jacobian);
    (void)dx;
    (void)work1;
    (void)work2;
    (void)work3;
    if (ode->jacobian(t, small_vector_data(x), J, ode->context) == STATUS_OK &&
        integrator_are_finite(J, ode->state_count * ode->state_count)) {
        return 0;
    }
    integrator->failed_at = t;
    return 1; // a smaller step is tried
}

static void destroy(struct integrator *integrator) {
    if (integrator->solver != NULL) {
        CVodeFree(&integrator->solver);
    }
    if (integrator->nonlinear_solver != NULL) {
        SUNNonlinSolFree(integrator->nonlinear_solver);
        integrator->nonlinear_solver = NULL;
    }
    if (integrator->linear_solver != NULL) {
        SUNLinSolFree(integrator->linear_solver);
        integrator->linear_solver = NULL;
    }
    if (integrator->jacobian != NULL) {
        SUNMatDestroy(integrator->jacobian);
        integrator->jacobian = NULL;
    }
}

/* What both methods need. */
static bool create_solver(struct integrator *integrator, int multistep_method) {
    integrator->solver = CVodeCreate(multistep_method, integrator->context);
    return integrator->solver != NULL &&
           sundials_redirect_cvode(integrator->context, integrator->solver, &integrator->texts) ==
               0 &&
           CVodeInit(integrator->solver, integrator_evaluate_rhs, 0.0, integrator->x) ==
               CV_SUCCESS &&
           CVodeSetUserData(integrator->solver, integrator) == CV_SUCCESS &&
           // warnings of steps too short to change the time: SUNDIALS 7 prints them
           CVodeSetMaxHnilWarns(integrator->solver, -1) == CV_SUCCESS;
}

static enum status create_adams(struct integrator *integrator) {
    if (!create_solver(integrator, CV_ADAMS)) {
        return STATUS_OUT_OF_MEMORY;
    }
    integrator->nonlinear_solver = SUNNonlinSol_FixedPoint(integrator->x, 0, integrator->context);
    const bool created =
        integrator->nonlinear_solver != NULL &&
        CVodeSetNonlinearSolver(integrator->solver, integrator->nonlinear_solver) == CV_SUCCESS &&
        CVodeSetNonlinConvCoef(integrator->solver, adams_iteration_error) == CV_SUCCESS;
    return created ? STATUS_OK : STATUS_OUT_OF_MEMORY;
}

static enum status create_bdf(struct integrator *integrator) {
    const sunindextype n = (sunindextype)integrator->ode.state_count;
    if (!create_solver(integrator, CV_BDF)) {
        return STATUS_OUT_OF_MEMORY;
    }
    integrator->jacobian = SUNDenseMatrix(n, n, integrator->context);
    if (integrator->jacobian == NULL) {
        return STATUS_OUT_OF_MEMORY;
    }
    // the solver is made for any vector with an array, but takes none of an unknown kind for
    // pattern
    N_Vector pattern = N_VNew_Serial(n, integrator->context);
    if (pattern == NULL) {
        return STATUS_OUT_OF_MEMORY;
    }
    integrator->linear_solver = SUNLinSol_Dense(pattern, integrator->jacobian, integrator->context);
    N_VDestroy(pattern);
    integrator->nonlinear_solver = SUNNonlinSol_Newton(integrator->x, integrator->context);
    const bool created =
        integrator->linear_solver != NULL && integrator->nonlinear_solver != NULL &&
        CVodeSetNonlinearSolver(integrator->solver, integrator->nonlinear_solver) == CV_SUCCESS &&
        CVodeSetLinearSolver(integrator->solver, integrator->linear_solver, integrator->jacobian) ==
            CV_SUCCESS &&
        CVodeSetJacFn(integrator->solver, evaluate_jacobian) == CV_SUCCESS;
    return created ? STATUS_OK : STATUS_OUT_OF_MEMORY;
}

static int configure(struct integrator *integrator) {
    int flag = CVodeSVtolerances(integrator->solver, integrator->settings.relative_tolerance,
                                 integrator->absolute_tolerances);
    if (flag == CV_SUCCESS) {
        flag = CVodeSetMaxStep(integrator->solver, integrator->settings.max_step);
    }
    if (flag == CV_SUCCESS) {
        flag = CVodeReInit(integrator->solver, 0.0, integrator->x);
    }
    return flag;
}

static int restart(struct integrator *integrator) {
    return CVodeReInit(integrator->solver, 0.0, integrator->x);
}

/* CVODE interpolates by combining the columns of its Nordsieck array, up to 13, which stay as they
 * are until the next internal step. It computes the powers of the time with a product for each
 * factor: most of the cost of a short communication step. So it tells the columns once per internal
 * step, and all points within the step come from Horner's scheme. */
static void evaluate_history(struct integrator *integrator, double t) {
    double internal = 0.0;
    double last_step = 0.0;
    (void)CVodeGetCurrentTime(integrator->solver, &internal);
    (void)CVodeGetLastStep(integrator->solver, &last_step);
    small_vector_polynomial(&integrator->columns, (t - internal) / last_step, integrator->x);
}

static bool interpolate(struct integrator *integrator, double t) {
    if (integrator->columns.count == 0) {
        return false;
    }
    evaluate_history(integrator, t);
    return true;
}

static int advance(struct integrator *integrator, double t, long max_steps, double *stopped_at) {
    int flag = CVodeSetMaxNumSteps(integrator->solver, max_steps);
    if (flag == CV_SUCCESS && integrator->reached == 0.0) {
        flag = CVodeSetInitStep(integrator->solver, fmin(integrator->first_step, t));
    }
    if (flag == CV_SUCCESS) {
        // at every call: CVODE forgets a stop time that it has reached and keeps one over restarts
        flag = CVodeSetStopTime(integrator->solver, integrator->span);
    }
    if (flag != CV_SUCCESS) {
        return flag;
    }
    integrator->columns.count = 0;
    small_vector_note_terms(integrator->x, &integrator->columns);
    flag = CVode(integrator->solver, t, integrator->x, stopped_at, CV_NORMAL);
    small_vector_note_terms(integrator->x, NULL);
    // as at all other points within the step: where the stops are does not matter
    if (flag == CV_SUCCESS && integrator->columns.count > 0) {
        evaluate_history(integrator, t);
    }
    return flag;
}

/* The error of a step h of order 1 is about h^2 x'' / 2. */
static double next_step(const struct integrator *integrator) {
    const double relative = integrator->settings.relative_tolerance;
    const double *absolute = small_vector_data(integrator->absolute_tolerances);
    const double *x = small_vector_data(integrator->last_x);
    const double *ddx = small_vector_data(integrator->work);
    if (integrator->counted.last_order < 2 ||
        CVodeGetDky(integrator->solver, integrator->reached, 2, integrator->work) != CV_SUCCESS) {
        return 0.0;
    }
    double sum = 0.0;
    for (size_t i = 0; i < integrator->ode.state_count; i++) {
        const double weighted = ddx[i] / (relative * fabs(x[i]) + absolute[i]);
        sum += weighted * weighted;
    }
    const double norm = sqrt(sum / (double)integrator->ode.state_count);
    const double step = first_step_fraction * sqrt(2.0 / norm);
    return isfinite(step) ? step : 0.0;
}

static void count(const struct integrator *integrator, struct integrator_statistics *now) {
    long iteration_failures = 0;
    // these calls fail only without CVODE's memory
    (void)CVodeGetNumSteps(integrator->solver, &now->steps);
    (void)CVodeGetNumErrTestFails(integrator->solver, &now->failed_steps);
    (void)CVodeGetNumStepSolveFails(integrator->solver, &iteration_failures);
    (void)CVodeGetLastStep(integrator->solver, &now->last_step);
    (void)CVodeGetLastOrder(integrator->solver, &now->last_order);
    now->failed_steps += iteration_failures;
}

static double internal_time(const struct integrator *integrator) {
    double t = 0.0;
    (void)CVodeGetCurrentTime(integrator->solver, &t);
    return t;
}

#define COMMON                                                                                     \
    .has_history = true, .name = "CVODE", .destroy = destroy, .configure = configure,              \
    .restart = restart, .advance = advance, .next_step = next_step, .count = count,                \
    .internal_time = internal_time, .interpolate = interpolate, .status_of_flag = status_of_flag

const struct method integrator_cvode_adams = {COMMON, .create = create_adams};
const struct method integrator_cvode_bdf = {COMMON, .create = create_bdf};
