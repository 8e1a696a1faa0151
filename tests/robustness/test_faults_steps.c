/* Steps that the FMU can do only in part, with each method of the solver: the internal steps run
 * out, or values overflow on the way. fmi2DoStep returns fmi2Discard at the last state that is
 * right. After a rollback, smaller steps give the same values as without the failed step. FMI 2.0
 * is cited by section. */
#include "captured_stderr.h"
#include "fmu_harness.h"
#include "fmu_snapshots.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

enum { METHODS = 3, MOST_STEPS = 400 };

static char about[120];
static unsigned discarded;

static const fmi2ValueReference set_first[] = {
    RP_MANIPULATOR_m2, RP_MANIPULATOR_l1,  RP_MANIPULATOR_a,  RP_MANIPULATOR_g,
    RP_MANIPULATOR_q2, RP_MANIPULATOR_dq1, RP_MANIPULATOR_dq2};

/* A run that one step cannot do. */
struct obstacle {
    const char *name;
    double values[FMU_COUNT(set_first)];
    double force_slope; /* N/s: f2 rises from 0; otherwise tau1 changes from step to step */
    fmi2Integer max_internal_steps;
    double length; /* s: of the step tried */
    double end;    /* s: which smaller steps reach */
    const char *message;
};

/* In the second the force overflows at 1.8 s; the mass is such that all else stays small. */
static const struct obstacle obstacles[] = {
    {"too many internal steps",
     {1.0, 0.5, 0.1, 9.81, 0.1, 2.0, 0.0},
     0.0,
     25,
     4.0,
     4.0,
     "all internal steps"},
    {"overflow", {1e308, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0}, 1e308, 100000, 3.0, 1.7, "not finite"},
};

static const double start = 2.0;

static void set_input(fmi2Component c, const struct obstacle *obstacle, double t, unsigned step) {
    const fmi2ValueReference f2 = RP_MANIPULATOR_f2;
    const fmi2Integer order = 1;
    if (obstacle->force_slope == 0.0) {
        fmu_set(c, RP_MANIPULATOR_tau1, 1.0 + step / 2 % 3);
        return;
    }
    fmu_set(c, f2, obstacle->force_slope * (t - start));
    ASSERT_OK(fmu.SetRealInputDerivatives(c, &f2, 1, &order, &obstacle->force_slope));
}

static fmi2Component begin(const struct obstacle *obstacle, fmi2Integer method, bool has_logger) {
    const fmi2ValueReference integers[] = {RP_MANIPULATOR_max_internal_steps,
                                           RP_MANIPULATOR_solver_method};
    const fmi2Integer settings[] = {obstacle->max_internal_steps, method};
    fmi2CallbackFunctions callbacks = fmu_callbacks(&messages);
    callbacks.logger = has_logger ? callbacks.logger : NULL;
    const fmi2Component c = fmu.Instantiate("manipulator", fmi2CoSimulation, RP_MANIPULATOR_GUID,
                                            "", &callbacks, fmi2False, fmi2False);
    TEST_ASSERT_NOT_NULL(c);
    ASSERT_OK(fmu.SetReal(c, set_first, FMU_COUNT(set_first), obstacle->values));
    ASSERT_OK(fmu.SetInteger(c, integers, 2, settings));
    fmu_initialize(c, start, 0.0);
    set_input(c, obstacle, start, 0);
    return c;
}

/* Section 4.2.3: where the step ended, and that the values are those of there. */
static double assert_discarded(fmi2Component c, double t, double h, const char *message) {
    double reached = NAN;
    fmi2Boolean terminated = fmi2True;
    discarded++;
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu.GetRealStatus(c, fmi2LastSuccessfulTime, &reached),
                                  about);
    // in FMI 3.0 the instance is where it was before the step
    TEST_ASSERT_TRUE_MESSAGE(fmu_version == 3 ? reached == t : reached >= t && reached < t + h,
                             about);
    TEST_ASSERT_TRUE_MESSAGE(reached == fmu_get(c, RP_MANIPULATOR_time), about);
    if (fmu_version == 2) {
        ASSERT_OK(fmu.GetBooleanStatus(c, fmi2Terminated, &terminated));
        TEST_ASSERT_EQUAL_INT(fmi2False, terminated);
    }
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, messages.count[fmi2Error], messages.texts);
    if (messages.count[fmi2Discard] > 0) { // there is a logger
        fmu_assert_logged(&messages, message);
    }
    return reached;
}

/* A step of this length at once ends where the other one gave up, or nearly. */
static void assert_is_state_at(fmi2Component c, const struct obstacle *obstacle, fmi2Integer method,
                               double reached) {
    double x[4];
    double expected[4];
    struct obstacle patient = *obstacle;
    patient.max_internal_steps = 100000;
    fmu_get_states(c, x);
    const fmi2Component other = begin(&patient, method, true);
    if (reached > start) {
        ASSERT_OK(fmu.DoStep(other, start, reached - start, fmi2True));
    }
    fmu_get_states(other, expected);
    for (int i = 0; i < 4; i++) {
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-7 * (1.0 + fabs(expected[i])), expected[i], x[i],
                                          about);
    }
    fmu.FreeInstance(other);
}

static void assert_same(fmi2Component c, fmi2Component other) {
    struct fmu_values values;
    struct fmu_values expected;
    const fmi2Status status = fmu_get_all(other, &expected);
    TEST_ASSERT_EQUAL_INT_MESSAGE(status, fmu_get_all(c, &values), about);
    fmu_assert_same_values(&expected, &values, about);
}

/* The step is halved until it succeeds, again and again to the end. Another instance takes only the
 * steps that succeeded. */
static void halve_to_the_end(fmi2Component c, fmi2Component other,
                             const struct obstacle *obstacle) {
    fmi2FMUstate state = NULL;
    double t = start;
    unsigned step = 0;
    while (t < start + obstacle->end && step < MOST_STEPS) {
        double h = fmin(obstacle->length, start + obstacle->end - t);
        set_input(c, obstacle, t, step);
        set_input(other, obstacle, t, step);
        ASSERT_OK(fmu.GetFMUstate(c, &state));
        fmu_log_clear(&messages);
        fmi2Status status = fmu.DoStep(c, t, h, fmi2False);
        while (status == fmi2Discard) {
            (void)assert_discarded(c, t, h, obstacle->message);
            if (fmu_version == 2) {
                fmu_restore(c, state);
            }
            h *= 0.5;
            fmu_log_clear(&messages);
            status = fmu.DoStep(c, t, h, fmi2False);
        }
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, status, about);
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu.DoStep(other, t, h, fmi2False), about);
        assert_same(c, other);
        t += h;
        step++;
    }
    TEST_ASSERT_TRUE_MESSAGE(t >= start + obstacle->end, about);
}

static void overcome(const struct obstacle *obstacle, fmi2Integer method, bool has_logger) {
    snprintf(about, sizeof about, "%s, method %d, logger %d", obstacle->name, method, has_logger);
    const fmi2Component c = begin(obstacle, method, has_logger);
    const fmi2Component other = begin(obstacle, method, has_logger);
    fmi2FMUstate state = fmu_save(c);
    fmu_log_clear(&messages);
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2Discard, fmu.DoStep(c, start, obstacle->length, fmi2True),
                                  about);
    TEST_ASSERT_TRUE_MESSAGE((messages.count[fmi2Discard] > 0) == has_logger, about);
    const double reached = assert_discarded(c, start, obstacle->length, obstacle->message);
    TEST_ASSERT_TRUE_MESSAGE(fmu_version == 3 || reached > start, about);
    assert_is_state_at(c, obstacle, method, reached);

    if (fmu_version == 2) {
        fmu_restore(c, state);
    }
    assert_same(c, other);
    halve_to_the_end(c, other, obstacle);
    fmu_assert_reset_is_fresh(c, about);
    fmu.FreeInstance(c);
    fmu.FreeInstance(other);
}

static void overcome_all(fmi2Integer method) {
    const size_t count = fmu_version == 2 ? FMU_COUNT(obstacles) : 1; // no slopes in FMI 3.0
    for (size_t i = 0; i < count; i++) {
        overcome(&obstacles[i], method, true);
        overcome(&obstacles[i], method, false);
    }
}

static void test_each_method(void) {
    for (fmi2Integer method = 1; method <= METHODS; method++) {
        overcome_all(method);
    }
}

void suiteSetUp(void) {
    fmu_load();
}

void setUp(void) {
    fmu_log_clear(&messages);
    captured_stderr_begin();
}

void tearDown(void) {
    TEST_ASSERT_EQUAL_STRING("", captured_stderr_end());
    fmu_tear_down(&messages);
}

int suiteTearDown(int failures) {
    printf("figures: step faults; executions %u; findings %d\n", discarded, failures);
    return failures;
}
