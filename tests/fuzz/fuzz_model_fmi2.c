/* Steps of FMI 2.0. */
#include "fuzz_model.h"

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
    return fuzz_step(instance, length);
}
