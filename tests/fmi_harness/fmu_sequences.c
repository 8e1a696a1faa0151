#include "fmu_sequences.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

/* ---- Random numbers ------------------------------------------------------------------------- */

/* splitmix64: Steele, Lea and Flood, Fast splittable pseudorandom number generators, 2014. */
static uint64_t next(struct fmu_random *random) {
    uint64_t z = random->state += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

unsigned fmu_random_below(struct fmu_random *random, unsigned count) {
    return (unsigned)(next(random) % count);
}

double fmu_random_between(struct fmu_random *random, double low, double high) {
    return low + (high - low) * ((double)(next(random) >> 11) * 0x1p-53);
}

/* ---- Operations ----------------------------------------------------------------------------- */

static const fmi2ValueReference inputs[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_f2};

struct range {
    fmi2ValueReference reference;
    double low, high;
};

static const struct range tunable[] = {
    {RP_MANIPULATOR_m1, 0.5, 4.0},  {RP_MANIPULATOR_m2, 0.2, 3.0}, {RP_MANIPULATOR_I1z, 0.05, 0.3},
    {RP_MANIPULATOR_I2z, 0.0, 0.1}, {RP_MANIPULATOR_l1, 0.2, 1.0}, {RP_MANIPULATOR_lc1, 0.0, 0.5},
    {RP_MANIPULATOR_a, -0.2, 0.2},  {RP_MANIPULATOR_g, 0.0, 12.0},
};

static const struct range states[] = {
    {RP_MANIPULATOR_q1, -3.0, 3.0},
    {RP_MANIPULATOR_q2, -0.2, 0.5},
    {RP_MANIPULATOR_dq1, -4.0, 4.0},
    {RP_MANIPULATOR_dq2, -1.0, 1.0},
};

static struct fmu_operation set_within(struct fmu_random *random, const struct range *range) {
    return (struct fmu_operation){
        .kind = FMU_SET,
        .reference = range->reference,
        .value = fmu_random_between(random, range->low, range->high),
    };
}

static struct fmu_operation set_input(struct fmu_random *random) {
    return (struct fmu_operation){
        .kind = FMU_SET,
        .reference = inputs[fmu_random_below(random, FMU_COUNT(inputs))],
        .value = fmu_random_between(random, -20.0, 20.0),
    };
}

static struct fmu_operation derive(struct fmu_random *random) {
    return (struct fmu_operation){
        .kind = FMU_DERIVE,
        .reference = inputs[fmu_random_below(random, FMU_COUNT(inputs))],
        .order = (fmi2Integer)fmu_random_below(random, 3) + 1,
        .value = fmu_random_between(random, -50.0, 50.0),
    };
}

static double random_step(struct fmu_random *random) {
    static const double usual[] = {1e-3, 1.0 / 60.0, 0.01, 0.1, 0.25};
    const unsigned choice = fmu_random_below(random, FMU_COUNT(usual) + 2);
    return choice < FMU_COUNT(usual) ? usual[choice]
                                     : pow(10.0, fmu_random_between(random, -5.0, -0.3));
}

static struct fmu_operation step(double length, double *time) {
    const struct fmu_operation operation = {.kind = FMU_STEP, .point = *time, .value = length};
    *time += length;
    return operation;
}

struct fmu_operation fmu_random_operation(struct fmu_random *random, double *time) {
    switch (fmu_random_below(random, 5)) {
    case 0:
        return set_input(random);
    case 1:
        return set_within(random, &tunable[fmu_random_below(random, FMU_COUNT(tunable))]);
    case 2:
        return derive(random);
    default:
        return step(random_step(random), time);
    }
}

fmi2Status fmu_apply(fmi2Component component, const struct fmu_operation *operation) {
    const bool has_stop = isfinite(operation->value);
    switch (operation->kind) {
    case FMU_SET:
        return fmu_try_set(component, operation->reference, operation->value);
    case FMU_SET_INTEGER:
        return fmu.SetInteger(component, &operation->reference, 1, &operation->order);
    case FMU_DERIVE:
        return fmu.SetRealInputDerivatives(component, &operation->reference, 1, &operation->order,
                                           &operation->value);
    case FMU_SETUP:
        return fmu.SetupExperiment(component, fmi2False, 0.0, operation->point, has_stop,
                                   has_stop ? operation->value : 0.0);
    case FMU_ENTER:
        if (fmu_version == 3) { // the experiment belongs to this call, and not to an FMU state
            (void)fmu.SetupExperiment(component, fmi2False, 0.0, operation->point, has_stop,
                                      has_stop ? operation->value : 0.0);
        }
        return fmu.EnterInitializationMode(component);
    case FMU_EXIT:
        return fmu.ExitInitializationMode(component);
    case FMU_STEP:
        return fmu.DoStep(component, operation->point, operation->value, fmi2True);
    }
    return fmi2Fatal;
}

/* ---- Sequences ------------------------------------------------------------------------------ */

static void add(struct fmu_sequence *sequence, struct fmu_operation operation) {
    if (sequence->count < FMU_SEQUENCE_CAPACITY) {
        sequence->operations[sequence->count++] = operation;
    }
}

/* Every 25th sequence begins with a hold of thousands of internal steps, in a motion that does not
 * slow down: the slide oscillates between a constant force inward and the centrifugal one. */
static bool holds_long(unsigned seed) {
    return seed % 25 == 1;
}

static const struct fmu_operation lasting[] = {
    {.kind = FMU_SET, .reference = RP_MANIPULATOR_g, .value = 0.0},
    {.kind = FMU_SET, .reference = RP_MANIPULATOR_q2, .value = 0.0},
    {.kind = FMU_SET, .reference = RP_MANIPULATOR_dq1, .value = 10.0},
    {.kind = FMU_SET, .reference = RP_MANIPULATOR_tau1, .value = 0.0},
    {.kind = FMU_SET, .reference = RP_MANIPULATOR_f2, .value = -20.0},
};

fmi2Component fmu_lasting(fmi2Integer method, struct fmu_log *log) {
    const fmi2Component component = fmu_instantiate(log, false);
    fmu_set_integer(component, RP_MANIPULATOR_solver_method, method);
    for (size_t i = 0; i < FMU_COUNT(lasting); i++) {
        ASSERT_OK(fmu_apply(component, &lasting[i]));
    }
    fmu_initialize(component, 0.0, 0.0);
    return component;
}

static struct fmu_operation set_integer(fmi2ValueReference reference, unsigned value) {
    return (struct fmu_operation){
        .kind = FMU_SET_INTEGER, .reference = reference, .order = (fmi2Integer)value};
}

static void add_initialization(struct fmu_sequence *sequence, struct fmu_random *random,
                               unsigned seed) {
    static const double starts[] = {0.0, 0.0, -0.5, 1000.0};
    static const double tolerances[] = {0.0, 0.0, 1e-4, 1e-6, 1e-10};
    for (size_t i = 0; i < FMU_COUNT(states); i++) {
        add(sequence, set_within(random, &states[i]));
    }
    add(sequence, set_input(random));
    add(sequence, (struct fmu_operation){
                      .kind = FMU_SET,
                      .reference = RP_MANIPULATOR_relative_tolerance,
                      .value = tolerances[fmu_random_below(random, FMU_COUNT(tolerances))],
                  });
    for (size_t i = 0; holds_long(seed) && i < FMU_COUNT(lasting); i++) {
        add(sequence, lasting[i]);
    }
    add(sequence, set_integer(RP_MANIPULATOR_solver_method, 1 + seed % (FMU_METHODS - 1)));
    if (seed % 4 == 3) {
        add(sequence, set_within(random, &(struct range){RP_MANIPULATOR_max_step, 0.002, 0.05}));
    }
    if (seed % 10 == 0) {
        add(sequence, set_integer(RP_MANIPULATOR_max_internal_steps, 40));
    }
    sequence->end = starts[fmu_random_below(random, FMU_COUNT(starts))];
    add(sequence,
        (struct fmu_operation){.kind = FMU_SETUP, .point = sequence->end, .value = INFINITY});
    if (!holds_long(seed) && fmu_random_below(random, 2) == 0) {
        add(sequence, derive(random));
    }
    sequence->readable_from = sequence->count;
    add(sequence,
        (struct fmu_operation){.kind = FMU_ENTER, .point = sequence->end, .value = INFINITY});
    if (!holds_long(seed)) {
        add(sequence, set_within(random, &tunable[fmu_random_below(random, FMU_COUNT(tunable))]));
        add(sequence, derive(random));
    }
    add(sequence, (struct fmu_operation){.kind = FMU_EXIT});
}

/* Some steps: inputs change at each, or at none, or come back to what they were. */
static void add_steps(struct fmu_sequence *sequence, struct fmu_random *random) {
    const unsigned style = fmu_random_below(random, 6);
    const unsigned count = 1 + fmu_random_below(random, 12);
    const double length = random_step(random);
    const bool varies = fmu_random_below(random, 2) == 0;
    struct fmu_operation input = set_input(random);
    if (style == 5) {
        add(sequence, set_within(random, &tunable[fmu_random_below(random, FMU_COUNT(tunable))]));
    }
    for (unsigned i = 0; i < count; i++) {
        if (style == 0 || style == 1) {
            add(sequence, set_input(random));
        }
        if (style == 1 || (style == 2 && fmu_random_below(random, 3) == 0)) {
            add(sequence, derive(random));
        }
        if (style == 3) { // the same value again, after another one or not
            if (fmu_random_below(random, 2) == 0) {
                struct fmu_operation other = input;
                other.value += 1.0;
                add(sequence, other);
            }
            add(sequence, input);
        }
        if (sequence->count < FMU_SEQUENCE_CAPACITY) {
            add(sequence, step(varies ? random_step(random) : length, &sequence->end));
        }
    }
}

void fmu_sequence_make(struct fmu_sequence *sequence, unsigned seed) {
    enum { SHORT = 60 };
    struct fmu_random random = {.state = seed};
    *sequence = (struct fmu_sequence){0};
    add_initialization(sequence, &random, seed);
    for (int i = 0; holds_long(seed) && i < 10; i++) {
        add(sequence, step(fmu_random_between(&random, 0.1, 2.0), &sequence->end));
    }
    while (sequence->count < SHORT) {
        add_steps(sequence, &random);
    }
    const double stop = fmu_random_below(&random, 2) == 0 ? sequence->end : INFINITY;
    for (size_t i = 0; i < sequence->count; i++) {
        if (sequence->operations[i].kind == FMU_SETUP ||
            sequence->operations[i].kind == FMU_ENTER) {
            sequence->operations[i].value = stop;
        }
    }
}

/* ---- Traces --------------------------------------------------------------------------------- */

static fmi2Status apply(fmi2Component component, const struct fmu_sequence *sequence, size_t at,
                        struct fmu_values *values) {
    memset(values, 0, sizeof *values);
    const fmi2Status status = fmu_apply(component, &sequence->operations[at]);
    if (at >= sequence->readable_from) {
        ASSERT_OK(fmu_get_all(component, values));
    }
    return status;
}

void fmu_sequence_run(fmi2Component component, const struct fmu_sequence *sequence,
                      struct fmu_trace *trace) {
    fmi2Status status = fmi2OK;
    trace->count = 0;
    while (trace->count < sequence->count && status == fmi2OK) {
        status = apply(component, sequence, trace->count, &trace->values[trace->count]);
        trace->statuses[trace->count++] = status;
    }
}

void fmu_sequence_check(fmi2Component component, const struct fmu_sequence *sequence, size_t at,
                        const struct fmu_trace *expected, const char *message) {
    struct fmu_values values;
    char text[256];
    snprintf(text, sizeof text, "%.200s, operation %zu", message, at);
    const fmi2Status status = apply(component, sequence, at, &values);
    TEST_ASSERT_EQUAL_INT_MESSAGE(expected->statuses[at], status, text);
    fmu_assert_same_values(&expected->values[at], &values, text);
}
