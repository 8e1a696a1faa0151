/* Random valid parameters, states, inputs, tolerances, methods and steps: physics holds at every
 * successful step. README.md says how an input is decoded and why the bounds hold. */
#include "fuzz_instance.h"
#include "fuzz_physics.h"

#include <math.h>
#include <string.h>

const char *const fuzz_target_name = FUZZ_TARGET_NAME;

enum { MAX_STEPS = 8, MAX_INTERNAL_STEPS = 1000 };

static const fmi2ValueReference parameter_references[8] = {
    RP_MANIPULATOR_m1, RP_MANIPULATOR_m2,  RP_MANIPULATOR_I1z, RP_MANIPULATOR_I2z,
    RP_MANIPULATOR_l1, RP_MANIPULATOR_lc1, RP_MANIPULATOR_a,   RP_MANIPULATOR_g,
};
static const fmi2ValueReference state_references[4] = {RP_MANIPULATOR_q1, RP_MANIPULATOR_q2,
                                                       RP_MANIPULATOR_dq1, RP_MANIPULATOR_dq2};
static const fmi2ValueReference input_references[2] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_f2};

/* ---- What is simulated ----------------------------------------------------------------------- */

struct segment {
    double length; /* s */
    bool sets_inputs;
    double efforts[2];
    bool sets_derivative;
    fmi2Integer order;
    double derivative;
    bool sets_parameter;
    unsigned parameter;
    double parameter_value;
};

struct simulation {
    bool is_moderate; /* all magnitudes from 1e-3 to 1e3: the energy balance must hold */
    fmi2Integer method;
    double tolerance; /* relative, as requested */
    double max_step;  /* s; 0: no limit */
    double start;     /* s */
    double parameters[8];
    double states[4];
    size_t count;
    struct segment segments[MAX_STEPS];
};

/* 0, or of either sign. */
static double signed_magnitude(struct fuzz_input *input, bool is_moderate) {
    const unsigned selector = fuzz_byte(input);
    if (selector < 48) {
        return 0.0;
    }
    if (!is_moderate && selector < 96) {
        const double value = fuzz_real(input);
        return isfinite(value) ? value : 0.0;
    }
    const double magnitude = fuzz_magnitude(input, 1e-3, 1e3);
    return selector % 2 == 0 ? magnitude : -magnitude;
}

/* Valid whatever it is: section "Parameters" of the model's page. */
static double parameter(struct fuzz_input *input, unsigned i, bool is_moderate) {
    const bool has_sign = i >= 6;
    if (has_sign) {
        return signed_magnitude(input, is_moderate);
    }
    return is_moderate || fuzz_below(input, 2) == 0 ? fuzz_magnitude(input, 1e-3, 1e3)
                                                    : fuzz_magnitude(input, 1e-9, 1e100);
}

static void decode(struct fuzz_input *input, struct simulation *simulation) {
    memset(simulation, 0, sizeof *simulation);
    const bool is_moderate = fuzz_below(input, 4) != 3;
    simulation->is_moderate = is_moderate;
    simulation->method = 1 + (fmi2Integer)fuzz_below(input, FUZZ_METHODS);
    simulation->tolerance = fuzz_magnitude(input, 1e-14, 1e-2);
    simulation->max_step = fuzz_below(input, 8) == 7 ? fuzz_magnitude(input, 1e-6, 10.0) : 0.0;
    simulation->start = fuzz_below(input, 8) == 7 ? signed_magnitude(input, true) : 0.0;
    for (unsigned i = 0; i < 8; i++) {
        simulation->parameters[i] = parameter(input, i, is_moderate);
    }
    for (int i = 0; i < 4; i++) {
        simulation->states[i] = signed_magnitude(input, is_moderate);
    }
    while (simulation->count < MAX_STEPS && (input->left > 0 || simulation->count == 0)) {
        struct segment *segment = &simulation->segments[simulation->count++];
        const unsigned changes = fuzz_byte(input);
        segment->length = fuzz_magnitude(input, 1e-6, 1e3);
        segment->sets_inputs = (changes & 1) != 0 || simulation->count == 1;
        for (int i = 0; segment->sets_inputs && i < 2; i++) {
            segment->efforts[i] = signed_magnitude(input, is_moderate);
        }
        segment->sets_derivative = changes % 16 == 15;
        if (segment->sets_derivative) {
            segment->order = 1 + (fmi2Integer)fuzz_below(input, 3);
            segment->derivative = signed_magnitude(input, is_moderate);
        }
        segment->sets_parameter = changes % 16 == 14;
        if (segment->sets_parameter) {
            segment->parameter = fuzz_below(input, 8);
            segment->parameter_value = parameter(input, segment->parameter, is_moderate);
        }
    }
}

/* ---- One run --------------------------------------------------------------------------------- */

struct trace {
    size_t count; /* segments done */
    fmi2Status statuses[MAX_STEPS];
    struct fuzz_values values[MAX_STEPS];
};

static void begin(struct fuzz_instance *instance, const struct simulation *simulation) {
    const fmi2ValueReference method = RP_MANIPULATOR_solver_method;
    const fmi2ValueReference max_step = RP_MANIPULATOR_max_step;
    fuzz_limit_steps(instance, MAX_INTERNAL_STEPS);
    fuzz_require(FUZZ_CHECKED(instance, SetReal, parameter_references, 8, simulation->parameters),
                 instance, "setting valid parameters");
    fuzz_require(FUZZ_CHECKED(instance, SetReal, state_references, 4, simulation->states), instance,
                 "setting states");
    fuzz_require(FUZZ_CHECKED(instance, SetInteger, &method, 1, &simulation->method), instance,
                 "setting the method");
    fuzz_require(FUZZ_CHECKED(instance, SetReal, &max_step, 1, &simulation->max_step), instance,
                 "setting the longest step");
    fuzz_require(fuzz_initialize(instance, simulation->tolerance, simulation->start), instance,
                 "the initialization");
}

/* Where a step was discarded the instance is at the last successful time, within the step; from the
 * state before, a shorter one may succeed. */
static void check_discard(struct fuzz_instance *instance, fmi2FMUstate before,
                          const struct segment *segment) {
    double reached;
    struct fuzz_values values;
    fuzz_require(FUZZ_CHECKED(instance, GetRealStatus, fmi2LastSuccessfulTime, &reached), instance,
                 "fmi2LastSuccessfulTime after a discarded step");
    if (!(reached >= instance->time && reached <= instance->time + segment->length)) {
        fuzz_fail("a step from %.17g of %.17g s is discarded with the last successful time %.17g",
                  instance->time, segment->length, reached);
    }
    fuzz_read(instance, &values);
    if (fuzz_value(&values, RP_MANIPULATOR_time) != reached) {
        fuzz_fail("after a discarded step the time is %.17g, the last successful one %.17g",
                  fuzz_value(&values, RP_MANIPULATOR_time), reached);
    }
    fuzz_require(FUZZ_CHECKED(instance, SetFMUstate, before), instance, "a rollback");
    if (fuzz_step(instance, segment->length / 1024.0) == fmi2Error) {
        fuzz_fail("a shorter step after a rollback fails: %s", instance->text);
    }
}

/* Sets what changes in front of a step. */
static void prepare(struct fuzz_instance *instance, const struct segment *segment) {
    if (segment->sets_parameter) {
        fuzz_require(FUZZ_CHECKED(instance, SetReal, &parameter_references[segment->parameter], 1,
                                  &segment->parameter_value),
                     instance, "changing a parameter");
    }
    if (segment->sets_inputs) {
        fuzz_require(FUZZ_CHECKED(instance, SetReal, input_references, 2, segment->efforts),
                     instance, "setting inputs");
    }
    if (segment->sets_derivative) {
        fuzz_require(FUZZ_CHECKED(instance, SetRealInputDerivatives, input_references, 1,
                                  &segment->order, &segment->derivative),
                     instance, "setting the derivative of an input");
    }
}

/* The trace of an instance that was just made or reset; false: it ended with a discarded step. */
static bool run(struct fuzz_instance *instance, const struct simulation *simulation,
                bool checks_energy, struct trace *trace) {
    fmi2FMUstate before = NULL;
    bool is_done = true;
    trace->count = 0;
    begin(instance, simulation);
    while (trace->count < simulation->count && is_done) {
        const struct segment *segment = &simulation->segments[trace->count];
        struct fuzz_values *after = &trace->values[trace->count];
        struct fuzz_values values;
        prepare(instance, segment);
        fuzz_read(instance, &values);
        fuzz_require(FUZZ_CHECKED(instance, GetFMUstate, &before), instance, "fmi2GetFMUstate");
        const fmi2Status status = fuzz_step(instance, segment->length);
        trace->statuses[trace->count] = status;
        fuzz_read(instance, after);
        trace->count++;
        is_done = status == fmi2OK;
        if (status == fmi2Error && instance->time + segment->length != instance->time) {
            fuzz_fail("a step of %g s fails: %s", segment->length, instance->text);
        }
        if (status == fmi2Discard) {
            check_discard(instance, before, segment);
        }
        if (status == fmi2OK && after->status == fmi2OK) {
            fuzz_check_newton_euler(after, !segment->sets_derivative);
        }
        if (status == fmi2OK && checks_energy && !segment->sets_derivative &&
            values.status == fmi2OK && after->status == fmi2OK) {
            fuzz_check_energy(instance, before, simulation->tolerance, segment->length, &values,
                              after);
        }
    }
    if (before != NULL) {
        fuzz_require(FUZZ_CHECKED(instance, FreeFMUstate, &before), instance, "fmi2FreeFMUstate");
    }
    return is_done;
}

/* ---- The target ------------------------------------------------------------------------------ */

void fuzz_target_run(struct fuzz_input *input) {
    static struct trace first;
    static struct trace second;
    struct simulation simulation;
    decode(input, &simulation);
    struct fuzz_instance *instance = fuzz_instance_create(fmi2CoSimulation, true, false);
    const bool was_done = run(instance, &simulation, simulation.is_moderate, &first);

    // an instance that has failed is as good as new after fmi2Reset; one that has not, now and then
    if (!was_done || simulation.count % 4 == 0) {
        fuzz_reset(instance);
        run(instance, &simulation, false, &second);
        for (size_t i = 0; i < first.count; i++) {
            if (second.count != first.count || first.statuses[i] != second.statuses[i]) {
                fuzz_fail("repeated after fmi2Reset, step %zu has the status %d, not %d", i,
                          (int)second.statuses[i], (int)first.statuses[i]);
            }
            fuzz_assert_same(&first.values[i], &second.values[i],
                             "a simulation repeated after fmi2Reset");
        }
        fuzz_assert_as_new(instance, (unsigned)simulation.method + FUZZ_METHODS - 1);
    }
    fuzz_instance_free(instance);
}
