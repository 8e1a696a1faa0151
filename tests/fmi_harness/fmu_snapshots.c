#include "fmu_snapshots.h"

#include <stdlib.h>
#include <string.h>
#include <unity.h>

fmi2FMUstate fmu_save(fmi2Component component) {
    fmi2FMUstate state = NULL;
    ASSERT_OK(fmu.GetFMUstate(component, &state));
    TEST_ASSERT_NOT_NULL(state);
    return state;
}

void fmu_restore(fmi2Component component, fmi2FMUstate state) {
    ASSERT_OK(fmu.SetFMUstate(component, state));
}

void fmu_forget(fmi2Component component, fmi2FMUstate *state) {
    ASSERT_OK(fmu.FreeFMUstate(component, state));
    TEST_ASSERT_NULL(*state);
}

struct fmu_bytes fmu_serialize(fmi2Component component, fmi2FMUstate state) {
    struct fmu_bytes bytes = {0};
    ASSERT_OK(fmu.SerializedFMUstateSize(component, state, &bytes.size));
    TEST_ASSERT_GREATER_THAN_UINT(0, bytes.size);
    bytes.data = malloc(bytes.size); // not cleared: every byte is to be written
    TEST_ASSERT_NOT_NULL(bytes.data);
    ASSERT_OK(fmu.SerializeFMUstate(component, state, bytes.data, bytes.size));
    return bytes;
}

fmi2FMUstate fmu_deserialize(fmi2Component component, const struct fmu_bytes *bytes) {
    fmi2FMUstate state = NULL;
    ASSERT_OK(fmu.DeSerializeFMUstate(component, bytes->data, bytes->size, &state));
    TEST_ASSERT_NOT_NULL(state);
    return state;
}

void fmu_bytes_free(struct fmu_bytes *bytes) {
    free(bytes->data);
    *bytes = (struct fmu_bytes){0};
}

struct fmu_bytes fmu_bytes_copy(const struct fmu_bytes *bytes, size_t size) {
    struct fmu_bytes copy = {.data = malloc(size > 0 ? size : 1), .size = size};
    TEST_ASSERT_NOT_NULL(copy.data);
    memset(copy.data, 0, size);
    memcpy(copy.data, bytes->data, size < bytes->size ? size : bytes->size);
    return copy;
}

void fmu_assert_same_bytes(const struct fmu_bytes *expected, const struct fmu_bytes *actual,
                           const char *message) {
    TEST_ASSERT_EQUAL_UINT_MESSAGE(expected->size, actual->size, message);
    TEST_ASSERT_EQUAL_MEMORY_MESSAGE(expected->data, actual->data, expected->size, message);
}

struct fmu_bytes fmu_save_bytes(fmi2Component component) {
    fmi2FMUstate state = fmu_save(component);
    const struct fmu_bytes bytes = fmu_serialize(component, state);
    fmu_forget(component, &state);
    return bytes;
}

void fmu_restore_bytes(fmi2Component component, const struct fmu_bytes *bytes) {
    fmi2FMUstate state = fmu_deserialize(component, bytes);
    fmu_restore(component, state);
    fmu_forget(component, &state);
}

/* ---- An instance to save -------------------------------------------------------------------- */

static const double used_until = 0.625; /* s */

fmi2Component fmu_used(fmi2Integer method, struct fmu_log *log) {
    const fmi2Integer order = 2;
    const fmi2ValueReference f2 = RP_MANIPULATOR_f2;
    const double slope = 3.0;
    const fmi2Component c = fmu_instantiate(log, false);
    fmu_set_integer(c, RP_MANIPULATOR_solver_method, method);
    fmu_set(c, RP_MANIPULATOR_max_step, 0.03125);
    fmu_set(c, RP_MANIPULATOR_q1, 0.25);
    fmu_set(c, RP_MANIPULATOR_m1, 1.5);
    fmu_initialize(c, 0.5, 1e-7);
    fmu_set(c, RP_MANIPULATOR_tau1, -2.0);
    ASSERT_OK(fmu.DoStep(c, 0.5, 0.0625, fmi2True));
    ASSERT_OK(fmu.DoStep(c, 0.5625, 0.0625, fmi2True));
    fmu_set(c, RP_MANIPULATOR_g, 5.0);
    ASSERT_OK(fmu.SetRealInputDerivatives(c, &f2, 1, &order, &slope));
    return c;
}

void fmu_used_step(fmi2Component component, struct fmu_values *values) {
    ASSERT_OK(fmu.DoStep(component, used_until, 0.25, fmi2True));
    ASSERT_OK(fmu_get_all(component, values));
}
