/* RPPlant with friction, stops and payload: random valid parameters that change while it runs, all
 * inputs, saved and serialized states, in Co-Simulation and Model Exchange. README.md says how an
 * input is decoded. */
#include "fuzz_bytes.h"
#include "fuzz_plant_checks.h"
#include "fuzz_plant_settings.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

const char *const fuzz_target_name = FUZZ_TARGET_NAME;

enum { MAX_OPERATIONS = 20, MAX_INTERNAL_STEPS = 200 };

struct plant {
    struct fuzz_input *input;
    struct fuzz_instance *instance;
    double limits[2][2]; /* lower and upper stop of each joint */
    double tolerance;    /* as requested */
    bool inputs_move;    /* over the next step */
    bool has_wrench;
    bool is_disturbed;  /* parameters or payload have changed since the last step */
    fmi2FMUstate saved; /* NULL: none */
    double saved_time;
    bool saved_wrench;
};

/* ---- Settings -------------------------------------------------------------------------------- */

static void set_inputs(struct plant *plant) {
    static const fmi2ValueReference references[] = {RP_PLANT_tau1, RP_PLANT_f2, RP_PLANT_ee_fx,
                                                    RP_PLANT_ee_fy, RP_PLANT_ee_mz};
    double values[5] = {0.0};
    plant->has_wrench = fuzz_below(plant->input, 4) == 3;
    for (int i = 0; i < (plant->has_wrench ? 5 : 2); i++) {
        values[i] = fuzz_signed(plant->input, 1e-3, 100.0);
    }
    fuzz_require(FUZZ_CHECKED(plant->instance, SetReal, references, 5, values), plant->instance,
                 "inputs");
}

static void set_input_derivative(struct plant *plant) {
    const fmi2ValueReference reference =
        fuzz_below(plant->input, 2) == 0 ? RP_PLANT_tau1 : RP_PLANT_f2;
    const fmi2Integer order = 1 + (fmi2Integer)fuzz_below(plant->input, 3);
    const double value = fuzz_signed(plant->input, 1e-2, 1e3);
    fuzz_require(
        FUZZ_CHECKED(plant->instance, SetRealInputDerivatives, &reference, 1, &order, &value),
        plant->instance, "fmi2SetRealInputDerivatives");
    plant->inputs_move = true;
}

static void set_payload(struct plant *plant) {
    const fmi2ValueReference reference = RP_PLANT_payload_attached;
    const fmi2Boolean is_attached = fuzz_below(plant->input, 2) == 0 ? fmi2True : fmi2False;
    fuzz_require(FUZZ_CHECKED(plant->instance, SetBoolean, &reference, 1, &is_attached),
                 plant->instance, "fmi2SetBoolean");
    plant->is_disturbed = true;
}

static void initialize(struct plant *plant) {
    const fmi2ValueReference integers[] = {RP_PLANT_solver_method, RP_PLANT_max_events};
    const fmi2Integer limits[] = {fuzz_method(fuzz_byte(plant->input)),
                                  1 + (fmi2Integer)fuzz_below(plant->input, 20)};
    plant->tolerance = fuzz_magnitude(plant->input, 1e-12, 1e-3);
    fuzz_limit_steps(plant->instance, MAX_INTERNAL_STEPS);
    fuzz_require(FUZZ_CHECKED(plant->instance, SetInteger, integers, 2, limits), plant->instance,
                 "limits");
    fuzz_plant_set_arm(plant->input, plant->instance);
    for (unsigned i = 0; i < FUZZ_PLANT_GROUPS; i++) {
        fuzz_plant_set(plant->input, plant->instance, i, plant->limits);
    }
    fuzz_plant_set_states(plant->input, plant->instance, plant->limits);
    if (fuzz_below(plant->input, 2) == 0) {
        set_payload(plant);
    }
    set_inputs(plant);
    fuzz_require(fuzz_initialize(plant->instance, plant->tolerance, 0.0), plant->instance,
                 "initialization");
}

/* ---- Steps ----------------------------------------------------------------------------------- */

static double time_of(const struct fuzz_values *values) {
    return fuzz_value(values, RP_PLANT_time);
}

/* The time is within the step; in FMI 3.0 a discarded step leaves no trace. */
static void check_discard(struct plant *plant, const struct fuzz_values *after, double length) {
    struct fuzz_instance *instance = plant->instance;
    const double begin = instance->time;
    const double reached = time_of(after);
    if (!(reached >= begin && reached <= begin + length)) {
        fuzz_fail("a discarded step from %.17g of %g s reaches %.17g", begin, length, reached);
    }
    const bool is_undone = fmu_version == 3;
    if (is_undone && reached != begin) {
        fuzz_fail("a discarded step from %.17g leaves the time %.17g", begin, reached);
    }
    if (!is_undone) { // stops that were moved before the step have not moved the joints yet
        fuzz_check_stops(after);
    }
    if (strstr(instance->text, "max_events") != NULL) {
        fuzz_check_event_text(instance->text, reached, is_undone ? begin + length : reached);
    }
}

static double any_length(struct fuzz_input *input) {
    return fuzz_below(input, 4) == 0 ? 1e-3 : fuzz_magnitude(input, 1e-6, 2.0);
}

/* One step; often made again from the state before it, with the same bits. */
static void step(struct plant *plant) {
    struct fuzz_instance *instance = plant->instance;
    struct fuzz_values before;
    struct fuzz_values after;
    const double length = any_length(plant->input);
    const double begin = instance->time;
    fmi2FMUstate state = fuzz_save(plant->instance);
    fuzz_read(instance, &before);
    const fmi2Status status = fuzz_step(instance, length);
    if (status == fmi2Error) {
        fuzz_fail("a step from %.17g of %g s fails: %s", begin, length, instance->text);
    }
    fuzz_read(instance, &after);
    if (status == fmi2OK) {
        fuzz_check_point(&after);
        if (!plant->is_disturbed && !plant->inputs_move && !plant->has_wrench) {
            fuzz_check_losses(&before, &after, plant->tolerance);
        }
    } else {
        check_discard(plant, &after, length);
    }
    if (status != fmi2OK || fuzz_below(plant->input, 3) == 0) {
        struct fuzz_values again;
        fuzz_restore(instance, state, begin);
        if (fuzz_step(instance, length) != status) {
            fuzz_fail("a repeated step has another status than %d", (int)status);
        }
        fuzz_read(instance, &again);
        fuzz_assert_same(&after, &again, "a repeated step");
    }
    if (status != fmi2OK) {
        fuzz_restore(instance, state, begin);
        if (fuzz_step(instance, length / 1024.0) == fmi2Error) {
            fuzz_fail("a shorter step after a rollback fails: %s", instance->text);
        }
        fuzz_restore(instance, state, begin);
    } else {
        plant->inputs_move = false;
        plant->is_disturbed = false;
    }
    fuzz_forget(plant->instance, &state);
}

static fmi2Status step_plainly(struct fuzz_instance *instance, double length, unsigned choices) {
    return fuzz_step(instance, length);
}

static const struct fuzz_stepping stepping = {
    .any_length = any_length, .step = step_plainly, .most = 3 * MAX_INTERNAL_STEPS};

/* ---- Co-Simulation --------------------------------------------------------------------------- */

static void keep_or_go_back(struct plant *plant) {
    if (plant->saved != NULL && fuzz_below(plant->input, 2) == 0) {
        fuzz_restore(plant->instance, plant->saved, plant->saved_time);
        plant->has_wrench = plant->saved_wrench;
        plant->inputs_move = plant->is_disturbed = true; // not known any more
        return;
    }
    if (plant->saved != NULL) {
        fuzz_forget(plant->instance, &plant->saved);
    }
    plant->saved = fuzz_save(plant->instance);
    plant->saved_time = plant->instance->time;
    plant->saved_wrench = plant->has_wrench;
}

static void derive(struct plant *plant) {
    const fmi2ValueReference outputs[] = {RP_PLANT_ddq1, RP_PLANT_friction2, RP_PLANT_ee_ax};
    const fmi2ValueReference knowns[] = {RP_PLANT_f2, RP_PLANT_tau1};
    const double seed[] = {1.0, -0.5};
    double values[3];
    fuzz_poison(values, 3);
    const fmi2Status status = FUZZ_CHECKED(plant->instance, GetDirectionalDerivative, outputs, 3,
                                           knowns, 2, seed, values);
    fuzz_assert_written(status, values, 3, "fmi2GetDirectionalDerivative");
}

static void run_co_simulation(struct plant *plant) {
    for (int i = 0; i < MAX_OPERATIONS && plant->input->left > 0; i++) {
        switch (fuzz_below(plant->input, 16)) {
        case 0:
            set_payload(plant);
            break;
        case 1:
            fuzz_plant_set(plant->input, plant->instance,
                           fuzz_below(plant->input, FUZZ_PLANT_GROUPS), plant->limits);
            plant->is_disturbed = true;
            break;
        case 2:
            set_input_derivative(plant);
            break;
        case 3:
            fuzz_move_state(plant->input, plant->instance, &stepping);
            break;
        case 4:
        case 5:
            keep_or_go_back(plant);
            break;
        case 6:
            derive(plant);
            break;
        case 7:
        case 8:
            set_inputs(plant);
            break;
        default:
            step(plant);
            break;
        }
    }
}

/* ---- The target ------------------------------------------------------------------------------ */

void fuzz_target_run(struct fuzz_input *input) {
    const unsigned selector = fuzz_byte(input);
    const fmi2Type kind = selector % 4 == 3 ? fmi2ModelExchange : fmi2CoSimulation;
    struct plant plant = {.input = input, .instance = fuzz_instance_create(kind, true, false)};
    initialize(&plant);
    if (kind == fmi2CoSimulation) {
        run_co_simulation(&plant);
    } else {
        fuzz_plant_exchange(input, plant.instance);
    }
    if (plant.saved != NULL) {
        fuzz_forget(plant.instance, &plant.saved);
    }
    if (selector >= 224) {
        fuzz_assert_as_new(plant.instance, selector);
    }
    fuzz_instance_free(plant.instance);
}
