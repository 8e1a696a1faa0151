/* From one communication point to the next, with each method, against the solution in closed form.
 */
#include "clock.h"
#include "each_method.h"
#include "one_instance.h"
#include "oscillator.h"
#include "snapshot.h"

#include <stdint.h>
#include <stdlib.h>

/* The oscillator, with a note of how far the integrator has gone. */
static double latest; /* s: latest time that the right-hand side was evaluated at */

static unsigned series_begun;

static enum status watched_rhs(const void *values, double t, const double x[], const double u[],
                               double dx[]) {
    latest = fmax(latest, t);
    return equations_model.right_hand_side(values, t, x, u, dx);
}

static enum status watched_extend(const struct series_origin *origin, int first, int last,
                                  double row[][SERIES_LENGTH]) {
    latest = fmax(latest, origin->t);
    series_begun += first == 0 ? 1 : 0;
    return equations_model.series->extend(origin, first, last, row);
}

static struct instance *watched(void) {
    static struct series series;
    static struct model model;
    static struct model_description altered_description;
    const unsigned reference = OSCILLATOR_solver_method;
    model = equations_model;
    model.right_hand_side = watched_rhs;
    series = *equations_model.series;
    series.extend = watched_extend;
    model.series = &series;
    altered_description = model_description;
    altered_description.model = &model;
    struct instance *made = created(&altered_description);
    ASSERT_OK(instance_set_integer(made, &reference, 1, &method));
    return made;
}

void setUp(void) {
    latest = -INFINITY;
    instance = watched();
}

/* Back to what setUp gives. */
static void begin_anew(void) {
    tearDown();
    setUp();
}

static void get_states(struct instance *from, double states[2]) {
    states[0] = get_of(from, OSCILLATOR_x);
    states[1] = get_of(from, OSCILLATOR_v);
}

EACH_METHOD static void test_the_sign_of_zero_is_no_change(void) {
    initialize_at(0.0);
    for (int i = 0; i < 50; i++) {
        set(OSCILLATOR_u, i % 2 == 0 ? 0.0 : -0.0);
        ASSERT_OK(instance_do_step(instance, 0.01 * i, 0.01, NULL));
    }
    const int alternating = get_int(OSCILLATOR_solver_steps);
    begin_anew();
    initialize_at(0.0);
    for (int i = 0; i < 50; i++) {
        ASSERT_OK(instance_do_step(instance, 0.01 * i, 0.01, NULL));
    }
    TEST_ASSERT_EQUAL_INT(get_int(OSCILLATOR_solver_steps), alternating);
}

/* ---- Beyond communication points ------------------------------------------------------------ */

static void step_held(int steps, double h) {
    for (int i = 0; i < steps; i++) {
        ASSERT_OK(instance_do_step(instance, i * h, h, NULL));
    }
}

EACH_METHOD static void test_no_internal_step_passes_the_stop_time(void) {
    static const double stops[] = {0.5, 0.7, 1.0};
    for (size_t i = 0; i < sizeof stops / sizeof stops[0]; i++) {
        const double h = stops[i] / 100.0;
        begin_anew();
        initialize_of(instance, 0.0, stops[i]);
        step_held(100, h);
        TEST_ASSERT_TRUE(latest <= stops[i] * (1.0 + 1e-12));
        // a series is evaluated where a step begins
        TEST_ASSERT_TRUE(method == INTEGRATOR_TAYLOR || latest >= stops[i] * (1.0 - 1e-12));
        TEST_ASSERT_DOUBLE_WITHIN(1e-7, cos(2.0 * stops[i]), get(OSCILLATOR_x));
    }
}

/* The Taylor method keeps one internal step: wherever the instance is restored, it is calculated
 * once more at most. The other methods have no series. */
EACH_METHOD static void test_a_rollback_repeats_one_series_at_most(void) {
    struct instance_snapshot *snapshot = NULL;
    double expected[2];
    double states[2];
    initialize_at(0.0);
    for (int i = 0; i < 400; i++) {
        const double t = instance_time(instance);
        ASSERT_OK(instance_save(instance, 0, &snapshot));
        unsigned begun = series_begun;
        ASSERT_OK(instance_do_step(instance, t, 0.0078125, NULL));
        get_states(instance, expected);
        const unsigned once = series_begun - begun;
        ASSERT_OK(instance_restore(instance, snapshot));
        begun = series_begun;
        ASSERT_OK(instance_do_step(instance, t, 0.0078125, NULL));
        get_states(instance, states);
        // one at its begin, and one at its end for the check
        TEST_ASSERT_TRUE(series_begun - begun <= once + 2);
        TEST_ASSERT_EQUAL_MEMORY(expected, states, sizeof states);
    }
}

/* In the step with a derivative and in one right after steps that went beyond. */
EACH_METHOD static void test_no_internal_step_passes_the_end_of_a_polynomial(void) {
    const double h = 1.0 / 1024.0;
    initialize_at(0.0);
    step_held(1024, h);
    for (int i = 1024; i < 1100; i++) {
        latest = -INFINITY;
        set_input_derivative(OSCILLATOR_u, 1, 0.5);
        ASSERT_OK(instance_do_step(instance, i * h, h, NULL));
        TEST_ASSERT_TRUE(latest <= (i + 1) * h * (1.0 + 1e-12));
    }
}

/* With another parameter there is no first step from before either: bit for bit a new instance that
 * starts in the state at the point, the times being exact. */
EACH_METHOD static void test_a_new_parameter_makes_a_new_instance(void) {
    const double h = 1.0 / 1024.0;
    double states[2];
    double expected[2];
    initialize_of(instance, 0.0, 4.0);
    step_held(1024, h);
    get_states(instance, states);
    struct instance *fresh = watched();
    set_of(fresh, OSCILLATOR_x, states[0]);
    set_of(fresh, OSCILLATOR_v, states[1]);
    set_of(fresh, OSCILLATOR_omega, 3.0);
    set_of(fresh, OSCILLATOR_u, 1.5);
    initialize_of(fresh, 1.0, 4.0);
    set(OSCILLATOR_omega, 3.0);
    set(OSCILLATOR_u, 1.5);
    for (int i = 1024; i < 2048; i++) {
        ASSERT_OK(instance_do_step(instance, i * h, h, NULL));
        ASSERT_OK(instance_do_step(fresh, i * h, h, NULL));
        get_states(instance, states);
        get_states(fresh, expected);
        TEST_ASSERT_EQUAL_MEMORY(expected, states, sizeof states);
    }
    instance_destroy(fresh);
}

/* ---- Jumps of the input --------------------------------------------------------------------- */

/* Linear congruential generator of Knuth, MMIX: from -1 to 1. */
static double random_sign(uint64_t *state) {
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (double)(*state >> 11) * 0x1p-52 - 1.0;
}

/* Error of 1000 steps of 1/128 s, relative to the largest values of the solution. The input jumps
 * by up to this fraction of itself, at every so many communication points. */
static double error_with_jumps(double tolerance, double jump, int every) {
    const double h = 1.0 / 128.0;
    uint64_t random = 1;
    double exact[2] = {1.0, 0.0};
    double states[2];
    double u = 1.0;
    double error = 0.0;
    double scale = 0.0;
    begin_anew();
    set(OSCILLATOR_relative_tolerance, tolerance);
    initialize_at(0.0);
    for (int i = 0; i < 1000; i++) {
        if (i % every == 0) {
            u = 1.0 + jump * random_sign(&random);
        }
        set(OSCILLATOR_u, u);
        ASSERT_OK(instance_do_step(instance, i * h, h, NULL));
        oscillator_solution(2.0, u, h, exact, exact);
        get_states(instance, states);
        for (int k = 0; k < 2; k++) {
            error = fmax(error, fabs(states[k] - exact[k]));
            scale = fmax(scale, fabs(exact[k]));
        }
    }
    return error / scale;
}

/* No size of jump is so small that going on costs accuracy, or so large that a restart does. */
EACH_METHOD static void test_jumps_of_all_sizes_keep_the_accuracy(void) {
    static const double tolerances[] = {1e-5, 1e-9};
    static const int intervals[] = {1, 25};
    for (int i = 0; i < 4; i++) {
        const double tolerance = tolerances[i / 2];
        const double smallest = error_with_jumps(tolerance, 1e-12, intervals[i % 2]);
        for (int exponent = -12; exponent <= 3; exponent += 2) {
            const double error = error_with_jumps(tolerance, pow(10.0, exponent), intervals[i % 2]);
            TEST_ASSERT_TRUE(error <= 3.0 * tolerance);
            TEST_ASSERT_TRUE(error <= 2.0 * smallest);
        }
    }
}

/* At 2^53 s a step of 1 s rounds to none, though one of -1 s would not. */
EACH_METHOD static void test_a_step_that_rounds_to_none_is_refused(void) {
    const double far = 9007199254740992.0;
    TEST_ASSERT_TRUE(far + 1.0 == far && far - 1.0 != far);
    initialize_of(instance, far, INFINITY);
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_TIME, instance_do_step(instance, far, 1.0, NULL));
    TEST_ASSERT_NOT_NULL(strstr(last_text, "does not change the time"));
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_TIME, instance_do_step(instance, far - 1.0, 1.0, NULL));
    ASSERT_OK(instance_do_step(instance, far, 2.0, NULL));
}

/* A nominal value sets the scale of the absolute tolerance: the larger, the fewer internal steps
 * where the state is small. */
static int steps_with_nominal(double nominal) {
    struct variable variables[32];
    struct model_description description = model_description;
    struct instance *scaled = NULL;
    const unsigned steps_reference = OSCILLATOR_solver_steps;
    const unsigned method_reference = OSCILLATOR_solver_method;
    int steps = 0;
    for (size_t i = 0; i < model_description.variable_count; i++) {
        variables[i] = model_description.variables[i];
        if (variables[i].reference == OSCILLATOR_x || variables[i].reference == OSCILLATOR_v) {
            variables[i].nominal = nominal;
        }
    }
    description.variables = variables;
    ASSERT_OK(instance_create(&description, &last_text_sink, &scaled));
    ASSERT_OK(instance_set_integer(scaled, &method_reference, 1, &method));
    set_of(scaled, OSCILLATOR_x, 1e-6);
    initialize_of(scaled, 0.0, INFINITY);
    ASSERT_OK(instance_do_step(scaled, 0.0, 10.0, NULL));
    ASSERT_OK(instance_get_integer(scaled, &steps_reference, 1, &steps));
    instance_destroy(scaled);
    return steps;
}

EACH_METHOD static void test_nominal_values_scale_the_absolute_tolerance(void) {
    TEST_ASSERT_GREATER_THAN_INT(3 * steps_with_nominal(1e2) / 2, steps_with_nominal(1e-2));
}

/* A restart takes its first step from the last one: it needs no evaluation to find one. */
EACH_CVODE_METHOD static void test_a_restart_finds_its_first_step_without_evaluations(void) {
    struct instance *fresh = watched();
    const double x = 0.5;
    initialize_of(instance, 0.0, INFINITY);
    ASSERT_OK(instance_do_step(instance, 0.0, 2.0, NULL));
    const int before = get_int(OSCILLATOR_solver_rhs_evaluations);
    set(OSCILLATOR_u, x);
    ASSERT_OK(instance_do_step(instance, 2.0, 1e-6, NULL));
    const int restarted = get_int(OSCILLATOR_solver_rhs_evaluations) - before;

    set_of(fresh, OSCILLATOR_x, get(OSCILLATOR_x));
    set_of(fresh, OSCILLATOR_v, get(OSCILLATOR_v));
    set_of(fresh, OSCILLATOR_u, x);
    initialize_of(fresh, 0.0, INFINITY);
    ASSERT_OK(instance_do_step(fresh, 0.0, 1e-6, NULL));
    const unsigned reference = OSCILLATOR_solver_rhs_evaluations;
    int evaluations = 0;
    ASSERT_OK(instance_get_integer(fresh, &reference, 1, &evaluations));
    TEST_ASSERT_LESS_THAN_INT(evaluations, restarted);
    instance_destroy(fresh);
}

/* ---- Inputs at four times, and reports ------------------------------------------------------- */

/* u = 1 - t + t^2 - 2 t^3 after the start at 1 s. */
static double cubic(double time) {
    const double t = time - 1.0;
    return 1.0 - t * (1.0 - t * (1.0 - 2.0 * t));
}

static unsigned asked;

static enum status set_cubic(void *context, double time) {
    asked++;
    set(OSCILLATOR_u, cubic(time));
    return STATUS_OK;
}

/* x'' = -omega^2 x + u with u a cubic and x(0) = 1, x'(0) = 0: a particular cubic and the free
 * motion. */
static double solution(double time) {
    const double t = time - 1.0;
    const double w2 = 4.0; // omega = 2
    const double c[4] = {1.0, -1.0, 1.0, -2.0};
    const double p3 = c[3] / w2;
    const double p2 = c[2] / w2;
    const double p1 = (c[1] - 6.0 * p3) / w2;
    const double p0 = (c[0] - 2.0 * p2) / w2;
    return p0 + t * (p1 + t * (p2 + t * p3)) + (1.0 - p0) * cos(2.0 * t) - p1 / 2.0 * sin(2.0 * t);
}

EACH_METHOD static void test_a_cubic_input_is_exact(void) {
    const struct step_options options = {.ask_inputs = set_cubic};
    asked = 0;
    set(OSCILLATOR_max_step, 0.25); // so that all methods need some steps
    initialize_at(1.0);
    for (int i = 0; i < 4; i++) {
        ASSERT_OK(instance_do_step(instance, 1.0 + 0.25 * i, 0.25, &options));
        TEST_ASSERT_TRUE(get(OSCILLATOR_u) == cubic(1.25 + 0.25 * i));
    }
    TEST_ASSERT_EQUAL_UINT(4 * POLYNOMIAL_NODES, asked);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, solution(2.0), get(OSCILLATOR_x));
    // afterwards it is held at its last value
    const double held = get(OSCILLATOR_u);
    ASSERT_OK(instance_do_step(instance, 2.0, 0.25, NULL));
    TEST_ASSERT_TRUE(held == get(OSCILLATOR_u));
}

static unsigned report_count;
static double last_report; /* s */

/* At the third one the step is to end at 90 s. */
static enum status note(void *context, double time, double *end) {
    TEST_ASSERT_TRUE(time > last_report && time <= *end);
    TEST_ASSERT_TRUE(get(OSCILLATOR_time) == time);
    last_report = time;
    if (++report_count == 3) {
        *end = 90.0;
    }
    return STATUS_OK;
}

/* Asked for the end of internal steps, a step may take as many of them as without. */
EACH_METHOD static void test_the_limit_of_internal_steps_holds_over_early_ends(void) {
    const struct step_options noting = {.accept = note};
    set_int(OSCILLATOR_max_internal_steps, 12);
    initialize_at(1.0);
    report_count = 0;
    last_report = 1.0;
    TEST_ASSERT_EQUAL_INT(STATUS_TOO_MANY_STEPS, instance_do_step(instance, 1.0, 99.0, &noting));
    TEST_ASSERT_LESS_OR_EQUAL_UINT(12, report_count);
}

/* ---- Messages ------------------------------------------------------------------------------- */

static unsigned times_said;

/* Times of a step from 1000 s to 1100 s, which an integrator counts from its last restart. */
static void note_times(void *context, enum status status, const char *text) {
    static const char name[] = "t = ";
    for (const char *at = strstr(text, name); at != NULL; at = strstr(at + 1, name)) {
        const double t = strtod(at + strlen(name), NULL);
        TEST_ASSERT_TRUE_MESSAGE(t >= 1000.0 && t <= 1100.0, text);
        times_said += strstr(text, integrator_method_name((enum integrator_method)method)) == text;
    }
}

EACH_METHOD static void test_messages_have_the_time_of_the_simulation(void) {
    const struct message_sink sink = {.write = note_times};
    const struct model_description *description = instance->description;
    tearDown();
    times_said = 0;
    ASSERT_OK(instance_create(description, &sink, &instance));
    set_int(OSCILLATOR_solver_method, method);
    set_int(OSCILLATOR_max_internal_steps, 12);
    initialize_at(1000.0);
    ASSERT_OK(instance_do_step(instance, 1000.0, 1e-6, NULL));
    set(OSCILLATOR_u, 1.0); // a restart
    const double t = instance_time(instance);
    TEST_ASSERT_EQUAL_INT(STATUS_TOO_MANY_STEPS, instance_do_step(instance, t, 99.0, NULL));
    TEST_ASSERT_GREATER_THAN_UINT(0, times_said);
}
