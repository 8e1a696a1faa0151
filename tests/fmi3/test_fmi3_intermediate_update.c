/* Intermediate updates: inputs at four times of a step, outputs after each internal step, and an
 * early return that is asked for there. FMI 3.0, section 4.2.2. */
#include "each_method.h"
#include "fmu3_harness.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

static const fmi3ValueReference inputs[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_f2};
static const fmi3ValueReference outputs[] = {RP_MANIPULATOR_q1, RP_MANIPULATOR_ddq1};

static const struct fmu3_options with_inputs = {
    .intermediate_updates = true, .required = inputs, .required_count = FMU_COUNT(inputs)};
static const struct fmu3_options with_outputs = {.intermediate_updates = true,
                                                 .early_return = true,
                                                 .required = outputs,
                                                 .required_count = FMU_COUNT(outputs)};

static fmi3Instance swinging(const struct fmu3_options *options, int with_method, double start) {
    const fmi3Instance instance = fmu3_co_simulation(options);
    fmu3_set_method(instance, with_method);
    fmu3_set(instance, RP_MANIPULATOR_relative_tolerance, 1e-11);
    fmu3_set(instance, RP_MANIPULATOR_q1, 0.3);
    fmu3_set(instance, RP_MANIPULATOR_dq1, 1.0);
    fmu3_initialize(instance, start);
    return instance;
}

/* ---- Inputs --------------------------------------------------------------------------------- */

/* tau1 and f2 as functions of time, with all their derivatives at t. */
static void smooth_inputs(double t, double u[2]) {
    u[0] = 12.0 + 6.0 * sin(7.0 * t);
    u[1] = 4.0 + 5.0 * cos(5.0 * t);
}

struct asked {
    double times[16];
    unsigned count;
    fmi3Status status; /* the worst of setting the inputs */
};

static void set_smooth_inputs(struct fmu3_importer *of, const struct fmu3_update *update) {
    struct asked *asked = of->data;
    double u[2];
    if (!update->set) {
        return;
    }
    smooth_inputs(update->time, u);
    const fmi3Status status = fmu3.SetFloat64(of->instance, inputs, 2, u, 2);
    asked->status = status > asked->status ? status : asked->status;
    if (asked->count < FMU_COUNT(asked->times)) {
        asked->times[asked->count++] = update->time;
    }
}

static void test_inputs_are_asked_for_at_four_times(void) {
    struct asked asked = {.status = fmi3OK};
    importer.update = set_smooth_inputs;
    importer.data = &asked;
    const fmi3Instance instance = swinging(&with_inputs, 1, 2.0);
    fmu3_step(instance, 2.0, 0.75);
    static const double expected[] = {2.0, 2.25, 2.5, 2.75};
    TEST_ASSERT_EQUAL_UINT(4, asked.count);
    TEST_ASSERT_EQUAL_MEMORY(expected, asked.times, sizeof expected);

    // the last one is the value of the input from then on
    double u[2];
    smooth_inputs(2.75, u);
    TEST_ASSERT_TRUE(u[0] == fmu3_get(instance, RP_MANIPULATOR_tau1));
    TEST_ASSERT_TRUE(u[1] == fmu3_get(instance, RP_MANIPULATOR_f2));
}

/* What is asked for and not set keeps its value: the same bits as without intermediate updates. */
EACH_METHOD static void test_what_is_not_set_keeps_its_value(void) {
    double x[2][FMU_STATES];
    for (int updates = 0; updates < 2; updates++) {
        const fmi3Instance instance = swinging(updates ? &with_inputs : NULL, method, 0.0);
        for (int i = 0; i < 50; i++) {
            if (i % 10 == 0) {
                fmu3_set(instance, RP_MANIPULATOR_tau1, 3.0 + i);
            }
            fmu3_step(instance, 0.02 * i, 0.02);
        }
        fmu3_get_states(instance, x[updates]);
    }
    TEST_ASSERT_EQUAL_MEMORY(x[0], x[1], sizeof x[0]);
    TEST_ASSERT_GREATER_THAN_UINT(199, importer.updates);
}

/* No input is among the variables: none is asked for. */
static void note_set(struct fmu3_importer *of, const struct fmu3_update *update) {
    *(unsigned *)of->data += update->set;
}

static void test_inputs_that_were_not_named_are_not_asked_for(void) {
    unsigned asked = 0;
    importer.update = note_set;
    importer.data = &asked;
    const fmi3Instance instance = swinging(&with_outputs, 1, 0.0);
    fmu3_step(instance, 0.0, 0.5);
    TEST_ASSERT_EQUAL_UINT(0, asked);
    TEST_ASSERT_GREATER_THAN_UINT(0, importer.updates);
}

/* ---- Outputs -------------------------------------------------------------------------------- */

enum { MOST_POINTS = 4000 };

struct points {
    unsigned count;
    double times[MOST_POINTS];
    double values[MOST_POINTS][2];
    double derivatives[MOST_POINTS];
    bool is_wrong; /* a status or a flag */
};

static void get_outputs(struct fmu3_importer *of, const struct fmu3_update *update) {
    const fmi3Int32 order = 1;
    struct points *points = of->data;
    const unsigned i = points->count;
    if (i == MOST_POINTS) {
        return;
    }
    points->times[i] = update->time;
    points->is_wrong |= update->set || !update->get || !update->finished || *update->return_early ||
                        *update->early_time != update->time;
    points->is_wrong |= fmu3.GetFloat64(of->instance, outputs, 2, points->values[i], 2) != fmi3OK ||
                        fmu3.GetOutputDerivatives(of->instance, &outputs[0], 1, &order,
                                                  &points->derivatives[i], 1) != fmi3OK;
    points->count++;
}

/* The values at internal steps are those of an instance that steps there, within the error of the
 * integration; times rise; the last one is the end of the step. Watching changes no bit. */
EACH_METHOD static void test_outputs_at_internal_steps(void) {
    static struct points points;
    const double start = 1.0;
    double x[2][FMU_STATES];
    memset(&points, 0, sizeof points);
    importer.update = get_outputs;
    importer.data = &points;
    for (int watched = 0; watched < 2; watched++) {
        const fmi3Instance instance = swinging(watched ? &with_outputs : NULL, method, start);
        fmu3_step(instance, start, 0.5);
        fmu3_step(instance, start + 0.5, 0.25);
        fmu3_get_states(instance, x[watched]);
    }
    TEST_ASSERT_EQUAL_MEMORY(x[0], x[1], sizeof x[0]);
    TEST_ASSERT_FALSE(points.is_wrong);
    TEST_ASSERT_GREATER_THAN_UINT(10, points.count);
    TEST_ASSERT_LESS_THAN_UINT(MOST_POINTS, points.count);

    double last = start;
    bool is_end_seen = false;
    const fmi3Instance other = swinging(NULL, method, start);
    for (unsigned i = 0; i < points.count; i++) {
        TEST_ASSERT_TRUE(points.times[i] > last);
        is_end_seen |= points.times[i] == start + 0.5;
        (void)fmu3_try_step(other, last, points.times[i] - last);
        last = points.times[i];
        TEST_ASSERT_DOUBLE_WITHIN(1e-8, fmu3_get(other, RP_MANIPULATOR_q1), points.values[i][0]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-7, fmu3_get(other, RP_MANIPULATOR_ddq1), points.values[i][1]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-8, fmu3_get(other, RP_MANIPULATOR_dq1), points.derivatives[i]);
    }
    TEST_ASSERT_TRUE(is_end_seen);
    TEST_ASSERT_TRUE(last == start + 0.75);
}

/* An output that depends on inputs directly follows them while they move. */
static const fmi3ValueReference power[] = {RP_MANIPULATOR_actuator_power, RP_MANIPULATOR_dq1,
                                           RP_MANIPULATOR_dq2};

static void compare_power(struct fmu3_importer *of, const struct fmu3_update *update) {
    double *largest_error = of->data;
    double u[2];
    double values[3];
    smooth_inputs(update->time, u);
    if (update->set) {
        (void)fmu3.SetFloat64(of->instance, inputs, 2, u, 2);
    } else if (fmu3.GetFloat64(of->instance, power, 3, values, 3) == fmi3OK) {
        const double expected = u[0] * values[1] + u[1] * values[2];
        *largest_error = fmax(*largest_error, fabs(values[0] - expected));
    } else {
        *largest_error = INFINITY;
    }
}

EACH_METHOD static void test_outputs_follow_moving_inputs(void) {
    static const fmi3ValueReference all[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_f2,
                                             RP_MANIPULATOR_actuator_power, RP_MANIPULATOR_dq1,
                                             RP_MANIPULATOR_dq2};
    static const struct fmu3_options options = {
        .intermediate_updates = true, .required = all, .required_count = FMU_COUNT(all)};
    double largest_error = 0.0;
    importer.update = compare_power;
    importer.data = &largest_error;
    const fmi3Instance instance = swinging(&options, method, 0.0);
    for (int i = 0; i < 10; i++) {
        fmu3_step(instance, 0.05 * i, 0.05);
    }
    // four times for inputs and once at least for outputs in each step
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(50, importer.updates);
    TEST_ASSERT_TRUE(largest_error < 1e-3); // of the cubic
}

/* ---- Early return --------------------------------------------------------------------------- */

struct request {
    unsigned at_update; /* counted from 1 */
    double after;       /* s: from the time of the update to the time asked for */
    double time;        /* s: that was asked for */
    unsigned could;     /* updates in which it was allowed */
    unsigned could_not;
};

static void ask_for_return(struct fmu3_importer *of, const struct fmu3_update *update) {
    struct request *request = of->data;
    request->could += update->can_return_early;
    request->could_not += !update->can_return_early;
    if (of->updates == request->at_update) {
        request->time = update->time + request->after;
        *update->return_early = true;
        *update->early_time = request->time;
    }
}

/* At the time asked for, or at the internal step where that lies before; the rest of the step ends
 * where the whole one does. */
EACH_METHOD static void test_an_early_return_is_obeyed(void) {
    static const double after[] = {0.0, -1.0, 1e-3, 0.04, 1e-9};
    const double end = 0.6;
    const fmi3Instance whole = swinging(NULL, method, 0.0);
    fmu3_step(whole, 0.0, end);
    for (size_t i = 0; i < FMU_COUNT(after); i++) {
        struct request request = {.at_update = 8, .after = after[i]};
        importer.update = ask_for_return;
        importer.data = &request;
        importer.updates = 0;
        const fmi3Instance instance = swinging(&with_outputs, method, 0.0);
        const struct fmu3_step early = fmu3_try_step(instance, 0.0, end);
        ASSERT_OK(early.status);
        TEST_ASSERT_TRUE(early.early);
        TEST_ASSERT_FALSE(early.event || early.terminate);
        TEST_ASSERT_TRUE(early.reached == fmu3_get(instance, RP_MANIPULATOR_time));
        TEST_ASSERT_TRUE(early.reached < end);
        if (after[i] >= 1e-3) {
            TEST_ASSERT_TRUE(early.reached == request.time);
        } else {
            TEST_ASSERT_DOUBLE_WITHIN(1.1e-9, request.time - fmin(after[i], 0.0), early.reached);
        }

        request.at_update = 0;
        fmu3_step(instance, early.reached, end - early.reached);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, fmu3_get(whole, RP_MANIPULATOR_q1),
                                  fmu3_get(instance, RP_MANIPULATOR_q1));
        fmu3_free(instance);
    }
}

/* Nor at the end of the step, whatever the importer says there. */
static void test_no_early_return_where_it_is_not_allowed(void) {
    for (int allowed = 0; allowed < 2; allowed++) {
        struct fmu3_options options = with_outputs;
        struct request request = {.at_update = allowed ? 0 : 3, .after = 0.0};
        options.early_return = allowed;
        importer.update = ask_for_return;
        importer.data = &request;
        importer.updates = 0;
        const fmi3Instance instance = swinging(&options, 1, 0.0);
        fmu3_step(instance, 0.0, 0.5);
        TEST_ASSERT_EQUAL_UINT(allowed ? 1 : importer.updates, request.could_not);
        TEST_ASSERT_EQUAL_UINT(allowed ? importer.updates - 1 : 0, request.could);
    }
}

/* An input that moves has the value of the time of the return. */
static void set_and_return(struct fmu3_importer *of, const struct fmu3_update *update) {
    if (update->set) {
        fmi3Float64 u[2];
        smooth_inputs(update->time, u);
        (void)fmu3.SetFloat64(of->instance, inputs, 2, u, 2);
    } else {
        *update->return_early = true;
        *update->early_time = 0.1;
    }
}

static void test_inputs_stop_where_the_step_does(void) {
    struct fmu3_options options = with_inputs;
    double u[2];
    options.early_return = true;
    importer.update = set_and_return;
    const fmi3Instance instance = swinging(&options, 1, 0.0);
    const struct fmu3_step early = fmu3_try_step(instance, 0.0, 0.15);
    TEST_ASSERT_TRUE(early.early && early.reached == 0.1);
    smooth_inputs(0.1, u);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, u[0], fmu3_get(instance, RP_MANIPULATOR_tau1));
    TEST_ASSERT_DOUBLE_WITHIN(0.02, u[1], fmu3_get(instance, RP_MANIPULATOR_f2));
}

/* ---- What fails in an intermediate update ------------------------------------------------------
 */

/* One call, made in the first update that allows to get, or to set. */
struct intrusion {
    const char *name;
    bool while_setting;
    fmi3Status (*call)(fmi3Instance instance, fmi3ValueReference reference, double value);
    fmi3ValueReference reference;
    double value;
    fmi3Status status;
    unsigned calls;
};

static void intrude(struct fmu3_importer *of, const struct fmu3_update *update) {
    struct intrusion *intrusion = of->data;
    if (intrusion->calls == 0 && update->set == intrusion->while_setting) {
        intrusion->calls++;
        intrusion->status = intrusion->call(of->instance, intrusion->reference, intrusion->value);
    }
}

static fmi3Status read(fmi3Instance instance, fmi3ValueReference reference, double value) {
    return fmu3.GetFloat64(instance, &reference, 1, &value, 1);
}

static fmi3Status read_integer(fmi3Instance instance, fmi3ValueReference reference, double value) {
    fmi3Int32 integer;
    return fmu3.GetInt32(instance, &reference, 1, &integer, 1);
}

static fmi3Status free_instance(fmi3Instance instance, fmi3ValueReference reference, double value) {
    fmu3.FreeInstance(instance);
    return fmi3Error;
}

static fmi3Status free_after_error(fmi3Instance instance, fmi3ValueReference reference,
                                   double value) {
    (void)fmu3.Reset(instance);
    fmu3.FreeInstance(instance);
    (void)fmu3.Reset(instance);
    return fmi3Error;
}

/* The step then returns an error, whatever was called (each function: test_fmi3_states.c); the
 * instance can be reset and used again. */
static void test_what_is_not_allowed_makes_the_step_fail(void) {
    static const fmi3ValueReference both[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_q1,
                                              RP_MANIPULATOR_ddq1};
    static const struct fmu3_options options = {.intermediate_updates = true,
                                                .early_return = true,
                                                .required = both,
                                                .required_count = FMU_COUNT(both)};
    static const struct intrusion intrusions[] = {
        {"a parameter is read", false, read, .reference = RP_MANIPULATOR_m1},
        {"an output that was not named", false, read, .reference = RP_MANIPULATOR_ee_x},
        {"an integer is read", false, read_integer, .reference = RP_MANIPULATOR_solver_steps},
        {"an output is read while inputs are set", true, read, .reference = RP_MANIPULATOR_q1},
        {"an input is set after an internal step", false, fmu3_try_set,
         .reference = RP_MANIPULATOR_tau1, .value = 1.0},
        {"a parameter is set", true, fmu3_try_set, .reference = RP_MANIPULATOR_m1, .value = 1.0},
        {"an output is set", true, fmu3_try_set, .reference = RP_MANIPULATOR_q1, .value = 1.0},
        {"an input is not a number", true, fmu3_try_set, .reference = RP_MANIPULATOR_tau1,
         .value = NAN},
        {"the instance is freed", false, .call = free_instance},
        {"the instance is freed while inputs are set", true, .call = free_instance},
        {"the instance is freed after an error", false, .call = free_after_error},
    };
    for (size_t i = 0; i < FMU_COUNT(intrusions); i++) {
        struct intrusion intrusion = intrusions[i];
        importer.update = intrude;
        importer.data = &intrusion;
        const fmi3Instance instance = swinging(&options, 1, 0.0);
        fmu_log_clear(&messages);
        const struct fmu3_step step = fmu3_try_step(instance, 0.0, 0.5);
        TEST_ASSERT_EQUAL_UINT_MESSAGE(1, intrusion.calls, intrusion.name);
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi3Error, intrusion.status, intrusion.name);
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi3Error, step.status, intrusion.name);
        TEST_ASSERT_TRUE_MESSAGE(step.reached == -1.0 && step.early, intrusion.name); // not written
        TEST_ASSERT_GREATER_THAN_UINT_MESSAGE(0, messages.count[fmi3Error], intrusion.name);

        // terminated: values can be read, and a reset leads out
        (void)fmu3_get(instance, RP_MANIPULATOR_q1);
        ASSERT_ERROR(fmu3_try_step(instance, 0.0, 0.1).status);
        ASSERT_OK(fmu3.Reset(instance));
        fmu3_initialize(instance, 0.0);
        fmu3_step(instance, 0.0, 0.1);
        fmu3_free(instance);
    }
}
