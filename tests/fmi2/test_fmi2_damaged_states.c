/* Serialized FMU states that are damaged, foreign or forged are refused, or at least do no harm.
 * FMI 2.0, section 2.1.8; src/instance/serialization.h defines the format of a serialized
 * state. */
#define _POSIX_C_SOURCE 200809L
#include "each_method.h"
#include "fmu_harness.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/time.h>
#include <unity.h>

/* Where the parts of a serialized state begin. */
enum {
    VERSION_AT = 8,
    LENGTH_AT = 12,
    GUID_LENGTH_AT = 16,
    GUID_AT = 20,
    FIELDS_AT = GUID_AT + sizeof RP_MANIPULATOR_GUID - 1,
    CHECKSUM_SIZE = 8
};

/* ---- Refused bytes -------------------------------------------------------------------------- */

/* The bytes are refused, and the instance continues as if they had not been given. */
static void assert_refused(fmi2Component c, fmi2FMUstate good, const struct fmu_bytes *bytes,
                           const char *message) {
    static struct fmu_values before;
    static struct fmu_values after;
    fmi2FMUstate made = NULL;
    ASSERT_OK(fmu_get_all(c, &before));
    fmu_log_clear(&messages);
    const fmi2Status status = fmu.DeSerializeFMUstate(c, bytes->data, bytes->size, &made);
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2Error, status, message);
    TEST_ASSERT_NULL_MESSAGE(made, message);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, messages.count[fmi2Error], message);
    ASSERT_OK(fmu_get_all(c, &after));
    fmu_assert_same_values(&before, &after, message);
    fmu_assert_in_error(c);
    fmu_restore(c, good);
}

/* What is said of a part that is damaged. */
static const char *fault_at(size_t i) {
    return i < VERSION_AT       ? "not a saved state"
           : i < LENGTH_AT      ? "version"
           : i < GUID_LENGTH_AT ? "length"
           : i < FIELDS_AT      ? "GUID"
                                : "checksum";
}

static void check_damaged(fmi2Component c, fmi2FMUstate good, const struct fmu_bytes *bytes) {
    static const fmi2Byte masks[] = {(fmi2Byte)0xff, 0x01, (fmi2Byte)0x80};
    for (size_t i = 0; i < bytes->size; i++) {
        char text[64];
        snprintf(text, sizeof text, "byte %zu flipped", i);
        struct fmu_bytes damaged = fmu_bytes_copy(bytes, bytes->size);
        damaged.data[i] = (fmi2Byte)(damaged.data[i] ^ masks[i % FMU_COUNT(masks)]);
        assert_refused(c, good, &damaged, text);
        fmu_assert_logged(&messages, fault_at(i));
        fmu_bytes_free(&damaged);
    }
}

static void check_truncated(fmi2Component c, fmi2FMUstate good, const struct fmu_bytes *bytes) {
    for (size_t size = 0; size < bytes->size; size++) {
        char text[64];
        snprintf(text, sizeof text, "truncated to %zu", size);
        struct fmu_bytes truncated = fmu_bytes_copy(bytes, size);
        assert_refused(c, good, &truncated, text);
        fmu_assert_logged(&messages, size < GUID_AT     ? "cut off"
                                     : size < FIELDS_AT ? "GUID"
                                                        : "length");
        fmu_bytes_free(&truncated);
    }
}

static void check_trailing(fmi2Component c, fmi2FMUstate good, const struct fmu_bytes *bytes) {
    static const size_t more[] = {1, 7, 8, 4096};
    for (size_t i = 0; i < FMU_COUNT(more); i++) {
        struct fmu_bytes longer = fmu_bytes_copy(bytes, bytes->size + more[i]);
        assert_refused(c, good, &longer, "trailing bytes");
        fmu_bytes_free(&longer);
    }
}

/* ---- Valid checksums ------------------------------------------------------------------------ */

/* FNV-1a over all but the checksum itself: src/instance/serialization.h. */
static void set_checksum(struct fmu_bytes *bytes) {
    uint64_t hash = 0xcbf29ce484222325u;
    for (size_t i = 0; i < bytes->size - CHECKSUM_SIZE; i++) {
        hash = (hash ^ (uint8_t)bytes->data[i]) * 0x100000001b3u;
    }
    for (size_t i = 0; i < CHECKSUM_SIZE; i++) {
        bytes->data[bytes->size - CHECKSUM_SIZE + i] = (fmi2Byte)(hash >> (8 * i));
    }
}

static void test_the_form_is_the_documented_one(void) {
    static const char guid[] = RP_MANIPULATOR_GUID;
    struct fmu_bytes bytes = fmu_save_bytes(fmu_used(FMU_CVODE_ADAMS, &messages));
    const uint8_t *data = (const uint8_t *)bytes.data;
    const size_t length = data[LENGTH_AT] + 256u * data[LENGTH_AT + 1];
    TEST_ASSERT_EQUAL_MEMORY("COSIMSTA", data, VERSION_AT);
    TEST_ASSERT_EQUAL_MEMORY("\3\0\0\0", data + VERSION_AT, 4);
    TEST_ASSERT_EQUAL_UINT(bytes.size, length);
    TEST_ASSERT_EQUAL_UINT(sizeof guid - 1, data[GUID_LENGTH_AT]);
    TEST_ASSERT_EQUAL_MEMORY(guid, data + GUID_AT, sizeof guid - 1);

    struct fmu_bytes again = fmu_bytes_copy(&bytes, bytes.size);
    set_checksum(&again);
    fmu_assert_same_bytes(&bytes, &again, "checksum");
    fmu_bytes_free(&again);
    fmu_bytes_free(&bytes);
}

static void check_foreign(fmi2Component c, fmi2FMUstate good, const struct fmu_bytes *bytes) {
    static const struct {
        size_t at;
        fmi2Byte value;
    } cases[] = {
        {0, 'X'},
        {VERSION_AT, 2},
        {VERSION_AT, 4},
        {VERSION_AT + 3, 1},
        {LENGTH_AT, 0},
        {LENGTH_AT + 3, 1},
        {GUID_LENGTH_AT, 37},
        {GUID_LENGTH_AT + 3, (fmi2Byte)0xff},
        {GUID_AT + 1, 'x'},
    };
    for (size_t i = 0; i < FMU_COUNT(cases); i++) {
        char text[64];
        snprintf(text, sizeof text, "byte %zu is %d", cases[i].at, cases[i].value);
        struct fmu_bytes foreign = fmu_bytes_copy(bytes, bytes->size);
        foreign.data[cases[i].at] = cases[i].value;
        set_checksum(&foreign);
        assert_refused(c, good, &foreign, text);
        fmu_assert_logged(&messages, fault_at(cases[i].at));
        fmu_bytes_free(&foreign);
    }
}

/* Bytes of a used instance, whose next step is unaffected. */
static void test_damaged_and_foreign_bytes_are_refused(void) {
    struct fmu_values expected;
    struct fmu_values values;
    fmu_used_step(fmu_used(FMU_CVODE_ADAMS, &messages), &expected);
    const fmi2Component c = fmu_used(FMU_CVODE_ADAMS, &messages);
    fmi2FMUstate good = fmu_save(c);
    struct fmu_bytes bytes = fmu_serialize(c, good);
    check_damaged(c, good, &bytes);
    check_truncated(c, good, &bytes);
    check_trailing(c, good, &bytes);
    check_foreign(c, good, &bytes);
    fmu_used_step(c, &values);
    fmu_assert_same_values(&expected, &values, "after refused bytes");
    fmu_bytes_free(&bytes);
    fmu_assert_reset_is_fresh(c, "after refused bytes");
}

/* Everything that can be done with a restored state. */
static void use_restored(fmi2Component c) {
    static struct fmu_values values;
    const fmi2ValueReference time_reference = RP_MANIPULATOR_time;
    const fmi2ValueReference ddq2 = RP_MANIPULATOR_ddq2;
    const fmi2ValueReference f2 = RP_MANIPULATOR_f2;
    const fmi2Integer order = 2;
    double time = 0.0;
    double value = 1.0;
    (void)fmu.GetReal(c, &time_reference, 1, &time);
    for (int i = 0; i < 3; i++) {
        (void)fmu.DoStep(c, time + i * 1e-3, 1e-3, fmi2True);
    }
    (void)fmu.GetRealOutputDerivatives(c, &ddq2, 1, &order, &value);
    (void)fmu.GetDirectionalDerivative(c, &ddq2, 1, &f2, 1, &value, &value);
    (void)fmu_get_all(c, &values);
    for (size_t i = 0; i < fmu_variable_count; i++) {
        TEST_ASSERT_TRUE(isfinite(values.reals[i]));
    }
}

/* Whether the state was accepted. */
static bool try_forged(const struct fmu_bytes *forged, bool checks_reset, const char *message) {
    fmi2FMUstate made = NULL;
    const fmi2Component c = fmu_instantiate(&messages, false);
    const fmi2Status status = fmu.DeSerializeFMUstate(c, forged->data, forged->size, &made);
    TEST_ASSERT_TRUE_MESSAGE(status == fmi2OK || status == fmi2Error, message);
    if (status == fmi2OK) {
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu.SetFMUstate(c, made), message);
        use_restored(c);
    }
    if (status == fmi2OK && checks_reset) { // after a refusal: check_refused
        fmu_assert_reset_is_fresh(c, message);
    }
    fmu_free(c);
    return status == fmi2OK;
}

/* Replaces each field in turn by values of all kinds. */
static void forge(fmi2Component c) {
    static const uint64_t fields[] = {
        0,
        1,
        3,
        0x80000000u,         // 2^31
        0xffffffffffffffffu, // -1 or NaN
        0x7fffffffffffffffu, // the largest integer, or NaN
        0x8000000000000000u, // the smallest integer, or -0.0
        0x7ff0000000000000u, // infinity
        0x7fe0000000000000u, // about 1e308
        0xffe0000000000000u, // and its negative
        0x7e37e43c8800759cu, // 1e300
        0x01a56e1fc2f8f359u, // 1e-300
        0xbff0000000000000u, // -1.0
    };
    struct fmu_bytes bytes = fmu_save_bytes(c);
    for (size_t at = FIELDS_AT; at + CHECKSUM_SIZE < bytes.size; at += 8) {
        bool is_reset = false; // once after this field
        for (size_t i = 0; i < FMU_COUNT(fields); i++) {
            char text[64];
            snprintf(text, sizeof text, "field at %zu, value %zu", at, i);
            struct fmu_bytes forged = fmu_bytes_copy(&bytes, bytes.size);
            for (size_t k = 0; k < 8; k++) {
                forged.data[at + k] = (fmi2Byte)(fields[i] >> (8 * k));
            }
            set_checksum(&forged);
            is_reset |= try_forged(&forged, !is_reset, text);
            fmu_bytes_free(&forged);
        }
    }
    fmu_bytes_free(&bytes);
}

/* Whatever a state with a valid checksum holds: no crash, no hang, and no value that is not finite.
 */
EACH_METHOD static void test_forged_states_do_no_harm(void) {
    // s of the processor: ends the program where one hangs
    struct itimerval limit = {0};
    limit.it_value.tv_sec = 100;
    TEST_ASSERT_EQUAL_INT(0, setitimer(ITIMER_PROF, &limit, NULL));
    if (method == FMU_CVODE_ADAMS) { // what it has besides a history is the same with each method
        forge(fmu_used(method, &messages));
    }
    const fmi2Component held =
        fmu_initialized_with(method, &messages, 0.0); // the integrator continues
    ASSERT_OK(fmu.DoStep(held, 0.0, 0.125, fmi2True));
    ASSERT_OK(fmu.DoStep(held, 0.125, 0.125, fmi2True));
    forge(held);
    limit.it_value.tv_sec = 0;
    TEST_ASSERT_EQUAL_INT(0, setitimer(ITIMER_PROF, &limit, NULL));
}

/* Continuous time belongs to Model Exchange: no state of Co-Simulation fits that phase. What else
 * contradicts itself: tests/instance/test_plausibility.c. */
static void test_a_phase_of_the_other_kind_is_refused(void) {
    enum { CONTINUOUS_TIME = 3 }; // enum phase, the second field
    const fmi2Component c = fmu_instantiate(&messages, false);
    struct fmu_bytes bytes = fmu_save_bytes(c);
    bytes.data[FIELDS_AT + 8] = CONTINUOUS_TIME;
    fmi2FMUstate made = NULL;
    set_checksum(&bytes);
    ASSERT_ERROR(fmu.DeSerializeFMUstate(c, bytes.data, bytes.size, &made));
    TEST_ASSERT_NULL(made);
    fmu_assert_logged(&messages, "Co-Simulation");
    fmu_bytes_free(&bytes);
}
