#include "fuzz_exchange.h"
#include "fuzz_model.h"

#include <math.h>

enum { MAX_STEPS = 40, MOST_UPDATES = 100 };

/* From event mode to continuous-time mode; false: no modes follow. */
static bool update_discrete_states(struct subject *subject, struct fuzz_exchange *run) {
    struct fuzz_instance *instance = subject->instance;
    fmi2EventInfo info = {.newDiscreteStatesNeeded = fmi2True};
    for (int i = 0; info.newDiscreteStatesNeeded; i++) {
        const fmi2Status status = FUZZ_CHECKED(instance, NewDiscreteStates, &info);
        if (status == fmi2Error && !subject->is_inconsistent) {
            fuzz_fail("fmi2NewDiscreteStates fails: %s", instance->text);
        }
        if (status != fmi2OK || i == MOST_UPDATES) {
            return false;
        }
        if (info.terminateSimulation || info.nominalsOfContinuousStatesChanged) {
            fuzz_fail("fmi2NewDiscreteStates wants the end, or other nominal values");
        }
        if (info.nextEventTimeDefined && !isfinite(info.nextEventTime)) {
            fuzz_fail("the next time event is at %g s", info.nextEventTime);
        }
    }
    if (info.nextEventTimeDefined && !(info.nextEventTime > instance->time)) {
        fuzz_fail("the next time event at %.17g s is not behind %.17g s", info.nextEventTime,
                  instance->time);
    }
    run->next_time = info.nextEventTimeDefined ? info.nextEventTime : INFINITY;
    if (FUZZ_CHECKED_PLAIN(instance, EnterContinuousTimeMode) != fmi2OK) {
        if (!subject->is_inconsistent) {
            fuzz_fail("fmi2EnterContinuousTimeMode fails: %s", instance->text);
        }
        return false;
    }
    subject->is_inconsistent = false;
    subject->phase = PHASE_CONTINUOUS_TIME;
    return fuzz_exchange_read(run);
}

/* Inputs and parameters change in event mode. */
static bool handle_event(struct subject *subject, struct fuzz_exchange *run) {
    fuzz_require(FUZZ_CHECKED_PLAIN(subject->instance, EnterEventMode), subject->instance,
                 "fmi2EnterEventMode");
    subject->phase = PHASE_STEPPING;
    const unsigned count = fuzz_below(subject->input, 4);
    for (unsigned i = 0; i < count; i++) {
        fuzz_model_set_any(subject);
    }
    return update_discrete_states(subject, run);
}

void fuzz_model_exchange(struct subject *subject) {
    struct fuzz_exchange run = {.instance = subject->instance};
    const double length = fuzz_magnitude(subject->input, 1e-5, 0.05);
    if (!isfinite(subject->instance->time + MAX_STEPS * length) ||
        subject->instance->time + length == subject->instance->time ||
        !update_discrete_states(subject, &run)) {
        return;
    }
    for (int i = 0; i < MAX_STEPS && subject->input->left > 0; i++) {
        const unsigned selector = fuzz_below(subject->input, 16);
        if (selector == 0) {
            fuzz_exchange_repeat(&run, length);
        } else if (selector == 1) {
            fuzz_model_set_any(subject);
        } else if (selector == 2) {
            fuzz_model_derive(subject);
        }
        if (subject->instance->in_error) {
            return;
        }
        const enum fuzz_outcome outcome = fuzz_exchange_step(&run, length);
        if (outcome == FUZZ_IS_OVER ||
            ((outcome == FUZZ_MEETS_EVENT || selector == 3) && !handle_event(subject, &run))) {
            return;
        }
    }
}
