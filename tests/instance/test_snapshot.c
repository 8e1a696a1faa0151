#include "snapshot.h"

#include "derivatives.h"
#include "each_method.h"
#include "instance.h"
#include "last_text.h"
#include "oscillator_by_hand.h"
#include "serialization.h"
#include "stepping.h"
#include "values.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

static struct instance *instance;

static struct instance *started(void) {
    struct instance *created = NULL;
    const struct instance_experiment experiment = {.stop_time_defined = true, .stop_time = 1000.0};
    const unsigned reference = OSCILLATOR_SOLVER_METHOD;
    ASSERT_OK(instance_create(&oscillator_description, &last_text_sink, &created));
    ASSERT_OK(instance_set_integer(created, &reference, 1, &method));
    ASSERT_OK(instance_setup_experiment(created, &experiment));
    ASSERT_OK(instance_enter_initialization(created));
    ASSERT_OK(instance_exit_initialization(created));
    return created;
}

void setUp(void) {
    memset(last_text, 0, sizeof last_text);
    instance = started();
}

void tearDown(void) {
    instance_destroy(instance);
}

/* Everything that can be read, to be compared as bytes. */
struct readings {
    double reals[9];
    int integers[3];
};

static struct readings read(struct instance *from) {
    static const unsigned reals[] = {0, 1, 2, 10, 11, 20, 30, 82, 84};
    static const unsigned integers[] = {80, 81, 83};
    struct readings readings;
    memset(&readings, 0, sizeof readings);
    ASSERT_OK(instance_get_real(from, reals, 9, readings.reals));
    ASSERT_OK(instance_get_integer(from, integers, 3, readings.integers));
    return readings;
}

static void assert_equal(struct instance *expected, struct instance *actual) {
    const struct readings first = read(expected);
    const struct readings second = read(actual);
    TEST_ASSERT_EQUAL_MEMORY(&first, &second, sizeof first);
}

static void set(struct instance *to, unsigned reference, double value) {
    ASSERT_OK(instance_set_real(to, &reference, 1, &value));
}

static void step(struct instance *stepped, double h) {
    ASSERT_OK(instance_do_step(stepped, instance_time(stepped), h));
}

/* Inputs that change at every step, so that each restart relies on the step before. */
EACH_METHOD static void test_a_run_of_restarts_goes_on_bit_for_bit(void) {
    struct instance *other = started();
    struct instance_snapshot *snapshot = NULL;
    struct instance_snapshot *copy = NULL;
    unsigned char bytes[4096];
    const size_t size = instance_serialized_size(instance);
    TEST_ASSERT_TRUE(size <= sizeof bytes);
    for (int i = 0; i < 60; i++) {
        const double u = sin(0.3 * i);
        const double h = i % 7 == 0 ? 0.3 : 0.001;
        ASSERT_OK(instance_save(instance, 0, &snapshot));
        ASSERT_OK(instance_serialize(instance, snapshot, bytes, size));
        set(instance, OSCILLATOR_U, 3.0);
        step(instance, 0.1);
        if (i % 2 == 0) {
            ASSERT_OK(instance_restore(instance, snapshot));
            ASSERT_OK(instance_save(instance, 0, &snapshot)); // of a state that was only restored
            ASSERT_OK(instance_restore(instance, snapshot));
        } else {
            ASSERT_OK(instance_deserialize(instance, bytes, size, &copy));
            ASSERT_OK(instance_restore(instance, copy));
            ASSERT_OK(instance_forget(instance, &copy));
        }
        set(instance, OSCILLATOR_U, u);
        set(other, OSCILLATOR_U, u);
        step(instance, h);
        step(other, h);
        assert_equal(other, instance);
    }
    instance_destroy(other);
}

/* A snapshot from before initialization carries another method. */
EACH_METHOD static void test_a_state_of_another_method_can_be_restored(void) {
    struct instance *other = started();
    struct instance_snapshot *snapshot = NULL;
    struct instance_snapshot *copy = NULL;
    unsigned char bytes[4096];
    const size_t size = instance_serialized_size(instance);
    const int own_method = method;
    step(instance, 0.1);
    ASSERT_OK(instance_save(instance, 0, &snapshot));
    ASSERT_OK(instance_serialize(instance, snapshot, bytes, size));
    instance_destroy(other);
    method = method == INTEGRATOR_ERK ? INTEGRATOR_CVODE_ADAMS : INTEGRATOR_ERK;
    other = started();
    method = own_method;
    step(other, 0.2);
    ASSERT_OK(instance_deserialize(other, bytes, size, &copy));
    ASSERT_OK(instance_restore(other, copy));
    for (int i = 0; i < 10; i++) {
        step(instance, 0.1);
        step(other, 0.1);
        assert_equal(instance, other);
    }
    instance_destroy(other);
}

EACH_METHOD static void test_a_run_goes_on_from_its_history_bit_for_bit(void) {
    struct instance *other = started();
    struct instance_snapshot *snapshot = NULL;
    for (int i = 0; i < 137; i++) {
        step(instance, 0.01);
        step(other, 0.01);
    }
    ASSERT_OK(instance_save(instance, 7, &snapshot));
    set(instance, OSCILLATOR_U, 3.0);
    step(instance, 1.0);
    ASSERT_OK(instance_restore(instance, snapshot));
    assert_equal(other, instance);
    for (int i = 0; i < 50; i++) {
        step(instance, 0.013);
        step(other, 0.013);
        assert_equal(other, instance);
    }
    instance_destroy(other);
}

EACH_METHOD static void test_saving_at_every_step_changes_nothing(void) {
    struct instance *other = started();
    struct instance_snapshot *snapshot = NULL;
    for (int i = 0; i < 200; i++) {
        ASSERT_OK(instance_save(instance, 0, &snapshot));
        step(instance, 0.02);
        step(other, 0.02);
        assert_equal(other, instance);
    }
    instance_destroy(other);
}

/* Long enough for restarts without any change; wherever it is restored, they come at the same step.
 */
EACH_METHOD static void test_restarts_without_a_change_are_part_of_the_state(void) {
    struct instance *other = started();
    struct instance_snapshot *snapshot = NULL;
    for (int i = 0; i < 400; i++) {
        if (i % 17 == 0) {
            ASSERT_OK(instance_save(instance, 0, &snapshot));
            step(instance, 1.7);
            ASSERT_OK(instance_restore(instance, snapshot));
        }
        step(instance, 1.0);
        step(other, 1.0);
        assert_equal(other, instance);
    }
    const int64_t longest = integrator_longest_history((enum integrator_method)method, false);
    TEST_ASSERT_TRUE(read(instance).integers[0] > 3 * longest);
    instance_destroy(other);
}

EACH_METHOD static void test_bytes_carry_a_state_to_another_instance(void) {
    struct instance *other = started();
    struct instance_snapshot *snapshot = NULL;
    struct instance_snapshot *copy = NULL;
    const size_t size = instance_serialized_size(instance);
    unsigned char *bytes = malloc(size);
    unsigned char *again = malloc(size);
    unsigned tag = 0;
    enum phase phase = PHASE_COUNT;
    set(instance, OSCILLATOR_U, 0.5);
    for (int i = 0; i < 33; i++) {
        step(instance, 0.1);
    }
    ASSERT_OK(instance_save(instance, 42, &snapshot));
    ASSERT_OK(instance_serialize(instance, snapshot, bytes, size));

    ASSERT_OK(instance_deserialize(other, bytes, size, &copy));
    ASSERT_OK(instance_snapshot_tag(other, copy, &tag, &phase));
    TEST_ASSERT_EQUAL_UINT(42, tag);
    TEST_ASSERT_EQUAL_INT(PHASE_STEPPING, phase);
    ASSERT_OK(instance_restore(other, copy));
    ASSERT_OK(instance_serialize(other, copy, again, size));
    TEST_ASSERT_EQUAL_MEMORY(bytes, again, size);
    for (int i = 0; i < 20; i++) {
        assert_equal(instance, other);
        step(instance, 0.1);
        step(other, 0.1);
    }
    free(bytes);
    free(again);
    instance_destroy(other);
}

EACH_METHOD static void test_input_derivatives_are_part_of_the_state(void) {
    struct instance_snapshot *snapshot = NULL;
    const unsigned input = OSCILLATOR_U;
    const int order = 2;
    const double value = 4.0;
    ASSERT_OK(instance_set_input_derivatives(instance, &input, 1, &order, &value));
    ASSERT_OK(instance_save(instance, 0, &snapshot));
    step(instance, 0.5);
    const struct readings expected = read(instance);
    ASSERT_OK(instance_restore(instance, snapshot));
    step(instance, 0.5);
    const struct readings repeated = read(instance);
    TEST_ASSERT_EQUAL_MEMORY(&expected, &repeated, sizeof expected);
}

EACH_METHOD static void test_snapshots_of_others_are_refused(void) {
    struct instance *other = started();
    struct instance_snapshot *foreign = NULL;
    unsigned char bytes[4096];
    unsigned tag;
    enum phase phase;
    ASSERT_OK(instance_save(other, 0, &foreign));
    struct instance_snapshot *handle = foreign;
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT, instance_restore(instance, foreign));
    TEST_ASSERT_NOT_NULL(strstr(last_text, "belongs to another instance"));
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT, instance_save(instance, 0, &handle));
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT, instance_forget(instance, &handle));
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT,
                          instance_snapshot_tag(instance, foreign, &tag, &phase));
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT,
                          instance_serialize(instance, foreign, bytes, sizeof bytes));
    TEST_ASSERT_EQUAL_PTR(foreign, handle);
    instance_destroy(other);
}

EACH_METHOD static void test_a_snapshot_can_be_forgotten_in_any_order(void) {
    struct instance_snapshot *snapshots[5] = {NULL};
    static const int order[] = {2, 4, 0, 3, 1};
    for (int i = 0; i < 5; i++) {
        step(instance, 0.1);
        ASSERT_OK(instance_save(instance, (unsigned)i, &snapshots[i]));
    }
    for (int i = 0; i < 5; i++) {
        unsigned tag = 99;
        enum phase phase = PHASE_COUNT;
        ASSERT_OK(instance_snapshot_tag(instance, snapshots[order[i]], &tag, &phase));
        TEST_ASSERT_EQUAL_UINT(order[i], tag);
        ASSERT_OK(instance_forget(instance, &snapshots[order[i]]));
        TEST_ASSERT_NULL(snapshots[order[i]]);
    }
}

EACH_METHOD static void test_bytes_that_are_not_sound_are_refused(void) {
    struct instance_snapshot *snapshot = NULL;
    struct instance_snapshot *read_back = NULL;
    unsigned char bytes[4096];
    const size_t size = instance_serialized_size(instance);
    TEST_ASSERT_TRUE(size < sizeof bytes);
    ASSERT_OK(instance_save(instance, 0, &snapshot));
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT,
                          instance_serialize(instance, snapshot, bytes, size - 1));
    ASSERT_OK(instance_serialize(instance, snapshot, bytes, size));
    const struct readings before = read(instance);
    for (size_t i = 0; i < size; i++) {
        bytes[i] ^= 0x10;
        TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT,
                              instance_deserialize(instance, bytes, size, &read_back));
        bytes[i] ^= 0x10;
        TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT,
                              instance_deserialize(instance, bytes, i, &read_back));
    }
    const struct readings after = read(instance);
    TEST_ASSERT_EQUAL_MEMORY(&before, &after, sizeof before);
    TEST_ASSERT_NULL(read_back);
}
