/* Impossible states are refused: each value beyond its limits, one at a time, and its name in the
 * message. */
#include "plausibility.h"

#include "history.h"
#include "one_instance.h"
#include "oscillator.h"
#include "state.h"

static struct instance_state state; /* of an instance that has taken a step */
static char block[1024];

void setUp(void) {
    create(&model_description);
    initialize_of(instance, 0.0, 10.0);
    ASSERT_OK(instance_do_step(instance, 0.0, 0.5, NULL));
    ASSERT_OK(instance_do_step(instance, 0.5, 0.5, NULL));
    state = instance->state;
    TEST_ASSERT_TRUE(state.has_history && instance->memory.size <= sizeof block);
    memcpy(block, instance->memory.block, instance->memory.size);
}

static bool is_plausible(void) {
    return instance_check_plausible(instance, &state, block) == STATUS_OK;
}

static void assert_refused(const char *name) {
    TEST_ASSERT_FALSE_MESSAGE(is_plausible(), name);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(last_text, name), last_text);
    last_text[0] = '\0';
}

/* With this value of a field the state is refused. */
#define REFUSED_WITH(field, value, name)                                                           \
    do {                                                                                           \
        const struct instance_state kept = state;                                                  \
        state.field = (value);                                                                     \
        assert_refused(name);                                                                      \
        state = kept;                                                                              \
    } while (0)

/* A real at *value: refused with each of bad, accepted with each of good; then as it was. */
static void check_real(double *value, const char *name, const double good[2], const double bad[2]) {
    const double kept = *value;
    for (int i = 0; i < 2; i++) {
        *value = good[i];
        TEST_ASSERT_TRUE_MESSAGE(is_plausible(), name);
        *value = bad[i];
        assert_refused(name);
    }
    *value = NAN;
    assert_refused(name);
    *value = kept;
    TEST_ASSERT_TRUE_MESSAGE(is_plausible(), name);
}

static void check_count(int64_t *value, const char *name, int64_t good, const int64_t bad[2]) {
    const int64_t kept = *value;
    *value = good;
    TEST_ASSERT_TRUE_MESSAGE(is_plausible(), name);
    for (int i = 0; i < 2; i++) {
        *value = bad[i];
        assert_refused(name);
    }
    *value = kept;
    TEST_ASSERT_TRUE_MESSAGE(is_plausible(), name);
}

static void test_times_are_finite(void) {
    const double finite[2] = {-1e300, 1e300};
    const double infinite[2] = {-INFINITY, INFINITY};
    state.has_history = false;
    state.own.event_count = 1;
    const double after_start[2] = {0.0, 1e300};
    const double not_after_start[2] = {-1e-300, INFINITY};
    check_real(&state.time.s, "time", after_start, not_after_start);
    const double rounding[2] = {0.0, 1e-17 * state.time.s};
    const double more[2] = {1e-15 * state.time.s, 0.5};
    check_real(&state.time.rest, "rest of time", rounding, more);
    const double until_now[2] = {0.0, state.time.s};
    const double not_until_now[2] = {-1e-300, 1.001 * state.time.s};
    check_real(&state.own.last_event_time, "last_event_time", until_now, not_until_now);
    check_real(&state.restart_time.s, "restart_time", finite, infinite);
    const double nothing[2] = {0.0, 1e-17 * state.restart_time.s};
    const double something[2] = {-0.5, INFINITY};
    check_real(&state.restart_time.rest, "rest of restart_time", nothing, something);
    check_real(&state.statistics.last_step, "last_step", finite, infinite);
}

static void test_steps_and_tolerances_are_not_negative(void) {
    const double good[2] = {0.0, 1e300};
    const double bad[2] = {-1e-300, INFINITY};
    check_real(&state.own.relative_tolerance, "relative_tolerance", good, bad);
    check_real(&state.own.max_step, "max_step", good, bad);
    check_real(&state.restart_step, "restart_step", good, bad);
    check_real(&state.next_step, "next_step", good, bad);
}

static void test_counts_can_be_counted_on_from(void) {
    struct integrator_statistics *totals = &state.statistics;
    const int64_t bad[2] = {-1, INT64_MAX / 2 + 1};
    check_count(&totals->rhs_evaluations, "solver_rhs_evaluations", 0, bad);
    check_count(&totals->rhs_evaluations, "solver_rhs_evaluations", INT64_MAX / 2, bad);
    check_count(&totals->failed_steps, "solver_failed_steps", 0, bad);
    const int64_t no_restart[2] = {-1, 0}; // with a history
    check_count(&totals->restarts, "solver_restarts", 1, no_restart);
    check_count(&totals->steps, "solver_steps", totals->steps, bad);
    const int64_t before[2] = {-1, totals->steps + 1};
    check_count(&state.steps_before_restart, "steps before the restart", 0, before);
}

static void test_phase_method_and_limit_exist(void) {
    REFUSED_WITH(phase, (enum phase) - 1, "phase = -1");
    REFUSED_WITH(phase, PHASE_COUNT, "phase = 4");
    REFUSED_WITH(own.max_internal_steps, 0, "max_internal_steps = 0");
    REFUSED_WITH(own.max_events, 0, "max_events = 0");
    REFUSED_WITH(own.event_count, -1, "event_count = -1");
    const int most = state.own.max_internal_steps;
    state.own.max_internal_steps = 1;
    TEST_ASSERT_TRUE(is_plausible());
    state.own.max_internal_steps = most;
    for (int method = -1; method <= (int)INTEGRATOR_METHODS; method++) {
        const bool exists = method > (int)INTEGRATOR_NO_METHOD && method < (int)INTEGRATOR_METHODS;
        state.own.solver_method = method;
        TEST_ASSERT_TRUE(is_plausible() == exists);
    }
}

/* A replay goes from the restart to first_time and on to the time, within the horizon and the
 * steps.
 */
static void test_a_history_does_not_contradict_itself(void) {
    const double first[2] = {1e-300, state.latest_time};
    const double not_first[2] = {0.0, -1.0};
    check_real(&state.first_time, "first_time", first, not_first);
    const double latest_restart = state.time.s - state.first_time;
    REFUSED_WITH(restart_time.s, latest_restart + 1e-3, "time since the restart");
    REFUSED_WITH(time.s, 0.999 * state.first_time, "time since the restart");
    const double passed[2] = {state.first_time, INFINITY};
    const double not_passed[2] = {0.999 * state.first_time, -INFINITY};
    check_real(&state.passed_time, "passed_time", passed, not_passed);

    // internal steps since the restart: at least one, and no more than restart and step allow
    const int64_t most = integrator_longest_history(INTEGRATOR_CVODE_ADAMS, false) +
                         (int64_t)state.own.max_internal_steps;
    state.statistics.steps = state.steps_before_restart + most;
    TEST_ASSERT_TRUE(is_plausible());
    state.statistics.steps++;
    assert_refused("steps since the restart");
    state.statistics.steps = state.steps_before_restart;
    assert_refused("steps since the restart");

    // all of that does not matter without a history
    state.has_history = false;
    state.first_time = state.passed_time = -1.0;
    TEST_ASSERT_TRUE(is_plausible());
}

/* A history that does not reach its first time in the steps it names cannot be replayed, though it
 * would reach its latest time from there. */
static void test_a_history_that_is_too_short_is_found_at_the_next_step(void) {
    struct instance *forged = created(&model_description);
    initialize_of(forged, 0.0, INFINITY);
    ASSERT_OK(instance_do_step(forged, 0.0, 0.5, NULL));
    const long needed = forged->state.statistics.steps;
    TEST_ASSERT_GREATER_THAN_INT(2, needed);
    ASSERT_OK(instance_do_step(forged, 0.5, 1e-3, NULL));
    forged->state.steps_before_restart = forged->state.statistics.steps - (needed - 1);
    forged->history_is_lost = true;
    ASSERT_REFUSED(instance_do_step(forged, 0.501, 1e-3, NULL));
    instance_destroy(forged);
}

static char *place(const void *own) {
    return block + ((const char *)own - instance->memory.block);
}

static void test_values_could_have_been_set(void) {
    struct equations_values *values = (void *)place(instance->memory.values);
    struct equations_values *held = (void *)place(instance->memory.restart_values);
    const double omegas[2] = {-10.0, 100.0};
    const double no_omegas[2] = {-10.5, 100.5};
    check_real(&values->v_omega, "omega", omegas, no_omegas);
    check_real(&held->v_omega, "omega", omegas, no_omegas);
    const double finite[2] = {-1e300, 1e300};
    const double infinite[2] = {-INFINITY, INFINITY};
    check_real(&values->v_x, "x = ", finite, infinite);
    check_real(&held->v_v, "v = ", finite, infinite);

    // calculated values are not read, and held values only with a history
    values->v_energy = held->v_energy = NAN;
    TEST_ASSERT_TRUE(is_plausible());
    state.has_history = false;
    held->v_v = NAN;
    TEST_ASSERT_TRUE(is_plausible());
}

static void test_inputs_are_finite(void) {
    const double finite[2] = {-1e300, 1e300};
    const double infinite[2] = {-INFINITY, INFINITY};
    struct polynomial *pending = (void *)place(instance->memory.next_inputs);
    struct polynomial *current = (void *)place(instance->memory.current_inputs);
    struct polynomial *running = (void *)place(instance->memory.active_inputs);
    state.has_history = false; // its horizon follows from the inputs
    for (int k = 0; k <= POLYNOMIAL_DEGREE; k++) {
        check_real(&pending->d[k], "an input =", finite, infinite);
        check_real(&running->d[k], "an input since the restart", finite, infinite);
        if (k > 0) {
            current->d[k] = INFINITY; // it may have overflowed on its way
            TEST_ASSERT_TRUE(is_plausible());
        }
    }
}

/* ---- What stands twice ---------------------------------------------------------------------- */

static void check_twin(double *value, const char *name) {
    const double kept = *value;
    const double others[] = {nextafter(kept, INFINITY), 2.0 * kept + 1.0, -1.0, NAN};
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++) {
        *value = others[i];
        assert_refused(name);
    }
    *value = kept;
    TEST_ASSERT_TRUE_MESSAGE(is_plausible(), name);
}

static void test_what_stands_twice_agrees(void) {
    check_twin(&state.own.last_event_time, "last_event_time"); // there has been no event
    const struct equations_values *values = (void *)place(instance->memory.values);
    struct polynomial *current = (void *)place(instance->memory.current_inputs);
    TEST_ASSERT_EQUAL_MEMORY(&values->v_u, &current->d[0], sizeof current->d[0]);
    check_twin(&current->d[0], "two values of u");
    struct equations_values *held = (void *)place(instance->memory.restart_values);
    check_twin(&held->v_gain, "gain");
}

static void test_the_clock_and_the_history_agree(void) {
    REFUSED_WITH(experiment.stop_time, -1.0, "stop time");
    REFUSED_WITH(experiment_defined, false, "experiment_defined");
    REFUSED_WITH(event_point, EVENT_HANDLED, "event_point");
}

static void test_nothing_has_been_before_the_start(void) {
    instance_reset(instance);
    state = instance->state;
    memcpy(block, instance->memory.block, instance->memory.size);
    TEST_ASSERT_TRUE(is_plausible());
    REFUSED_WITH(own.event_count, 1, "event_count = 1");
    REFUSED_WITH(own.last_event_time, 1.0, "last_event_time = 1");
    REFUSED_WITH(experiment.stop_time_defined, true, "stop_time_defined");
    REFUSED_WITH(statistics.steps, 7, "solver_steps = 7");
    REFUSED_WITH(time.s, 1.0, "time = 1");
}
