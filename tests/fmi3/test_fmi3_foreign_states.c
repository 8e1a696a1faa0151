/* Serialized states of another version of FMI, or of an instance of another kind, are refused, and
 * the message says what they are. */
#include "fmu3_harness.h"

#include <unity.h>

enum kind { MODEL_EXCHANGE, CO_SIMULATION, CO_SIMULATION_WITH_EVENTS, KINDS };

static fmi2Type type_of(enum kind kind) {
    return kind == MODEL_EXCHANGE ? fmi2ModelExchange : fmi2CoSimulation;
}

static fmi2Component instantiate(enum kind kind) {
    fmu_fmi3_options.event_mode = kind == CO_SIMULATION_WITH_EVENTS;
    const fmi2Component c = fmu_instantiate_as(type_of(kind), &messages, false);
    fmu_fmi3_options.event_mode = false;
    return c;
}

static void assert_refused(const struct fmu_functions *by, fmi2Component c,
                           const struct fmu_bytes *bytes, const char *words) {
    fmi2FMUstate made = NULL;
    fmu_log_clear(&messages);
    ASSERT_ERROR(by->DeSerializeFMUstate(c, bytes->data, bytes->size, &made));
    TEST_ASSERT_NULL(made);
    TEST_ASSERT_EQUAL_UINT(1, messages.count[fmi2Error]);
    fmu_assert_logged(&messages, words);
}

static void test_states_of_the_other_version_are_refused(void) {
    static struct fmu_functions fmu2;
    const fmi2CallbackFunctions callbacks = fmu_callbacks(&messages);
    TEST_ASSERT_NOT_NULL(fmu_library_open(FMU2_LIBRARY, &fmu2));
    for (enum kind kind = MODEL_EXCHANGE; kind < KINDS; kind++) {
        fmi2FMUstate state = NULL;
        struct fmu_bytes of_2 = {0};
        struct fmu_bytes of_3 = fmu_save_bytes(instantiate(kind));
        const fmi2Component c = fmu2.Instantiate("m", type_of(kind), RP_MANIPULATOR_GUID, "",
                                                 &callbacks, fmi2False, fmi2False);
        ASSERT_OK(fmu2.GetFMUstate(c, &state));
        ASSERT_OK(fmu2.SerializedFMUstateSize(c, state, &of_2.size));
        struct fmu_bytes room = {0};
        of_2 = fmu_bytes_copy(&room, of_2.size);
        ASSERT_OK(fmu2.SerializeFMUstate(c, state, of_2.data, of_2.size));
        for (enum kind to = MODEL_EXCHANGE; to < KINDS; to++) {
            assert_refused(&fmu, instantiate(to), &of_2,
                           "it is one of FMI 2, the instance of FMI 3");
        }
        assert_refused(&fmu2, c, &of_3, "it is one of FMI 3, the instance of FMI 2");
        fmu2.FreeInstance(c);
        fmu_bytes_free(&of_2);
        fmu_bytes_free(&of_3);
    }
}

static void test_states_of_other_kinds_are_refused(void) {
    static const char *const names[] = {"an instance for Model Exchange",
                                        "an instance for Co-Simulation cannot",
                                        "an instance for Co-Simulation with event mode"};
    for (enum kind from = MODEL_EXCHANGE; from < KINDS; from++) {
        struct fmu_bytes bytes = fmu_save_bytes(instantiate(from));
        for (enum kind to = MODEL_EXCHANGE; to < KINDS; to++) {
            if (to != from) {
                assert_refused(&fmu, instantiate(to), &bytes, names[to]);
            }
        }
        fmu_bytes_free(&bytes);
    }
}
