#include "rp_controller_events.h"

#include "rp_controller_law.h"

#include <math.h>
#include <stdio.h>

const double rp_controller_shortest_sample_time = 1e-6;

/* ---- Times ---------------------------------------------------------------------------------- */

/* s: of sample k, from k itself, so that rounding errors do not add up. */
static double sample_time_of(const struct rp_controller_values *values, double k) {
    return values->samples.start + k * values->parameters.sample_time;
}

/* s: when the efforts of the last sample come into effect: with the next sample at the latest,
 * which would take their place. Rounding must change neither this nor that both have the same time.
 */
static double show_time(const struct rp_controller_values *values) {
    const struct rp_controller_samples *samples = &values->samples;
    const struct rp_controller_parameters *p = &values->parameters;
    if (!(samples->shown < samples->taken)) {
        return INFINITY;
    }
    const double next_sample = sample_time_of(values, samples->taken);
    const double due = sample_time_of(values, samples->taken - 1.0) + p->delay;
    return p->delay < p->sample_time && due < next_sample ? due : next_sample;
}

static double next_time(const void *values_pointer) {
    const struct rp_controller_values *values = values_pointer;
    if (values->form != RP_CONTROLLER_SAMPLED) {
        return INFINITY;
    }
    const double sample = sample_time_of(values, values->samples.taken);
    const double due = show_time(values);
    return due < sample ? due : sample;
}

/* ---- Samples -------------------------------------------------------------------------------- */

static bool are_finite(const double x[2]) {
    return isfinite(x[0]) && isfinite(x[1]);
}

/* The law at the present inputs. Each integral part has moved at its rate of the last sample since
 * then: Euler's forward method. */
static enum status take_sample(struct rp_controller_values *values) {
    const struct rp_controller_parameters *p = &values->parameters;
    struct rp_controller_samples *samples = &values->samples;
    struct rp_controller_command command = {.unlimited = {0.0}, .effort = {0.0}};
    double integral[2];
    double rate[2];
    for (int i = 0; i < 2; i++) {
        integral[i] = values->integral[i] + p->sample_time * samples->rate[i];
    }
    law_unlimited(p, values->payload_attached != 0, &values->inputs, integral, command.unlimited);
    for (int i = 0; i < 2; i++) {
        command.effort[i] = law_limited(p, command.unlimited[i], i);
        rate[i] = law_integral_rate(p, &values->inputs, command.unlimited[i], i);
    }
    if (!are_finite(integral) || !are_finite(command.unlimited) || !are_finite(rate)) {
        return STATUS_NOT_FINITE;
    }
    for (int i = 0; i < 2; i++) {
        values->integral[i] = integral[i];
        samples->rate[i] = rate[i];
    }
    samples->next = command;
    samples->taken += 1.0;
    return STATUS_OK;
}

static void show(struct rp_controller_samples *samples) {
    samples->command = samples->next;
    samples->shown = samples->taken;
}

/* The first sample takes effect at once. */
static enum status start(struct rp_controller_values *values, const struct event *event) {
    const double t = event->t;
    const double period = values->parameters.sample_time;
    if (!(period > 0.0)) {
        values->form = RP_CONTROLLER_CONTINUOUS;
        return STATUS_OK;
    }
    if (period < event_shortest_period(t)) {
        (void)snprintf(event->reason, event->reason_size,
                       "sample_time = %g s is refused: at a start time of %g s it must be %g s or "
                       "more",
                       period, t, event_shortest_period(t));
        return STATUS_INVALID_PARAMETERS;
    }
    const enum status status = take_sample(values);
    if (status == STATUS_OK) {
        values->form = RP_CONTROLLER_SAMPLED;
        values->samples.start = t;
        show(&values->samples);
    }
    return status;
}

/* Shows the efforts and takes the sample that are due at the next time: the efforts first, as the
 * sample would replace them. */
static enum status pass_time(struct rp_controller_values *values) {
    const double t = next_time(values);
    enum status status = STATUS_OK;
    if (show_time(values) <= t) {
        show(&values->samples);
    }
    if (sample_time_of(values, values->samples.taken) <= t) {
        status = take_sample(values);
        if (status == STATUS_OK && show_time(values) <= t) {
            show(&values->samples);
        }
    }
    return status;
}

/* ---- struct model_events -------------------------------------------------------------------- */

static enum status update(void *values_pointer, const struct event *event) {
    struct rp_controller_values *values = values_pointer;
    if (values->form == RP_CONTROLLER_UNDECIDED) {
        return start(values, event);
    }
    return event->is_timed ? pass_time(values) : STATUS_OK;
}

static bool is_count(double x) {
    return x >= 1.0 && x == floor(x);
}

static bool modes_are_possible(const void *values_pointer, bool is_held) {
    const struct rp_controller_values *values = values_pointer;
    const struct rp_controller_samples *samples = &values->samples;
    const bool is_sampled = values->parameters.sample_time > 0.0;
    if (values->form != (is_sampled ? RP_CONTROLLER_SAMPLED : RP_CONTROLLER_CONTINUOUS)) {
        return false;
    }
    return !is_sampled ||
           (is_count(samples->taken) && is_count(samples->shown) &&
            samples->shown <= samples->taken && samples->shown >= samples->taken - 1.0);
}

/* Integral parts of the sampled form only jump. */
static bool is_at_rest(const void *values_pointer) {
    const struct rp_controller_values *values = values_pointer;
    return values->form == RP_CONTROLLER_SAMPLED;
}

const struct model_events rp_controller_events = {
    .modes = {offsetof(struct rp_controller_values, form), sizeof(int)},
    .discrete_states = {offsetof(struct rp_controller_values, samples),
                        sizeof(struct rp_controller_samples)},
    .discrete_inputs = {offsetof(struct rp_controller_values, payload_attached), sizeof(int)},
    .modes_are_possible = modes_are_possible,
    .is_at_rest = is_at_rest,
    .next_time = next_time,
    .update = update,
};
