/* Explicit Runge-Kutta steps of ARKODE. Each advance starts ERKStep again: only the length of the
 * next step connects one advance with the next. */
#include "sundials.h"
#include "workspace.h"

#include <arkode/arkode_erkstep.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

/* Dormand-Prince 5(4). Other tables of ERKStep: Cash-Karp 5(4) is 10 to 20 % faster and has 1.2 to
 * 7 times the error; Fehlberg 8(7) is 1.3 to 1.6 times slower at steps of 1 and 10 ms, and fails at
 * tolerances below 1e-9 at steps of 0.1 s; Verner 6(5) has the errors of a lower order. */
static const ARKODE_ERKTableID table = ARKODE_DORMAND_PRINCE_7_4_5;
static const int order = 5;

/* Largest numbers of steps in the search for the time of an event. */
enum { MOST_CORRECTIONS = 20, MOST_DIVISIONS = 40 };

/* Part of a step over which a state changes as its derivative, up to rounding. */
static const double negligible = 0x1p-24;

/* Shortest advance, s. ARKODE multiplies lengths of steps with each other, and with a length that
 * it keeps over a restart. If that underflows, its result would depend on the step before. */
static const double shortest_advance = 1e-100;

struct erk {
    struct sundials base; /* first */
    void *solver;
    double next_step; /* first internal step of the next advance, s; 0 if ARKODE finds one */

    /* of the running advance */
    double end;        /* s since the restart */
    double watched;    /* last time that the observer was asked about, s since the restart */
    bool is_cut_short; /* true if an event in the step before that time, or the observer there,
                          ended the advance */
    double *cut_x;     /* the state there */

    /* begin of the running internal step, if events are searched */
    double step_begin; /* s since the restart; NaN if they are not */
    double *step_x;    /* the state there */
    double *step_dx;   /* right-hand sides of all stages, one after the other; the first is there */
    double *dx;        /* the right-hand side at the end, the last of the stages */
    double second_t;   /* of the second stage, if it is evaluated before ERKStep starts; else NaN */
    double *second_x;  /* the state there */
    double last_t;     /* of the last stage that ERKStep has evaluated; NaN if there is none */
    const double *last_dx; /* the right-hand side there */
    enum status search_status;
    ARKodeButcherTable coefficients; /* of the table, in ERKStep's memory */
};

/* ---- Observation ---------------------------------------------------------------------------- */

/* Writes the cubic polynomial through the states and right-hand sides at the begin of the step and
 * at its end t, where they are x and erk->dx. */
static void write_cubic(const struct erk *erk, double t, const double x[],
                        struct location *location) {
    struct step_polynomial *step = &location->step;
    const double h = t - erk->step_begin;
    step->begin = erk->step_begin;
    step->end = t;
    step->is_from_end = false;
    step->degree = 3;
    step->row = location->rows;
    for (size_t i = 0; i < location->ode->state_count; i++) {
        const double change = x[i] - erk->step_x[i];
        const double first = h * erk->step_dx[i];
        const double last = h * erk->dx[i];
        step->row[i][0] = erk->step_x[i];
        step->row[i][1] = first;
        step->row[i][2] = 3.0 * change - 2.0 * first - last;
        step->row[i][3] = first + last - 2.0 * change;
    }
}

/* Searches the step that has ended at t with the state x and the right-hand side erk->dx.
 * search_step: location_search or location_try. */
static void search(struct erk *erk, double t, const double x[],
                   enum status (*search_step)(struct location *)) {
    struct location *location = &erk->base.problem->location;
    const bool is_active = location_is_active(location);
    if (is_active && erk->search_status == STATUS_OK) {
        write_cubic(erk, t, x, location);
        erk->search_status = search_step(location);
    }
    erk->is_cut_short =
        erk->search_status != STATUS_OK || (is_active && location->time <= erk->end);
}

/* True if the begin of each internal step is kept: to search it, or to go back to it. */
static bool keeps_begins(const struct problem *problem) {
    return location_is_active(&problem->location) || problem->ode.settle != NULL;
}

/* Evaluates the right-hand side of an advance that is watched: it is known at the begin of an
 * internal step and perhaps at the second stage, and behind the last step nothing needs it. */
static int watched_rhs(sunrealtype t, N_Vector x, N_Vector dx, void *user_data) {
    struct erk *erk = user_data;
    const size_t size = erk->base.problem->ode.state_count * sizeof(double);
    if (erk->is_cut_short) {
        return 0;
    }
    if (t == erk->step_begin && memcmp(small_vector_data(x), erk->step_x, size) == 0) {
        memcpy(small_vector_data(dx), erk->step_dx, size);
        return 0;
    }
    if (t == erk->second_t && memcmp(small_vector_data(x), erk->second_x, size) == 0) {
        memcpy(small_vector_data(dx), erk->step_dx + erk->base.problem->ode.state_count, size);
        return 0;
    }
    erk->last_t = t;
    erk->last_dx = small_vector_data(dx);
    return sundials_rhs(t, x, dx, user_data);
}

/* Observes each step that ERKStep accepts; ends the advance at an event or if the observer says so.
 * Times that come again after a failure are not reported twice. */
static int observe(sunrealtype t, N_Vector x, void *user_data) {
    struct erk *erk = user_data;
    const struct problem *problem = erk->base.problem;
    if (t <= erk->watched) {
        return 0;
    }
    erk->watched = t;
    if (keeps_begins(problem)) {
        if (t == erk->last_t) { // the last stage is at the end of the step
            memcpy(erk->dx, erk->last_dx, problem->ode.state_count * sizeof(double));
        } else {
            erk->search_status = problem_rhs(erk->base.problem, t, small_vector_data(x), erk->dx);
        }
        search(erk, t, small_vector_data(x), location_search);
        if (!erk->is_cut_short) {
            const size_t size = problem->ode.state_count * sizeof(double);
            erk->step_begin = t;
            memcpy(erk->step_x, small_vector_data(x), size);
            memcpy(erk->step_dx, erk->dx, size);
        }
    }
    if (!erk->is_cut_short) {
        problem_settle(erk->base.problem, t, small_vector_data(x));
    }
    if (!erk->is_cut_short && problem->observer != NULL && t < erk->end) {
        erk->is_cut_short = problem_ask_observer(problem, t, small_vector_data(x));
    }
    if (erk->search_status != STATUS_OK) { // back to where the step began
        (void)problem_fail(erk->base.problem, t, small_vector_data(x));
        erk->watched = erk->step_begin;
        memcpy(erk->cut_x, erk->step_x, problem->ode.state_count * sizeof(double));
        return ERKStepSetStopTime(erk->solver, t);
    }
    if (erk->is_cut_short) {
        memcpy(erk->cut_x, small_vector_data(x), problem->ode.state_count * sizeof(double));
        return ERKStepSetStopTime(erk->solver, t);
    }
    return 0;
}

/* Prepares observe for an advance from the state begin_x to the time end, which writes the state to
 * x. */
static int begin_watching(struct erk *erk, double end, const double begin_x[], double x[]) {
    struct problem *problem = erk->base.problem;
    const bool keeps = keeps_begins(problem);
    erk->is_cut_short = false;
    erk->cut_x = x;
    erk->end = end;
    erk->watched = problem->reached;
    erk->search_status = STATUS_OK;
    erk->step_begin = NAN;
    erk->second_t = NAN;
    erk->last_t = NAN;
    if (keeps) {
        memcpy(erk->step_x, begin_x, problem->ode.state_count * sizeof(double));
        if (problem_rhs(problem, problem->reached, begin_x, erk->step_dx) != STATUS_OK) {
            return ARK_RHSFUNC_FAIL;
        }
        erk->step_begin = problem->reached;
    }
    return ERKStepSetPostprocessStepFn(erk->solver,
                                       keeps || problem->observer != NULL ? observe : NULL);
}

/* ---- Life ----------------------------------------------------------------------------------- */

static void destroy(void *memory) {
    struct erk *erk = memory;
    workspace_free(erk->step_x);
    if (erk->solver != NULL) {
        ERKStepFree(&erk->solver);
    }
    sundials_destroy(erk);
}

static bool create_solver(struct erk *erk) {
    struct sundials *base = &erk->base;
    erk->solver = ERKStepCreate(sundials_rhs, 0.0, base->x, base->context);
    return erk->solver != NULL &&
           ERKStepSetErrHandlerFn(erk->solver, sundials_text, base) == ARK_SUCCESS &&
           ERKStepSetUserData(erk->solver, base) == ARK_SUCCESS &&
           ERKStepSetTableNum(erk->solver, table) == ARK_SUCCESS &&
           ERKStepGetCurrentButcherTable(erk->solver, &erk->coefficients) == ARK_SUCCESS &&
           // steps end at the requested points: no polynomial is needed, which saves an evaluation
           // each
           ERKStepSetInterpolantType(erk->solver, ARK_INTERP_LAGRANGE) == ARK_SUCCESS &&
           ERKStepSetInterpolantDegree(erk->solver, 0) == ARK_SUCCESS &&
           // the first stage after an event may still be on the other side of it
           ERKStepSetMaxErrTestFails(erk->solver, 30) == ARK_SUCCESS &&
           ERKStepSetMaxHnilWarns(erk->solver, -1) == ARK_SUCCESS;
}

static enum status create(struct problem *problem, void **memory) {
    *memory = NULL;
    struct erk *erk = sundials_create(sizeof *erk, problem, &integrator_erk);
    if (erk == NULL) {
        return STATUS_OUT_OF_MEMORY;
    }
    const size_t n = problem->ode.state_count;
    const bool has_solver = create_solver(erk);
    const size_t stages = has_solver ? (size_t)erk->coefficients->stages : 0;
    erk->step_x = workspace_calloc((2 + stages) * n, sizeof *erk->step_x);
    const bool is_created = has_solver && erk->step_x != NULL;
    const enum status status = is_created ? sundials_warm_up(erk) : STATUS_OUT_OF_MEMORY;
    if (status != STATUS_OK) {
        destroy(erk);
        return status;
    }
    erk->step_dx = erk->step_x + n;
    erk->dx = erk->step_x + stages * n;
    erk->second_x = erk->dx + n;
    *memory = erk;
    return STATUS_OK;
}

static enum status configure(void *memory) {
    struct erk *erk = memory;
    struct sundials *base = &erk->base;
    const struct integrator_settings *settings = &base->problem->settings;
    memcpy(small_vector_data(base->absolute_tolerances), settings->absolute_tolerances,
           base->problem->ode.state_count * sizeof(double));
    int flag =
        ERKStepSVtolerances(erk->solver, settings->relative_tolerance, base->absolute_tolerances);
    if (flag == ARK_SUCCESS) {
        flag = ERKStepSetMaxStep(erk->solver, settings->max_step);
    }
    return sundials_status(base->problem, flag);
}

/* ---- Integration ---------------------------------------------------------------------------- */

static enum status restart(void *memory, const double x[]) {
    struct erk *erk = memory;
    sundials_set_state(&erk->base, x);
    erk->next_step = erk->base.problem->first_step;
    return STATUS_OK;
}

/* Starts ERKStep from the state in base.x at the time begin; first_step: s, 0 if ARKODE finds one.
 */
static int start(struct erk *erk, double begin, double end, double first_step) {
    const struct problem *problem = erk->base.problem;
    const bool is_watched = keeps_begins(problem) || problem->observer != NULL;
    int flag =
        ERKStepReInit(erk->solver, is_watched ? watched_rhs : sundials_rhs, begin, erk->base.x);
    if (flag == ARK_SUCCESS) {
        flag = ERKStepSetInitStep(erk->solver, first_step);
    }
    return flag == ARK_SUCCESS ? ERKStepSetStopTime(erk->solver, end) : flag;
}

/* Adds the work since ERKStep's last start, from which it counts. */
static void add_work(const struct erk *erk, struct method_work *work) {
    long steps = 0;
    long failed_steps = 0;
    // these calls fail only without ARKODE's memory
    (void)ERKStepGetNumSteps(erk->solver, &steps);
    (void)ERKStepGetNumErrTestFails(erk->solver, &failed_steps);
    (void)ERKStepGetCurrentTime(erk->solver, &work->internal);
    work->steps += steps;
    work->failed_steps += failed_steps;
    if (steps > 0) {
        (void)ERKStepGetLastStep(erk->solver, &work->last_step);
        work->last_order = order;
    }
}

/* Writes x = step_x + length times the sum of factors[j] dx_j; the second stage, of one term, to
 * the bit as ERKStep. */
ALWAYS_INLINE void combine(size_t n, int count, double length, const double factors[],
                           const double *restrict dx, const double *restrict step_x,
                           double *restrict x) {
    const double first = count == 1 ? length * factors[0] : factors[0];
    const double scale = count == 1 ? 1.0 : length;
    for (size_t i = 0; i < n; i++) {
        x[i] = first * dx[i];
    }
    for (int j = 1; j < count; j++) {
        for (size_t i = 0; i < n; i++) {
            x[i] += factors[j] * dx[(size_t)j * n + i];
        }
    }
    for (size_t i = 0; i < n; i++) {
        x[i] = step_x[i] + scale * x[i];
    }
}

static void combine_stages(const struct erk *erk, int count, double length, const double factors[],
                           double x[]) {
    const size_t n = erk->base.problem->ode.state_count;
    if (n == 4) { // the compiler unrolls these loops
        combine(4, count, length, factors, erk->step_dx, erk->step_x, x);
    } else {
        combine(n, count, length, factors, erk->step_dx, erk->step_x, x);
    }
}

/* Writes the state to x and the right-hand side of stage k > 0 of a step to the time t. Returns
 * false if that cannot be evaluated. */
static bool evaluate_stage(struct erk *erk, int k, double t, double x[]) {
    const struct ARKodeButcherTableMem *of = erk->coefficients;
    const size_t n = erk->base.problem->ode.state_count;
    const double length = t - erk->step_begin;
    const double stage_t = of->c[k] < 1.0 ? erk->step_begin + of->c[k] * length : t;
    combine_stages(erk, k, length, of->A[k], x);
    return problem_rhs(erk->base.problem, stage_t, x, erk->step_dx + (size_t)k * n) == STATUS_OK;
}

/* Steps from the begin of the running internal step to the time t, beginning with stage `first`.
 * The last stage begins with the state there: writes it to x and the right-hand side to erk->dx.
 * Returns false if that cannot be evaluated. */
static bool step_to(struct erk *erk, int first, double t, double x[]) {
    bool is_evaluated = true;
    for (int k = first; is_evaluated && k < erk->coefficients->stages; k++) {
        is_evaluated = evaluate_stage(erk, k, t, x);
    }
    return is_evaluated;
}

/* Returns the value of an INDICATOR_OF_STATE at the states x. */
static double indicator_at_state(const struct indicator *indicator, const double x[]) {
    return indicator->offset + indicator->factor * x[indicator->state];
}

/* True if an indicator of a state is above 0 at the state x, and not at the state `next`. */
static bool falls_between(const struct location *location, const double x[], const double next[]) {
    bool falls = false;
    for (size_t k = 0; k < location->used_count; k++) {
        const struct indicator *indicator = &location->indicators[location->used[k]];
        falls |= indicator->kind == INDICATOR_OF_STATE && indicator_at_state(indicator, x) > 0.0 &&
                 indicator_at_state(indicator, next) <= 0.0;
    }
    return falls;
}

/* True if an indicator of a state falls to 0 up to the time t as far as the first two stages, which
 * it evaluates, can say. x: room for a state. */
static bool foresees_event(struct erk *erk, double t, double x[]) {
    const size_t n = erk->base.problem->ode.state_count;
    const double length = t - erk->step_begin;
    if (!location_is_active(&erk->base.problem->location) ||
        !evaluate_stage(erk, 1, t, erk->second_x)) {
        return false;
    }
    erk->second_t = erk->step_begin + erk->coefficients->c[1] * length;
    const double of_change = 0.5 / erk->coefficients->c[1];
    for (size_t i = 0; i < n; i++) {
        const double change = erk->step_dx[n + i] - erk->step_dx[i];
        x[i] = erk->step_x[i] + length * (erk->step_dx[i] + of_change * change);
    }
    return falls_between(&erk->base.problem->location, erk->step_x, x);
}

/* Makes the advance after an event, or onto one, in one step, without the start of ERKStep, a half
 * of the work. Returns false if ERKStep is to advance: the step is long, its error above a tenth of
 * the tolerances, or the event that was foreseen does not come. */
static bool leap(struct erk *erk, double t, double x[], struct method_work *work) {
    const struct ARKodeButcherTableMem *of = erk->coefficients;
    const struct problem *problem = erk->base.problem;
    const size_t n = problem->ode.state_count;
    const double length = t - erk->step_begin;
    const double max_step = problem->settings.max_step;
    const bool is_short = length <= erk->next_step && !(max_step > 0.0 && length > max_step);
    if (!is_short || !(problem->continues || foresees_event(erk, t, x)) ||
        !step_to(erk, problem->continues ? 1 : 2, t, x)) {
        return false;
    }
    double *other = erk->second_x; // the state by the other weights of the table
    erk->second_t = NAN;
    combine_stages(erk, of->stages, length, of->d, other);
    double sum = 0.0;
    for (size_t i = 0; i < n; i++) {
        const double error =
            (x[i] - other[i]) / (problem->settings.relative_tolerance * fabs(erk->step_x[i]) +
                                 problem->settings.absolute_tolerances[i]);
        sum += error * error;
    }
    if (!(sum <= 0.01 * (double)n)) {
        return false;
    }
    search(erk, t, x, problem->continues ? location_search : location_try);
    if (!problem->continues && !(problem->location.time <= t)) { // without an event ERKStep's bits
        erk->search_status = STATUS_OK;
        erk->is_cut_short = false;
        return false;
    }
    erk->watched = t;
    *work =
        (struct method_work){.steps = 1, .last_step = length, .last_order = order, .internal = t};
    return true;
}

/* Advances step by step after ERKStep has failed: it gives up at the first right-hand side that
 * cannot be evaluated, and then reports the time of that evaluation instead of its last state's.
 * Here ever shorter steps are tried. x: the last valid state. */
static int advance_carefully(struct erk *erk, double begin, double end, int64_t max_steps,
                             const double begin_x[], double *stopped_at, double x[],
                             struct method_work *work) {
    struct problem *problem = erk->base.problem;
    const struct message_sink sink = problem->sink;
    double step = end - begin;
    double good = begin;        // the time of x
    problem->sink.write = NULL; // the failure before has kept its message
    sundials_set_state(&erk->base, begin_x);
    sundials_get_state(&erk->base, x);
    int flag = start(erk, begin, end, erk->next_step);
    for (int64_t steps = 0; flag >= 0 && good < end; steps++) {
        if (steps == max_steps) {
            flag = ARK_TOO_MUCH_WORK;
            break;
        }
        flag = ERKStepEvolve(erk->solver, end, erk->base.x, stopped_at, ARK_ONE_STEP);
        const bool is_unsearched = erk->search_status != STATUS_OK;
        if (erk->is_cut_short && !is_unsearched) {
            break;
        }
        if (flag >= 0 && !is_unsearched) {
            good = *stopped_at;
            sundials_get_state(&erk->base, x);
            (void)ERKStepGetCurrentStep(erk->solver, &step);
            continue;
        }
        step = 0.5 * fmin(step, end - good);
        if (problem->failed_at < good || !(step > 16.0 * DBL_EPSILON * fmax(good, end))) {
            break;
        }
        add_work(erk, work);
        erk->is_cut_short = false;
        erk->search_status = STATUS_OK;
        sundials_set_state(&erk->base, x);
        flag = start(erk, good, end, step);
    }
    problem->sink = sink;
    *stopped_at = good;
    return flag;
}

/* Writes indicator i at the time t and the state x to z. */
static enum status evaluate_indicator(const struct location *location, size_t i, double t,
                                      const double x[], double *z) {
    if (location->indicators[i].kind == INDICATOR_OF_STATE) {
        *z = indicator_at_state(&location->indicators[i], x);
        return STATUS_OK;
    }
    const enum status status = location->ode->indicators(t, x, location->z, location->ode->context);
    *z = location->z[i];
    return status;
}

/* Writes z, the value of the first indicator that has triggered, and Newton's correction (s) of the
 * event's time, -z / z', from the state x and its derivative dx at the time t. Returns false if
 * there is no correction. */
static bool correct_time(const struct location *location, double t, const double x[],
                         const double dx[], double *z, double *correction) {
    size_t i = 0;
    while (!location->triggered[i]) {
        i++;
    }
    if (evaluate_indicator(location, i, t, x, z) != STATUS_OK) {
        return false;
    }
    // over so small a part of the step the derivative of an indicator hardly changes; the part is
    // longer if the difference is lost in rounding
    double z_ahead = *z;
    double ahead = 0x1p-20 * (location->step.end - location->step.begin);
    for (int tries = 0; z_ahead == *z && tries < 4; tries++) {
        for (size_t j = 0; j < location->ode->state_count; j++) {
            location->x[j] = x[j] + ahead * dx[j];
        }
        if (evaluate_indicator(location, i, t + ahead, location->x, &z_ahead) != STATUS_OK) {
            return false;
        }
        *correction = -*z * ahead / (z_ahead - *z);
        ahead *= 0x1p4;
    }
    return isfinite(*correction);
}

/* Steps onto the event. The polynomial of the search is less accurate than the step: Newton's
 * method leads from its root to the root of the steps that end there. The indicator may be 0 at the
 * begin of the step, too: a correction that leads out of the part with the fall divides this part
 * in two. On failure the advance is back where the step began. */
static int step_onto_event(struct erk *erk, double *stopped_at, double x[]) {
    struct location *location = &erk->base.problem->location;
    double low = erk->step_begin;
    double high = erk->watched;
    const double slack = 0x1p-30 * (high - low); // far more than rounding
    bool is_below = false;                       // true if the indicator is below 0 at `high`
    double t = location->time;
    int flag = ARK_SUCCESS;
    int corrections = 0;
    int divisions = 0;
    while (flag >= 0 && corrections < MOST_CORRECTIONS && divisions < MOST_DIVISIONS) {
        flag = step_to(erk, 1, t, x) ? ARK_SUCCESS : ARK_RHSFUNC_FAIL;
        double z = 0.0;
        double correction = 0.0;
        if (flag < 0 || !correct_time(location, t, x, erk->dx, &z, &correction)) {
            break;
        }
        if (z > 0.0) {
            low = t;
        } else {
            high = t;
            is_below = true;
        }
        double next = t + correction;
        if (next > high && !is_below) {
            next = high;
        }
        if (fabs(next - t) <=
            fmax(negligible * (t - erk->step_begin), 2.0 * DBL_EPSILON * erk->watched)) {
            next = next > erk->step_begin ? fmin(next, erk->watched) : t;
            for (size_t i = 0; i < erk->base.problem->ode.state_count; i++) {
                x[i] += (next - t) * erk->dx[i];
            }
            t = next;
            break;
        }
        // at the begin, where the modes were found valid, the event would come again and again
        if (next > fmax(low - slack, erk->step_begin) && next <= high + slack) {
            t = next;
            corrections++;
        } else {
            t = 0.5 * (low + high);
            divisions++;
        }
    }
    if (flag < 0) {
        memcpy(x, erk->step_x, erk->base.problem->ode.state_count * sizeof *x);
        t = erk->step_begin;
    }
    location->time = flag < 0 ? INFINITY : t;
    *stopped_at = t;
    return flag;
}

/* Integrates with ERKStep. watching: the flag of begin_watching. */
static int integrate(struct erk *erk, int watching, double t, int64_t max_steps,
                     const double begin_x[], double *stopped_at, double x[],
                     struct method_work *work) {
    // parts of equal length leave no sliver at the end
    const double begin = erk->base.problem->reached;
    const double length = t - begin;
    const double first_step = erk->next_step > 0.0 ? length / ceil(length / erk->next_step) : 0.0;
    struct sundials_message kept = {.text = ""};
    const struct message_sink sink = erk->base.problem->sink;
    erk->base.problem->sink =
        (struct message_sink){.write = sundials_keep_message, .context = &kept};
    sundials_set_state(&erk->base, begin_x);
    int flag = start(erk, begin, t, first_step);
    if (flag == ARK_SUCCESS) {
        flag = watching;
    }
    if (flag == ARK_SUCCESS) {
        flag = ERKStepSetMaxNumSteps(erk->solver, sundials_steps(max_steps));
    }
    if (flag == ARK_SUCCESS) {
        flag = ERKStepEvolve(erk->solver, t, erk->base.x, stopped_at, ARK_NORMAL);
    }
    const bool is_given_up = erk->search_status != STATUS_OK ||
                             (flag < 0 && flag != ARK_TOO_MUCH_WORK && !erk->is_cut_short);
    if (is_given_up) {
        add_work(erk, work);
        // what has settled cannot be taken back
        const bool has_moved = erk->base.problem->ode.settle != NULL && isfinite(erk->step_begin);
        flag = advance_carefully(erk, has_moved ? erk->step_begin : begin, t, max_steps,
                                 has_moved ? erk->step_x : begin_x, stopped_at, x, work);
    } else if (!erk->is_cut_short) {
        sundials_get_state(&erk->base, x);
    }
    erk->base.problem->sink = sink;
    if (flag < 0 && kept.text[0] != '\0') {
        message_write(&sink, kept.status, "%s", kept.text);
    }
    add_work(erk, work);
    // an event says nothing about the length of steps
    const double before = erk->is_cut_short ? erk->next_step : 0.0;
    (void)ERKStepGetCurrentStep(erk->solver, &erk->next_step);
    erk->next_step = erk->next_step < before ? before : erk->next_step;
    return flag;
}

static enum status advance(void *memory, double t, int64_t max_steps, const double begin_x[],
                           double *stopped_at, double x[], struct method_work *work) {
    struct erk *erk = memory;
    const struct problem *problem = erk->base.problem;
    if (t - problem->reached < shortest_advance) {
        erk->next_step = 0.0;
        work->internal = problem->reached;
        sundials_set_state(&erk->base, begin_x);
        sundials_get_state(&erk->base, x);
        return sundials_status(problem, ARK_TOO_CLOSE);
    }
    int flag = begin_watching(erk, t, begin_x, x);
    if (flag != ARK_SUCCESS || !leap(erk, t, x, work)) {
        flag = integrate(erk, flag, t, max_steps, begin_x, stopped_at, x, work);
    }
    if (erk->is_cut_short) {
        work->is_cut_short = true;
        *stopped_at = erk->watched;
        flag = problem->location.time <= t ? step_onto_event(erk, stopped_at, x) : ARK_SUCCESS;
    }
    if (flag < 0 || !isfinite(erk->next_step)) {
        erk->next_step = 0.0;
    }
    return erk->search_status != STATUS_OK ? erk->search_status : sundials_status(problem, flag);
}

static double next_step(void *memory, const double x[]) {
    const struct erk *erk = memory;
    return erk->next_step;
}

/* The largest power of ten at which the error, measured with steps of 1 ms to 2 s, is CVODE's or
 * less (at one of 31 points a fifth more); with shorter steps it is the error of rounding. */
#define TOLERANCE_FRACTION 1e-2

const struct method integrator_erk = {
    .name = "erk",
    .tolerance_fraction = TOLERANCE_FRACTION,
    .longest_history = 0,
    .longest_history_with_events = 0,
    .memory_size = sundials_memory_size,
    .create = create,
    .destroy = destroy,
    .configure = configure,
    .restart = restart,
    .advance = advance,
    .next_step = next_step,
};
