#include "serialization.h"

#include "codec.h"
#include "plausibility.h"
#include "snapshot_contents.h"

static void transfer_experiment(struct codec *codec, struct instance_experiment *experiment) {
    codec_real(codec, &experiment->start_time);
    codec_bool(codec, "stop_time_defined", &experiment->stop_time_defined);
    codec_real(codec, &experiment->stop_time);
    codec_bool(codec, "tolerance_defined", &experiment->tolerance_defined);
    codec_real(codec, &experiment->tolerance);
}

static void transfer_own(struct codec *codec, struct instance_values *own) {
    codec_real(codec, &own->time);
    codec_int(codec, "solver_steps", &own->solver_steps);
    codec_int(codec, "solver_rhs_evaluations", &own->solver_rhs_evaluations);
    codec_real(codec, &own->relative_tolerance);
    codec_int(codec, "max_internal_steps", &own->max_internal_steps);
    codec_real(codec, &own->effective_relative_tolerance);
    codec_int(codec, "solver_restarts", &own->solver_restarts);
    codec_real(codec, &own->solver_last_step);
    codec_int(codec, "solver_last_order", &own->solver_last_order);
    codec_int(codec, "solver_failed_steps", &own->solver_failed_steps);
    codec_int(codec, "solver_method", &own->solver_method);
    codec_real(codec, &own->max_step);
    codec_int(codec, "event_count", &own->event_count);
    codec_real(codec, &own->last_event_time);
    codec_int(codec, "max_events", &own->max_events);
}

static void transfer_statistics(struct codec *codec, struct integrator_statistics *statistics) {
    codec_int64(codec, &statistics->steps);
    codec_int64(codec, &statistics->rhs_evaluations);
    codec_int64(codec, &statistics->failed_steps);
    codec_int64(codec, &statistics->restarts);
    codec_real(codec, &statistics->last_step);
    codec_int(codec, "last_order", &statistics->last_order);
}

/* Values of the model that are not calculated: parameters, inputs and states. */
static void transfer_values(struct codec *codec, const struct model_description *description,
                            char *values) {
    for (size_t i = 0; i < description->variable_count; i++) {
        const struct variable *variable = &description->variables[i];
        void *field = values + variable->offset;
        if (variable->owner != VARIABLE_OF_MODEL || variable->initial == INITIAL_CALCULATED) {
            continue;
        }
        if (variable->type == VARIABLE_FLOAT64) {
            codec_real(codec, field);
        } else {
            codec_int(codec, variable->name, field);
        }
    }
}

/* What events keep: modes and discrete states, declared as variables or not. */
static void transfer_kept(struct codec *codec, const struct model *model, char *values) {
    const struct model_events events = events_of(model);
    int *modes = ints_of(values, events.modes);
    double *kept = doubles_of(values, events.discrete_states);
    for (size_t i = 0; i < events.modes.size / sizeof *modes; i++) {
        codec_int(codec, "a mode", &modes[i]);
    }
    for (size_t i = 0; i < count_of(events.discrete_states); i++) {
        codec_real(codec, &kept[i]);
    }
}

/* The event at which the last step ended. */
static void transfer_event_point(struct codec *codec, const struct model *model,
                                 struct instance_state *state, bool unhandled[]) {
    int event_point = (int)state->event_point;
    codec_int(codec, "event_point", &event_point);
    state->event_point = (enum event_point)event_point;
    codec_real(codec, &state->cut_end.s);
    codec_real(codec, &state->cut_end.rest);
    for (size_t i = 0; i <= model->events->indicator_count; i++) {
        codec_bool(codec, "a cause of the unhandled event", &unhandled[i]);
    }
}

static void transfer_polynomials(struct codec *codec, struct polynomial polynomials[],
                                 size_t count) {
    for (size_t i = 0; i < count; i++) {
        for (int k = 0; k <= POLYNOMIAL_DEGREE; k++) {
            codec_real(codec, &polynomials[i].d[k]);
        }
    }
}

/* A value structure: all but what the outputs of the model calculate. */
static void transfer_structure(struct codec *codec, const struct instance *instance, char *values) {
    transfer_values(codec, instance->description, values);
    transfer_kept(codec, instance->model, values);
}

/* All fields, in one order for reading, writing and counting. */
static void transfer_state(struct codec *codec, const struct instance *instance, unsigned *tag,
                           struct instance_state *state, char *block) {
    const struct instance_memory *memory = &instance->memory;
    const size_t input_count = count_of(instance->model->inputs);
    int phase = (int)state->phase;
    codec_unsigned(codec, "tag", tag);
    codec_int(codec, "phase", &phase);
    state->phase = (enum phase)phase;
    codec_bool(codec, "experiment_defined", &state->experiment_defined);
    transfer_experiment(codec, &state->experiment);
    transfer_own(codec, &state->own);
    codec_real(codec, &state->time.s);
    codec_real(codec, &state->time.rest);
    codec_real(codec, &state->drift);
    codec_bool(codec, "has_history", &state->has_history);
    codec_real(codec, &state->restart_time.s);
    codec_real(codec, &state->restart_time.rest);
    codec_real(codec, &state->horizon);
    codec_real(codec, &state->first_time);
    codec_real(codec, &state->latest_time);
    codec_real(codec, &state->passed_time);
    transfer_statistics(codec, &state->statistics);
    codec_int64(codec, &state->steps_before_restart);
    codec_real(codec, &state->restart_step);
    codec_real(codec, &state->next_step);
    codec_bool(codec, "restart_continues", &state->restart_continues);
    transfer_structure(codec, instance, block + (memory->values - memory->block));
    transfer_structure(codec, instance, block + (memory->restart_values - memory->block));
    // the three arrays of inputs lie side by side
    transfer_polynomials(
        codec, (struct polynomial *)(void *)(block + ((char *)memory->next_inputs - memory->block)),
        3 * input_count);
    if (instance->model->events != NULL) {
        transfer_event_point(codec, instance->model, state,
                             (bool *)(void *)(block + ((char *)memory->unhandled - memory->block)));
    }
}

size_t instance_serialized_size(const struct instance *instance) {
    // counting writes nothing, so that any state serves
    struct instance_state state = instance->state;
    unsigned tag = 0;
    struct codec codec = codec_counting();
    codec_begin(&codec, instance->description->guid);
    transfer_state(&codec, instance, &tag, &state, instance->memory.block);
    codec_end(&codec);
    return codec.at;
}

enum status instance_serialize(struct instance *instance, struct instance_snapshot *snapshot,
                               unsigned char bytes[], size_t size) {
    const enum status status = instance_check_own(instance, snapshot);
    if (status != STATUS_OK) {
        return status;
    }
    if (size < instance_serialized_size(instance)) {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "%zu bytes are too few for the saved state, which takes %zu", size,
                      instance_serialized_size(instance));
        return STATUS_INVALID_ARGUMENT;
    }
    struct codec codec = codec_writing(bytes, instance_serialized_size(instance));
    codec_begin(&codec, instance->description->guid);
    transfer_state(&codec, instance, &snapshot->tag, &snapshot->state, (char *)snapshot->memory);
    codec_end(&codec);
    return STATUS_OK;
}

enum status instance_deserialize(struct instance *instance, const unsigned char bytes[],
                                 size_t size, struct instance_snapshot **snapshot) {
    struct codec codec = codec_reading(bytes, size);
    const char *fault =
        codec_check(&codec, instance->description->guid, instance_serialized_size(instance));
    if (fault != NULL) {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "the serialized state is refused: %s", fault);
        return STATUS_INVALID_ARGUMENT;
    }

    // over a copy of the instance: calculated values are not among the bytes
    struct instance_snapshot *read = NULL;
    enum status status = instance_save(instance, 0, &read);
    if (status != STATUS_OK) {
        return status;
    }
    transfer_state(&codec, instance, &read->tag, &read->state, (char *)read->memory);
    if (codec.bad_field != NULL) {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "the serialized state is refused: the type of %s does not have its value",
                      codec.bad_field);
        status = STATUS_INVALID_ARGUMENT;
    } else {
        status = instance_check_plausible(instance, &read->state, (const char *)read->memory);
    }
    if (status != STATUS_OK) {
        instance_forget(instance, &read);
        return status;
    }
    *snapshot = read;
    return STATUS_OK;
}
