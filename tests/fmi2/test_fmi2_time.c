/* Time as masters keep it: experiments, steps and their status, FMI 2.0, sections 2.1.6, 4.2.2 and
 * 4.2.3; and the integrator's parameters, solver_method and max_step. That all methods give the
 * same motion: rparm/test_accuracy.py. */
#include "each_method.h"
#include "fmu_harness.h"

#include <float.h>
#include <math.h>
#include <unity.h>

/* ---- Experiments ---------------------------------------------------------------------------- */

static void test_experiments_that_are_refused(void) {
    static const struct {
        bool has_tolerance, has_stop;
        double tolerance, start, stop;
        const char *word; /* of the message */
    } cases[] = {
        {true, false, 0.0, 0.0, 0.0, "tolerance"},
        {true, false, -1e-6, 0.0, 0.0, "tolerance"},
        {true, false, NAN, 0.0, 0.0, "tolerance"},
        {true, false, INFINITY, 0.0, 0.0, "tolerance"},
        {false, false, 0.0, NAN, 0.0, "start time"},
        {false, false, 0.0, INFINITY, 0.0, "start time"},
        {false, false, 0.0, -INFINITY, 0.0, "start time"},
        {false, true, 0.0, 1.0, 0.5, "stop time"},
        {false, true, 0.0, 1.0, NAN, "stop time"},
        {false, true, 0.0, 1.0, -INFINITY, "stop time"},
    };
    for (size_t i = 0; i < FMU_COUNT(cases); i++) {
        const fmi2Component c = fmu_instantiate(&messages, false);
        fmu_log_clear(&messages);
        // in FMI 3.0 the second call has these arguments
        TEST_ASSERT_EQUAL_INT(fmu_version == 2 ? fmi2Error : fmi2OK,
                              fmu.SetupExperiment(c, cases[i].has_tolerance, cases[i].tolerance,
                                                  cases[i].start, cases[i].has_stop,
                                                  cases[i].stop));
        ASSERT_ERROR(fmu.EnterInitializationMode(c));
        fmu_assert_logged(&messages, cases[i].word);
        fmu_assert_reset_is_fresh(c, cases[i].word);
        fmu_free(c);
    }
}

static void test_what_is_not_defined_is_not_looked_at(void) {
    const fmi2Component c = fmu_instantiate(&messages, false);
    ASSERT_OK(fmu.SetupExperiment(c, fmi2False, NAN, 1.0, fmi2False, -NAN));
    ASSERT_OK(fmu.SetupExperiment(c, fmi2False, -1.0, 1.0, fmi2False, 0.5));
    ASSERT_OK(fmu.EnterInitializationMode(c));
    ASSERT_OK(fmu.ExitInitializationMode(c));
    ASSERT_OK(fmu.DoStep(c, 1.0, 1.0, fmi2True));
}

static double effective_tolerance(double parameter, double experiment) {
    const fmi2Component c = fmu_instantiate(&messages, false);
    fmu_set(c, RP_MANIPULATOR_relative_tolerance, parameter);
    fmu_initialize(c, 0.0, experiment);
    const double tolerance = fmu_get(c, RP_MANIPULATOR_effective_relative_tolerance);
    fmu_free(c);
    return tolerance;
}

/* An experiment's tolerance above 1e-4, as of a master that passes its own, is used as 1e-4. */
static void test_a_coarse_tolerance_of_the_experiment_is_cut_and_reported(void) {
    const double coarsest = effective_tolerance(0.0, 1e-4);
    const double coarser_parameter = effective_tolerance(1e-3, 0.0);
    TEST_ASSERT_EQUAL_UINT(0, fmu_log_count(&messages, "logStatusWarning"));
    TEST_ASSERT_TRUE(coarser_parameter > coarsest);

    const double tolerances[] = {1.01e-4, 1e-3, 0.1, 1e300};
    for (size_t i = 0; i < FMU_COUNT(tolerances); i++) {
        fmu_log_clear(&messages);
        TEST_ASSERT_TRUE(effective_tolerance(0.0, tolerances[i]) == coarsest);
        TEST_ASSERT_EQUAL_UINT(1, fmu_log_count(&messages, "logStatusWarning"));
        TEST_ASSERT_EQUAL_UINT(1, messages.count[fmi2OK]);
        TEST_ASSERT_EQUAL_UINT(1, fmu_log_total(&messages));
        fmu_assert_logged(&messages, "0.0001");
        fmu_assert_logged(&messages, "relative_tolerance");

        // the parameter wins, without a word
        fmu_log_clear(&messages);
        TEST_ASSERT_TRUE(effective_tolerance(1e-3, tolerances[i]) == coarser_parameter);
        TEST_ASSERT_EQUAL_UINT(0, fmu_log_total(&messages));
    }
}

/* The integrator runs at a fraction of the requested tolerance. The fraction is not tested. */
static void test_the_tolerance_parameter_wins_over_the_experiment(void) {
    const double by_default = effective_tolerance(0.0, 0.0);
    const double fine = effective_tolerance(0.0, 1e-9);
    const double coarse = effective_tolerance(0.0, 1e-4);
    TEST_ASSERT_TRUE(0.0 < fine && fine < by_default && by_default < coarse);
    TEST_ASSERT_TRUE(fine <= 1e-9 && coarse <= 1e-4);
    TEST_ASSERT_TRUE(by_default == effective_tolerance(0.0, 1e-8));
    TEST_ASSERT_TRUE(coarse == effective_tolerance(1e-4, 0.0));
    TEST_ASSERT_TRUE(coarse == effective_tolerance(1e-4, 1e-9));
    TEST_ASSERT_TRUE(fine == effective_tolerance(1e-9, 1e-4));
}

/* ---- Steps ---------------------------------------------------------------------------------- */

static void test_steps_that_are_refused(void) {
    static const double start = 1.75;
    static const struct {
        double point, length;
        const char *words[2]; /* of the message */
    } cases[] = {
        {start, 0.0, {"above 0", "1.75"}},    {start, -0.0, {"above 0", "1.75"}},
        {start, -0.5, {"-0.5", "1.75"}},      {start, NAN, {"nan", "1.75"}},
        {start, INFINITY, {"inf", "1.75"}},   {start, -INFINITY, {"inf", "1.75"}},
        {NAN, 0.5, {"nan", "0.5"}},           {INFINITY, 0.5, {"inf", "0.5"}},
        {DBL_MAX, DBL_MAX, {"refused", ""}},  {start, 1e-20, {"1e-20", "1.75"}},
        {start, 1.1e300, {"1e+300", "1.75"}}, // an integrator would overflow
        {1.5, 0.25, {"1.5", "1.75"}},         // backwards
        {1.8125, 0.625, {"1.8125", "1.75"}},  // a tenth of a step late
        {1.6875, 0.625, {"1.6875", "1.75"}},  // and early
        {0.0, 0.625, {"t = 0", "1.75"}},
    };
    for (size_t i = 0; i < FMU_COUNT(cases); i++) {
        const fmi2Component c = fmu_initialized(&messages, start);
        fmu_log_clear(&messages);
        TEST_ASSERT_EQUAL_INT_MESSAGE(
            fmi2Error, fmu.DoStep(c, cases[i].point, cases[i].length, fmi2True), cases[i].words[0]);
        fmu_assert_logged(&messages, cases[i].words[0]);
        fmu_assert_logged(&messages, cases[i].words[1]);
        TEST_ASSERT_EQUAL_DOUBLE(start, fmu_get(c, RP_MANIPULATOR_time));
        fmu_assert_in_error(c);
        fmu_assert_reset_is_fresh(c, messages.texts);
        fmu_free(c);
    }
}

/* A master's rounding: followed, and the step ends where the master says. */
static void test_a_mismatch_of_rounding_is_followed(void) {
    static const double mismatches[] = {1e-10, -1e-10, 3e-12, DBL_EPSILON};
    for (size_t i = 0; i < FMU_COUNT(mismatches); i++) {
        const fmi2Component c = fmu_initialized(&messages, 1.0);
        const double point = 1.0 + mismatches[i];
        ASSERT_OK(fmu.DoStep(c, point, 0.1, fmi2True));
        TEST_ASSERT_TRUE(point + 0.1 == fmu_get(c, RP_MANIPULATOR_time));
        fmu_free(c);
    }
}

/* Within the slack of rounding, but it would end where the instance is. */
static void test_a_step_that_ends_where_the_instance_is_is_refused(void) {
    const double at = 1e6;
    const double before = nextafter(at, 0.0);
    static const struct {
        int ulps;
        fmi2Status status;
    } cases[] = {{1, fmi2Error}, {2, fmi2OK}};
    for (size_t i = 0; i < FMU_COUNT(cases); i++) {
        const fmi2Component c = fmu_initialized(&messages, at);
        const double h = cases[i].ulps * (at - before);
        TEST_ASSERT_EQUAL_INT(cases[i].status, fmu.DoStep(c, before, h, fmi2True));
        TEST_ASSERT_TRUE(fmu_get(c, RP_MANIPULATOR_time) >= at);
        fmu_free(c);
    }
}

static fmi2Component initialized_until(double start, double stop) {
    const fmi2Component c = fmu_instantiate(&messages, false);
    ASSERT_OK(fmu.SetupExperiment(c, fmi2False, 0, start, fmi2True, stop));
    ASSERT_OK(fmu.EnterInitializationMode(c));
    ASSERT_OK(fmu.ExitInitializationMode(c));
    return c;
}

static void test_a_step_past_the_stop_time_is_refused(void) {
    const fmi2Component c = initialized_until(1.0, 1.25);
    ASSERT_OK(fmu.DoStep(c, 1.0, 0.125, fmi2True));
    ASSERT_ERROR(fmu.DoStep(c, 1.125, 0.1875, fmi2True));
    fmu_assert_logged(&messages, "1.3125");
    fmu_assert_logged(&messages, "1.25");
    fmu_assert_in_error(c);
    fmu_assert_reset_is_fresh(c, "after a step past the stop time");
}

static void test_the_stop_time_itself_is_reached_within_slack(void) {
    static const double beyond[] = {0.0, 1e-10, -1e-10, DBL_EPSILON};
    for (size_t i = 0; i < FMU_COUNT(beyond); i++) {
        const fmi2Component c = initialized_until(1.0, 1.25);
        ASSERT_OK(fmu.DoStep(c, 1.0, 0.25 + beyond[i], fmi2True));
        TEST_ASSERT_TRUE(1.0 + (0.25 + beyond[i]) == fmu_get(c, RP_MANIPULATOR_time));
        fmu_free(c);
    }
}

/* noSetFMUStatePriorToCurrentPoint is only a hint. */
static void test_the_rollback_hint_changes_nothing(void) {
    static const fmi2Boolean hints[] = {fmi2True, fmi2False, 7};
    double q1[FMU_COUNT(hints)];
    for (size_t i = 0; i < FMU_COUNT(hints); i++) {
        const fmi2Component c = fmu_initialized(&messages, 0.0);
        ASSERT_OK(fmu.DoStep(c, 0.0, 0.5, hints[i]));
        q1[i] = fmu_get(c, RP_MANIPULATOR_q1);
        TEST_ASSERT_TRUE(q1[i] == q1[0]);
    }
}

/* fmi2Discard of fmi2DoStep: section 4.2.2; fmi2LastSuccessfulTime: 4.2.3. */
static void test_a_failed_step_tells_how_far_it_got(void) {
    fmu_only_in(2, "in FMI 3.0 a failed step leaves the instance as it was");
    const fmi2ValueReference max_steps = RP_MANIPULATOR_max_internal_steps;
    const double start = 2.0;
    const double length = 10.0;
    const fmi2Integer one = 1;
    const fmi2Component c = fmu_instantiate(&messages, false);
    ASSERT_OK(fmu.SetInteger(c, &max_steps, 1, &one));
    fmu_initialize(c, start, 0.0);
    ASSERT_DISCARD(fmu.DoStep(c, start, length, fmi2True));
    TEST_ASSERT_GREATER_THAN_UINT(0, messages.count[fmi2Discard]);

    double reached = NAN;
    ASSERT_OK(fmu.GetRealStatus(c, fmi2LastSuccessfulTime, &reached));
    TEST_ASSERT_TRUE(reached >= start && reached < start + length);
    TEST_ASSERT_EQUAL_DOUBLE(reached, fmu_get(c, RP_MANIPULATOR_time));

    double x[4] = {NAN, NAN, NAN, NAN};
    fmu_get_states(c, x);
    for (size_t i = 0; i < 4; i++) {
        TEST_ASSERT_TRUE(isfinite(x[i]));
    }
    fmi2Boolean terminated = fmi2True;
    ASSERT_OK(fmu.GetBooleanStatus(c, fmi2Terminated, &terminated));
    TEST_ASSERT_EQUAL_INT(fmi2False, terminated);
}

/* ---- Status --------------------------------------------------------------------------------- */

static void test_status_tells_what_can_be_known(void) {
    fmu_only_in(2, "FMI 3.0 has no status of a step");
    static const fmi2StatusKind kinds[] = {fmi2DoStepStatus, fmi2PendingStatus,
                                           fmi2LastSuccessfulTime, fmi2Terminated,
                                           (fmi2StatusKind)99};
    const fmi2Component c = fmu_initialized(&messages, 2.0);
    ASSERT_OK(fmu.DoStep(c, 2.0, 0.5, fmi2True));
    for (size_t i = 0; i < FMU_COUNT(kinds); i++) {
        const bool is_time = kinds[i] == fmi2LastSuccessfulTime;
        const bool is_terminated = kinds[i] == fmi2Terminated;
        fmi2Status status = fmi2Fatal;
        fmi2Real real = -1.0;
        fmi2Integer integer = -1;
        fmi2Boolean boolean = -1;
        fmi2String text = "untouched";
        ASSERT_DISCARD(fmu.GetStatus(c, kinds[i], &status));
        ASSERT_DISCARD(fmu.GetIntegerStatus(c, kinds[i], &integer));
        ASSERT_DISCARD(fmu.GetStringStatus(c, kinds[i], &text));
        TEST_ASSERT_EQUAL_INT(is_time ? fmi2OK : fmi2Discard,
                              fmu.GetRealStatus(c, kinds[i], &real));
        TEST_ASSERT_EQUAL_INT(is_terminated ? fmi2OK : fmi2Discard,
                              fmu.GetBooleanStatus(c, kinds[i], &boolean));
        TEST_ASSERT_EQUAL_INT(fmi2Fatal, status);
        TEST_ASSERT_EQUAL_INT(-1, integer);
        TEST_ASSERT_EQUAL_STRING("untouched", text);
        TEST_ASSERT_EQUAL_DOUBLE(is_time ? 2.5 : -1.0, real);
        TEST_ASSERT_EQUAL_INT(is_terminated ? fmi2False : -1, boolean);
    }
    ASSERT_OK(fmu.DoStep(c, 2.5, 0.5, fmi2True)); // a Discard here is no failure
}

/* ---- The method ----------------------------------------------------------------------------- */

EACH_METHOD static void test_the_order_is_one_of_the_method(void) {
    static const int highest[FMU_METHODS] = {
        [FMU_CVODE_ADAMS] = 12, [FMU_CVODE_BDF] = 5, [FMU_ERK] = 5, [FMU_TAYLOR] = 31};
    static const int lowest_of_last[FMU_METHODS] = {
        [FMU_CVODE_ADAMS] = 6, [FMU_CVODE_BDF] = 3, [FMU_ERK] = 5, [FMU_TAYLOR] = 12};
    const fmi2Component c = fmu_instantiate(&messages, false);
    fmu_set_integer(c, RP_MANIPULATOR_solver_method, method);
    fmu_set(c, RP_MANIPULATOR_dq1, 2.0);
    fmu_initialize(c, 0.0, 1e-10);
    for (int i = 0; i < 100; i++) {
        ASSERT_OK(fmu.DoStep(c, 0.01 * i, 0.01, fmi2True));
        TEST_ASSERT_LESS_OR_EQUAL_INT(highest[method],
                                      fmu_get_integer(c, RP_MANIPULATOR_solver_last_order));
    }
    TEST_ASSERT_GREATER_OR_EQUAL_INT(lowest_of_last[method],
                                     fmu_get_integer(c, RP_MANIPULATOR_solver_last_order));
}

/* A reset solver keeps nothing: the same method again, after failed steps of all kinds. */
EACH_METHOD static void test_a_reset_leaves_nothing_of_what_failed(void) {
    static const struct {
        fmi2ValueReference reference;
        double value, length;
    } failures[] = {{RP_MANIPULATOR_dq1, 1e160, 0.1},     {RP_MANIPULATOR_dq2, 1e200, 0.1},
                    {RP_MANIPULATOR_f2, 1e300, 0.1},      {RP_MANIPULATOR_dq1, 1.0, 1e-160},
                    {RP_MANIPULATOR_dq1, 1.0, 1e300},     {RP_MANIPULATOR_tau1, 1.7e308, 1.0},
                    {RP_MANIPULATOR_max_step, 1e-20, 1.0}};
    static struct fmu_run expected;
    static struct fmu_run again;
    const fmi2Component fresh = fmu_instantiate(&messages, false);
    fmu_set_integer(fresh, RP_MANIPULATOR_solver_method, method);
    ASSERT_OK(fmu_run(fresh, 0, &expected));

    const fmi2Component c = fmu_instantiate(&messages, false);
    for (size_t i = 0; i < FMU_COUNT(failures); i++) {
        fmu_set_integer(c, RP_MANIPULATOR_solver_method, method);
        fmu_set(c, failures[i].reference, failures[i].value);
        fmu_initialize(c, 0.0, 0.0);
        // solvers square their step; the Taylor method has no step that is too short
        const bool is_done = method == FMU_TAYLOR && failures[i].length < 1e-100;
        TEST_ASSERT_EQUAL_INT(is_done ? fmi2OK : fmi2Discard,
                              fmu.DoStep(c, 0.0, failures[i].length, fmi2True));
        ASSERT_OK(fmu.Reset(c));
        fmu_set_integer(c, RP_MANIPULATOR_solver_method, method);
        ASSERT_OK(fmu_run(c, 0, &again));
        TEST_ASSERT_EQUAL_MEMORY(&expected, &again, sizeof expected);
        ASSERT_OK(fmu.Reset(c));
    }
}

/* CVODE goes past communication points with held inputs, the Taylor method too, from a restart for
 * each step; the Runge-Kutta method ends there. */
EACH_METHOD static void test_internal_steps_over_communication_points(void) {
    enum { STEPS = 1000 };
    const double h = 1.0 / 1024.0;
    const fmi2Component c = fmu_initialized_with(method, &messages, 0.0);
    for (int i = 0; i < STEPS; i++) {
        ASSERT_OK(fmu.DoStep(c, i * h, h, fmi2True));
    }
    const int steps = fmu_get_integer(c, RP_MANIPULATOR_solver_steps);
    if (method == FMU_ERK) {
        TEST_ASSERT_GREATER_OR_EQUAL_INT(STEPS, steps);
        TEST_ASSERT_EQUAL_INT(STEPS, fmu_get_integer(c, RP_MANIPULATOR_solver_restarts));
    } else {
        TEST_ASSERT_LESS_THAN_INT(STEPS, steps);
        TEST_ASSERT_EQUAL_INT(method == FMU_TAYLOR ? steps : 1,
                              fmu_get_integer(c, RP_MANIPULATOR_solver_restarts));
        TEST_ASSERT_TRUE(fmu_get(c, RP_MANIPULATOR_solver_last_step) > h);
    }
}

/* ---- The limit ------------------------------------------------------------------------------ */

/* Steps in which nothing, inputs or derivatives change in turn; the last values are those after
 * them. */
static void run(fmi2Component c, double h, double limit, struct fmu_values *values) {
    const fmi2ValueReference f2 = RP_MANIPULATOR_f2;
    const fmi2Integer first = 1;
    const double slope = 3.0;
    for (int i = 0; i < 60; i++) {
        if (i % 10 > 5) {
            fmu_set(c, RP_MANIPULATOR_tau1, i % 7);
        }
        if (i % 10 > 7) {
            ASSERT_OK(fmu.SetRealInputDerivatives(c, &f2, 1, &first, &slope));
        }
        ASSERT_OK(fmu.DoStep(c, i * h, h, fmi2True));
        TEST_ASSERT_TRUE(fmu_get(c, RP_MANIPULATOR_solver_last_step) <= limit * (1.0 + 1e-9));
    }
    ASSERT_OK(fmu_get_all(c, values));
}

static fmi2Component limited(double limit) {
    const fmi2Component c = fmu_instantiate(&messages, false);
    fmu_set_integer(c, RP_MANIPULATOR_solver_method, method);
    fmu_set(c, RP_MANIPULATOR_max_step, limit);
    fmu_initialize(c, 0.0, 1e-4);
    return c;
}

EACH_METHOD static void test_no_internal_step_is_longer_than_the_limit(void) {
    static const double limits[] = {1e-4, 1e-3, 0.01, 0.05};
    static const double lengths[] = {1.0 / 128.0, 0.25};
    struct fmu_values values;
    for (size_t i = 0; i < FMU_COUNT(limits) * FMU_COUNT(lengths); i++) {
        const double limit = limits[i / FMU_COUNT(lengths)];
        const double h = lengths[i % FMU_COUNT(lengths)];
        const fmi2Component c = limited(limit);
        run(c, h, limit, &values);
        TEST_ASSERT_TRUE(fmu_get_integer(c, RP_MANIPULATOR_solver_steps) * limit >=
                         60.0 * h * (1.0 - 1e-9));
        fmu_free(c);
    }
}

EACH_METHOD static void test_no_limit_and_one_that_is_not_reached_change_nothing(void) {
    struct fmu_values expected;
    struct fmu_values values;
    const fmi2Component plain = fmu_instantiate(&messages, false);
    fmu_set_integer(plain, RP_MANIPULATOR_solver_method, method);
    fmu_initialize(plain, 0.0, 1e-4);
    run(plain, 0.25, INFINITY, &expected);

    const fmi2Component unset = fmu_instantiate(&messages, false);
    fmu_set_integer(unset, RP_MANIPULATOR_solver_method, method);
    fmu_set(unset, RP_MANIPULATOR_max_step, 0.01);
    fmu_set(unset, RP_MANIPULATOR_max_step, 0.0);
    fmu_initialize(unset, 0.0, 1e-4);
    run(unset, 0.25, INFINITY, &values);
    fmu_assert_same_values(&expected, &values, "a limit taken back");

    const fmi2Component wide = limited(1e6);
    run(wide, 0.25, INFINITY, &values);
    for (size_t i = 0; i < fmu_variable_count; i++) {
        if (fmu_variables[i].reference == RP_MANIPULATOR_max_step) {
            values.reals[i] = 0.0;
        }
    }
    fmu_assert_same_values(&expected, &values, "a limit of 1e6 s");
}

/* A limit so short that a step cannot end. */
EACH_METHOD static void test_a_limit_that_is_too_short_is_told(void) {
    static const double limits[] = {1e-7, 1e-20, 1e-300, 5e-324};
    for (size_t i = 0; i < FMU_COUNT(limits); i++) {
        const fmi2Component c = limited(limits[i]);
        fmu_log_clear(&messages);
        ASSERT_DISCARD(fmu.DoStep(c, 0.0, 1.0, fmi2True));
        TEST_ASSERT_GREATER_THAN_UINT(0, messages.count[fmi2Discard]);
        TEST_ASSERT_TRUE(fmu_get(c, RP_MANIPULATOR_time) < 1.0);
        TEST_ASSERT_TRUE(isfinite(fmu_get(c, RP_MANIPULATOR_q1)));
        fmu_assert_reset_is_fresh(c, "after a limit that is too short");
        fmu_free(c);
    }
}
