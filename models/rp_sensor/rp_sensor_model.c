#include "rp_sensor_model.h"

#include "rp_sensor_calculated.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

_Static_assert(offsetof(struct rp_sensor_values, ticks) ==
                   offsetof(struct rp_sensor_values, start) + sizeof(double),
               "the discrete states are one array of doubles");

static enum status right_hand_side(const void *values, double t, const double x[], const double u[],
                                   double dx[]) {
    return STATUS_OK; // there is no state
}

/* ---- Ticks ---------------------------------------------------------------------------------- */

/* Count of joint i at tick k, from the inputs. */
static int sampled(const struct rp_sensor_values *values, int i, double k) {
    const struct rp_sensor_parameters *p = &values->parameters;
    const double noise = p->noise[i] * rp_sensor_noise(p->seed, i, (uint64_t)k);
    return rp_sensor_count(values->q[i] + noise, p->resolution[i]);
}

/* Place of tick k. */
static size_t place_of(double k) {
    return (size_t)((uint64_t)k % RP_SENSOR_SAMPLES);
}

/* Count of joint i that is shown at tick k: of the start while none has come through. */
static int shown(const struct rp_sensor_values *values, int i, double k) {
    return values->samples[place_of(fmax(k - values->parameters.latency, 0.0))][i];
}

static double next_time(const void *values_pointer) {
    const struct rp_sensor_values *values = values_pointer;
    return values->start + values->ticks * values->parameters.sample_time;
}

/* Takes the sample of the start, at the end of the initialization, and the sample of each tick. */
static enum status update(void *values_pointer, const struct event *event) {
    struct rp_sensor_values *values = values_pointer;
    const bool is_start = values->ticks == 0.0;
    if (!is_start && !event->is_timed) {
        return STATUS_OK;
    }
    if (!isfinite(values->q[0]) || !isfinite(values->q[1])) {
        return STATUS_NOT_FINITE;
    }
    if (is_start) {
        const double shortest = event_shortest_period(event->t);
        if (values->parameters.sample_time < shortest) {
            (void)snprintf(event->reason, event->reason_size,
                           "sample_time = %g s is refused: at a start time of %g s it must be %g s "
                           "or more",
                           values->parameters.sample_time, event->t, shortest);
            return STATUS_INVALID_PARAMETERS;
        }
        values->start = event->t;
    }
    for (int i = 0; i < 2; i++) {
        values->samples[place_of(values->ticks)][i] = sampled(values, i, values->ticks);
    }
    values->ticks += 1.0;
    return STATUS_OK;
}

/* Ticks are counted in whole numbers, no count is beyond the last, and where none has been written
 * there is none. */
static bool modes_are_possible(const void *values_pointer, bool is_held) {
    const struct rp_sensor_values *values = values_pointer;
    if (!(values->ticks >= 1.0 && values->ticks <= 0x1p53 &&
          values->ticks == floor(values->ticks))) {
        return false;
    }
    for (size_t k = 0; k < RP_SENSOR_SAMPLES; k++) {
        for (size_t i = 0; i < 2; i++) {
            const int count = values->samples[k][i];
            if (count < -RP_SENSOR_COUNT_MAX || ((double)k >= values->ticks && count != 0)) {
                return false;
            }
        }
    }
    return true;
}

static const struct model_events events = {
    .modes = {offsetof(struct rp_sensor_values, samples), sizeof(int[RP_SENSOR_SAMPLES][2])},
    .discrete_states = {offsetof(struct rp_sensor_values, start), 2 * sizeof(double)},
    .modes_are_possible = modes_are_possible,
    .update = update,
    .next_time = next_time,
};

/* ---- Calculated values ---------------------------------------------------------------------- */

/* Counts of joint i that are shown now and were shown a tick before. */
static void find_shown(const struct rp_sensor_values *values, int i, int *now, int *before) {
    const double last = values->ticks - 1.0;
    // before the end of the initialization what the start will show
    const bool has_started = values->ticks > 0.0;
    *now = has_started ? shown(values, i, last) : sampled(values, i, 0.0);
    *before = has_started ? shown(values, i, last - 1.0) : *now;
}

static enum status outputs(void *values_pointer, double t) {
    struct rp_sensor_values *values = values_pointer;
    int before[2];
    for (int i = 0; i < 2; i++) {
        find_shown(values, i, &values->counts[i], &before[i]);
    }
    rp_sensor_calculate(values, values->counts, before);
    return STATUS_OK;
}

/* Between two ticks the counts rest: only resolution and sample time count. */
static enum status propagate(const void *values_pointer, double t, double dt, void *first_pointer,
                             void *second_pointer) {
    const struct rp_sensor_values *values = values_pointer;
    struct rp_sensor_values *first = first_pointer;
    struct rp_sensor_values *second = second_pointer;
    const double period = values->parameters.sample_time;
    const double dperiod = first->parameters.sample_time;
    for (int i = 0; i < 2; i++) {
        int now;
        int before;
        find_shown(values, i, &now, &before);
        const double counts = (double)now - before; // dq T = counts resolution
        const double dq = counts * values->parameters.resolution[i] / period;
        first->q_measured[i] = now * first->parameters.resolution[i];
        first->dq_measured[i] = (counts * first->parameters.resolution[i] - dq * dperiod) / period;
        if (second != NULL) {
            second->q_measured[i] = now * second->parameters.resolution[i];
            second->dq_measured[i] =
                (counts * second->parameters.resolution[i] - 2.0 * first->dq_measured[i] * dperiod -
                 dq * second->parameters.sample_time) /
                period;
        }
    }
    return STATUS_OK;
}

/* Outputs are finite whatever the counts are. */
static enum status check_parameters(const void *values_pointer, char *text, size_t size) {
    const struct rp_sensor_parameters *p =
        &((const struct rp_sensor_values *)values_pointer)->parameters;
    for (int i = 0; i < 2; i++) {
        const double largest = 2.0 * (int)RP_SENSOR_COUNT_MAX * p->resolution[i] / p->sample_time;
        if (!isfinite(largest)) {
            (void)snprintf(text, size,
                           "resolution%d = %g is refused: with sample_time = %g s the velocity of "
                           "2^32 counts in one sample time is not finite",
                           i + 1, p->resolution[i], p->sample_time);
            return STATUS_INVALID_PARAMETERS;
        }
    }
    return STATUS_OK;
}

const struct model rp_sensor_model = {
    .values_size = sizeof(struct rp_sensor_values),
    .parameters = {offsetof(struct rp_sensor_values, parameters),
                   sizeof(struct rp_sensor_parameters)},
    .inputs = {offsetof(struct rp_sensor_values, q), sizeof(double[2])},
    .right_hand_side = right_hand_side,
    .outputs = outputs,
    .propagate = propagate,
    .check_parameters = check_parameters,
    .events = &events,
};
