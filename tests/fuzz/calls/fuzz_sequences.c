/* A run of a target of calls: single calls, and some in a row. */
#include "fuzz_arguments.h"
#include "fuzz_session.h"

#include <string.h>

enum { MAX_OPERATIONS = 150 };

/* ---- Some calls in a row, to come further ---------------------------------------------------- */

static void start_stepping(struct fuzz_session *session, struct fuzz_instance *instance) {
    struct fuzz_input *input = session->input;
    const fmi2ValueReference method_reference = RP_MANIPULATOR_solver_method;
    const fmi2Integer method = 1 + (fmi2Integer)fuzz_below(input, FUZZ_METHODS);
    const fmi2ValueReference states[] = {RP_MANIPULATOR_q1, RP_MANIPULATOR_q2, RP_MANIPULATOR_dq1,
                                         RP_MANIPULATOR_dq2};
    double values[4];
    fuzz_reset(instance);
    FUZZ_CHECKED(instance, SetInteger, &method_reference, 1, &method);
    for (size_t i = 0; i < FUZZ_COUNT(values); i++) {
        values[i] = fuzz_likely_real(input);
    }
    FUZZ_CHECKED(instance, SetReal, states, FUZZ_COUNT(states), values);
    const double tolerance = fuzz_below(input, 2) == 0 ? 0.0 : fuzz_magnitude(input, 1e-14, 1.0);
    const double start_time = fuzz_below(input, FUZZ_METHODS) != 0 ? 0.0 : fuzz_real(input);
    if (fuzz_initialize(instance, tolerance, start_time) == fmi2OK &&
        instance->kind == fmi2ModelExchange && fuzz_below(input, 2) == 0) {
        FUZZ_CHECKED_PLAIN(instance, EnterContinuousTimeMode);
    }
}

/* Not of an instance for Model Exchange, mostly: that is an error. */
static bool may_step(struct fuzz_session *session, const struct fuzz_instance *instance) {
    return instance->kind == fmi2CoSimulation || fuzz_below(session->input, 16) == 15;
}

static void step(struct fuzz_session *session, struct fuzz_instance *instance) {
    if (may_step(session, instance)) {
        fuzz_step(instance, fuzz_any_step(session->input));
    }
}

/* A step, with an input changed or not, and the same again from a state saved before it. */
static void step_twice(struct fuzz_session *session, struct fuzz_instance *instance) {
    if (!may_step(session, instance)) {
        return;
    }
    const double length = fuzz_any_step(session->input);
    const bool sets_input = fuzz_below(session->input, 2) == 0;
    const fmi2ValueReference input = RP_MANIPULATOR_f2;
    const double effort = sets_input ? fuzz_likely_real(session->input) : 0.0;
    const struct fuzz_instance before = *instance;
    fmi2FMUstate state = NULL;
    struct fuzz_values values[2];
    fmi2Status statuses[2];
    memset(values, 0, sizeof values);
    FUZZ_CHECKED(instance, GetFMUstate, &state);
    for (int i = 0; i < 2; i++) {
        if (sets_input) {
            FUZZ_CHECKED(instance, SetReal, &input, 1, &effort);
        }
        statuses[i] = fuzz_step(instance, length);
        if (statuses[i] != fmi2Error) {
            fuzz_read(instance, &values[i]);
        }
        if (i == 0 && FUZZ_CHECKED(instance, SetFMUstate, state) != fmi2OK) {
            fuzz_fail("an own state cannot be restored");
        }
        if (i == 0) {
            instance->in_error = before.in_error;
            instance->time = before.time;
        }
    }
    if (statuses[0] != statuses[1]) {
        fuzz_fail("a step repeated after a rollback has the status %d, not %d", (int)statuses[1],
                  (int)statuses[0]);
    }
    fuzz_assert_same(&values[0], &values[1], "a step repeated after a rollback");
    FUZZ_CHECKED(instance, FreeFMUstate, &state);
}

static void compare_with_new(struct fuzz_session *session, struct fuzz_instance *instance) {
    fuzz_assert_as_new(instance, fuzz_byte(session->input));
}

/* ---- A run ----------------------------------------------------------------------------------- */

/* What leads further stands here several times. */
static fuzz_operation *const sequences[] = {
    start_stepping,
    step,
    step,
    step,
    step,
    step,
    step,
    step,
    step,
    step_twice,
    step_twice,
    step_twice,
    compare_with_new,
    fuzz_call_GetFMUstate,
    fuzz_call_GetFMUstate,
    fuzz_call_SetFMUstate,
    fuzz_call_SetFMUstate,
    fuzz_call_SerializeFMUstate,
    fuzz_call_SerializeFMUstate,
    fuzz_call_DeSerializeFMUstate,
    fuzz_call_DeSerializeFMUstate,
};

/* Most calls lead an instance into the error state, where little is left to be tried. */
static void recover(struct fuzz_session *session, struct fuzz_instance *instance) {
    if (instance->in_error && fuzz_below(session->input, 4) != 0) {
        start_stepping(session, instance);
    }
}

void fuzz_session_run(struct fuzz_input *input, fuzz_operation *const calls[], size_t count) {
    struct fuzz_session session = {.input = input};
    for (int i = 0; i < MAX_OPERATIONS && input->left > 0; i++) {
        const size_t number = fuzz_byte(input) % (count + FUZZ_COUNT(sequences));
        fuzz_operation *const chosen = number < count ? calls[number] : sequences[number - count];
        struct fuzz_instance *instance = fuzz_session_instance(&session);
        recover(&session, instance);
        chosen(&session, instance);
        fuzz_free_arguments();
    }
    for (size_t i = 0; i < FUZZ_COUNT(session.instances); i++) {
        struct fuzz_instance *instance = session.instances[i];
        if (instance != NULL && instance->had_error) {
            fuzz_assert_as_new(instance, (unsigned)input->left + (unsigned)i);
        }
    }
    fuzz_session_end(&session);
}
