/* Every allocation of the FMU fails in turn, alone or with all later ones: a clean error, nothing
 * lost, nothing printed, and an instance that can be freed, reset or restored. Only fmi2Instantiate
 * and what makes a new FMU state allocate. */
#include "allocator.h"
#include "captured_stderr.h"
#include "fmu_harness.h"

#include <stdio.h>
#include <string.h>
#include <unity.h>

/* ---- Subjects ------------------------------------------------------------------------------- */

/* A kind of instance with a method of the solver. */
struct subject {
    fmi2Type kind;
    fmi2Integer method;
    bool has_logger;
};

enum { METHODS = 3, MIDDLE = 5 /* step of the run that faults happen after */ };

static struct fmu_run expected[2][METHODS + 1]; /* by kind and method */
static struct fmu_run actual;
static char about[200];
static unsigned faults;

static fmi2Component instantiate(const struct subject *subject) {
    fmi2CallbackFunctions callbacks = fmu_callbacks(&messages);
    callbacks.logger = subject->has_logger ? callbacks.logger : NULL;
    return fmu.Instantiate("manipulator", subject->kind, RP_MANIPULATOR_GUID, "", &callbacks,
                           fmi2False, fmi2False);
}

/* To initialization mode, all values set. */
static void enter_initialization(fmi2Component c, fmi2Integer method) {
    const fmi2ValueReference integer = RP_MANIPULATOR_solver_method;
    const fmi2ValueReference references[] = {RP_MANIPULATOR_q1, RP_MANIPULATOR_q2,
                                             RP_MANIPULATOR_dq1, RP_MANIPULATOR_m2};
    const double values[] = {0.3, 0.1, -0.5, 1.5};
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu.SetReal(c, references, 4, values), about);
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu.SetInteger(c, &integer, 1, &method), about);
    TEST_ASSERT_EQUAL_INT_MESSAGE(
        fmi2OK, fmu.SetupExperiment(c, fmi2False, 0.0, 0.5, fmi2False, 0.0), about);
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu.EnterInitializationMode(c), about);
}

static void begin_stepping(fmi2Component c, const struct subject *subject) {
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu.ExitInitializationMode(c), about);
    if (subject->kind == fmi2ModelExchange) {
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu.EnterContinuousTimeMode(c), about);
    }
}

static void run_steps(fmi2Component c, const struct subject *subject, unsigned from, unsigned to) {
    for (unsigned i = from; i < to; i++) {
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu_run_step(subject->kind, c, i, &actual), about);
    }
}

static void assert_rest_of_run(fmi2Component c, const struct subject *subject, unsigned from) {
    const struct fmu_run *fresh = &expected[subject->kind][subject->method];
    run_steps(c, subject, from, FMU_RUN_STEPS);
    for (unsigned i = from; i < FMU_RUN_STEPS; i++) {
        fmu_assert_same_values(&fresh->after[i], &actual.after[i], about);
    }
}

static void assert_reset_is_fresh(fmi2Component c, const struct subject *subject) {
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu.Reset(c), about);
    enter_initialization(c, subject->method);
    begin_stepping(c, subject);
    assert_rest_of_run(c, subject, 0);
}

/* In the middle of its run. */
static fmi2Component running(const struct subject *subject) {
    const fmi2Component c = instantiate(subject);
    TEST_ASSERT_NOT_NULL_MESSAGE(c, about);
    enter_initialization(c, subject->method);
    begin_stepping(c, subject);
    run_steps(c, subject, 0, MIDDLE);
    return c;
}

/* ---- Faults --------------------------------------------------------------------------------- */

static void begin_fault(const struct subject *subject, const char *what, long number,
                        enum allocator_fault fault) {
    snprintf(about, sizeof about, "%s, kind %d, method %d, allocation %ld%s", what,
             (int)subject->kind, subject->method, number, fault == ALLOCATOR_ALL ? " on" : "");
    fmu_log_clear(&messages);
    allocator_fail(number, fault);
}

/* Whether an allocation failed. Then the call has to say so, and otherwise it has to succeed. */
static bool end_fault(const struct subject *subject, bool succeeded) {
    const long failed = allocator_stop();
    faults += failed > 0;
    TEST_ASSERT_EQUAL_INT_MESSAGE(failed == 0, succeeded, about);
    if (failed > 0 && subject->has_logger) {
        fmu_assert_logged(&messages, "out of memory");
        TEST_ASSERT_GREATER_THAN_UINT_MESSAGE(0, messages.count[fmi2Error], about);
    }
    return failed > 0;
}

/* Makes one call in which this allocation fails, and checks the instance. Returns whether there was
 * such an allocation. */
typedef bool trial_function(const struct subject *subject, long number, enum allocator_fault fault);

/* Number 1, 2, ... until the call needs no more. Nothing may be left, nothing printed. */
static void fail_in_turn_of(trial_function *trial, const struct subject *subject, long at_least) {
    for (int fault = ALLOCATOR_ONE; fault <= ALLOCATOR_ALL; fault++) {
        long number = 0;
        bool has_failed = true;
        while (has_failed) {
            const long before = allocator_outstanding();
            has_failed = trial(subject, ++number, (enum allocator_fault)fault);
            TEST_ASSERT_EQUAL_INT_MESSAGE(before, allocator_outstanding(), about);
            TEST_ASSERT_EQUAL_UINT_MESSAGE(0, messages.malformed, about);
        }
        TEST_ASSERT_GREATER_THAN_INT_MESSAGE(at_least, number, about);
    }
}

static void fail_in_turn(trial_function *trial, long at_least) {
    for (int kind = fmi2ModelExchange; kind <= fmi2CoSimulation; kind++) {
        for (int method = 1; method <= METHODS; method++) {
            for (int logger = 0; logger < 2; logger++) {
                const struct subject subject = {(fmi2Type)kind, method, logger != 0};
                fail_in_turn_of(trial, &subject, at_least);
            }
        }
    }
}

/* ---- Trials --------------------------------------------------------------------------------- */

static bool try_instantiate(const struct subject *subject, long number,
                            enum allocator_fault fault) {
    begin_fault(subject, "fmi2Instantiate", number, fault);
    const fmi2Component c = instantiate(subject);
    const bool has_failed = end_fault(subject, c != NULL);
    if (c != NULL) {
        assert_reset_is_fresh(c, subject);
        fmu.FreeInstance(c);
    }
    return has_failed;
}

static void test_instantiate(void) {
    fail_in_turn(try_instantiate, 5);
}

/* After the error the instance continues from the state before; after a reset, from the start.
 */
static bool try_save(const struct subject *subject, long number, enum allocator_fault fault) {
    const fmi2Component c = running(subject);
    const fmi2FMUstate before = fmu_save(c);
    fmi2FMUstate state = NULL;
    begin_fault(subject, "fmi2GetFMUstate", number, fault);
    const fmi2Status status = fmu.GetFMUstate(c, &state);
    const bool has_failed = end_fault(subject, status == fmi2OK);
    TEST_ASSERT_TRUE_MESSAGE(has_failed == (state == NULL), about);
    fmu_restore(c, before);
    assert_rest_of_run(c, subject, MIDDLE);
    assert_reset_is_fresh(c, subject);
    fmu.FreeInstance(c);
    return has_failed;
}

static bool try_deserialize(const struct subject *subject, long number,
                            enum allocator_fault fault) {
    const fmi2Component c = running(subject);
    struct fmu_bytes bytes = fmu_save_bytes(c);
    const fmi2FMUstate before = fmu_save(c);
    fmi2FMUstate state = NULL;
    begin_fault(subject, "fmi2DeSerializeFMUstate", number, fault);
    const fmi2Status status = fmu.DeSerializeFMUstate(c, bytes.data, bytes.size, &state);
    const bool has_failed = end_fault(subject, status == fmi2OK);
    TEST_ASSERT_TRUE_MESSAGE(has_failed == (state == NULL), about);
    fmu_restore(c, has_failed ? before : state);
    assert_rest_of_run(c, subject, MIDDLE);
    assert_reset_is_fresh(c, subject);
    fmu_bytes_free(&bytes);
    fmu.FreeInstance(c);
    return has_failed;
}

static void test_snapshots(void) {
    fail_in_turn(try_save, 1);
    fail_in_turn(try_deserialize, 1);
}

/* ---- No memory at all ----------------------------------------------------------------------- */

/* Also initialization with a solver that the instance did not have before. */
static void test_the_rest_allocates_nothing(void) {
    for (int kind = fmi2ModelExchange; kind <= fmi2CoSimulation; kind++) {
        for (int method = 1; method <= METHODS; method++) {
            struct subject subject = {(fmi2Type)kind, method, true};
            const fmi2Component c = running(&subject);
            fmi2FMUstate states[] = {fmu_save(c), fmu_save(c)};
            struct fmu_bytes bytes = fmu_serialize(c, states[0]);
            begin_fault(&subject, "everything else", 1, ALLOCATOR_ALL);
            ASSERT_OK(fmu.GetFMUstate(c, &states[0]));
            ASSERT_OK(fmu.SerializeFMUstate(c, states[1], bytes.data, bytes.size));
            assert_rest_of_run(c, &subject, MIDDLE);
            fmu_forget(c, &states[0]);
            ASSERT_OK(fmu.Terminate(c));
            fmu_restore(c, states[1]);
            assert_rest_of_run(c, &subject, MIDDLE);
            ASSERT_ERROR(fmu.EnterInitializationMode(c));
            for (int i = 0; i <= METHODS; i++) { // and back to the first
                subject.method = (method + i) % METHODS + 1;
                assert_reset_is_fresh(c, &subject);
                assert_reset_is_fresh(c, &subject);
            }
            TEST_ASSERT_EQUAL_INT_MESSAGE(0, allocator_stop(), about);
            fmu.FreeInstance(c);
            fmu_bytes_free(&bytes);
        }
    }
}

/* ---- Begin and end of each test ------------------------------------------------------------- */

static void run_without_faults(void) {
    for (int kind = fmi2ModelExchange; kind <= fmi2CoSimulation; kind++) {
        for (int method = 1; method <= METHODS; method++) {
            const struct subject subject = {(fmi2Type)kind, method, true};
            const fmi2Component c = instantiate(&subject);
            enter_initialization(c, method);
            begin_stepping(c, &subject);
            run_steps(c, &subject, 0, FMU_RUN_STEPS);
            expected[kind][method] = actual;
            fmu.FreeInstance(c);
        }
    }
}

void suiteSetUp(void) {
    fmu_load();
}

void setUp(void) {
    fmu_log_clear(&messages);
    captured_stderr_begin();
    run_without_faults();
}

void tearDown(void) {
    (void)allocator_stop();
    TEST_ASSERT_EQUAL_STRING_MESSAGE("", captured_stderr_end(), about);
    fmu_tear_down(&messages);
}

int suiteTearDown(int failures) {
    printf("figures: allocation faults; executions %u; findings %d\n", faults, failures);
    return failures;
}
