/* A step that is being done, for the files step_*.c and
 * stepping.c that do it.
 */
#ifndef INSTANCE_STEP_H
#define INSTANCE_STEP_H

#include "history.h"
#include "internals.h"
#include "model_modes.h"
#include "stepping.h"

struct step {
    struct instance *instance;
    const struct step_options *options;
    struct clock_time begin;
    struct clock_time end;          /* where it will end; may become earlier */
    struct clock_time until;        /* end of its present part: the same, or a time event before */
    bool meets_time_event;          /* at the end of its present part */
    double drift;                   /* s: of the communication points, up to its beginning */
    bool is_early;                  /* end has become earlier */
    bool is_over;                   /* the step ends where it is */
    struct instance_snapshot *kept; /* the instance before the step; NULL: not needed so far */
    enum status answer;             /* of options->accept */
    struct event_counts events;     /* so far */
    int64_t steps_before;           /* internal ones, since initialization */
};

/* ---- Integration (step_part.c) -------------------------------------------------------------- */

/* Reports the time of the instance to options->accept; true: the step will end earlier. */
NONNULL bool instance_report(struct step *step);

/* To step->until, or to a state event before it. Both may become earlier on the way. */
MUST_CHECK NONNULL enum status instance_move(struct step *step, enum continuation continuation);

/* Internal steps that the step may still take. */
static inline int64_t instance_steps_left(const struct step *step) {
    const struct instance_state *state = &step->instance->state;
    return state->own.max_internal_steps - (state->statistics.steps - step->steps_before);
}

/* ---- Inputs (step_inputs.c) ----------------------------------------------------------------- */

/* Sets the inputs to those at the beginning of a step. Until then, inputs have the values to which
 * the derivatives of the last step led. */
NONNULL void instance_begin_inputs(struct instance *instance);

/* Those at the time of the instance, elapsed s after the beginning of the step. */
NONNULL void instance_evaluate_inputs(struct instance *instance, double elapsed);

/* Sets the inputs of the step to polynomials through the values that the importer gives. */
MUST_CHECK NONNULL enum status instance_ask_inputs(const struct step *step, double t, double h);

/* STATUS_NOT_FINITE, with a message, if the polynomial of an input overflows within the step, which
 * no integrator notices in a model without states. */
MUST_CHECK NONNULL enum status instance_check_inputs(const struct step *step);

/* After a step that has asked for inputs: they keep the value given for its end or, where the step
 * ended earlier, the value there. */
NONNULL void instance_keep_last_nodes(const struct step *step);

/* ---- Events (step_events.c) ----------------------------------------------------------------- */

/* Sets the end of the next part of the step. A time event that differs from the end of the step by
 * no more than rounding is at the end, be it earlier or later. */
static inline void instance_set_part(struct step *step) {
    const double time = instance_next_time(step->instance);
    step->until = step->end;
    step->meets_time_event = false;
    if (time == INFINITY) {
        return;
    }
    const double slack = clock_tick_slack(instance_size_of_times(step->instance, step->end.s),
                                          clock_difference(step->end, step->begin), step->drift);
    const double left = clock_difference(step->end, (struct clock_time){.s = time});
    step->meets_time_event = left >= -slack;
    if (left > slack) {
        const struct clock_time now = step->instance->state.time;
        step->until = time <= now.s ? now : (struct clock_time){.s = time};
    }
}

/* To step->end over all events on the way. */
MUST_CHECK NONNULL enum status instance_move_over_events(struct step *step,
                                                         enum continuation continuation);

#endif
