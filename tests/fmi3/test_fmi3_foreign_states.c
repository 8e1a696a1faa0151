/* Serialized states of another version of FMI, or of an instance of another kind, are refused, and
 * the message says what they are. */
#include "fmu3_harness.h"
#include "fmu_library.h"

#include <stdlib.h>
#include <unity.h>

static struct fmu_functions fmu2;

static const struct fmu3_options with_events = {.event_mode = true};

enum kind { MODEL_EXCHANGE, CO_SIMULATION, CO_SIMULATION_WITH_EVENTS };

static fmi3Instance instantiate(enum kind kind) {
    return kind == MODEL_EXCHANGE
               ? fmu3_model_exchange(&importer)
               : fmu3_co_simulation(&importer,
                                    kind == CO_SIMULATION_WITH_EVENTS ? &with_events : NULL);
}

struct bytes {
    fmi3Byte data[16384];
    size_t size;
};

static void save_3(fmi3Instance c, struct bytes *bytes) {
    fmi3FMUState state = NULL;
    TEST_ASSERT_EQUAL_INT(fmi3OK, fmu3.GetFMUState(c, &state));
    TEST_ASSERT_EQUAL_INT(fmi3OK, fmu3.SerializedFMUStateSize(c, state, &bytes->size));
    TEST_ASSERT_TRUE(bytes->size <= sizeof bytes->data);
    TEST_ASSERT_EQUAL_INT(fmi3OK, fmu3.SerializeFMUState(c, state, bytes->data, bytes->size));
}

static void load_2(void) {
    static void *library;
    if (library == NULL) {
        library = fmu_library_open(FMU2_LIBRARY, &fmu2);
    }
    TEST_ASSERT_NOT_NULL(library);
}

static fmi2Component instantiate_2(fmi2Type type) {
    static const fmi2CallbackFunctions none = {0};
    const fmi2Component c =
        fmu2.Instantiate("m", type, RP_MANIPULATOR_GUID, "", &none, fmi2False, fmi2False);
    TEST_ASSERT_NOT_NULL(c);
    return c;
}

static void save_2(fmi2Component c, struct bytes *bytes) {
    fmi2FMUstate state = NULL;
    TEST_ASSERT_EQUAL_INT(fmi2OK, fmu2.GetFMUstate(c, &state));
    TEST_ASSERT_EQUAL_INT(fmi2OK, fmu2.SerializedFMUstateSize(c, state, &bytes->size));
    TEST_ASSERT_TRUE(bytes->size <= sizeof bytes->data);
    TEST_ASSERT_EQUAL_INT(fmi2OK,
                          fmu2.SerializeFMUstate(c, state, (fmi2Byte *)bytes->data, bytes->size));
}

static void assert_refused_by_3(fmi3Instance c, const struct bytes *bytes, const char *words) {
    fmi3FMUState made = NULL;
    fmu3_clear_messages(&importer);
    TEST_ASSERT_EQUAL_INT(fmi3Error, fmu3.DeserializeFMUState(c, bytes->data, bytes->size, &made));
    TEST_ASSERT_NULL(made);
    TEST_ASSERT_EQUAL_UINT(1, importer.count[fmi3Error]);
    fmu3_assert_logged(&importer, words);
    TEST_ASSERT_EQUAL_INT(fmi3OK, fmu3.Reset(c));
}

static void test_states_of_fmi_2_are_refused(void) {
    static struct bytes bytes;
    load_2();
    for (int kind = 0; kind < 2; kind++) {
        const fmi2Component source =
            instantiate_2(kind == MODEL_EXCHANGE ? fmi2ModelExchange : fmi2CoSimulation);
        save_2(source, &bytes);
        for (enum kind to = MODEL_EXCHANGE; to <= CO_SIMULATION_WITH_EVENTS; to++) {
            assert_refused_by_3(instantiate(to), &bytes,
                                "it is one of FMI 2, the instance of FMI 3");
        }
        fmu2.FreeInstance(source);
    }
}

static void take_note(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status,
                      fmi2String category, fmi2String message, ...) {
    struct fmu3_importer *to = environment;
    to->count[status]++;
    for (size_t i = 0; i + 1 < sizeof to->texts && message[i] != '\0'; i++) {
        to->texts[i] = message[i];
        to->texts[i + 1] = '\0';
    }
}

static void test_states_of_fmi_3_are_refused_by_fmi_2(void) {
    static struct bytes bytes;
    load_2();
    for (enum kind kind = MODEL_EXCHANGE; kind <= CO_SIMULATION_WITH_EVENTS; kind++) {
        const fmi2CallbackFunctions callbacks = {.logger = take_note,
                                                 .componentEnvironment = &importer};
        fmi2FMUstate made = NULL;
        save_3(instantiate(kind), &bytes);
        const fmi2Component c =
            fmu2.Instantiate("m", kind == MODEL_EXCHANGE ? fmi2ModelExchange : fmi2CoSimulation,
                             RP_MANIPULATOR_GUID, "", &callbacks, fmi2False, fmi2False);
        fmu3_clear_messages(&importer);
        TEST_ASSERT_EQUAL_INT(fmi2Error, fmu2.DeSerializeFMUstate(c, (const fmi2Byte *)bytes.data,
                                                                  bytes.size, &made));
        TEST_ASSERT_NULL(made);
        fmu3_assert_logged(&importer, "it is one of FMI 3, the instance of FMI 2");
        fmu2.FreeInstance(c);
    }
}

static void test_states_of_other_kinds_are_refused(void) {
    static const char *const names[] = {"an instance for Model Exchange",
                                        "an instance for Co-Simulation cannot",
                                        "an instance for Co-Simulation with event mode"};
    static struct bytes bytes;
    for (enum kind from = MODEL_EXCHANGE; from <= CO_SIMULATION_WITH_EVENTS; from++) {
        save_3(instantiate(from), &bytes);
        for (enum kind to = MODEL_EXCHANGE; to <= CO_SIMULATION_WITH_EVENTS; to++) {
            if (to != from) {
                assert_refused_by_3(instantiate(to), &bytes, names[to]);
            }
        }
    }
}
