/* Steps of FMI 2.0, and hostile calls that only this version has. */
#include "fuzz_hostile.h"
#include "fuzz_model.h"

#include <math.h>

unsigned fuzz_model_variety(struct fuzz_input *input) {
    (void)fuzz_byte(input); // as in FMI 3.0: one corpus
    return 0;
}

void fuzz_model_move_inputs(struct subject *subject) {
    enum { MOST_ORDERS = 3 };
    fmi2ValueReference references[FUZZ_VARIABLE_CAPACITY];
    const size_t count = fuzz_model_references(CAUSALITY_INPUT, references);
    if (count == 0) {
        return;
    }
    const size_t i = fuzz_below(subject->input, (unsigned)count);
    const fmi2Integer order = 1 + (fmi2Integer)fuzz_below(subject->input, MOST_ORDERS);
    const fmi2Real value = fuzz_likely_real(subject->input);
    fmi2FMUstate state = fuzz_save(subject->instance);
    const fmi2Status status =
        FUZZ_CHECKED(subject->instance, SetRealInputDerivatives, &references[i], 1, &order, &value);
    if (status == fmi2OK) {
        subject->is_usual &= value >= -1e3 && value <= 1e3;
    } else {
        fuzz_restore(subject->instance, state, subject->instance->time);
    }
    fuzz_forget(subject->instance, &state);
}

bool fuzz_model_failed_inside(void) {
    return false; // nobody asks inside of a step
}

fmi2Status fuzz_model_step(struct fuzz_instance *instance, double length, unsigned choices) {
    const fmi2Status status = FUZZ_CHECKED(instance, DoStep, instance->time, length, fmi2True);
    if (status == fmi2OK) {
        instance->time += length;
    }
    return status;
}

/* ---- Hostile calls --------------------------------------------------------------------------- */

static void DoStep(struct fuzz_input *input, struct fuzz_instance *instance) {
    const double point = fuzz_any_point(input, instance);
    const double length = fuzz_any_length(input);
    if (FUZZ_CHECKED(instance, DoStep, point, length, fuzz_integer(input)) == fmi2OK) {
        if (!(length > 0.0) || !isfinite(point + length)) {
            fuzz_fail("a step of %g s from %g s succeeds", length, point);
        }
        instance->time = point + length;
    }
}

static void CancelStep(struct fuzz_input *input, struct fuzz_instance *instance) {
    FUZZ_CHECKED_PLAIN(instance, CancelStep);
}

static void SetRealInputDerivatives(struct fuzz_input *input, struct fuzz_instance *instance) {
    const struct fuzz_references some = fuzz_any(input, VARIABLE_FLOAT64, true);
    const fmi2Integer *orders = fuzz_any_orders(input, some.count);
    const double *values = fuzz_any_reals(input, some.count);
    FUZZ_CHECKED(instance, SetRealInputDerivatives, some.at, some.count, orders, values);
}

static fmi2StatusKind any_status_kind(struct fuzz_input *input) {
    return (fmi2StatusKind)(fuzz_below(input, 8) != 0 ? (int)fuzz_below(input, 4)
                                                      : fuzz_integer(input));
}

static void GetRealStatus(struct fuzz_input *input, struct fuzz_instance *instance) {
    double *value = fuzz_unwritten(1);
    const fmi2Status status = FUZZ_CHECKED(instance, GetRealStatus, any_status_kind(input), value);
    fuzz_assert_written(status, value, 1, "fmi2GetRealStatus");
}

#define STATUS_CALL(name, type)                                                                    \
    static void name(struct fuzz_input *input, struct fuzz_instance *instance) {                   \
        FUZZ_CHECKED(instance, name, any_status_kind(input), &(type){0});                          \
    }
STATUS_CALL(GetStatus, fmi2Status)
STATUS_CALL(GetIntegerStatus, fmi2Integer)
STATUS_CALL(GetBooleanStatus, fmi2Boolean)
STATUS_CALL(GetStringStatus, fmi2String)

static fuzz_hostile_call *const calls[] = {
    DoStep,        DoStep,    DoStep,           CancelStep,       SetRealInputDerivatives,
    GetRealStatus, GetStatus, GetIntegerStatus, GetBooleanStatus, GetStringStatus,
};
const struct fuzz_hostile_calls fuzz_version_calls = {FUZZ_COUNT(calls), calls};
