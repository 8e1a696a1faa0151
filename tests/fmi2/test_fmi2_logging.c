/* What the FMU logs and when. It writes nowhere else. FMI 2.0, sections 2.1.5 and 2.2.4. */
#define _POSIX_C_SOURCE 200809L
#include "fmi_states.h"
#include "fmu_harness.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include <unity.h>

static const char *const categories[] = {"logEvents",      "logStatusWarning", "logStatusDiscard",
                                         "logStatusError", "logStatusFatal",   "logAll"};

static const char errors_are_sent[] = "in FMI 3.0 errors cannot be silenced: test_fmi3.c";

/* One message of each kind: events, a discard, an error, a step that CVODE complains about. */
static void make_messages(fmi2Component c) {
    const fmi2ValueReference max_steps = RP_MANIPULATOR_max_internal_steps;
    const fmi2Integer one = 1;
    ASSERT_OK(fmu.Reset(c));
    ASSERT_OK(fmu.SetInteger(c, &max_steps, 1, &one));
    ASSERT_DISCARD(fmu_try_set(c, RP_MANIPULATOR_tau1, NAN));
    fmu_initialize(c, 0.0, 0.0);
    ASSERT_DISCARD(fmu.DoStep(c, 0.0, 10.0, fmi2True));
    ASSERT_OK(fmu.Terminate(c));
    ASSERT_ERROR(fmu.DoStep(c, 0.0, 10.0, fmi2True));
}

static fmi2Status enable(fmi2Component c, const char *category) {
    return fmu.SetDebugLogging(c, fmi2True, 1, &category);
}

/* ---- Categories ----------------------------------------------------------------------------- */

static size_t declared_categories(void) {
    size_t count = 0;
    for (const char *at = fmu_description; (at = strstr(at, "<Category ")) != NULL; at++) {
        count++;
    }
    return count;
}

static void test_the_categories_are_those_declared(void) {
    const fmi2Component c = fmu_instantiate(&messages, false);
    TEST_ASSERT_EQUAL_UINT(FMU_COUNT(categories), declared_categories());
    for (size_t i = 0; i < FMU_COUNT(categories); i++) {
        char element[64];
        snprintf(element, sizeof element, "<Category name=\"%s\"", categories[i]);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(fmu_description, element), element);
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, enable(c, categories[i]), element);
    }
    ASSERT_OK(fmu.SetDebugLogging(c, fmi2True, 0, NULL));
    make_messages(c);

    unsigned declared = 0;
    for (size_t i = 0; i < FMU_COUNT(categories); i++) {
        declared += fmu_log_count(&messages, categories[i]);
    }
    TEST_ASSERT_EQUAL_UINT(fmu_log_total(&messages), declared);
}

static void test_unknown_categories_are_named(void) {
    static const char *const unknown[] = {"logNothing", "logevents", "logAll ",
                                          "",           NULL,        "logStatusPending"};
    for (size_t i = 0; i < FMU_COUNT(unknown); i++) {
        const fmi2String names[] = {"logEvents", unknown[i]};
        for (fmi2Boolean on = fmi2False; on <= fmi2True; on++) {
            const fmi2Component c = fmu_instantiate(&messages, false);
            fmu_log_clear(&messages);
            ASSERT_ERROR(fmu.SetDebugLogging(c, on, 2, names));
            TEST_ASSERT_EQUAL_UINT(1, messages.count[fmi2Error]);
            fmu_assert_logged(&messages, unknown[i] != NULL ? unknown[i] : "category");
            fmu_assert_in_error(c);
            fmu_assert_reset_is_fresh(c, messages.texts);
            TEST_ASSERT_EQUAL_UINT(0, fmu_log_count(&messages, "logEvents")); // nothing changed
            fmu_free(c);
        }
    }
}

/* ---- On and off ----------------------------------------------------------------------------- */

/* Off, it still says what failed; each category fits the status. */
static void test_logging_on_tells_events(void) {
    for (int on = 0; on < 2; on++) {
        const fmi2Component c = fmu_instantiate(&messages, on);
        fmu_log_clear(&messages);
        make_messages(c);
        TEST_ASSERT_GREATER_THAN_UINT(1, messages.count[fmi2Discard]);
        TEST_ASSERT_EQUAL_UINT(messages.count[fmi2Discard],
                               fmu_log_count(&messages, "logStatusDiscard"));
        TEST_ASSERT_EQUAL_UINT(1, messages.count[fmi2Error]);
        TEST_ASSERT_EQUAL_UINT(1, fmu_log_count(&messages, "logStatusError"));
        TEST_ASSERT_EQUAL_UINT(0, messages.count[fmi2Fatal]);
        TEST_ASSERT_TRUE((messages.count[fmi2OK] > 0) == on);
        TEST_ASSERT_TRUE((fmu_log_count(&messages, "logEvents") > 0) == on);
        TEST_ASSERT_EQUAL_INT(on, fmu_log_count(&messages, "logAll") > 0);
        fmu_free(c);
    }
}

/* For good: the messages begin with a reset. */
static void test_set_debug_logging_silences_all(void) {
    fmu_only_in(2, errors_are_sent);
    for (int logging_on = 0; logging_on < 2; logging_on++) {
        const fmi2Component c = fmu_instantiate(&messages, logging_on);
        ASSERT_OK(fmu.SetDebugLogging(c, fmi2False, 0, NULL));
        fmu_log_clear(&messages);
        make_messages(c);
        TEST_ASSERT_EQUAL_UINT_MESSAGE(0, fmu_log_total(&messages), messages.texts);
    }
}

static void test_only_the_categories_named_are_on(void) {
    fmu_only_in(2, errors_are_sent);
    static const char *const named[] = {"logEvents", "logStatusDiscard", "logStatusError"};
    for (size_t i = 0; i < FMU_COUNT(named); i++) {
        const fmi2Component c = fmu_instantiate(&messages, true);
        ASSERT_OK(enable(c, named[i]));
        fmu_log_clear(&messages);
        make_messages(c);
        TEST_ASSERT_GREATER_THAN_UINT(0, fmu_log_count(&messages, named[i]));
        TEST_ASSERT_EQUAL_UINT(fmu_log_total(&messages), fmu_log_count(&messages, named[i]));
        fmu_free(c);
    }
}

static void test_named_categories_can_be_switched_off(void) {
    const fmi2String name = "logStatusDiscard";
    const fmi2Component c = fmu_instantiate(&messages, true);
    ASSERT_OK(enable(c, "logEvents"));
    ASSERT_OK(enable(c, name));
    ASSERT_OK(fmu.SetDebugLogging(c, fmi2False, 1, &name));
    fmu_log_clear(&messages);
    make_messages(c);
    TEST_ASSERT_EQUAL_UINT(0, fmu_log_count(&messages, name));
}

static void test_log_all_shows_every_call(void) {
    const fmi2ValueReference steps = RP_MANIPULATOR_solver_steps;
    fmi2Integer integer;
    double real;
    const fmi2Component c = fmu_instantiate(&messages, false);
    ASSERT_OK(enable(c, "logAll"));
    fmu_initialize(c, 0.0, 0.0);
    fmu_set(c, RP_MANIPULATOR_tau1, fmu_get(c, RP_MANIPULATOR_q1));
    ASSERT_OK(fmu.GetInteger(c, &steps, 1, &integer));
    ASSERT_OK(fmu.SetInteger(c, NULL, 0, NULL));
    ASSERT_OK(fmu.GetBoolean(c, NULL, 0, NULL));
    ASSERT_OK(fmu.DoStep(c, 0.0, 0.1, fmi2True));
    ASSERT_OK(fmu.GetRealStatus(c, fmi2LastSuccessfulTime, &real));
    ASSERT_OK(fmu.Terminate(c));
    ASSERT_OK(fmu.Reset(c));

    static const enum fmu_function called[] = {FMU_EnterInitializationMode,
                                               FMU_ExitInitializationMode,
                                               FMU_SetReal,
                                               FMU_GetReal,
                                               FMU_GetInteger,
                                               FMU_SetInteger,
                                               FMU_GetBoolean,
                                               FMU_DoStep,
                                               FMU_Terminate,
                                               FMU_Reset};
    for (size_t i = 0; i < FMU_COUNT(called); i++) {
        fmu_assert_logged(&messages, fmu_name_of(called[i]));
    }
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(FMU_COUNT(called), fmu_log_count(&messages, "logAll"));
}

static void test_log_all_switches_every_category(void) {
    fmu_only_in(2, errors_are_sent);
    static const char *const told[] = {"logAll", "logEvents", "logStatusDiscard", "logStatusError"};
    const fmi2String name = "logAll";
    for (fmi2Boolean on = fmi2False; on <= fmi2True; on++) {
        const fmi2Component c = fmu_instantiate(&messages, !on);
        ASSERT_OK(fmu.SetDebugLogging(c, on, 1, &name));
        fmu_log_clear(&messages);
        make_messages(c);
        for (size_t i = 0; i < FMU_COUNT(told); i++) {
            TEST_ASSERT_EQUAL_MESSAGE(on, fmu_log_count(&messages, told[i]) > 0, told[i]);
        }
        fmu_free(c);
    }
}

/* ---- Where messages go ---------------------------------------------------------------------- */

static void test_messages_carry_the_name_of_the_instance(void) {
    static const char *const names[] = {"left arm", "arm%s#1", "Roboter \xc3\xa4"};
    for (size_t i = 0; i < FMU_COUNT(names); i++) {
        const fmi2CallbackFunctions callbacks = fmu_callbacks(&messages);
        const fmi2Component c = fmu.Instantiate(names[i], fmi2CoSimulation, RP_MANIPULATOR_GUID,
                                                NULL, &callbacks, fmi2False, fmi2True);
        ASSERT_ERROR(fmu.Terminate(c));
        TEST_ASSERT_EQUAL_STRING(names[i], messages.instance_name);
        fmu_log_clear(&messages);
        fmu.FreeInstance(c);
        fmu_assert_logged(&messages, fmu_name_of(FMU_FreeInstance));
    }
}

/* The harness refuses a '%' and a single '#' in any message: see fmu_tear_down. */
static void test_hostile_texts_are_made_harmless(void) {
    char many[4096];
    memset(many, '#', sizeof many - 1);
    many[sizeof many - 1] = '\0';
    const char *const hostile[] = {"%s%n%d", "#r10#", "line\nbreak\x1b[2J", many};
    for (size_t i = 0; i < FMU_COUNT(hostile); i++) {
        const fmi2Component c = fmu_instantiate(&messages, false);
        fmu_log_clear(&messages);
        ASSERT_ERROR(enable(c, hostile[i]));
        TEST_ASSERT_EQUAL_UINT(1, fmu_log_total(&messages));
        TEST_ASSERT_NULL(strchr(messages.text, '\n'));
        fmu_free(c);
    }
}

/* Both streams go to a file while messages are made; returns how much was written there. */
static long written_while_making_messages(fmi2Component c, FILE *file) {
    fflush(NULL);
    const int out = dup(STDOUT_FILENO);
    const int err = dup(STDERR_FILENO);
    dup2(fileno(file), STDOUT_FILENO);
    dup2(fileno(file), STDERR_FILENO);

    // asserted below: a failed assertion would be written to the file
    const fmi2ValueReference max_steps = RP_MANIPULATOR_max_internal_steps;
    const fmi2Integer one = 1;
    (void)fmu.SetInteger(c, &max_steps, 1, &one);
    (void)fmu.SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    (void)fmu.EnterInitializationMode(c);
    (void)fmu.ExitInitializationMode(c);
    (void)fmu.DoStep(c, 0.0, 10.0, fmi2True); // too few internal steps
    (void)fmu.Reset(c);
    (void)fmu_try_set(c, RP_MANIPULATOR_dq1, 1e200);
    (void)fmu.SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    (void)fmu.EnterInitializationMode(c);
    (void)fmu.ExitInitializationMode(c);
    (void)fmu.DoStep(c, 0.0, 10.0, fmi2True); // the first slope overflows
    (void)fmu.DoStep(c, 0.0, 10.0, fmi2True); // not allowed

    fflush(NULL);
    dup2(out, STDOUT_FILENO);
    dup2(err, STDERR_FILENO);
    close(out);
    close(err);
    return lseek(fileno(file), 0, SEEK_END);
}

/* ---- Calls from inside ---------------------------------------------------------------------- */

/* A logger that calls a function of the instance whose message it gets. */
static struct {
    fmi2Component component;
    enum fmu_function function;
    unsigned messages, refused, notes; /* notes: messages that say what was refused */
} meddler;

/* Whether a call needs no instance, or no call of the FMU in FMI 3.0. */
static bool is_not_refused(enum fmu_function function) {
    const bool is_of_fmi2 = function == FMU_SetupExperiment ||
                            function == FMU_SetRealInputDerivatives ||
                            function == FMU_FreeInstance || // test_fmi3.c
                            (function >= FMU_GetStatus && function <= FMU_GetStringStatus);
    return function == FMU_GetTypesPlatform || function == FMU_GetVersion ||
           function == FMU_Instantiate || (fmu_version == 3 && is_of_fmi2);
}

static void meddle(fmi2ComponentEnvironment environment, fmi2String instance_name,
                   fmi2Status status, fmi2String category, fmi2String message, ...) {
    const bool is_note = strstr(message, "refused inside the logger") != NULL;
    meddler.messages++;
    meddler.notes += is_note && strstr(message, fmu_name_of(meddler.function)) != NULL;
    if (meddler.component == NULL || is_not_refused(meddler.function)) {
        return;
    }
    if (meddler.function == FMU_FreeInstance) { // nothing is freed
        fmu.FreeInstance(meddler.component);
        meddler.refused++;
    } else {
        meddler.refused +=
            fmu_call(meddler.function, meddler.component, 0.0, 0.125) == fmi2Error ? 1 : 0;
    }
}

/* Each function, from each message of a run, where every call sends one. */
static void check_meddling(fmi2Type type) {
    static struct fmu_run expected;
    static struct fmu_run run;
    fmi2CallbackFunctions callbacks = fmu_callbacks(&messages);
    callbacks.logger = meddle;
    (void)fmu_run_as(type, fmu_instantiate_as(type, &messages, false), 1, &expected);
    for (int function = 0; function < FMU_FUNCTION_COUNT; function++) {
        const char *name = fmu_name_of((enum fmu_function)function);
        meddler.component = NULL;
        const fmi2Component c = fmu.Instantiate("meddled with", type, RP_MANIPULATOR_GUID, "",
                                                &callbacks, fmi2False, fmi2True);
        TEST_ASSERT_NOT_NULL(c);
        memset(&meddler, 0, sizeof meddler);
        meddler.component = c;
        meddler.function = (enum fmu_function)function;
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu_run_as(type, c, 1, &run), name);
        TEST_ASSERT_EQUAL_MEMORY_MESSAGE(&expected, &run, sizeof run, name);
        TEST_ASSERT_GREATER_THAN_UINT(FMU_RUN_STEPS, meddler.messages);
        if (!is_not_refused(meddler.function)) {
            TEST_ASSERT_EQUAL_UINT_MESSAGE(meddler.messages, meddler.refused, name);
            TEST_ASSERT_EQUAL_UINT_MESSAGE(meddler.messages, 2 * meddler.notes, name);
        }
        meddler.component = NULL;
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu.Reset(c), name);
        TEST_ASSERT_EQUAL_INT_MESSAGE(
            fmi2OK, fmu.SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0), name);
        fmu.FreeInstance(c);
    }
}

static void test_no_call_comes_through_from_the_logger(void) {
    check_meddling(fmi2CoSimulation);
    check_meddling(fmi2ModelExchange);
}

static void test_nothing_is_written_to_the_standard_streams(void) {
    for (int with_logger = 0; with_logger < 2; with_logger++) {
        fmi2CallbackFunctions callbacks = fmu_callbacks(&messages);
        callbacks.logger = with_logger ? callbacks.logger : NULL;
        const fmi2Component c = fmu.Instantiate("m", fmi2CoSimulation, RP_MANIPULATOR_GUID, NULL,
                                                &callbacks, fmi2False, fmi2False);
        FILE *file = tmpfile();
        TEST_ASSERT_NOT_NULL(file);
        const long written = written_while_making_messages(c, file);
        fclose(file);
        fmu.FreeInstance(c);
        TEST_ASSERT_EQUAL_INT(0, written);
    }
    // the last step: all went as planned; in FMI 3.0 it finds the instance as it was
    TEST_ASSERT_EQUAL_UINT(fmu_version == 2 ? 1 : 0, messages.count[fmi2Error]);
    TEST_ASSERT_GREATER_THAN_UINT(1, messages.count[fmi2Discard]);
    fmu_assert_logged(&messages, "cvode_adams: ");
}
