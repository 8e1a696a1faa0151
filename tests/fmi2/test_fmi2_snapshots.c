/* FMU states: their contents in each state of an instance, their owner and who frees them, and the
 * bytes that they are in other instances. FMI 2.0, section 2.1.8. That rollback is exact:
 * test_fmi2_rollback.c; other processes: tests/platforms. */
#include "each_method.h"
#include "fmi_states.h"
#include "fmu_harness.h"

#include <math.h>
#include <string.h>
#include <unity.h>

static const fmi2Type types[] = {fmi2CoSimulation, fmi2ModelExchange};

static void step(fmi2Component c, double time) {
    ASSERT_OK(fmu.DoStep(c, time, 0.125, fmi2True));
}

/* ---- Every state ---------------------------------------------------------------------------- */

static void get_all_where_allowed(fmi2Component c, const struct fmi_state *state,
                                  struct fmu_values *values) {
    memset(values, 0, sizeof *values);
    if (state->letter != 'I') {
        ASSERT_OK(fmu_get_all(c, values));
    }
}

static void go_elsewhere(fmi2Type type, fmi2Component c, int where) {
    static struct fmu_run run;
    switch (where) {
    case 0:
        ASSERT_OK(fmu.Reset(c));
        break;
    case 1:
        ASSERT_ERROR(fmu.CancelStep(c));
        break;
    default:
        ASSERT_OK(fmu.Reset(c));
        ASSERT_OK(fmu_run_as(type, c, 5, &run));
        break;
    }
}

static void assert_restored(fmi2Component c, const struct fmi_state *state,
                            const struct fmu_values *expected, const char *text) {
    struct fmu_values values;
    get_all_where_allowed(c, state, &values);
    fmu_assert_same_values(expected, &values, text);
    fmu_assert_in_state(c, state, 0.0, &messages, text);
}

static void check_state(fmi2Type type, const struct fmi_state *state) {
    for (int where = 0; where < 3; where++) {
        struct fmu_values expected;
        const fmi2Component c = fmu_reach(type, state, &messages);
        get_all_where_allowed(c, state, &expected);
        fmi2FMUstate saved = fmu_save(c);
        struct fmu_bytes bytes = fmu_serialize(c, saved);

        go_elsewhere(type, c, where);
        fmu_restore(c, saved);
        assert_restored(c, state, &expected, state->name);

        const fmi2Component other = fmu_instantiate_as(type, &messages, false);
        go_elsewhere(type, other, where);
        fmu_restore_bytes(other, &bytes);
        assert_restored(other, state, &expected, state->name);
        fmu_bytes_free(&bytes);
        fmu_free(c);
        fmu_free(other);
    }
}

static void test_every_state_is_restored(void) {
    for (size_t t = 0; t < FMU_COUNT(types); t++) {
        for (size_t i = 0; i < fmi_states_of(types[t])->count; i++) {
            check_state(types[t], &fmi_states_of(types[t])->states[i]);
        }
    }
}

/* The status of a failed step is part of the state. */
static void test_the_time_of_a_failed_step_is_restored(void) {
    fmu_only_in(2, "in FMI 3.0 a failed step leaves the instance as it was");
    double reached = -1.0;
    double restored = -1.0;
    const struct fmi_state *failed = fmi_state_of(fmi2CoSimulation, 'F');
    const fmi2Component c = fmu_reach(fmi2CoSimulation, failed, &messages);
    ASSERT_OK(fmu.GetRealStatus(c, fmi2LastSuccessfulTime, &reached));
    fmi2FMUstate saved = fmu_save(c);
    ASSERT_OK(fmu.Reset(c));
    fmu_restore(c, saved);
    ASSERT_OK(fmu.GetRealStatus(c, fmi2LastSuccessfulTime, &restored));
    TEST_ASSERT_EQUAL_DOUBLE(reached, restored);
    ASSERT_ERROR(fmu.DoStep(c, reached, 0.1, fmi2True));
}

static fmi2Component with_few_internal_steps(void) {
    const fmi2Component c = fmu_instantiate(&messages, false);
    fmu_set_integer(c, RP_MANIPULATOR_solver_method, method);
    fmu_set_integer(c, RP_MANIPULATOR_max_internal_steps, method == FMU_TAYLOR ? 5 : 60);
    fmu_initialize(c, 0.0, 0.0);
    return c;
}

/* An instance with enough internal steps gets here in one step. */
static void assert_on_the_way(fmi2Component c) {
    double x[FMU_STATES];
    double expected[FMU_STATES];
    const double reached = fmu_get(c, RP_MANIPULATOR_time);
    const fmi2Component other = fmu_initialized_with(method, &messages, 0.0);
    TEST_ASSERT_TRUE(fmu_version == 3 ? reached == 0.0 : reached > 0.0);
    if (reached > 0.0) {
        ASSERT_OK(fmu.DoStep(other, 0.0, reached, fmi2True));
    }
    fmu_get_states(c, x);
    fmu_get_states(other, expected);
    for (int i = 0; i < FMU_STATES; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-7 * (1.0 + fabs(expected[i])), expected[i], x[i]);
    }
    fmu_free(other);
}

/* A step that fails ends in a state of the motion. It is undone and repeated in halves, with the
 * bits of an instance that has not tried it: section 4.2.2. */
EACH_METHOD static void test_a_failed_step_is_repeated_in_smaller_ones(void) {
    struct fmu_values values;
    struct fmu_values expected;
    const fmi2Component c = with_few_internal_steps();
    const fmi2Component other = with_few_internal_steps();
    fmi2FMUstate saved = fmu_save(c);
    double length = 64.0;
    while (fmu.DoStep(c, 0.0, length, fmi2True) != fmi2OK) {
        assert_on_the_way(c);
        fmu_restore(c, saved);
        length /= 2.0;
        TEST_ASSERT_TRUE(length > 1e-3);
    }
    TEST_ASSERT_TRUE(length < 64.0);
    TEST_ASSERT_TRUE(fmu_get(c, RP_MANIPULATOR_time) == length);
    ASSERT_OK(fmu.DoStep(other, 0.0, length, fmi2True));
    ASSERT_OK(fmu_get_all(c, &values));
    ASSERT_OK(fmu_get_all(other, &expected));
    fmu_assert_same_values(&expected, &values, "after steps that failed");
}

/* ---- Handles -------------------------------------------------------------------------------- */

EACH_METHOD static void test_get_into_a_handle_reuses_it(void) {
    const fmi2Component c = fmu_initialized_with(method, &messages, 0.0);
    fmi2FMUstate state = fmu_save(c);
    const fmi2FMUstate first = state;
    step(c, 0.0);
    const double q1 = fmu_get(c, RP_MANIPULATOR_q1);
    ASSERT_OK(fmu.GetFMUstate(c, &state));
    TEST_ASSERT_EQUAL_PTR(first, state);
    step(c, 0.125);
    fmu_restore(c, state);
    TEST_ASSERT_TRUE(q1 == fmu_get(c, RP_MANIPULATOR_q1));
}

/* Every function that takes a handle, by one signature. */
static const enum fmu_function handle_functions[] = {
    FMU_GetFMUstate,       FMU_SetFMUstate,  FMU_SerializedFMUstateSize,
    FMU_SerializeFMUstate, FMU_FreeFMUstate,
};

static fmi2Status call_with(enum fmu_function function, fmi2Component c, fmi2FMUstate *state) {
    fmi2Byte buffer[16384];
    size_t size = sizeof buffer;
    switch (function) {
    case FMU_GetFMUstate:
        return fmu.GetFMUstate(c, state);
    case FMU_SetFMUstate:
        return fmu.SetFMUstate(c, *state);
    case FMU_SerializedFMUstateSize:
        return fmu.SerializedFMUstateSize(c, *state, &size);
    case FMU_SerializeFMUstate:
        return fmu.SerializeFMUstate(c, *state, buffer, size);
    default:
        return fmu.FreeFMUstate(c, state);
    }
}

/* The handle is refused, the instance otherwise as it was. */
static void assert_handle_refused(enum fmu_function function, fmi2Component c, fmi2FMUstate state) {
    struct fmu_values before;
    struct fmu_values after;
    const char *name = fmu_name_of(function);
    fmi2FMUstate good = fmu_save(c);
    fmi2FMUstate given = state;
    ASSERT_OK(fmu_get_all(c, &before));
    fmu_log_clear(&messages);
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2Error, call_with(function, c, &given), name);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, messages.count[fmi2Error], name);
    TEST_ASSERT_EQUAL_PTR_MESSAGE(state, given, name);
    ASSERT_OK(fmu_get_all(c, &after));
    fmu_assert_same_values(&before, &after, name);
    fmu_assert_in_error(c);
    fmu_restore(c, good);
    fmu_forget(c, &good);
}

static void test_handles_of_others_are_refused(void) {
    for (size_t i = 0; i < FMU_COUNT(handle_functions); i++) {
        const fmi2Component owner = fmu_initialized(&messages, 0.0);
        const fmi2Component c = fmu_initialized(&messages, 0.0);
        fmi2FMUstate foreign = fmu_save(owner);
        assert_handle_refused(handle_functions[i], c, foreign);
        step(c, 0.0);
        step(owner, 0.0);
        fmu_restore(owner, foreign);
        step(owner, 0.0);
        fmu_free(c);
        fmu_free(owner);
    }
}

static void test_what_is_no_handle_is_refused(void) {
    for (size_t i = 0; i < FMU_COUNT(handle_functions); i++) {
        const fmi2Component c = fmu_initialized(&messages, 0.0);
        fmi2FMUstate kept = fmu_save(c); // or the memory of the next would be used again
        fmi2FMUstate saved = fmu_save(c);
        const fmi2FMUstate freed = saved;
        int nothing = 0;
        assert_handle_refused(handle_functions[i], c, &nothing);
        assert_handle_refused(handle_functions[i], c, c);
        fmu_forget(c, &saved);
        saved = freed;
        fmu_log_clear(&messages);
        ASSERT_ERROR(call_with(handle_functions[i], c, &saved));
        fmu_assert_in_error(c);
        fmu_restore(c, kept);
        step(c, 0.0);
        fmu_free(c);
    }
}

/* ---- Buffers -------------------------------------------------------------------------------- */

EACH_METHOD static void test_a_large_buffer_is_filled_as_far_as_needed(void) {
    const fmi2Component c = fmu_used(method, &messages);
    fmi2FMUstate state = fmu_save(c);
    struct fmu_bytes exact = fmu_serialize(c, state);
    struct fmu_bytes large = fmu_bytes_copy(&exact, exact.size + 64);
    memset(large.data, 0x55, large.size);
    ASSERT_OK(fmu.SerializeFMUstate(c, state, large.data, large.size));
    TEST_ASSERT_EQUAL_MEMORY(exact.data, large.data, exact.size);
    for (size_t i = exact.size; i < large.size; i++) {
        TEST_ASSERT_EQUAL_HEX8(0x55, large.data[i]);
    }
    fmu_bytes_free(&exact);
    fmu_bytes_free(&large);
}

EACH_METHOD static void test_a_small_buffer_is_refused(void) {
    const fmi2Component c = fmu_used(method, &messages);
    fmi2FMUstate state = fmu_save(c);
    struct fmu_bytes exact = fmu_serialize(c, state);
    for (size_t size = 0; size < exact.size; size++) {
        struct fmu_bytes small = fmu_bytes_copy(&exact, size);
        memset(small.data, 0x55, size);
        fmu_log_clear(&messages);
        ASSERT_ERROR(fmu.SerializeFMUstate(c, state, small.data, size));
        TEST_ASSERT_EQUAL_UINT(1, messages.count[fmi2Error]);
        for (size_t i = 0; i < size; i++) {
            TEST_ASSERT_EQUAL_HEX8(0x55, small.data[i]);
        }
        fmu_assert_in_error(c);
        fmu_restore(c, state);
        fmu_bytes_free(&small);
    }
    fmu_bytes_free(&exact);
}

/* ---- Kinds of instances --------------------------------------------------------------------- */

static void check_kind(fmi2Type from, fmi2Type to) {
    for (size_t i = 0; i < fmi_states_of(from)->count; i++) {
        const fmi2Component source = fmu_reach(from, &fmi_states_of(from)->states[i], &messages);
        struct fmu_bytes bytes = fmu_save_bytes(source);
        const fmi2Component c = fmu_reach(to, fmi_state_of(to, 'M'), &messages);
        fmi2FMUstate good = fmu_save(c);
        fmi2FMUstate made = NULL;
        const fmi2Status made_status = fmu.DeSerializeFMUstate(c, bytes.data, bytes.size, &made);
        const fmi2Status status = made_status == fmi2OK ? fmu.SetFMUstate(c, made) : made_status;
        ASSERT_ERROR(status);
        TEST_ASSERT_EQUAL_UINT(1, messages.count[fmi2Error]);
        fmu_assert_in_error(c);
        fmu_restore(c, good);
        ASSERT_OK(fmu.ExitInitializationMode(c));
        fmu_bytes_free(&bytes);
        fmu_free(source);
        fmu_free(c);
    }
}

static void test_states_of_the_other_kind_are_refused(void) {
    check_kind(fmi2CoSimulation, fmi2ModelExchange);
    check_kind(fmi2ModelExchange, fmi2CoSimulation);
}
