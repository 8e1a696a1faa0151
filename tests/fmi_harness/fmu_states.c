#include "fmu_states.h"

#include "fmu_calls.h"

#include <string.h>
#include <unity.h>

const struct fmu_states *fmu_states_of(fmi2Type type) {
    return type == fmi2CoSimulation ? &fmu_co_simulation_states : &fmu_model_exchange_states;
}

const struct fmu_state *fmu_state_of(fmi2Type type, char letter) {
    const struct fmu_state *state = fmu_states_of(type)->states;
    while (state->letter != letter) {
        state++;
    }
    return state;
}

/* The instance takes the one internal step that it may, and gives up. */
static void fail_step(fmi2Component c) {
    TEST_ASSERT_EQUAL_INT(fmi2Discard, fmu.DoStep(c, 0.0, 10.0, fmi2True));
}

fmi2Component fmu_reach(fmi2Type type, const struct fmu_state *state, struct fmu_log *log) {
    const fmi2ValueReference max_steps = RP_MANIPULATOR_max_internal_steps;
    const fmi2Integer one = 1;
    const fmi2Component c = fmu_instantiate_as(type, log, false);
    if (state->letter == 'F') {
        TEST_ASSERT_EQUAL_INT(fmi2OK, fmu.SetInteger(c, &max_steps, 1, &one));
    }
    TEST_ASSERT_EQUAL_INT(fmi2OK, fmu.SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0));
    if (state->letter != 'I') {
        TEST_ASSERT_EQUAL_INT(fmi2OK, fmu.EnterInitializationMode(c));
    }
    if (strchr("CFVNTE", state->letter) != NULL) {
        TEST_ASSERT_EQUAL_INT(fmi2OK, fmu.ExitInitializationMode(c));
    }
    if (state->letter == 'F') {
        fail_step(c);
    } else if (state->letter == 'N') {
        TEST_ASSERT_EQUAL_INT(fmi2OK, fmu.EnterContinuousTimeMode(c));
    } else if (state->letter == 'T') {
        TEST_ASSERT_EQUAL_INT(fmi2OK, fmu.Terminate(c));
    } else if (state->letter == 'E') {
        TEST_ASSERT_EQUAL_INT(fmi2Error, fmu.ExitInitializationMode(c));
    }
    fmu_log_clear(log);
    return c;
}

void fmu_assert_in_state(fmi2Component component, const struct fmu_state *state, double now,
                         struct fmu_log *log, const char *message) {
    if (state->proof != FMU_FUNCTION_COUNT) {
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu_call(state->proof, component, now, 0.01),
                                      message);
        return;
    }
    // the same functions work in the other states: only a refusal's message distinguishes them
    fmu_log_clear(log);
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2Error, fmu_try_set(component, RP_MANIPULATOR_tau1, 1.0),
                                  message);
    fmu_assert_logged(log, state->name);
    fmu_assert_in_error(component);
}
