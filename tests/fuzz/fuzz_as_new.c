/* After an error: a reset instance against a new one. */
#include "fuzz_bytes.h"

enum { RUN_STEPS = 6 };

/* A short simulation, and the serialized state before it. */
struct run {
    bool is_known;
    struct fuzz_bytes bytes;
    struct fuzz_values after[RUN_STEPS];
};

/* Inputs of step i that any model takes, and their derivatives. */
static void move_inputs(struct fuzz_instance *instance, int i) {
    fmi2ValueReference references[FUZZ_VARIABLE_CAPACITY];
    fmi2Real values[FUZZ_VARIABLE_CAPACITY];
    fmi2Integer orders[FUZZ_VARIABLE_CAPACITY];
    size_t count = 0;
    for (size_t k = 0; k < model_description.variable_count; k++) {
        if (fuzz_is_smooth_input(&model_description.variables[k])) {
            references[count] = model_description.variables[k].reference;
            values[count] = count % 2 == 0 ? 0.5 * i : 9.81 - i;
            orders[count] = 1 + (fmi2Integer)(count % 2);
            count++;
        }
    }
    if (i != 1 && i != 2) {
        fuzz_require(FUZZ_CHECKED(instance, SetReal, references, count, values), instance,
                     "fmi2SetReal");
    }
    if (i == 4) {
        fuzz_require(
            FUZZ_CHECKED(instance, SetRealInputDerivatives, references, count, orders, values),
            instance, "fmi2SetRealInputDerivatives");
    }
}

static void run_co_simulation(struct fuzz_instance *instance, struct run *run) {
    static const double lengths[RUN_STEPS] = {1.0 / 64, 1.0 / 64, 0.25, 1e-3, 1e-3, 0.5};
    for (int i = 0; i < RUN_STEPS; i++) {
        move_inputs(instance, i);
        fuzz_require(fuzz_step(instance, lengths[i]), instance, "fmi2DoStep");
        fuzz_read(instance, &run->after[i]);
    }
}

static void run_model_exchange(struct fuzz_instance *instance, struct run *run) {
    double x[FUZZ_STATE_CAPACITY];
    double dx[FUZZ_STATE_CAPACITY];
    const size_t count = fuzz_state_count();
    fuzz_require(FUZZ_CHECKED_PLAIN(instance, EnterContinuousTimeMode), instance,
                 "fmi2EnterContinuousTimeMode");
    fuzz_require(FUZZ_CHECKED(instance, GetContinuousStates, x, count), instance,
                 "fmi2GetContinuousStates");
    for (int i = 0; i < RUN_STEPS; i++) {
        fuzz_require(FUZZ_CHECKED(instance, GetDerivatives, dx, count), instance,
                     "fmi2GetDerivatives");
        for (size_t k = 0; k < count; k++) {
            x[k] += 0.01 * dx[k];
        }
        instance->time += 0.01;
        fuzz_require(FUZZ_CHECKED(instance, SetTime, instance->time), instance, "fmi2SetTime");
        fuzz_require(FUZZ_CHECKED(instance, SetContinuousStates, x, count), instance,
                     "fmi2SetContinuousStates");
        fuzz_read(instance, &run->after[i]);
    }
}

/* States that are not those of the start, and a method. */
static void set_starts(struct fuzz_instance *instance, unsigned variant) {
    const struct variable *method = fuzz_find("solver_method");
    const fmi2Integer method_value = fuzz_method(variant);
    for (size_t i = 0; variant < FUZZ_METHODS && i < model_description.variable_count; i++) {
        const struct variable *variable = &model_description.variables[i];
        const fmi2Real value = i % 2 == 0 ? -0.75 : 0.25;
        if (variable->variability == VARIABILITY_CONTINUOUS && variable->initial == INITIAL_EXACT) {
            fuzz_require(FUZZ_CHECKED(instance, SetReal, &variable->reference, 1, &value), instance,
                         "fmi2SetReal");
        }
    }
    if (method != NULL) {
        fuzz_require(FUZZ_CHECKED(instance, SetInteger, &method->reference, 1, &method_value),
                     instance, "fmi2SetInteger");
    }
}

/* From an instance that was just made or reset. */
static void make_run(struct fuzz_instance *instance, unsigned variant, struct run *run) {
    fuzz_serialize(instance, &run->bytes);
    set_starts(instance, variant);
    fuzz_require(fuzz_initialize(instance, variant < FUZZ_METHODS ? 0.0 : 1e-6,
                                 variant < FUZZ_METHODS ? 0.0 : 1000.0),
                 instance, "the initialization");
    if (instance->kind == fmi2CoSimulation) {
        run_co_simulation(instance, run);
    } else {
        run_model_exchange(instance, run);
    }
}

static const struct run *run_of_fresh(fmi2Type kind, unsigned variety, unsigned variant) {
    static struct run runs[2][FUZZ_VARIETIES][FUZZ_RUN_VARIANTS];
    struct run *run = &runs[kind == fmi2CoSimulation][variety][variant];
    if (!run->is_known) {
        struct fuzz_instance *fresh = fuzz_instance_create(kind, variety, false, false);
        make_run(fresh, variant, run);
        fuzz_instance_free(fresh);
        run->is_known = true;
    }
    return run;
}

void fuzz_assert_as_new(struct fuzz_instance *instance, unsigned variant) {
    static struct run run;
    variant %= FUZZ_RUN_VARIANTS;
    const struct run *expected = run_of_fresh(instance->kind, instance->variety, variant);
    fuzz_reset_plain(instance);
    make_run(instance, variant, &run);
    if (!fuzz_are_same_bytes(&run.bytes, &expected->bytes)) {
        fuzz_fail("the serialized state after fmi2Reset is not that of a new instance");
    }
    for (int i = 0; i < RUN_STEPS; i++) {
        fuzz_assert_same(&expected->after[i], &run.after[i], "a run after fmi2Reset");
    }
    fuzz_reset(instance);
}
