/* Serialized FMU states: always the same bytes, good in other instances and processes. FMI 2.0,
 * section 2.1.8. */
#define _POSIX_C_SOURCE 200809L
#include "each_method.h"
#include "fmu_harness.h"
#include "fmu_sequences.h"
#include "fmu_states.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include <unity.h>

/* ---- The same bytes ------------------------------------------------------------------------- */

EACH_METHOD static void test_a_state_is_always_the_same_bytes(void) {
    const fmi2Component c = fmu_used(method, &messages);
    fmi2FMUstate state = fmu_save(c);
    struct fmu_bytes first = fmu_serialize(c, state);
    struct fmu_bytes second = fmu_serialize(c, state);
    fmu_assert_same_bytes(&first, &second, "serialized twice");

    fmi2FMUstate copy = fmu_deserialize(c, &first);
    TEST_ASSERT_TRUE(copy != state);
    struct fmu_bytes third = fmu_serialize(c, copy);
    fmu_assert_same_bytes(&first, &third, "serialized, deserialized and serialized");

    struct fmu_values values;
    fmu_used_step(c, &values);
    fmu_restore(c, state);
    struct fmu_bytes fourth = fmu_save_bytes(c);
    fmu_assert_same_bytes(&first, &fourth, "saved after a rollback");
    fmu_bytes_free(&first);
    fmu_bytes_free(&second);
    fmu_bytes_free(&third);
    fmu_bytes_free(&fourth);
}

/* Nothing in them depends on where an instance lies in memory or what it did before. */
static void test_instances_in_the_same_state_give_the_same_bytes(void) {
    static struct fmu_sequence sequence;
    static struct fmu_trace trace;
    for (unsigned seed = 0; seed < 60; seed++) {
        fmu_sequence_make(&sequence, seed);
        const fmi2Component a = fmu_instantiate(&messages, false);
        const fmi2Component b = fmu_instantiate(&messages, true);
        fmu_sequence_run(b, &sequence, &trace);
        ASSERT_OK(fmu.Reset(b));
        fmu_sequence_run(a, &sequence, &trace);
        fmu_sequence_run(b, &sequence, &trace);
        struct fmu_bytes from_a = fmu_save_bytes(a);
        struct fmu_bytes from_b = fmu_save_bytes(b);
        fmu_assert_same_bytes(&from_a, &from_b, "of two instances");
        fmu_bytes_free(&from_a);
        fmu_bytes_free(&from_b);
        fmu_free(a);
        fmu_free(b);
    }
}

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
    for (size_t i = 0; i < fmu_states_of(from)->count; i++) {
        const fmi2Component source = fmu_reach(from, &fmu_states_of(from)->states[i], &messages);
        struct fmu_bytes bytes = fmu_save_bytes(source);
        const fmi2Component c = fmu_reach(to, fmu_state_of(to, 'M'), &messages);
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

/* ---- Another process ------------------------------------------------------------------------ */

/* continue_state.c */
static void run_child(char *from, char *to) {
    fflush(NULL);
    const pid_t child = fork();
    TEST_ASSERT_TRUE(child >= 0);
    if (child == 0) {
        char *const arguments[] = {CONTINUE_STATE, from, to, NULL};
        execv(arguments[0], arguments);
        _exit(127);
    }
    int status = -1;
    TEST_ASSERT_TRUE(waitpid(child, &status, 0) == child);
    TEST_ASSERT_TRUE(WIFEXITED(status));
    TEST_ASSERT_EQUAL_INT(0, WEXITSTATUS(status));
}

EACH_METHOD static void test_another_process_goes_on_with_the_same_bits(void) {
    struct fmu_values expected;
    struct fmu_values values;
    char from[] = "fmu-state-XXXXXX";
    char to[] = "fmu-values-XXXXXX";
    const fmi2Component c = fmu_used(method, &messages);
    struct fmu_bytes bytes = fmu_save_bytes(c);
    FILE *file = fdopen(mkstemp(from), "wb");
    TEST_ASSERT_NOT_NULL(file);
    TEST_ASSERT_EQUAL_UINT(bytes.size, fwrite(bytes.data, 1, bytes.size, file));
    TEST_ASSERT_EQUAL_INT(0, fclose(file));
    close(mkstemp(to));

    run_child(from, to);
    file = fopen(to, "rb");
    TEST_ASSERT_NOT_NULL(file);
    struct fmu_bytes again = fmu_bytes_copy(&bytes, bytes.size);
    TEST_ASSERT_EQUAL_UINT(1, fread(&values, sizeof values, 1, file));
    TEST_ASSERT_EQUAL_UINT(again.size, fread(again.data, 1, again.size, file));
    fclose(file);
    remove(from);
    remove(to);

    fmu_used_step(c, &expected);
    fmu_assert_same_values(&expected, &values, "in another process");
    fmu_assert_same_bytes(&bytes, &again, "serialized in another process");
    fmu_bytes_free(&bytes);
    fmu_bytes_free(&again);
}
