#include "fuzz_exchange.h"

#include <math.h>
#include <string.h>

bool fuzz_exchange_read(struct fuzz_exchange *run) {
    const size_t states = fuzz_state_count();
    const size_t indicators = model_description.indicator_count;
    if (indicators > FUZZ_INDICATOR_CAPACITY) {
        fuzz_fail("more indicators than FUZZ_INDICATOR_CAPACITY");
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

enum fuzz_outcome fuzz_exchange_step(struct fuzz_exchange *run, double length) {
    struct fuzz_instance *instance = run->instance;
    const size_t count = fuzz_state_count();
    fmi2Boolean enter_event_mode = fmi2True;
    fmi2Boolean terminate = fmi2True;
    double dx[FUZZ_STATE_CAPACITY];
    double z[FUZZ_INDICATOR_CAPACITY];
    const double end = fmin(instance->time + length, run->next_time);
    fuzz_poison(dx, count);
    const fmi2Status status = FUZZ_CHECKED(instance, GetDerivatives, dx, count);
    fuzz_assert_written(status, dx, count, "fmi2GetDerivatives");
    if (status != fmi2OK) {
        return FUZZ_IS_OVER;
    }
    for (size_t i = 0; i < count; i++) {
        run->x[i] += (end - instance->time) * dx[i];
        if (!(fabs(run->x[i]) < 1e6)) {
            return FUZZ_IS_OVER; // Euler's method has become unstable
        }
    }
    instance->time = end;
    if (FUZZ_CHECKED(instance, SetTime, end) != fmi2OK ||
        FUZZ_CHECKED(instance, SetContinuousStates, run->x, count) != fmi2OK ||
        FUZZ_CHECKED(instance, CompletedIntegratorStep, fmi2True, &enter_event_mode, &terminate) !=
            fmi2OK) {
        fuzz_fail("a step of Model Exchange to %.17g s fails: %s", end, instance->text);
    }
    if (enter_event_mode || terminate) {
        fuzz_fail("fmi2CompletedIntegratorStep asks for %d %d", enter_event_mode, terminate);
    }
    memcpy(z, run->z, sizeof z);
    if (!fuzz_exchange_read(run)) {
        return FUZZ_IS_OVER;
    }
    bool crosses = end == run->next_time;
    for (size_t i = 0; i < model_description.indicator_count; i++) {
        crosses |= (z[i] > 0.0) != (run->z[i] > 0.0);
    }
    return crosses ? FUZZ_MEETS_EVENT : FUZZ_RESUMES;
}

void fuzz_exchange_repeat(const struct fuzz_exchange *run, double length) {
    struct fuzz_values values[2];
    const double begin = run->instance->time;
    fmi2FMUstate state = fuzz_save(run->instance);
    for (int i = 0; i < 2; i++) {
        struct fuzz_exchange trial = *run;
        (void)fuzz_exchange_step(&trial, length);
        fuzz_read(run->instance, &values[i]);
        fuzz_restore(run->instance, state, begin);
    }
    fuzz_assert_same(&values[0], &values[1], "a repeated step of Model Exchange");
    fuzz_forget(run->instance, &state);
}
