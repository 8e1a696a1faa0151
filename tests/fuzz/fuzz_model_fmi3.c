/* Steps of FMI 3.0: intermediate updates move the inputs and may end the step, and events are left
 * to event mode. */
#include "fuzz_fmi3.h"
#include "fuzz_model.h"

#include <math.h>

/* What intermediate updates do in steps. */
static struct {
    fmi2ValueReference variables[FUZZ_VARIABLE_CAPACITY]; /* inputs, then outputs */
    size_t input_count, output_count;
    double begin;  /* s: of the step */
    double middle; /* s: from here on it is asked to end; INFINITY: it is not */
    bool was_asked, has_failed;
} updates = {.middle = INFINITY};

static void update(fmi3InstanceEnvironment environment, fmi3Float64 time, fmi3Boolean set,
                   fmi3Boolean get, fmi3Boolean finished, fmi3Boolean can_return_early,
                   fmi3Boolean *return_early, fmi3Float64 *early_time) {
    struct fuzz_instance *instance = environment;
    const fmi3Instance c = fmu_fmi3_instance(instance->component);
    double values[FUZZ_VARIABLE_CAPACITY];
    fmi3Status status = fmi3OK;
    if (set == get || finished != get || !isfinite(time)) {
        fuzz_fail("an intermediate update at %g s may set: %d, get: %d, finished: %d", time, set,
                  get, finished);
    }
    if (set && instance->slope != 0.0) {
        for (size_t i = 0; i < updates.input_count; i++) {
            values[i] = instance->slope * (time - updates.begin);
        }
        status = FUZZ_CALL(
            fmi3SetFloat64(c, updates.variables, updates.input_count, values, updates.input_count));
    }
    if (get) {
        fuzz_poison(values, updates.output_count);
        status = FUZZ_CALL(fmi3GetFloat64(c, updates.variables + updates.input_count,
                                          updates.output_count, values, updates.output_count));
        fuzz_assert_written((fmi2Status)status, values, updates.output_count,
                            "an intermediate update");
    }
    if (status == fmi3Error && set && isfinite(values[0])) {
        fuzz_fail("an intermediate update at %g s cannot set inputs: %s", time, instance->text);
    }
    updates.has_failed |= status == fmi3Error;
    if (get && can_return_early && time >= updates.middle) {
        *return_early = true;
        *early_time = time;
        updates.was_asked = true;
    }
}

static void choose_variety(unsigned variety) {
    updates.input_count = fuzz_model_references(CAUSALITY_INPUT, updates.variables);
    updates.output_count =
        fuzz_model_references(CAUSALITY_OUTPUT, updates.variables + updates.input_count);
    fmu_fmi3_options = (struct fmu_fmi3_options){
        .event_mode = variety & FUZZ_EVENT_MODE,
        .early_return = variety & FUZZ_EARLY_RETURN,
        .update = variety & FUZZ_UPDATES ? update : NULL,
        .required = updates.variables,
        .required_count = updates.input_count + updates.output_count,
    };
    if (variety == 0) {
        fmu_fmi3_options = (struct fmu_fmi3_options){0};
    }
}

unsigned fuzz_model_variety(struct fuzz_input *input) {
    fuzz_choose_variety = choose_variety;
    return fuzz_below(input, FUZZ_VARIETIES);
}

void fuzz_model_move_inputs(struct subject *subject) {
    const double slope = fuzz_likely_real(subject->input);
    // no part of the state: it must be usual whatever state comes next
    subject->instance->slope = fabs(slope) <= 1e3 ? slope : 1.0;
}

bool fuzz_model_failed_inside(void) {
    return updates.has_failed;
}

/* One update of the discrete states passes the event. */
static void handle_event(struct fuzz_instance *instance) {
    bool more = true;
    bool terminate = true;
    bool nominals = true;
    bool states = true;
    bool has_next = true;
    double next = NAN;
    if (FUZZ_FMI3_CHECKED_PLAIN(instance, EnterEventMode) != fmi2OK) {
        fuzz_fail("fmi3EnterEventMode fails: %s", instance->text);
    }
    const fmi2Status status = FUZZ_FMI3_CHECKED(instance, UpdateDiscreteStates, &more, &terminate,
                                                &nominals, &states, &has_next, &next);
    if (status == fmi2Error) {
        fuzz_fail("an event at %.17g s fails: %s", instance->time, instance->text);
    }
    if (status == fmi2OK && (terminate || nominals || (has_next && !isfinite(next)))) {
        fuzz_fail("an event at %.17g s ends the simulation: %d, changes nominal values: %d, has "
                  "the next one at %g s",
                  instance->time, terminate, nominals, next);
    }
    if (FUZZ_FMI3_CHECKED_PLAIN(instance, EnterStepMode) != fmi2OK) {
        fuzz_fail("fmi3EnterStepMode fails: %s", instance->text);
    }
}

/* choices: 1 asks for the end in the middle of the step, 2 leaves events to the next step. */
fmi2Status fuzz_model_step(struct fuzz_instance *instance, double length, unsigned choices) {
    const double end = instance->time + length;
    bool event = true;
    bool terminate = true;
    bool early = true;
    double reached;
    updates.begin = instance->time;
    updates.middle = choices & 1 ? instance->time + 0.5 * length : INFINITY;
    updates.was_asked = updates.has_failed = false;
    fuzz_poison(&reached, 1);
    const fmi2Status status = FUZZ_FMI3_CHECKED(instance, DoStep, instance->time, length, true,
                                                &event, &terminate, &early, &reached);
    fuzz_assert_written(status, &reached, 1, "fmi3DoStep");
    if (updates.has_failed && status != fmi2Error) {
        fuzz_fail("a step has the status %d after an error inside it", (int)status);
    }
    if (status != fmi2OK) {
        return status;
    }
    if (terminate || (event && !(instance->variety & FUZZ_EVENT_MODE)) ||
        early != (reached < end) || reached > end || reached < instance->time) {
        fuzz_fail("a step of %g s from %g s has reached %g s; early: %d, event: %d, end: %d",
                  length, instance->time, reached, early, event, terminate);
    }
    if (early && (!(instance->variety & FUZZ_EARLY_RETURN) ||
                  (model_description.model->events == NULL && !updates.was_asked))) {
        fuzz_fail("a step of %g s from %g s ends early though nobody asked", length,
                  instance->time);
    }
    instance->time = reached;
    if (event && !(choices & 2)) {
        handle_event(instance);
    }
    return status;
}
