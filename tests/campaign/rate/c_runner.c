/* The stepping loop of rparm/fmi/compiled_loop.py in C, over the same arrays: what a compiled
 * runner would gain. loop.py loads it as a shared library.
 */
#include <stdint.h>

#include "fmi2FunctionTypes.h"

struct wires {
    const uint32_t *inputs;
    const int64_t *first_input, *sources;
    const uint32_t *outputs;
    const int64_t *first_output;
    int64_t output_place; /* of the first output among the values */
};

/* As the rows of component_calls, of FMUs of FMI 2.0. */
struct calls {
    fmi2Component component;
    fmi2SetRealTYPE *set_real;
    fmi2GetRealTYPE *get_real;
    fmi2SetBooleanTYPE *set_boolean;
    fmi2GetBooleanTYPE *get_boolean;
    fmi2DoStepTYPE *do_step;
    fmi2GetDirectionalDerivativeTYPE *derivative;
    void *of_adapters[7];
};

/* All steps of a run; 0, or what failed. times: steps + 1; held: (steps + 1) x held_count; watched:
 * places among the values; record: (steps + 1) x watched_count. */
int advance(const struct calls *calls, int64_t components, const double *times, int64_t steps,
            const double *held, int64_t held_count, const struct wires *reals, double *values,
            double *to_set, const struct wires *switches, int32_t *truths, int32_t *switch_set,
            const int64_t *watched, int64_t watched_count, double *record);

int advance(const struct calls *calls, int64_t components, const double *times, int64_t steps,
            const double *held, int64_t held_count, const struct wires *reals, double *values,
            double *to_set, const struct wires *switches, int32_t *truths, int32_t *switch_set,
            const int64_t *watched, int64_t watched_count, double *record) {
    for (int64_t k = 0; k < watched_count; k++) {
        record[k] = values[watched[k]];
    }
    for (int64_t i = 0; i < steps; i++) {
        for (int64_t j = 0; j < held_count; j++) {
            values[j] = held[i * held_count + j];
        }
        for (int64_t c = 0; c < components; c++) {
            int64_t begin = reals->first_input[c], end = reals->first_input[c + 1];
            for (int64_t k = begin; k < end; k++) {
                to_set[k] = values[reals->sources[k]];
            }
            if (begin < end &&
                calls[c].set_real(calls[c].component, reals->inputs + begin, (size_t)(end - begin),
                                  to_set + begin) > fmi2Warning) {
                return 1;
            }
            begin = switches->first_input[c];
            end = switches->first_input[c + 1];
            int changed = 0;
            for (int64_t k = begin; k < end; k++) {
                changed |= switch_set[k] != truths[switches->sources[k]];
                switch_set[k] = truths[switches->sources[k]];
            }
            if (changed &&
                calls[c].set_boolean(calls[c].component, switches->inputs + begin,
                                     (size_t)(end - begin), switch_set + begin) > fmi2Warning) {
                return 2;
            }
        }
        for (int64_t c = 0; c < components; c++) {
            if (calls[c].do_step(calls[c].component, times[i], times[i + 1] - times[i], fmi2True) >
                fmi2Warning) {
                return 3;
            }
        }
        for (int64_t c = 0; c < components; c++) {
            int64_t begin = reals->first_output[c], end = reals->first_output[c + 1];
            if (begin < end &&
                calls[c].get_real(calls[c].component, reals->outputs + begin, (size_t)(end - begin),
                                  values + reals->output_place + begin) > fmi2Warning) {
                return 4;
            }
            begin = switches->first_output[c];
            end = switches->first_output[c + 1];
            if (begin < end &&
                calls[c].get_boolean(calls[c].component, switches->outputs + begin,
                                     (size_t)(end - begin),
                                     truths + switches->output_place + begin) > fmi2Warning) {
                return 5;
            }
        }
        for (int64_t k = 0; k < watched_count; k++) {
            record[(i + 1) * watched_count + k] = values[watched[k]];
        }
    }
    return 0;
}
