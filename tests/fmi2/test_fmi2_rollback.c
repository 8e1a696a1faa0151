/* Rollback to a saved state is exact to the bit and leaves no trace, wherever and however often it
 * happens. FMI 2.0, section 2.1.8. */
#include "each_method.h"
#include "fmu_harness.h"
#include "fmu_sequences.h"

#include <stdio.h>
#include <unity.h>

static struct fmu_sequence sequence;
static struct fmu_trace expected;

/* The trace of a run that saves nothing. */
static void run_plainly(unsigned seed) {
    fmu_sequence_make(&sequence, seed);
    const fmi2Component c = fmu_instantiate(&messages, false);
    fmu_sequence_run(c, &sequence, &expected);
    fmu_free(c);
}

/* ---- Going back ----------------------------------------------------------------------------- */

struct saved {
    size_t at; /* the operation that comes next */
    fmi2FMUstate state;
};

enum { SAVED_CAPACITY = 4 };

/* A run that goes back and forth in a sequence. */
struct run {
    fmi2Component component;
    size_t at; /* the operation that comes next */
    struct saved saved[SAVED_CAPACITY];
    size_t saved_count;
    struct fmu_random random;
};

static void save(struct run *run) {
    size_t slot = run->saved_count;
    if (slot == SAVED_CAPACITY) {
        slot = fmu_random_below(&run->random, SAVED_CAPACITY); // reuses the memory of its handle
    } else {
        run->saved[slot].state = NULL;
        run->saved_count++;
    }
    run->saved[slot].at = run->at;
    ASSERT_OK(fmu.GetFMUstate(run->component, &run->saved[slot].state));
}

static void restore(struct run *run, const struct saved *saved) {
    fmu_restore(run->component, saved->state);
    run->at = saved->at;
}

static void replace_by_copy(struct run *run, struct saved *saved) {
    struct fmu_bytes bytes = fmu_serialize(run->component, saved->state);
    fmu_forget(run->component, &saved->state);
    saved->state = fmu_deserialize(run->component, &bytes);
    fmu_bytes_free(&bytes);
}

/* Goes on in another instance, which may have been used for something else. */
static void move_to_other_instance(struct run *run) {
    static struct fmu_run other_run;
    struct fmu_bytes bytes = fmu_save_bytes(run->component);
    fmu_free(run->component);
    run->saved_count = 0;
    run->component = fmu_instantiate(&messages, false);
    if (fmu_random_below(&run->random, 2) == 0) {
        ASSERT_OK(fmu_run(run->component, 7, &other_run));
    }
    fmu_restore_bytes(run->component, &bytes);
    fmu_bytes_free(&bytes);
}

/* Takes a detour of random calls, which may fail, and restores the state. */
static void make_detour(struct run *run) {
    static struct fmu_run other_run;
    fmi2FMUstate state = fmu_save(run->component);
    double time = sequence.end;
    for (size_t at = run->at; at < sequence.count; at++) {
        if (sequence.operations[at].kind == FMU_STEP) {
            time = sequence.operations[at].point;
            break;
        }
    }
    const unsigned length = fmu_random_below(&run->random, 6);
    for (unsigned i = 0; i < length; i++) {
        const struct fmu_operation operation = fmu_random_operation(&run->random, &time);
        (void)fmu_apply(run->component, &operation);
    }
    switch (fmu_random_below(&run->random, 6)) {
    case 0:
        (void)fmu.Terminate(run->component);
        break;
    case 1:
        ASSERT_ERROR(fmu.CancelStep(run->component));
        break;
    case 2:
        ASSERT_OK(fmu.Reset(run->component));
        (void)fmu_run(run->component, 3, &other_run);
        break;
    default:
        break;
    }
    fmu_restore(run->component, state);
    fmu_forget(run->component, &state);
}

static void do_something(struct run *run) {
    struct saved *any =
        run->saved_count > 0
            ? &run->saved[fmu_random_below(&run->random, (unsigned)run->saved_count)]
            : NULL;
    switch (fmu_random_below(&run->random, 8)) {
    case 0:
    case 1:
    case 2:
        save(run);
        break;
    case 3:
    case 4:
        if (any != NULL) {
            restore(run, any);
        }
        break;
    case 5:
        if (any != NULL) {
            replace_by_copy(run, any);
        }
        break;
    case 6:
        move_to_other_instance(run);
        break;
    default:
        make_detour(run);
        break;
    }
}

static void run_with_rollbacks(unsigned seed) {
    char text[64];
    snprintf(text, sizeof text, "with rollbacks, seed %u", seed);
    struct run run = {
        .component = fmu_instantiate(&messages, false),
        .random = {.state = ~(uint64_t)seed},
    };
    int left = 24; // of what may be done: the run ends
    while (run.at < expected.count) {
        while (left > 0 && fmu_random_below(&run.random, 3) == 0) {
            do_something(&run);
            left--;
        }
        fmu_sequence_check(run.component, &sequence, run.at, &expected, text);
        run.at++;
    }
    fmu_free(run.component);
}

static void test_rollback_is_exact_in_random_sequences(void) {
    unsigned operations = 0;
    unsigned failed = 0;
    for (unsigned seed = 0; seed < 1000; seed++) {
        run_plainly(seed);
        run_with_rollbacks(seed);
        operations += (unsigned)expected.count;
        failed += expected.statuses[expected.count - 1] != fmi2OK;
    }
    // the sequences are what they are meant to be
    TEST_ASSERT_GREATER_THAN_UINT(40000, operations);
    TEST_ASSERT_GREATER_THAN_UINT(20, failed);
    TEST_ASSERT_LESS_THAN_UINT(120, failed);
}

/* The integrator's counters too are those of the state, where a step takes no internal step at all:
 * the first slope of the new input overflows. */
EACH_METHOD static void test_rollback_is_exact_where_the_first_slope_fails(void) {
    struct fmu_values outcomes[2];
    for (int with_detour = 0; with_detour < 2; with_detour++) {
        const fmi2Component c = fmu_initialized_with(method, &messages, 0.0);
        ASSERT_OK(fmu.DoStep(c, 0.0, 0.125, fmi2True));
        fmi2FMUstate state = fmu_save(c);
        if (with_detour) {
            fmu_set(c, RP_MANIPULATOR_f2, 30.0);
            ASSERT_OK(fmu.DoStep(c, 0.125, 3.0, fmi2True));
            fmu_restore(c, state);
        }
        fmu_set(c, RP_MANIPULATOR_tau1, 1.7e308);
        ASSERT_DISCARD(fmu.DoStep(c, 0.125, 0.125, fmi2True));
        (void)fmu_get_all(c, &outcomes[with_detour]); // accelerations are not finite
        fmu_free(c);
    }
    fmu_assert_same_values(&outcomes[0], &outcomes[1], "after a first slope that is not finite");
}

/* ---- Long holds ----------------------------------------------------------------------------- */

/* Many internal steps, enough for restarts without any change of a value. */
static void assert_long(fmi2Component c) {
    TEST_ASSERT_GREATER_THAN_INT(method == FMU_TAYLOR ? 300 : 5000,
                                 fmu_get_integer(c, RP_MANIPULATOR_solver_steps));
    TEST_ASSERT_GREATER_THAN_INT(3, fmu_get_integer(c, RP_MANIPULATOR_solver_restarts));
}

/* Single steps of thousands of internal steps each, repeated after a detour. */
EACH_METHOD static void test_rollback_is_exact_over_steps_of_many_internal_steps(void) {
    const double length = 20.0;
    struct fmu_values first;
    struct fmu_values again;
    const fmi2Component c = fmu_lasting(method, &messages);
    const fmi2Component saving = fmu_lasting(method, &messages);
    for (int i = 0; i < 4; i++) {
        fmi2FMUstate state = fmu_save(saving);
        ASSERT_OK(fmu.DoStep(c, i * length, length, fmi2True));
        ASSERT_OK(fmu_get_all(c, &first));
        for (int repeat = 0; repeat < 2; repeat++) {
            fmu_restore(saving, state);
            ASSERT_OK(fmu.DoStep(saving, i * length, 1.0, fmi2True));
            fmu_restore(saving, state);
            ASSERT_OK(fmu.DoStep(saving, i * length, length, fmi2True));
            ASSERT_OK(fmu_get_all(saving, &again));
            fmu_assert_same_values(&first, &again, "a step of 20 s");
        }
    }
    assert_long(c);
}
