/* The multistep methods of CVODE. */
#include "cvode_start.h"
#include "sundials.h"

#include "workspace.h"

#include <cvode/cvode.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <string.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_band.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>
#include <sunnonlinsol/sunnonlinsol_newton.h>

/* Error that Adams' corrector iteration may leave, relative to the error test. CVODE's own 0.1
 * costs a second evaluation of the right-hand side in most steps. Measured over steps of 1 ms, 10
 * ms and 2 s at tolerances from 2e-8 to 2e-14, 0.2 saves a sixth of the evaluations for the same
 * number of steps and the same error; 0.5 saves a quarter, but takes 30 % more steps and makes
 * three times the error if steps are long. */
static const double adams_iteration_error = 0.2;

/* Error that Newton's iteration may leave with gradients, relative to the error test, where CVODE
 * allows 0.1. A first iteration does not know how the gradients' rates depend on the states, and
 * the error test counts what it leaves: measured over stiff models with 1 to 20 gradients, 0.03
 * takes up to 30 % fewer steps and a quarter less time, or 3 % more; 0.01 costs up to 9 % where it
 * does not help. */
static const double newton_iteration_error_of_gradients = 0.03;

/* Largest growth of the step after the first one: after an event it does not outgrow the order
 * (first_step_fraction_after_event); otherwise CVODE's own. */
static const double growth_after_event = 10.0;
static const double usual_growth = 1e4;

/* Shortest first advance, s. The square of a length underflows in shorter first steps, and their
 * number then depends on who watches them. */
static const double shortest_first_advance = 1e-150;

/* Shortest internal step, s. It does not change the time, but a step that underflows to 0 would
 * make Newton's iteration endless, since CVODE then always keeps its old Jacobian. */
static const double shortest_step = 1e-200;

struct cvode {
    struct sundials base; /* first */
    void *solver;
    SUNNonlinearSolver nonlinear_solver;
    SUNMatrix jacobian;            /* of BDF */
    SUNLinearSolver linear_solver; /* of BDF */
    struct small_vector_terms
        columns; /* terms of the last internal step; count is 0 if they are not known */
    enum status search_status; /* status of the last search for an event */
    bool is_led; /* true if the last internal step is location->step, led from the restart */
    struct method_work counted;   /* work since the restart, up to the last advance */
    double (*row)[SERIES_LENGTH]; /* room for a series; NULL if none starts the method */
};

/* ---- Life ----------------------------------------------------------------------------------- */

static int evaluate_jacobian(sunrealtype t, N_Vector x, N_Vector dx, SUNMatrix jacobian,
                             void *user_data, N_Vector work1, N_Vector work2, N_Vector work3) {
    const struct sundials *base = user_data;
    struct problem *problem = base->problem;
    const struct ode *ode = &problem->ode;
    double *J = ode->band != NULL ? SM_DATA_B(jacobian) : SM_DATA_D(jacobian);
    enum status status = ode->jacobian(t, small_vector_data(x), J, ode->context);
    if (status != STATUS_OK || !problem_are_finite(J, ode_jacobian_size(ode))) {
        status = problem_fail(problem, t, small_vector_data(x));
    }
    return sundials_callback_flag(status);
}

/* True if a series starts the method after an event. */
static bool is_started_by_series(const struct ode *ode) {
    return ode->series != NULL && ode->indicator_count > 0;
}

static size_t memory_size(const struct ode *ode) {
    const size_t rows = is_started_by_series(ode) ? ode->series_row_count : 0;
    return sundials_memory_size(ode) + _Alignof(max_align_t) + rows * sizeof(double[SERIES_LENGTH]);
}

static void destroy(void *memory) {
    struct cvode *cvode = memory;
    workspace_free(cvode->row);
    if (cvode->solver != NULL) {
        CVodeFree(&cvode->solver);
    }
    if (cvode->nonlinear_solver != NULL) {
        SUNNonlinSolFree(cvode->nonlinear_solver);
    }
    if (cvode->linear_solver != NULL) {
        SUNLinSolFree(cvode->linear_solver);
    }
    if (cvode->jacobian != NULL) {
        SUNMatDestroy(cvode->jacobian);
    }
    sundials_destroy(cvode);
}

/* Creates the solver of either method. */
static bool create_solver(struct cvode *cvode, int multistep_method) {
    struct sundials *base = &cvode->base;
    cvode->solver = CVodeCreate(multistep_method, base->context);
    return cvode->solver != NULL &&
           CVodeSetErrHandlerFn(cvode->solver, sundials_text, base) == CV_SUCCESS &&
           CVodeInit(cvode->solver, sundials_rhs, 0.0, base->x) == CV_SUCCESS &&
           CVodeSetUserData(cvode->solver, base) == CV_SUCCESS &&
           // no warnings of steps too short to change the time
           CVodeSetMaxHnilWarns(cvode->solver, -1) == CV_SUCCESS;
}

static bool create_fixed_point_iteration(struct cvode *cvode) {
    cvode->nonlinear_solver = SUNNonlinSol_FixedPoint(cvode->base.x, 0, cvode->base.context);
    return cvode->nonlinear_solver != NULL &&
           CVodeSetNonlinearSolver(cvode->solver, cvode->nonlinear_solver) == CV_SUCCESS &&
           CVodeSetNonlinConvCoef(cvode->solver, adams_iteration_error) == CV_SUCCESS;
}

static bool create_newton_iteration(struct cvode *cvode) {
    SUNContext context = cvode->base.context;
    const struct ode *ode = &cvode->base.problem->ode;
    const struct band *band = ode->band;
    const sunindextype n = (sunindextype)ode_count_without_gradients(ode);
    cvode->jacobian = band != NULL ? band->solver->create_matrix(band, n, context)
                                   : SUNDenseMatrix(n, n, context);
    // the solvers work with any vector that has an array, but take only a serial one for pattern
    N_Vector pattern = cvode->jacobian != NULL ? N_VNew_Serial(n, context) : NULL;
    if (pattern == NULL) {
        return false;
    }
    cvode->linear_solver = band != NULL ? band->solver->create(band, pattern, cvode->jacobian)
                                        : SUNLinSol_Dense(pattern, cvode->jacobian, context);
    N_VDestroy(pattern);
    if (cvode->linear_solver != NULL && ode->gradient_count > 0) {
        cvode->linear_solver = sundials_column_solver(cvode->linear_solver, n);
        (void)CVodeSetNonlinConvCoef(cvode->solver, newton_iteration_error_of_gradients);
    }
    cvode->nonlinear_solver = SUNNonlinSol_Newton(cvode->base.x, context);
    return cvode->linear_solver != NULL && cvode->nonlinear_solver != NULL &&
           CVodeSetNonlinearSolver(cvode->solver, cvode->nonlinear_solver) == CV_SUCCESS &&
           CVodeSetLinearSolver(cvode->solver, cvode->linear_solver, cvode->jacobian) ==
               CV_SUCCESS &&
           CVodeSetJacFn(cvode->solver, evaluate_jacobian) == CV_SUCCESS;
}

static enum status create(struct problem *problem, const struct method *method,
                          int multistep_method, bool (*create_iteration)(struct cvode *),
                          void **memory) {
    *memory = NULL;
    struct cvode *cvode = sundials_create(sizeof *cvode, problem, method);
    if (cvode == NULL) {
        return STATUS_OUT_OF_MEMORY;
    }
    enum status status = STATUS_OUT_OF_MEMORY;
    if (create_solver(cvode, multistep_method) && create_iteration(cvode)) {
        status = sundials_warm_up(cvode);
    }
    if (status != STATUS_OK) {
        destroy(cvode);
        return status;
    }
    *memory = cvode;
    return STATUS_OK;
}

static enum status create_adams(struct problem *problem, void **memory) {
    const enum status status =
        create(problem, &integrator_cvode_adams, CV_ADAMS, create_fixed_point_iteration, memory);
    if (status != STATUS_OK || !is_started_by_series(&problem->ode)) {
        return status;
    }
    struct cvode *cvode = *memory;
    cvode->row = workspace_calloc(problem->ode.series_row_count, sizeof *cvode->row);
    if (cvode->row == NULL) {
        destroy(cvode);
        *memory = NULL;
        return STATUS_OUT_OF_MEMORY;
    }
    return STATUS_OK;
}

static enum status create_bdf(struct problem *problem, void **memory) {
    return create(problem, &integrator_cvode_bdf, CV_BDF, create_newton_iteration, memory);
}

static enum status configure(void *memory) {
    struct cvode *cvode = memory;
    struct sundials *base = &cvode->base;
    const struct integrator_settings *settings = &base->problem->settings;
    memcpy(small_vector_data(base->absolute_tolerances), settings->absolute_tolerances,
           base->problem->ode.state_count * sizeof(double));
    int flag =
        CVodeSVtolerances(cvode->solver, settings->relative_tolerance, base->absolute_tolerances);
    if (flag == CV_SUCCESS) {
        (void)CVodeSetMinStep(cvode->solver, 0.0); // else the one before may be above max_step
        flag = CVodeSetMaxStep(cvode->solver, settings->max_step);
    }
    if (flag == CV_SUCCESS && !(settings->max_step > 0.0 && settings->max_step < shortest_step)) {
        flag = CVodeSetMinStep(cvode->solver, shortest_step);
    }
    return sundials_status(base->problem, flag);
}

/* ---- First step -----------------------------------------------------------------------------
 * Length of the first internal step, which is of order 1: a fraction of the length at which its
 * error would be the tolerance, s; 0 if unknown. */

/* Fraction after a restart. CVODE's own choice is 0.5 and takes two evaluations to find. The errors
 * of first steps all have the same sign and add up from restart to restart: measured over 2000
 * steps of 1 ms, the error of the trajectory at 0.1 is a third of the error at 0.5, for as many
 * internal steps. */
static const double first_step_fraction = 0.1;

/* Fraction after an event, where no series starts the method. There errors add up in another way:
 * each bounce adds to the error of the height, and the last bounces are as low as the tolerance. So
 * the first steps are short, and do not grow to the tolerance before the order does: bouncing then
 * rests 1.7e-7 s early, as its cut-off says, and not 2.8e-7 s, for 5 % more time. */
static const double first_step_fraction_after_event = 0.003;

/* Returns the fraction of the length at which the error of a step of order 1, about h^2 x'' / 2, is
 * the tolerance. */
static double step_of_curvature(const struct problem *problem, double fraction, const double x[],
                                const double ddx[]) {
    const double relative = problem->settings.relative_tolerance;
    const double *absolute = problem->settings.absolute_tolerances;
    double sum = 0.0;
    for (size_t i = 0; i < problem->ode.state_count; i++) {
        const double weighted = ddx[i] / (relative * fabs(x[i]) + absolute[i]);
        sum += weighted * weighted;
    }
    const double norm = sqrt(sum / (double)problem->ode.state_count);
    const double step = fraction * sqrt(2.0 / norm);
    return isfinite(step) ? step : 0.0;
}

/* Returns the length after a restart at the state x, whose second derivative is ddx. */
static double first_step_after_restart(const struct problem *problem, const double x[],
                                       const double ddx[]) {
    return step_of_curvature(problem, first_step_fraction, x, ddx);
}

/* Time over which x'' is measured, s. */
static const double curvature_time = 1e-6;

/* Returns the length after an event at the time 0 and the state x. Writes x'' to ddx; uses the room
 * of problem->location. */
static double first_step_after_event(struct problem *problem, const double x[], double ddx[]) {
    const size_t n = problem->ode.state_count;
    const double ahead = fmin(curvature_time, problem->horizon);
    double *dx = problem->location.x;
    if (problem_rhs(problem, 0.0, x, dx) != STATUS_OK) {
        return 0.0;
    }
    double *moved = problem->location.dx;
    for (size_t i = 0; i < n; i++) {
        moved[i] = x[i] + ahead * dx[i];
    }
    if (problem_rhs(problem, ahead, moved, ddx) != STATUS_OK) {
        return 0.0;
    }
    for (size_t i = 0; i < n; i++) {
        ddx[i] = (ddx[i] - dx[i]) / ahead;
    }
    return step_of_curvature(problem, first_step_fraction_after_event, x, ddx);
}

/* ---- Integration ---------------------------------------------------------------------------- */

/* True after an event: there the first internal step does not depend on the next requested time. */
static bool does_not_depend_on_points(const struct problem *problem) {
    return problem->continues && location_is_active(&problem->location);
}

/* Returns the length of a first step after an event from CVODE's state, s; 0 if unknown. */
static double step_after_event(struct cvode *cvode) {
    struct problem *problem = cvode->base.problem;
    const double *x = small_vector_data(cvode->base.x);
    const double started =
        cvode->row != NULL ? cvode_start(cvode->solver, problem, x, cvode->row) : 0.0;
    return started > 0.0 ? started
                         : first_step_after_event(problem, x, small_vector_data(cvode->base.work));
}

static enum status restart(void *memory, const double x[]) {
    struct cvode *cvode = memory;
    const struct problem *problem = cvode->base.problem;
    sundials_set_state(&cvode->base, x);
    cvode->counted = (struct method_work){0};
    cvode->search_status = STATUS_OK;
    cvode->is_led = false;
    int flag = CV_SUCCESS;
    if (problem->ode.indicator_count > 0) {
        flag = CVodeSetEtaMaxFirstStep(
            cvode->solver, does_not_depend_on_points(problem) ? growth_after_event : usual_growth);
    }
    if (flag == CV_SUCCESS) {
        flag = CVodeReInit(cvode->solver, 0.0, cvode->base.x);
    }
    return sundials_status(problem, flag);
}

/* Writes the state at t within the last internal step. CVODE interpolates by combining the columns
 * of its Nordsieck array, up to 13, which stay the same until the next internal step. It computes
 * the powers of the time with a product for each factor: most of the cost of a short communication
 * step. So the columns are noted once per internal step, and all points within the step come from
 * Horner's scheme. */
static void evaluate_history(struct cvode *cvode, double t, double x[]) {
    if (cvode->is_led) {
        const struct location *location = &cvode->base.problem->location;
        const struct step_polynomial *step = &location->step;
        location_write_states(location, (t - step->begin) / (step->end - step->begin), x);
        return;
    }
    double internal = 0.0;
    double last_step = 0.0;
    (void)CVodeGetCurrentTime(cvode->solver, &internal);
    (void)CVodeGetLastStep(cvode->solver, &last_step);
    small_vector_polynomial(&cvode->columns, (t - internal) / last_step,
                            cvode->base.problem->ode.state_count, x);
}

static bool interpolate(void *memory, double t, double x[]) {
    struct cvode *cvode = memory;
    if (cvode->columns.count == 0) {
        return false;
    }
    evaluate_history(cvode, t, x);
    return true;
}

/* Leads location->step, which begins at the restart, through the state there: CVODE's polynomial
 * misses it by about its tolerance, and flights that are lower would begin below their limits. */
static void lead_from_restart(struct location *location) {
    const struct step_polynomial *step = &location->step;
    for (size_t i = 0; i < location->ode->state_count; i++) {
        double value = 0.0; // value at s = -1
        for (int k = step->degree; k >= 0; k--) {
            value = step->row[i][k] - value;
        }
        step->row[i][1] -= location->restart_x[i] - value;
    }
}

ALWAYS_INLINE void write_rows(const struct small_vector_terms *columns, size_t n,
                              double row[][SERIES_LENGTH]) {
    for (int k = 0; k < columns->count; k++) {
        const double *column = columns->data[columns->count - 1 - k];
        for (size_t i = 0; i < n; i++) {
            row[i][k] = column[i];
        }
    }
}

/* Searches the last internal step for an event. */
static enum status search(struct cvode *cvode, double begin, double end) {
    struct problem *problem = cvode->base.problem;
    struct step_polynomial *step = &problem->location.step;
    struct small_vector_terms *columns = &cvode->columns;
    columns->replace_sum = true;
    small_vector_note_terms(cvode->base.work, columns);
    const int flag = CVodeGetDky(cvode->solver, end, 0, cvode->base.work);
    small_vector_note_terms(cvode->base.work, NULL);
    columns->replace_sum = false;
    if (flag != CV_SUCCESS) {
        return sundials_status(problem, flag);
    }
    step->begin = begin;
    step->end = end;
    step->is_from_end = true;
    step->degree = columns->count - 1;
    step->row = problem->location.rows;
    if (problem->ode.state_count == 4) {
        write_rows(columns, 4, step->row); // the compiler leaves the inner loop out
    } else {
        write_rows(columns, problem->ode.state_count, step->row);
    }
    cvode->is_led = begin == 0.0 && problem->ode.rounding != NULL && step->degree > 0;
    if (cvode->is_led) {
        lead_from_restart(&problem->location);
    }
    return location_search(&problem->location);
}

/* Returns the time to which CVODE looks for a first step, s. It only bounds the step's length. */
static double longest_first_step(const struct problem *problem) {
    return fmin(problem->horizon, 1.0);
}

/* Takes the internal steps to t one by one, as CVode in normal mode would take them, searches each
 * and asks the observer about each that changes the time. */
static int integrate_watched(struct cvode *cvode, double t, int64_t max_steps, double *stopped_at,
                             double x[], bool *is_cut_short) {
    struct problem *problem = cvode->base.problem;
    long begin = 0;
    long steps = 0;
    double internal = 0.0;
    double watched = problem->reached;
    (void)CVodeGetNumSteps(cvode->solver, &begin);
    (void)CVodeGetCurrentTime(cvode->solver, &internal);
    int flag = CV_SUCCESS;
    while (flag >= 0 && internal < t && !*is_cut_short) {
        const bool is_independent = internal == 0.0 && does_not_depend_on_points(problem);
        (void)CVodeGetNumSteps(cvode->solver, &steps);
        if (steps - begin == max_steps) {
            return CV_TOO_MUCH_WORK;
        }
        // the first one may have been taken by the advance before, which has not returned its end
        const double before = internal;
        flag = CVode(cvode->solver, is_independent ? longest_first_step(problem) : t, cvode->base.x,
                     stopped_at, CV_ONE_STEP);
        sundials_get_state(&cvode->base, x);
        internal = *stopped_at;
        if (flag >= 0 && problem_has_ended(problem, internal, problem->failed_at)) {
            return CV_RHSFUNC_FAIL;
        }
        if (flag >= 0 && location_is_active(&problem->location) && internal > before) {
            cvode->search_status = search(cvode, before, internal);
            if (cvode->search_status != STATUS_OK) {
                (void)problem_fail(problem, internal, x);
                *stopped_at = before;
                evaluate_history(cvode, before, x);
                return CV_UNREC_RHSFUNC_ERR;
            }
            if (problem->location.time <= t) {
                *is_cut_short = true;
                *stopped_at = problem->location.time;
                evaluate_history(cvode, *stopped_at, x);
                break;
            }
        }
        if (flag >= 0 && internal > before) {
            problem_settle(problem, internal, x);
        }
        if (flag >= 0 && problem->observer != NULL && internal < t && internal > watched) {
            watched = internal;
            *is_cut_short = problem_ask_observer(problem, internal, x);
        }
    }
    return flag;
}

static int integrate(struct cvode *cvode, double t, int64_t max_steps, double *stopped_at,
                     double x[], bool *is_cut_short) {
    const struct problem *problem = cvode->base.problem;
    const bool is_searched = location_is_active(&problem->location);
    int flag = CVodeSetMaxNumSteps(cvode->solver, sundials_steps(max_steps));
    if (flag == CV_SUCCESS && problem->reached == 0.0) {
        flag =
            does_not_depend_on_points(problem)
                ? CVodeSetInitStep(cvode->solver, fmin(step_after_event(cvode), problem->horizon))
                : CVodeSetInitStep(cvode->solver, fmin(problem->first_step, t));
    }
    if (flag == CV_SUCCESS) {
        // set at every call: CVODE forgets a stop time that it has reached and keeps one over
        // restarts
        flag = CVodeSetStopTime(cvode->solver, problem->horizon);
    }
    cvode->columns.count = 0;
    const bool is_watched = problem->observer != NULL || is_searched || problem->ode.may_end;
    if (flag == CV_SUCCESS && is_watched) {
        flag = integrate_watched(cvode, t, max_steps, stopped_at, x, is_cut_short);
    }
    if (flag < 0 || *is_cut_short) {
        return flag;
    }
    small_vector_note_terms(cvode->base.x, &cvode->columns);
    flag = CVode(cvode->solver, t, cvode->base.x, stopped_at, CV_NORMAL);
    small_vector_note_terms(cvode->base.x, NULL);
    // as at all other points within the step, so that the places of stops do not matter
    if (flag == CV_SUCCESS && cvode->columns.count > 0) {
        evaluate_history(cvode, t, x);
    } else {
        sundials_get_state(&cvode->base, x);
    }
    return flag;
}

/* Measures the work since the last advance: CVODE counts from the last restart on. */
static void measure_work(struct cvode *cvode, struct method_work *work) {
    struct method_work now = {0};
    long steps = 0;
    long error_failures = 0;
    long iteration_failures = 0;
    // these calls fail only without CVODE's memory
    (void)CVodeGetNumSteps(cvode->solver, &steps);
    (void)CVodeGetNumErrTestFails(cvode->solver, &error_failures);
    (void)CVodeGetNumStepSolveFails(cvode->solver, &iteration_failures);
    (void)CVodeGetLastStep(cvode->solver, &now.last_step);
    (void)CVodeGetLastOrder(cvode->solver, &now.last_order);
    (void)CVodeGetCurrentTime(cvode->solver, &now.internal);
    now.steps = steps;
    now.failed_steps = (int64_t)error_failures + iteration_failures;
    if (now.steps == 0) {
        now.last_order = 0;
    }

    *work = now;
    work->steps -= cvode->counted.steps;
    work->failed_steps -= cvode->counted.failed_steps;
    cvode->counted = now;
}

static enum status advance(void *memory, double t, int64_t max_steps, const double begin_x[],
                           double *stopped_at, double x[], struct method_work *work) {
    struct cvode *cvode = memory;
    bool is_cut_short = false;
    if (cvode->base.problem->reached == 0.0 && t < shortest_first_advance) {
        *stopped_at = 0.0;
        sundials_get_state(&cvode->base, x);
        return sundials_status(cvode->base.problem, CV_TOO_CLOSE);
    }
    const int flag = integrate(cvode, t, max_steps, stopped_at, x, &is_cut_short);
    measure_work(cvode, work);
    work->is_cut_short = is_cut_short;
    return cvode->search_status != STATUS_OK ? cvode->search_status
                                             : sundials_status(cvode->base.problem, flag);
}

static double next_step(void *memory, const double x[]) {
    const struct cvode *cvode = memory;
    const struct problem *problem = cvode->base.problem;
    // after an event the motion has changed
    if (cvode->counted.last_order < 2 || problem->location.time == problem->reached ||
        CVodeGetDky(cvode->solver, problem->reached, 2, cvode->base.work) != CV_SUCCESS) {
        return 0.0;
    }
    return first_step_after_restart(problem, x, small_vector_data(cvode->base.work));
}

/* Measured over the scenarios: at 1/500 of the requested tolerance the error after 5000 restarts is
 * 19 times that tolerance; at 1/100 it is 97 times, for 8 % fewer internal steps. */
#define TOLERANCE_FRACTION 2e-3

/* With a longer history there are fewer restarts and rollback is slower. */
#define LONGEST_HISTORY 1000

#define COMMON                                                                                     \
    .tolerance_fraction = TOLERANCE_FRACTION, .longest_history = LONGEST_HISTORY,                  \
    .longest_history_with_events = LONGEST_HISTORY, .memory_size = memory_size,                    \
    .destroy = destroy, .configure = configure, .restart = restart, .advance = advance,            \
    .interpolate = interpolate, .next_step = next_step

const struct method integrator_cvode_adams = {COMMON, .name = "cvode_adams",
                                              .create = create_adams};
const struct method integrator_cvode_bdf = {COMMON, .name = "cvode_bdf", .create = create_bdf};
