#include "snapshot.h"

#include "derivatives.h"
#include "each_method.h"
#include "one_instance.h"
#include "oscillator_by_hand.h"
#include "serialization.h"

#include <stdlib.h>

static struct instance *started(void) {
    struct instance *made = created(&oscillator_description);
    const unsigned reference = OSCILLATOR_SOLVER_METHOD;
    ASSERT_OK(instance_set_integer(made, &reference, 1, &method));
    initialize_of(made, 0.0, 1000.0);
    return made;
}

void setUp(void) {
    instance = started();
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

static void step(struct instance *stepped, double h) {
    ASSERT_OK(instance_do_step(stepped, instance_time(stepped), h));
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

EACH_METHOD static void test_bytes_carry_a_state_to_another_instance(void) {
    struct instance *other = started();
    struct instance_snapshot *snapshot = NULL;
    struct instance_snapshot *copy = NULL;
    const size_t size = instance_serialized_size(instance);
    unsigned char *bytes = malloc(size);
    unsigned char *again = malloc(size);
    unsigned tag = 0;
    enum phase phase = PHASE_COUNT;
    set(OSCILLATOR_U, 0.5);
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
