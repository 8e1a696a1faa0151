/* What FMI 3.0 asks of every function: instances, messages, counts and types of values, event mode,
 * results of a step, adjoint derivatives, states of other versions and kinds. That adjoint
 * derivatives are the transposed directional ones: test_knowns.py. Sections 2.2.4, 2.2.6.2, 2.2.11,
 * 2.3.1 and 4.2. */
#include "fmu3_harness.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

/* ---- Instances ------------------------------------------------------------------------------ */

/* Called as fmi3LogMessageCallback. */
static void keep(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                 fmi3String message) {
    const fmi2CallbackFunctions callbacks = fmu_callbacks(&messages);
    callbacks.logger(&messages, "m", (fmi2Status)status, category, message);
}

/* What InstantiateCoSimulation returns; these variables are for intermediate updates. */
static fmi3Instance instantiate(const char *name, const char *token, bool logging_on,
                                const fmi3ValueReference required[], size_t count) {
    fmu_log_clear(&messages);
    return fmu3.InstantiateCoSimulation(name, token, NULL, false, logging_on, false, false,
                                        required, count, NULL, keep, NULL);
}

static void test_instantiate_says_what_it_refuses(void) {
    static const struct {
        const char *name, *token;
        const char *wrong, *expected; /* words of the message */
    } cases[] = {
        {NULL, RP_MANIPULATOR_TOKEN_FMI3, "name", "not empty"},
        {"", RP_MANIPULATOR_TOKEN_FMI3, "name", "not empty"},
        {"m", NULL, "token", RP_MANIPULATOR_TOKEN_FMI3},
        {"m", "{another}", "{another}", RP_MANIPULATOR_TOKEN_FMI3},
        {"m", RP_MANIPULATOR_GUID, RP_MANIPULATOR_GUID, RP_MANIPULATOR_TOKEN_FMI3},
        {"m", "{%s%n#}", "{%s%n##}", RP_MANIPULATOR_TOKEN_FMI3},
    };
    for (size_t i = 0; i < 2 * FMU_COUNT(cases); i++) {
        const char *name = cases[i / 2].name;
        const char *token = cases[i / 2].token;
        fmu_log_clear(&messages);
        TEST_ASSERT_NULL(
            i % 2 == 0 ? fmu3.InstantiateModelExchange(name, token, NULL, false, false, NULL, keep)
                       : instantiate(name, token, false, NULL, 0));
        TEST_ASSERT_EQUAL_UINT(1, messages.count[fmi3Error]);
        TEST_ASSERT_EQUAL_UINT(1, fmu_log_count(&messages, "logStatusError"));
        fmu_assert_logged(&messages, cases[i / 2].wrong);
        fmu_assert_logged(&messages, cases[i / 2].expected);
    }
}

static void test_scheduled_execution_is_refused(void) {
    TEST_ASSERT_NULL(fmu3.InstantiateScheduledExecution("m", RP_MANIPULATOR_TOKEN_FMI3, "", false,
                                                        false, NULL, keep, NULL, NULL, NULL));
    TEST_ASSERT_EQUAL_UINT(1, messages.count[fmi3Error]);
    fmu_assert_logged(&messages, "Co-Simulation");
}

/* Continuous inputs and outputs of the model, and nothing else, may be named for intermediate
 * updates. */
static void test_variables_of_intermediate_updates(void) {
    static const fmi3ValueReference good[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_q1,
                                              RP_MANIPULATOR_total_energy, RP_MANIPULATOR_tau1};
    static const fmi3ValueReference bad[] = {RP_MANIPULATOR_m1,
                                             RP_MANIPULATOR_time,
                                             RP_MANIPULATOR_D11,
                                             RP_MANIPULATOR_solver_steps,
                                             RP_MANIPULATOR_solver_last_step,
                                             9,
                                             9999,
                                             UINT32_MAX};
    const fmi3Instance made =
        instantiate("m", RP_MANIPULATOR_TOKEN_FMI3, false, good, FMU_COUNT(good));
    TEST_ASSERT_NOT_NULL(made);
    fmu3.FreeInstance(made);
    TEST_ASSERT_EQUAL_UINT(0, fmu_log_total(&messages));
    for (size_t i = 0; i < FMU_COUNT(bad); i++) {
        char number[16];
        const fmi3ValueReference mixed[] = {good[0], bad[i]};
        TEST_ASSERT_NULL(instantiate("m", RP_MANIPULATOR_TOKEN_FMI3, false, mixed, 2));
        snprintf(number, sizeof number, "%u", (unsigned)bad[i]);
        fmu_assert_logged(&messages, number);
        TEST_ASSERT_EQUAL_UINT(1, messages.count[fmi3Error]);
    }
    TEST_ASSERT_NULL(instantiate("m", RP_MANIPULATOR_TOKEN_FMI3, false, NULL, 2));
    fmu_assert_logged(&messages, "NULL");
}

static void test_callbacks_may_be_null(void) {
    const fmi3ValueReference tau1 = RP_MANIPULATOR_tau1;
    const fmi3Instance instance = fmu3.InstantiateCoSimulation(
        "m", RP_MANIPULATOR_TOKEN_FMI3, NULL, true, true, true, true, &tau1, 1, NULL, NULL, NULL);
    TEST_ASSERT_NOT_NULL(instance);
    fmu3_initialize(instance, 0.0);
    ASSERT_OK(fmu3.EnterStepMode(instance));
    fmu3_step(instance, 0.0, 0.1);
    ASSERT_ERROR(fmu3_try_set(instance, RP_MANIPULATOR_ddq1, 1.0));
    fmu3.FreeInstance(instance);
    TEST_ASSERT_NULL(fmu3.InstantiateModelExchange("", "", NULL, false, false, NULL, NULL));
    TEST_ASSERT_NULL(fmu3.InstantiateScheduledExecution("m", RP_MANIPULATOR_TOKEN_FMI3, "", false,
                                                        false, NULL, NULL, NULL, NULL, NULL));
}

/* ---- Messages ------------------------------------------------------------------------------- */

static void discard(fmi3Instance instance) {
    ASSERT_DISCARD(fmu3_try_set(instance, RP_MANIPULATOR_tau1, NAN));
}

static void fail(fmi3Instance instance) {
    ASSERT_ERROR(fmu3_try_set(instance, RP_MANIPULATOR_ddq1, 1.0));
    ASSERT_OK(fmu3.Reset(instance));
}

/* Section 2.3.1: with logging off errors are sent all the same, and nothing else. */
static void test_errors_cannot_be_silenced(void) {
    static const fmi3String events[] = {"logEvents"};
    const fmi3Instance quiet = instantiate("quiet", RP_MANIPULATOR_TOKEN_FMI3, false, NULL, 0);
    for (int round = 0; round < 3; round++) {
        if (round == 1) {
            ASSERT_OK(fmu3.SetDebugLogging(quiet, false, 0, NULL));
        } else if (round == 2) {
            static const fmi3String errors[] = {"logStatusError", "logStatusFatal"};
            ASSERT_OK(fmu3.SetDebugLogging(quiet, false, 2, errors));
        }
        fmu_log_clear(&messages);
        discard(quiet);
        fmu3_initialize(quiet, 0.0);
        TEST_ASSERT_EQUAL_UINT(0, fmu_log_total(&messages));
        fail(quiet);
        TEST_ASSERT_EQUAL_UINT(1, fmu_log_total(&messages));
        TEST_ASSERT_EQUAL_UINT(1, messages.count[fmi3Error]);
    }

    fmu3.FreeInstance(quiet);
    const fmi3Instance loud = instantiate("loud", RP_MANIPULATOR_TOKEN_FMI3, true, NULL, 0);
    fmu_log_clear(&messages);
    discard(loud);
    TEST_ASSERT_EQUAL_UINT(1, messages.count[fmi3Discard]);
    TEST_ASSERT_GREATER_THAN_UINT(0, messages.count[fmi3OK]); // the call
    ASSERT_OK(fmu3.SetDebugLogging(loud, true, 1, events));
    fmu_log_clear(&messages);
    discard(loud);
    TEST_ASSERT_EQUAL_UINT(0, fmu_log_total(&messages));
    fmu3_initialize(loud, 0.0);
    TEST_ASSERT_EQUAL_UINT(1, messages.count[fmi3OK]);
    TEST_ASSERT_EQUAL_UINT(1, fmu_log_count(&messages, "logEvents"));
    ASSERT_OK(fmu3.SetDebugLogging(loud, true, 0, NULL));
    discard(loud);
    TEST_ASSERT_EQUAL_UINT(1, messages.count[fmi3Discard]);
    fmu3.FreeInstance(loud);
}

/* Called as fmi3LogMessageCallback. */
static void free_instance(fmi3InstanceEnvironment environment, fmi3Status status,
                          fmi3String category, fmi3String message) {
    messages.count[status]++;
    fmu3.FreeInstance(importer.instance);
}

static void test_an_instance_is_not_freed_by_its_logger(void) {
    const fmi3Instance c = fmu3.InstantiateModelExchange("m", RP_MANIPULATOR_TOKEN_FMI3, NULL,
                                                         false, true, NULL, free_instance);
    importer.instance = c;
    fmu_log_clear(&messages);
    fmu3_initialize(c, 0.0);
    TEST_ASSERT_GREATER_THAN_UINT(1, messages.count[fmi3OK]);
    TEST_ASSERT_EQUAL_UINT(messages.count[fmi3OK], messages.count[fmi3Error]);
    importer.instance = NULL;
    fmu3.FreeInstance(c);
}

/* ---- Values --------------------------------------------------------------------------------- */

/* A new instance refuses the call, and says this. */
#define ASSERT_REFUSED(text, name, ...)                                                            \
    do {                                                                                           \
        const fmi3Instance c = fmu3_co_simulation(NULL);                                           \
        fmu3_initialize(c, 0.0);                                                                   \
        fmu_log_clear(&messages);                                                                  \
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi3Error, fmu3.name(c, __VA_ARGS__), #name);                \
        TEST_ASSERT_EQUAL_UINT_MESSAGE(1, messages.count[fmi3Error], #name);                       \
        fmu_assert_logged(&messages, text);                                                        \
        fmu3_free(c);                                                                              \
    } while (0)

/* nValues counts elements: all variables are scalars. */
static void test_counts_that_differ_are_errors(void) {
    static const size_t counts[] = {0, 1, 3, SIZE_MAX};
    static const char text[] = "2 are expected";
    const fmi3ValueReference of[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_f2};
    const fmi3Int32 orders[] = {1, 1};
    double values[] = {-1.0, -1.0, -1.0};
    fmi3Int32 integers[3] = {0};
    fmi3Int64 items[3] = {0};
    for (size_t i = 0; i < FMU_COUNT(counts); i++) {
        const size_t n = counts[i];
        ASSERT_REFUSED(text, GetFloat64, of, 2, values, n);
        ASSERT_REFUSED(text, SetFloat64, of, 2, values, n);
        ASSERT_REFUSED(text, GetInt32, of, 2, integers, n);
        ASSERT_REFUSED(text, GetInt64, of, 2, items, n);
        ASSERT_REFUSED(text, GetOutputDerivatives, of, 2, orders, values, n);
        ASSERT_REFUSED(text, GetDirectionalDerivative, of, 2, of, 2, values, n, values, 2);
        ASSERT_REFUSED(text, GetAdjointDerivative, of, 2, of, 2, values, 2, values, n);
        ASSERT_REFUSED(text, GetString, of, 2, NULL, n);
        TEST_ASSERT_TRUE(values[0] == -1.0);
    }
}

/* Integers and enumerations have functions of their own types. */
static void test_types(void) {
    const fmi3ValueReference method = RP_MANIPULATOR_solver_method;
    const fmi3ValueReference steps = RP_MANIPULATOR_max_internal_steps;
    fmi3Int32 integer = -1;
    fmi3Int64 item = -1;
    fmi3Instance c = fmu3_co_simulation(NULL);
    ASSERT_OK(fmu3.GetInt64(c, &method, 1, &item, 1));
    TEST_ASSERT_EQUAL_INT(1, item);
    ASSERT_OK(fmu3.GetInt32(c, &steps, 1, &integer, 1));
    TEST_ASSERT_EQUAL_INT(100000, integer);
    item = 3;
    ASSERT_OK(fmu3.SetInt64(c, &method, 1, &item, 1));
    item = 0;
    ASSERT_OK(fmu3.GetInt64(c, &method, 1, &item, 1));
    TEST_ASSERT_EQUAL_INT(3, item);

    static const fmi3Int64 no_items[] = {0, 5, -1, INT64_MAX, INT64_MIN, (INT64_C(1) << 32) + 1};
    for (size_t i = 0; i < FMU_COUNT(no_items); i++) {
        ASSERT_DISCARD(fmu3.SetInt64(c, &method, 1, &no_items[i], 1));
    }
    ASSERT_ERROR(fmu3.GetInt32(c, &method, 1, &integer, 1));
    fmu_assert_logged(&messages, "enumeration");
    c = fmu3_co_simulation(NULL);
    ASSERT_ERROR(fmu3.GetInt64(c, &steps, 1, &item, 1));
    fmu_assert_logged(&messages, "int32");
    c = fmu3_co_simulation(NULL);
    ASSERT_ERROR(fmu3.SetInt32(c, &method, 1, &integer, 1));
    c = fmu3_co_simulation(NULL);
    ASSERT_ERROR(fmu3.SetInt64(c, &steps, 1, &item, 1));
}

/* Some of the types that no variable has. */
static void test_types_without_variables(void) {
    static const char text[] = "value reference 10";
    const fmi3ValueReference q1 = RP_MANIPULATOR_q1;
    ASSERT_REFUSED(text, GetFloat32, &q1, 1, &(fmi3Float32){0}, 1);
    ASSERT_REFUSED(text, GetUInt64, &q1, 1, &(fmi3UInt64){0}, 1);
    ASSERT_REFUSED(text, GetBoolean, &q1, 1, &(fmi3Boolean){false}, 1);
    ASSERT_REFUSED(text, GetString, &q1, 1, &(fmi3String){NULL}, 1);
    ASSERT_REFUSED(text, SetBinary, &q1, 1, &(size_t){0}, &(fmi3Binary){NULL}, 1);
    ASSERT_REFUSED(text, SetInt8, &q1, 1, &(fmi3Int8){0}, 1);
}

/* Start values, and what was set, can be read before initialization. */
static void test_values_before_initialization(void) {
    const fmi3Instance c = fmu3_co_simulation(NULL);
    TEST_ASSERT_TRUE(fmu3_get(c, RP_MANIPULATOR_m1) == 2.0);
    fmu3_set(c, RP_MANIPULATOR_q2, 0.25);
    TEST_ASSERT_TRUE(fmu3_get(c, RP_MANIPULATOR_q2) == 0.25);
    TEST_ASSERT_TRUE(fmu3_get(c, RP_MANIPULATOR_ee_x) == 0.75);
}

/* ---- Event mode ----------------------------------------------------------------------------- */

static void update_discrete_states(fmi3Instance c) {
    bool flags[] = {true, true, true, true, true};
    double next = -1.0;
    ASSERT_OK(
        fmu3.UpdateDiscreteStates(c, &flags[0], &flags[1], &flags[2], &flags[3], &flags[4], &next));
    for (size_t i = 0; i < FMU_COUNT(flags); i++) {
        TEST_ASSERT_FALSE(flags[i]);
    }
    TEST_ASSERT_TRUE(next != -1.0);
}

/* An input that jumps in event mode does what it does between steps. */
static void test_inputs_may_jump_in_event_mode(void) {
    static const struct fmu3_options events = {.event_mode = true};
    double x[2][FMU_STATES];
    for (int with_events = 0; with_events < 2; with_events++) {
        const fmi3Instance c = fmu3_co_simulation(with_events ? &events : NULL);
        fmu3_initialize(c, 0.0);
        if (with_events) {
            update_discrete_states(c);
            ASSERT_OK(fmu3.EnterStepMode(c));
        }
        for (int i = 0; i < 20; i++) {
            if (i % 4 == 1 && with_events) {
                ASSERT_OK(fmu3.EnterEventMode(c));
            }
            if (i % 4 == 1) {
                fmu3_set(c, RP_MANIPULATOR_tau1, i - 7.0);
                fmu3_set(c, RP_MANIPULATOR_m2, 1.0 + 0.1 * i);
            }
            if (i % 4 == 1 && with_events) {
                update_discrete_states(c);
                ASSERT_OK(fmu3.EnterStepMode(c));
            }
            fmu3_step(c, 0.05 * i, 0.05);
        }
        fmu3_get_states(c, x[with_events]);
    }
    TEST_ASSERT_EQUAL_MEMORY(x[0], x[1], sizeof x[0]);
}

static void test_results_of_an_event_need_a_place(void) {
    static const struct fmu3_options events = {.event_mode = true};
    for (int missing = 0; missing < 6; missing++) {
        bool flags[5];
        bool *places[5];
        double next;
        for (int i = 0; i < 5; i++) {
            places[i] = i == missing ? NULL : &flags[i];
        }
        const fmi3Instance c = fmu3_co_simulation(&events);
        fmu3_initialize(c, 0.0);
        ASSERT_ERROR(fmu3.UpdateDiscreteStates(c, places[0], places[1], places[2], places[3],
                                               places[4], missing == 5 ? NULL : &next));
        fmu_assert_logged(&messages, "NULL");
        fmu3_free(c);
    }
}

/* ---- Steps ---------------------------------------------------------------------------------- */

static void test_results_of_a_step_need_a_place(void) {
    for (int missing = 0; missing < 4; missing++) {
        bool flags[3];
        double reached;
        const fmi3Instance c = fmu3_co_simulation(NULL);
        fmu3_initialize(c, 0.0);
        ASSERT_ERROR(fmu3.DoStep(c, 0.0, 0.1, true, missing == 0 ? NULL : &flags[0],
                                 missing == 1 ? NULL : &flags[1], missing == 2 ? NULL : &flags[2],
                                 missing == 3 ? NULL : &reached));
        fmu_assert_logged(&messages, "NULL");
        fmu3_free(c);
    }
}

/* ---- Adjoint derivatives -------------------------------------------------------------------- */

/* Of parameters, too, before the first step; a known that is listed twice is answered twice. */
static void test_adjoint_derivatives_by_parameters_and_repeated_knowns(void) {
    const fmi3ValueReference unknown = RP_MANIPULATOR_potential_energy;
    const fmi3ValueReference of[] = {RP_MANIPULATOR_g, RP_MANIPULATOR_q1, RP_MANIPULATOR_g};
    const double seed = 2.0;
    const double one = 1.0;
    double adjoint[3];
    double directional;
    const fmi3Instance instance = fmu3_co_simulation(NULL);
    fmu3_set(instance, RP_MANIPULATOR_q1, 0.7);
    ASSERT_OK(fmu3.EnterInitializationMode(instance, false, 0.0, 0.0, false, 0.0));
    ASSERT_OK(fmu3.GetAdjointDerivative(instance, &unknown, 1, of, 3, &seed, 1, adjoint, 3));
    ASSERT_OK(
        fmu3.GetDirectionalDerivative(instance, &unknown, 1, of, 1, &one, 1, &directional, 1));
    TEST_ASSERT_TRUE(directional != 0.0);
    TEST_ASSERT_TRUE(adjoint[0] == seed * directional);
    TEST_ASSERT_TRUE(adjoint[2] == adjoint[0]);
    // also later
    ASSERT_OK(fmu3.ExitInitializationMode(instance));
    double later[3];
    ASSERT_OK(fmu3.GetAdjointDerivative(instance, &unknown, 1, of, 3, &seed, 1, later, 3));
    TEST_ASSERT_EQUAL_MEMORY(adjoint, later, sizeof later);
}

/* Nothing is written where one of them is refused. */
static void test_adjoint_derivatives_that_are_refused(void) {
    static const fmi3ValueReference wrong[][2] = {
        // as a known, as an unknown
        {RP_MANIPULATOR_ee_x, RP_MANIPULATOR_time},
        {RP_MANIPULATOR_ddq1, RP_MANIPULATOR_m1},
        {RP_MANIPULATOR_relative_tolerance, RP_MANIPULATOR_tau1},
        {RP_MANIPULATOR_solver_steps, RP_MANIPULATOR_solver_steps},
        {9999, 9999},
    };
    for (size_t k = 0; k < 2 * FMU_COUNT(wrong); k++) {
        const bool is_unknown = k % 2 == 1;
        fmi3ValueReference rows[] = {RP_MANIPULATOR_ddq1, RP_MANIPULATOR_ddq2};
        fmi3ValueReference columns[] = {RP_MANIPULATOR_q1, RP_MANIPULATOR_q2};
        *(is_unknown ? &rows[1] : &columns[1]) = wrong[k / 2][is_unknown];
        const double seed[] = {1.0, 1.0};
        double result[] = {-1.0, -1.0};
        const fmi3Instance instance = fmu3_co_simulation(NULL);
        fmu3_initialize(instance, 0.0);
        ASSERT_ERROR(fmu3.GetAdjointDerivative(instance, rows, 2, columns, 2, seed, 2, result, 2));
        TEST_ASSERT_TRUE(result[0] == -1.0 && result[1] == -1.0);
        fmu3_free(instance);
    }
    const fmi3ValueReference ddq1 = RP_MANIPULATOR_ddq1;
    const fmi3ValueReference dq1 = RP_MANIPULATOR_dq1;
    const fmi3Instance instance = fmu3_co_simulation(NULL);
    fmu3_set(instance, RP_MANIPULATOR_dq1, 1e160);
    fmu3_initialize(instance, 0.0);
    const double seed = 1e200;
    double result = -1.0;
    ASSERT_DISCARD(fmu3.GetAdjointDerivative(instance, &ddq1, 1, &dq1, 1, &seed, 1, &result, 1));
    TEST_ASSERT_TRUE(result == -1.0);
}

/* ---- States of other versions and kinds ------------------------------------------------------ */

enum kind { MODEL_EXCHANGE, CO_SIMULATION, CO_SIMULATION_WITH_EVENTS, KINDS };

static fmi2Type type_of(enum kind kind) {
    return kind == MODEL_EXCHANGE ? fmi2ModelExchange : fmi2CoSimulation;
}

static fmi2Component of_kind(enum kind kind) {
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
        fmi2Byte nothing = 0;
        struct fmu_bytes of_2 = {0};
        struct fmu_bytes of_3 = fmu_save_bytes(of_kind(kind));
        const fmi2Component c = fmu2.Instantiate("m", type_of(kind), RP_MANIPULATOR_GUID, "",
                                                 &callbacks, fmi2False, fmi2False);
        ASSERT_OK(fmu2.GetFMUstate(c, &state));
        ASSERT_OK(fmu2.SerializedFMUstateSize(c, state, &of_2.size));
        of_2 = fmu_bytes_copy(&(struct fmu_bytes){&nothing, 1}, of_2.size);
        ASSERT_OK(fmu2.SerializeFMUstate(c, state, of_2.data, of_2.size));
        for (enum kind to = MODEL_EXCHANGE; to < KINDS; to++) {
            assert_refused(&fmu, of_kind(to), &of_2, "it is one of FMI 2, the instance of FMI 3");
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
        struct fmu_bytes bytes = fmu_save_bytes(of_kind(from));
        for (enum kind to = MODEL_EXCHANGE; to < KINDS; to++) {
            if (to != from) {
                assert_refused(&fmu, of_kind(to), &bytes, names[to]);
            }
        }
        fmu_bytes_free(&bytes);
    }
}
