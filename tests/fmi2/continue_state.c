/* The other process of test_fmi2_snapshots.c: continue_state FROM TO restores the serialized
 * state in a file and steps on; writes the values, and the state before the step, serialized again,
 * to another file. */
#include "fmu_harness.h"

#include <stdio.h>
#include <unity.h>

static const char *from;
static const char *to;

static void continue_from_file(void) {
    static fmi2Byte data[65536];
    struct fmu_values values;
    FILE *file = fopen(from, "rb");
    TEST_ASSERT_NOT_NULL(file);
    const struct fmu_bytes bytes = {.data = data, .size = fread(data, 1, sizeof data, file)};
    fclose(file);

    const fmi2Component c = fmu_instantiate(&messages, false);
    fmu_restore_bytes(c, &bytes);
    struct fmu_bytes again = fmu_save_bytes(c);
    fmu_used_step(c, &values);
    file = fopen(to, "wb");
    TEST_ASSERT_NOT_NULL(file);
    TEST_ASSERT_EQUAL_UINT(1, fwrite(&values, sizeof values, 1, file));
    TEST_ASSERT_EQUAL_UINT(again.size, fwrite(again.data, 1, again.size, file));
    TEST_ASSERT_EQUAL_INT(0, fclose(file));
    fmu_bytes_free(&again);
}

int main(int argc, char **argv) {
    if (argc != 3) {
        fprintf(stderr, "usage: %s FROM TO\n", argv[0]);
        return 2;
    }
    from = argv[1];
    to = argv[2];
    suiteSetUp();
    UNITY_BEGIN();
    RUN_TEST(continue_from_file);
    return UNITY_END();
}
