/* Model Exchange as an importer does it: Euler's method, event indicators and time events. */
#include "fuzz_model.h"

#include <math.h>
#include <string.h>

enum { MAX_STEPS = 40, MOST_UPDATES = 100, INDICATOR_CAPACITY = 16 };

/* What an importer keeps of a run. */
struct run {
    struct fuzz_instance *instance;
    double x[FUZZ_STATE_CAPACITY];
    double z[INDICATOR_CAPACITY];
    double next_time; /* s: of the next time event; INFINITY: there is none */
};

/* Reads states and indicators; false: they cannot be computed. */
static bool read(struct run *run) {
    const size_t states = fuzz_state_count();
    const size_t indicators = model_description.indicator_count;
    if (indicators > INDICATOR_CAPACITY) {
        fuzz_fail("more indicators than INDICATOR_CAPACITY");
    }
    fuzz_poison(run->x, states);
    fuzz_poison(run->z, indicators);
    fmi2Status status = FUZZ_CHECKED(run->instance, GetContinuousStates, run->x, states);
    fuzz_assert_written(status, run->x, states, "fmi2GetContinuousStates");
    if (status == fmi2OK) {
        status = FUZZ_CHECKED(run->instance, GetEventIndicators, run->z, indicators);
        fuzz_assert_written(status, run->z, indicators, "fmi2GetEventIndicators");
    }
    return status == fmi2OK;
}

/* ---- Steps ----------------------------------------------------------------------------------- */

enum outcome { RESUMES, MEETS_EVENT, IS_OVER };

/* Forward Euler to the next time event at most. */
static enum outcome step(struct run *run, double length) {
    struct fuzz_instance *instance = run->instance;
    const size_t count = fuzz_state_count();
    fmi2Boolean enter_event_mode = fmi2True;
    fmi2Boolean terminate = fmi2True;
    double dx[FUZZ_STATE_CAPACITY];
    double z[INDICATOR_CAPACITY];
    const double end = fmin(instance->time + length, run->next_time);
    fuzz_poison(dx, count);
    const fmi2Status status = FUZZ_CHECKED(instance, GetDerivatives, dx, count);
    fuzz_assert_written(status, dx, count, "fmi2GetDerivatives");
    if (status != fmi2OK) {
        return IS_OVER;
    }
    for (size_t i = 0; i < count; i++) {
        run->x[i] += (end - instance->time) * dx[i];
        if (!(fabs(run->x[i]) < 1e6)) {
            return IS_OVER; // Euler's method has become unstable
        }
    }
    instance->time = end;
    if (FUZZ_CHECKED(instance, SetTime, end) != fmi2OK ||
        FUZZ_CHECKED(instance, SetContinuousStates, run->x, count) != fmi2OK ||
        FUZZ_CHECKED(instance, CompletedIntegratorStep, fmi2True, &enter_event_mode, &terminate) !=
            fmi2OK) {
        fuzz_fail("a step of Model Exchange to %.17g s fails: %s", end, instance->text);
    }
    if (terminate || (enter_event_mode && model_description.indicator_count == 0)) {
        fuzz_fail("fmi2CompletedIntegratorStep asks for %d %d", enter_event_mode, terminate);
    }
    memcpy(z, run->z, sizeof z);
    if (!read(run)) {
        return IS_OVER;
    }
    bool crosses = end == run->next_time || enter_event_mode;
    for (size_t i = 0; i < model_description.indicator_count; i++) {
        crosses |= (z[i] > 0.0) != (run->z[i] > 0.0);
    }
    return crosses ? MEETS_EVENT : RESUMES;
}

/* From a saved state the same step has the same bits; then the run is where it was. */
static void repeat(const struct run *run, double length) {
    struct fuzz_values values[2];
    const double begin = run->instance->time;
    fmi2FMUstate state = fuzz_save(run->instance);
    for (int i = 0; i < 2; i++) {
        struct run trial = *run;
        (void)step(&trial, length);
        fuzz_read(run->instance, &values[i]);
        fuzz_restore(run->instance, state, begin);
    }
    fuzz_assert_same(&values[0], &values[1], "a repeated step of Model Exchange");
    fuzz_forget(run->instance, &state);
}

/* ---- Events ---------------------------------------------------------------------------------- */

/* What it says of jumps of the states is true. */
static fmi2Status update(struct fuzz_instance *instance, fmi2EventInfo *info) {
    double before[FUZZ_STATE_CAPACITY];
    double after[FUZZ_STATE_CAPACITY];
    const size_t count = fuzz_state_count();
    fuzz_require(FUZZ_CHECKED(instance, GetContinuousStates, before, count), instance,
                 "states before an event");
    const fmi2Status status = FUZZ_CHECKED(instance, NewDiscreteStates, info);
    if (status != fmi2OK) {
        return status;
    }
    fuzz_require(FUZZ_CHECKED(instance, GetContinuousStates, after, count), instance,
                 "states after an event");
    if (info->valuesOfContinuousStatesChanged !=
        (memcmp(before, after, count * sizeof before[0]) != 0)) {
        fuzz_fail("fmi2NewDiscreteStates says %d about jumps of states",
                  info->valuesOfContinuousStatesChanged);
    }
    return status;
}

/* From event mode to continuous-time mode; false: no modes follow. */
static bool update_discrete_states(struct subject *subject, struct run *run) {
    struct fuzz_instance *instance = subject->instance;
    fmi2EventInfo info = {.newDiscreteStatesNeeded = fmi2True};
    for (int i = 0; info.newDiscreteStatesNeeded; i++) {
        const fmi2Status status = update(instance, &info);
        if (status == fmi2Error && !subject->is_inconsistent &&
            strstr(instance->text, "faster than they can be seen") == NULL) {
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
    return read(run);
}

/* Inputs and parameters change in event mode. */
static bool handle_event(struct subject *subject, struct run *run) {
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
    struct run run = {.instance = subject->instance};
    const double length = fuzz_magnitude(subject->input, 1e-5, 0.05);
    if (!isfinite(subject->instance->time + MAX_STEPS * length) ||
        subject->instance->time + length == subject->instance->time ||
        !update_discrete_states(subject, &run)) {
        return;
    }
    for (int i = 0; i < MAX_STEPS && subject->input->left > 0; i++) {
        const unsigned selector = fuzz_below(subject->input, 16);
        if (selector == 0) {
            repeat(&run, length);
        } else if (selector == 1) {
            fuzz_model_set_any(subject);
        } else if (selector == 2) {
            fuzz_model_derive(subject);
        } else if (selector == 4) {
            fuzz_model_call_anything(subject);
        }
        if (subject->instance->in_error) {
            return;
        }
        const enum outcome outcome = step(&run, length);
        if (outcome == IS_OVER ||
            ((outcome == MEETS_EVENT || selector == 3) && !handle_event(subject, &run))) {
            return;
        }
    }
}
