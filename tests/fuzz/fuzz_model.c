/* Any model: random parameters, states and inputs by its description, steps, rollback, serialized
 * and forged states, in Co-Simulation and Model Exchange. README.md says how an input is decoded.
 */
#include "fuzz_model.h"

#include <math.h>

enum { MAX_SETTINGS = 12, MAX_OPERATIONS = 16, MAX_INTERNAL_STEPS = 100 };

/* ---- States ---------------------------------------------------------------------------------- */

static void keep_or_go_back(struct subject *subject) {
    if (subject->saved != NULL && fuzz_below(subject->input, 2) == 0) {
        fuzz_restore(subject->instance, subject->saved, subject->saved_time);
        subject->is_usual = subject->saved_usual;
        subject->is_inconsistent = subject->saved_inconsistent;
        return;
    }
    if (subject->saved != NULL) {
        fuzz_forget(subject->instance, &subject->saved);
    }
    subject->saved = fuzz_save(subject->instance);
    subject->saved_time = subject->instance->time;
    subject->saved_usual = subject->is_usual;
    subject->saved_inconsistent = subject->is_inconsistent;
}

/* ---- Initialization -------------------------------------------------------------------------- */

static void set_some(struct subject *subject) {
    const unsigned count = fuzz_below(subject->input, MAX_SETTINGS);
    for (unsigned i = 0; i < count; i++) {
        fuzz_model_set_any(subject);
    }
}

static double any_start(struct fuzz_input *input) {
    switch (fuzz_below(input, 8)) {
    case 0:
        return fuzz_real(input);
    case 1:
        return fuzz_magnitude(input, 1e-3, 1e9);
    default:
        return 0.0;
    }
}

static double any_tolerance(struct fuzz_input *input) {
    switch (fuzz_below(input, 8)) {
    case 0:
        return fuzz_real(input);
    case 1:
    case 2:
    case 3:
        return fuzz_magnitude(input, 1e-14, 1e-2);
    default:
        return 0.0; // not defined
    }
}

/* From a new or reset instance; false: something in it is refused, with the reason. */
static bool initialize(struct subject *subject) {
    struct fuzz_instance *instance = subject->instance;
    subject->phase = PHASE_INSTANTIATED;
    subject->is_usual = true;
    fuzz_limit_steps(instance, MAX_INTERNAL_STEPS);
    set_some(subject);
    const double tolerance = any_tolerance(subject->input);
    const double start = any_start(subject->input);
    subject->is_usual &= fabs(start) <= 1e6;
    if (FUZZ_CHECKED(instance, SetupExperiment, tolerance != 0.0, tolerance, start, fmi2False,
                     0.0) != fmi2OK) {
        return false;
    }
    instance->time = start;
    if (FUZZ_CHECKED_PLAIN(instance, EnterInitializationMode) != fmi2OK) {
        return false;
    }
    subject->phase = PHASE_INITIALIZATION;
    set_some(subject);
    if (FUZZ_CHECKED_PLAIN(instance, ExitInitializationMode) != fmi2OK) {
        return false;
    }
    if (!isfinite(start)) {
        fuzz_fail("a start at %g s is accepted", start);
    }
    subject->phase = PHASE_STEPPING;
    subject->is_inconsistent = false;
    return true;
}

static bool start_again(struct subject *subject) {
    fuzz_reset(subject->instance);
    return initialize(subject);
}

/* ---- Steps ----------------------------------------------------------------------------------- */

static double any_length(struct fuzz_input *input) {
    switch (fuzz_below(input, 8)) {
    case 0:
        return fuzz_real(input);
    case 1:
        return fuzz_magnitude(input, 1e-3, 1e6);
    case 2:
    case 3:
        return 1e-3;
    default:
        return fuzz_magnitude(input, 1e-7, 2.0);
    }
}

static bool is_possible(double begin, double length) {
    return length > 0.0 && length <= 1e300 && fabs(begin) <= 1e300 && begin + length != begin;
}

struct step {
    double begin, length; /* s */
    unsigned choices;
    fmi2Status status;
};

/* The time is within the step; in FMI 3.0 a discarded step leaves no trace. */
static void check_discard(const struct step *step, const struct fuzz_values *before,
                          const struct fuzz_values *after) {
    const double reached = fuzz_value(after, 0);
    if (!(reached >= step->begin && reached <= step->begin + step->length)) {
        fuzz_fail("a discarded step from %.17g of %g s reaches %.17g", step->begin, step->length,
                  reached);
    }
    if (fmu_version == 3) {
        fuzz_assert_same(before, after, "after a discarded step of FMI 3.0");
    }
}

/* A step fails where its times or the parameters are refused, and only there. */
static void check_error(const struct subject *subject, const struct step *step) {
    const bool is_refused = !is_possible(step->begin, step->length);
    if (is_refused && step->status != fmi2Error) {
        fuzz_fail("a step from %.17g of %g s has the status %d", step->begin, step->length,
                  (int)step->status);
    }
    const bool has_reason = is_refused || subject->is_inconsistent ||
                            (fuzz_model_failed_inside() && !subject->is_usual);
    if (step->status == fmi2Error && !has_reason) {
        fuzz_fail("a step from %.17g of %g s fails: %s", step->begin, step->length,
                  subject->instance->text);
    }
}

/* The same step from the state before it. */
static void repeat(struct subject *subject, const struct step *step, fmi2FMUstate state,
                   const struct fuzz_values *after) {
    struct fuzz_values again;
    fuzz_restore(subject->instance, state, step->begin);
    if (fuzz_model_step(subject->instance, step->length, step->choices) != step->status) {
        fuzz_fail("a repeated step has another status than %d", (int)step->status);
    }
    fuzz_read(subject->instance, &again);
    fuzz_assert_same(after, &again, "a repeated step");
}

static void do_step(struct subject *subject) {
    struct fuzz_instance *instance = subject->instance;
    struct fuzz_values before;
    struct fuzz_values after;
    struct step step = {.begin = instance->time, .length = any_length(subject->input)};
    step.choices = fuzz_byte(subject->input);
    fmi2FMUstate state = fuzz_save(subject->instance);
    fuzz_read(instance, &before);
    step.status = fuzz_model_step(instance, step.length, step.choices);
    check_error(subject, &step);
    if (step.status == fmi2OK) {
        subject->is_inconsistent = false;
        subject->is_usual &= fabs(instance->time) <= 1e6;
        fuzz_model_read(subject, &after);
    } else {
        fuzz_read(instance, &after);
    }
    if (step.status == fmi2Discard) {
        check_discard(&step, &before, &after);
    }
    if (step.status != fmi2OK || step.choices >= 160) {
        repeat(subject, &step, state, &after);
    }
    if (step.status != fmi2OK) {
        fuzz_restore(subject->instance, state, step.begin);
        fuzz_read(instance, &after);
        fuzz_assert_same(&before, &after, "after a rollback");
    }
    if (step.status == fmi2Discard && is_possible(step.begin, step.length / 1024.0)) {
        if (fuzz_model_step(instance, step.length / 1024.0, step.choices) == fmi2Error &&
            !fuzz_model_failed_inside()) {
            fuzz_fail("a shorter step after a rollback fails: %s", instance->text);
        }
        fuzz_restore(subject->instance, state, step.begin);
    }
    fuzz_forget(subject->instance, &state);
}

/* ---- Moved to another instance --------------------------------------------------------------- */

/* Whether a forged state asks for no more work in a step than this. */
static bool is_quick(struct fuzz_instance *instance, fmi2Integer most) {
    static const char *const limits[] = {"max_internal_steps", "max_events"};
    for (size_t i = 0; i < FUZZ_COUNT(limits); i++) {
        const struct variable *limit = fuzz_find(limits[i]);
        fmi2Integer value = 0;
        if (limit != NULL &&
            (FUZZ_CHECKED(instance, GetInteger, &limit->reference, 1, &value) != fmi2OK ||
             value > most)) {
            return false;
        }
    }
    return true;
}

static void use_forged(struct fuzz_input *input, struct fuzz_instance *other) {
    const fmi2ValueReference time = 0;
    const double length = any_length(input);
    struct fuzz_values values;
    if (is_quick(other, 4 * MAX_INTERNAL_STEPS) &&
        FUZZ_CHECKED(other, GetReal, &time, 1, &other->time) == fmi2OK &&
        fuzz_model_step(other, length, 0) != fmi2Error) {
        fuzz_read(other, &values);
    }
}

static void use_same(struct fuzz_input *input, struct fuzz_instance *instance,
                     struct fuzz_instance *other) {
    struct fuzz_values here;
    struct fuzz_values there;
    const double length = any_length(input);
    const unsigned choices = fuzz_byte(input);
    const double begin = instance->time;
    fmi2FMUstate before = fuzz_save(instance);
    other->time = begin;
    other->slope = instance->slope;
    const fmi2Status status = fuzz_model_step(instance, length, choices);
    if (fuzz_model_step(other, length, choices) != status) {
        fuzz_fail("a step in another instance has another status than %d", (int)status);
    }
    fuzz_read(instance, &here);
    fuzz_read(other, &there);
    fuzz_assert_same(&here, &there, "a step in another instance");
    fuzz_restore(instance, before, begin);
    fuzz_forget(instance, &before);
}

/* Gives the state to another instance by its bytes: a step of this variety has the same bits. Or
 * forges the bytes: they do no harm, a step can be tried, and its values are finite. A state that
 * is accepted serializes to the bytes that it came from. */
static void move_state(struct fuzz_input *input, struct fuzz_instance *instance) {
    static struct fuzz_bytes bytes;
    static struct fuzz_bytes again;
    const bool is_forged = fuzz_below(input, 2) == 0;
    struct fuzz_instance *other =
        fuzz_instance_create(instance->kind, is_forged ? 0 : instance->variety, true, false);
    fmi2FMUstate state = NULL;
    fuzz_serialize(instance, &bytes);
    if (is_forged) {
        fuzz_forge(input, &bytes);
    }
    const fmi2Status status =
        FUZZ_CHECKED(other, DeSerializeFMUstate, bytes.data, bytes.size, &state);
    if (!is_forged && status != fmi2OK) {
        fuzz_fail("a serialized state is refused: %s", other->text);
    }
    if (status == fmi2OK) {
        fuzz_serialize_state(other, state, &again);
        if (!fuzz_are_same_bytes(&again, &bytes)) {
            fuzz_fail("an accepted state is serialized to other bytes");
        }
        fuzz_require(FUZZ_CHECKED(other, SetFMUstate, state), other, "fmi2SetFMUstate");
        is_forged ? use_forged(input, other) : use_same(input, instance, other);
    }
    fuzz_instance_free(other);
}

/* ---- Co-Simulation --------------------------------------------------------------------------- */

static void run_co_simulation(struct subject *subject) {
    for (int i = 0; i < MAX_OPERATIONS && subject->input->left > 0; i++) {
        switch (fuzz_below(subject->input, 16)) {
        case 0:
        case 1:
            fuzz_model_set_any(subject);
            break;
        case 2:
            fuzz_model_move_inputs(subject);
            break;
        case 3:
            move_state(subject->input, subject->instance);
            break;
        case 4:
        case 5:
            keep_or_go_back(subject);
            break;
        case 6:
            fuzz_model_derive(subject);
            break;
        case 7:
        case 8:
            fuzz_model_set_inputs(subject);
            break;
        case 9:
            if (fuzz_below(subject->input, 4) != 0) {
                fuzz_model_call_anything(subject);
            } else if (!start_again(subject)) {
                return;
            }
            break;
        default:
            do_step(subject);
            break;
        }
        if (subject->instance->in_error) {
            return;
        }
    }
}

/* ---- The target ------------------------------------------------------------------------------ */

/* From a new or reset instance. */
static void run(struct fuzz_input *input, struct fuzz_instance *instance) {
    struct subject subject = {.input = input, .instance = instance};
    if (initialize(&subject)) {
        instance->kind == fmi2ModelExchange ? fuzz_model_exchange(&subject)
                                            : run_co_simulation(&subject);
    }
    if (subject.saved != NULL) {
        fuzz_forget(instance, &subject.saved);
    }
}

static void assert_same_bytes(struct fuzz_instance *expected, struct fuzz_instance *actual,
                              const char *what) {
    static struct fuzz_bytes bytes[2];
    fuzz_serialize(expected, &bytes[0]);
    fuzz_serialize(actual, &bytes[1]);
    if (!fuzz_are_same_bytes(&bytes[0], &bytes[1])) {
        fuzz_fail("%s differs from a new instance's", what);
    }
}

/* A reset instance is as a new one, whatever it did before, and so is another run of it. */
static void assert_as_new(const struct fuzz_input *rest, struct fuzz_instance *instance) {
    struct fuzz_instance *fresh =
        fuzz_instance_create(instance->kind, instance->variety, true, false);
    struct fuzz_input inputs[] = {*rest, *rest};
    fuzz_reset(instance);
    assert_same_bytes(fresh, instance, "the state after fmi2Reset");
    run(&inputs[0], fresh);
    run(&inputs[1], instance);
    if (fresh->in_error != instance->in_error) {
        fuzz_fail("a run after fmi2Reset has an error, or none: %s%s", fresh->text, instance->text);
    }
    if (!fresh->in_error) {
        assert_same_bytes(fresh, instance, "the end of a run after fmi2Reset");
    }
    fuzz_instance_free(fresh);
}

void fuzz_target_run(struct fuzz_input *input) {
    const unsigned selector = fuzz_byte(input);
    const unsigned variety = fuzz_model_variety(input);
    const bool is_exchange = selector % 4 == 3;
    const size_t skipped = input->left / 3;
    const struct fuzz_input rest = {.at = input->at + skipped, .left = input->left - skipped};
    struct fuzz_instance *instance = fuzz_instance_create(
        is_exchange ? fmi2ModelExchange : fmi2CoSimulation, is_exchange ? 0 : variety, true, false);
    run(input, instance);
    if (selector >= 192) {
        assert_as_new(&rest, instance);
    }
    fuzz_instance_free(instance);
}
