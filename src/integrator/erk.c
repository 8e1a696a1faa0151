/* Explicit Runge-Kutta steps of ARKODE. Each advance starts ERKStep anew, so that nothing but the
 * length of the next step connects one with the next. */
#include "method.h"

#include <float.h>
#include <math.h>

/* Dormand-Prince 5(4). Of what else ERKStep offers, Cash-Karp 5(4) is 10 to 20 % faster and has 1.2
 * to 7 times the error; Fehlberg 8(7) is 1.3 to 1.6 times slower at steps of 1 and 10 ms, and fails
 * at tolerances below 1e-9 at steps of 0.1 s; Verner 6(5) has errors as of a lower order. */
static const ARKODE_ERKTableID table = ARKODE_DORMAND_PRINCE_7_4_5;
static const int order = 5;

/* s: ARKODE multiplies lengths of steps with each other, and with one that it keeps over a restart.
 * Where that underflows, what it does would depend on the step before. */
static const double shortest_advance = 1e-100;

static enum status status_of_flag(const struct integrator *integrator, int flag) {
    const bool stuck = integrator_is_stuck(integrator);
    switch (flag) {
    case ARK_SUCCESS:
    case ARK_TSTOP_RETURN:
        return STATUS_OK;
    case ARK_RHSFUNC_FAIL:
    case ARK_FIRST_RHSFUNC_ERR:
    case ARK_REPTD_RHSFUNC_ERR:
    case ARK_UNREC_RHSFUNC_ERR:
        return STATUS_NOT_FINITE;
    case ARK_TOO_MUCH_WORK:
        return stuck ? STATUS_NOT_FINITE : STATUS_TOO_MANY_STEPS;
    case ARK_TOO_MUCH_ACC:
    case ARK_ERR_FAILURE:
    case ARK_CONV_FAILURE:
    // values so extreme that steps, weights or times underflow or overflow
    case ARK_BAD_T:
    case ARK_TOO_CLOSE:
    case ARK_ILL_INPUT:
        return stuck ? STATUS_NOT_FINITE : STATUS_NO_CONVERGENCE;
    case ARK_MEM_FAIL:
        return STATUS_OUT_OF_MEMORY;
    default:
        return STATUS_INTERNAL;
    }
}

static void destroy(struct integrator *integrator) {
    if (integrator->solver != NULL) {
        ERK(Free)(&integrator->solver);
    }
}

static enum status create(struct integrator *integrator) {
    integrator->solver =
        ERKStepCreate(integrator_evaluate_rhs, 0.0, integrator->x, integrator->context);
    const bool created =
        integrator->solver != NULL &&
        sundials_redirect_erk(integrator->context, integrator->solver, &integrator->texts) == 0 &&
        ERK(SetUserData)(integrator->solver, integrator) == ARK_SUCCESS &&
        ERKStepSetTableNum(integrator->solver, table) == ARK_SUCCESS &&
        // steps end at the points asked for: without a polynomial an evaluation each is saved
        ERK(SetInterpolantType)(integrator->solver, ARK_INTERP_LAGRANGE) == ARK_SUCCESS &&
        ERK(SetInterpolantDegree)(integrator->solver, 0) == ARK_SUCCESS &&
        ERK(SetMaxHnilWarns)(integrator->solver, -1) == ARK_SUCCESS;
    return created ? STATUS_OK : STATUS_OUT_OF_MEMORY;
}

static int configure(struct integrator *integrator) {
    const int flag = ERK(SVtolerances)(integrator->solver, integrator->settings.relative_tolerance,
                                       integrator->absolute_tolerances);
    return flag != ARK_SUCCESS ? flag
                               : ERK(SetMaxStep)(integrator->solver, integrator->settings.max_step);
}

static int restart(struct integrator *integrator) {
    (void)integrator;
    return ARK_SUCCESS;
}

/* From the state in x at the time begin; first_step: s, 0: ARKODE finds one. */
static int start(struct integrator *integrator, double begin, double end, double first_step) {
    int flag = ERKStepReInit(integrator->solver, integrator_evaluate_rhs, begin, integrator->x);
    if (flag == ARK_SUCCESS) {
        flag = ERK(SetInitStep)(integrator->solver, first_step);
    }
    return flag == ARK_SUCCESS ? ERK(SetStopTime)(integrator->solver, end) : flag;
}

/* ERKStep counts from its last start on. */
static void keep_counts(struct integrator *integrator) {
    struct integrator_statistics now = {0};
    integrator->method->count(integrator, &now);
    integrator->statistics.steps += now.steps;
    integrator->statistics.failed_steps += now.failed_steps;
}

/* Step by step, for where ERKStep has failed: it gives up at the first right-hand side that cannot
 * be evaluated, and then tells the time of that evaluation, not the one of its last state. Here
 * ever shorter steps are tried. */
static int advance_carefully(struct integrator *integrator, double begin, double end,
                             long max_steps, double *stopped_at) {
    double step = end - begin;
    double good = begin;
    N_VScale(1.0, integrator->last_x, integrator->x);
    int flag = start(integrator, begin, end, integrator->first_step);
    for (long steps = 0; flag >= 0 && good < end; steps++) {
        if (steps == max_steps) {
            flag = ARK_TOO_MUCH_WORK;
            break;
        }
        flag = ERK(Evolve)(integrator->solver, end, integrator->x, stopped_at, ARK_ONE_STEP);
        if (flag >= 0) {
            good = *stopped_at;
            N_VScale(1.0, integrator->x, integrator->work);
            (void)ERK(GetCurrentStep)(integrator->solver, &step);
            continue;
        }
        step = 0.5 * fmin(step, end - good);
        if (integrator->failed_at < good || !(step > 16.0 * DBL_EPSILON * fmax(good, end))) {
            break;
        }
        keep_counts(integrator);
        N_VScale(1.0, good > begin ? integrator->work : integrator->last_x, integrator->x);
        flag = start(integrator, good, end, step);
    }
    N_VScale(1.0, good > begin ? integrator->work : integrator->last_x, integrator->x);
    *stopped_at = good;
    return flag;
}

static int advance(struct integrator *integrator, double t, long max_steps, double *stopped_at) {
    // parts of equal length leave no sliver at the end
    const double begin = integrator->reached;
    const double length = t - begin;
    const double first_step =
        integrator->first_step > 0.0 ? length / ceil(length / integrator->first_step) : 0.0;
    integrator->counted = (struct integrator_statistics){0};
    N_VScale(1.0, integrator->last_x, integrator->x);
    if (length < shortest_advance) {
        *stopped_at = begin;
        integrator->first_step = 0.0;
        // brings its counts and its time to those of begin
        (void)ERKStepReInit(integrator->solver, integrator_evaluate_rhs, begin, integrator->x);
        return ARK_TOO_CLOSE;
    }
    int flag = start(integrator, begin, t, first_step);
    if (flag == ARK_SUCCESS) {
        flag = ERK(SetMaxNumSteps)(integrator->solver, max_steps);
    }
    if (flag == ARK_SUCCESS) {
        flag = ERK(Evolve)(integrator->solver, t, integrator->x, stopped_at, ARK_NORMAL);
    }
    if (flag < 0 && flag != ARK_TOO_MUCH_WORK) {
        keep_counts(integrator);
        flag = advance_carefully(integrator, begin, t, max_steps, stopped_at);
    }
    if (flag < 0 || ERK(GetCurrentStep)(integrator->solver, &integrator->first_step) < 0 ||
        !isfinite(integrator->first_step)) {
        integrator->first_step = 0.0;
    }
    return flag;
}

static double next_step(const struct integrator *integrator) {
    return integrator->first_step;
}

static void count(const struct integrator *integrator, struct integrator_statistics *now) {
    // these calls fail only without ARKODE's memory
    (void)ERK(GetNumSteps)(integrator->solver, &now->steps);
    (void)ERK(GetNumErrTestFails)(integrator->solver, &now->failed_steps);
    (void)ERK(GetLastStep)(integrator->solver, &now->last_step);
    now->last_order = order;
}

static double internal_time(const struct integrator *integrator) {
    double t = 0.0;
    (void)ERK(GetCurrentTime)(integrator->solver, &t);
    return t;
}

const struct method integrator_erk = {
    .has_history = false,
    .name = "ARKODE",
    .create = create,
    .destroy = destroy,
    .configure = configure,
    .restart = restart,
    .advance = advance,
    .next_step = next_step,
    .count = count,
    .internal_time = internal_time,
    .status_of_flag = status_of_flag,
};
