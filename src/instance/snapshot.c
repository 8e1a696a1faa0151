#include "snapshot.h"

#include "codec.h"
#include "internals.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

struct instance_snapshot {
    struct instance_snapshot *newer;
    struct instance_snapshot *older;
    unsigned tag;
    struct instance_state state;
    max_align_t memory[]; /* copy of instance_memory.block */
};

/* ---- In memory ------------------------------------------------------------------------------ */

/* Searches from both ends: masters free in the order of saving or in the reverse one. */
static bool is_own(const struct instance *instance, const struct instance_snapshot *snapshot) {
    const struct instance_snapshot *from_newest = instance->newest;
    const struct instance_snapshot *from_oldest = instance->oldest;
    while (from_newest != NULL) {
        if (from_newest == snapshot || from_oldest == snapshot) {
            return true;
        }
        from_newest = from_newest->older;
        from_oldest = from_oldest->newer;
    }
    return false;
}

static enum status check_own(const struct instance *instance,
                             const struct instance_snapshot *snapshot) {
    if (is_own(instance, snapshot)) {
        return STATUS_OK;
    }
    message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                  "the saved state is refused: it is none of this instance's");
    return STATUS_INVALID_ARGUMENT;
}

static struct instance_snapshot *new_snapshot(struct instance *instance) {
    struct instance_snapshot *created = malloc(sizeof *created + instance->memory.size);
    if (created == NULL) {
        message_write(&instance->sink, STATUS_OUT_OF_MEMORY, "the state is not saved: %s",
                      status_text(STATUS_OUT_OF_MEMORY));
        return NULL;
    }
    created->newer = NULL;
    created->older = instance->newest;
    if (instance->newest != NULL) {
        instance->newest->newer = created;
    } else {
        instance->oldest = created;
    }
    instance->newest = created;
    return created;
}

enum status instance_save(struct instance *instance, unsigned tag,
                          struct instance_snapshot **snapshot) {
    if (*snapshot == NULL) {
        struct instance_snapshot *created = new_snapshot(instance);
        if (created == NULL) {
            return STATUS_OUT_OF_MEMORY;
        }
        *snapshot = created;
    } else if (check_own(instance, *snapshot) != STATUS_OK) {
        return STATUS_INVALID_ARGUMENT;
    }
    instance_update_next_step(instance);
    (*snapshot)->tag = tag;
    (*snapshot)->state = instance->state;
    memcpy((*snapshot)->memory, instance->memory.block, instance->memory.size);
    return STATUS_OK;
}

/* Prepares the instance to go on from what was written into its state and memory. */
static enum status resume(struct instance *instance) {
    instance->outputs_are_valid = false;
    instance->history_is_lost = true;
    if (instance->integrator == NULL) {
        return STATUS_OK;
    }
    enum status status = STATUS_OK;
    if (instance_is_configured_otherwise(instance)) {
        status = instance_configure_integrator(instance);
    }
    integrator_set_statistics(instance->integrator, &instance->state.statistics);
    return status;
}

enum status instance_restore(struct instance *instance, struct instance_snapshot *snapshot) {
    const enum status status = check_own(instance, snapshot);
    if (status != STATUS_OK) {
        return status;
    }
    instance->state = snapshot->state;
    memcpy(instance->memory.block, snapshot->memory, instance->memory.size);
    return resume(instance);
}

enum status instance_forget(struct instance *instance, struct instance_snapshot **snapshot) {
    const enum status status = check_own(instance, *snapshot);
    if (status != STATUS_OK) {
        return status;
    }
    struct instance_snapshot *gone = *snapshot;
    *(gone->older != NULL ? &gone->older->newer : &instance->oldest) = gone->newer;
    *(gone->newer != NULL ? &gone->newer->older : &instance->newest) = gone->older;
    free(gone);
    *snapshot = NULL;
    return STATUS_OK;
}

enum status instance_snapshot_tag(struct instance *instance, struct instance_snapshot *snapshot,
                                  unsigned *tag, enum phase *phase) {
    const enum status status = check_own(instance, snapshot);
    if (status == STATUS_OK) {
        *tag = snapshot->tag;
        *phase = snapshot->state.phase;
    }
    return status;
}

/* ---- As bytes ------------------------------------------------------------------------------- */

static void transfer_experiment(struct codec *codec, struct instance_experiment *experiment) {
    codec_real(codec, &experiment->start_time);
    codec_bool(codec, &experiment->stop_time_defined);
    codec_real(codec, &experiment->stop_time);
    codec_bool(codec, &experiment->tolerance_defined);
    codec_real(codec, &experiment->tolerance);
}

static void transfer_own(struct codec *codec, struct instance_values *own) {
    codec_real(codec, &own->time);
    codec_int(codec, &own->solver_steps);
    codec_int(codec, &own->solver_rhs_evaluations);
    codec_real(codec, &own->relative_tolerance);
    codec_int(codec, &own->max_internal_steps);
    codec_real(codec, &own->effective_relative_tolerance);
    codec_int(codec, &own->solver_restarts);
    codec_real(codec, &own->solver_last_step);
    codec_int(codec, &own->solver_last_order);
    codec_int(codec, &own->solver_failed_steps);
    codec_int(codec, &own->solver_method);
    codec_real(codec, &own->max_step);
}

static void transfer_statistics(struct codec *codec, struct integrator_statistics *statistics) {
    codec_long(codec, &statistics->steps);
    codec_long(codec, &statistics->rhs_evaluations);
    codec_long(codec, &statistics->failed_steps);
    codec_long(codec, &statistics->restarts);
    codec_real(codec, &statistics->last_step);
    codec_int(codec, &statistics->last_order);
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
            codec_int(codec, field);
        }
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

/* All fields, in one order for reading, writing and counting. */
static void transfer_state(struct codec *codec, const struct instance *instance, unsigned *tag,
                           struct instance_state *state, char *block) {
    const struct instance_memory *memory = &instance->memory;
    const size_t input_count = count_of(instance->model->inputs);
    int phase = (int)state->phase;
    codec_unsigned(codec, tag);
    codec_int(codec, &phase);
    state->phase = (enum phase)phase;
    codec_bool(codec, &state->experiment_defined);
    transfer_experiment(codec, &state->experiment);
    transfer_own(codec, &state->own);
    codec_real(codec, &state->time.s);
    codec_real(codec, &state->time.rest);
    codec_bool(codec, &state->has_history);
    codec_real(codec, &state->restart_time.s);
    codec_real(codec, &state->restart_time.rest);
    codec_real(codec, &state->span);
    codec_real(codec, &state->first_time);
    codec_real(codec, &state->latest_time);
    transfer_statistics(codec, &state->statistics);
    codec_long(codec, &state->steps_before_restart);
    codec_real(codec, &state->restart_step);
    codec_real(codec, &state->next_step);
    transfer_values(codec, instance->description, block + (memory->values - memory->block));
    transfer_values(codec, instance->description, block + (memory->held - memory->block));
    // pending, current and running lie side by side
    transfer_polynomials(
        codec, (struct polynomial *)(void *)(block + ((char *)memory->pending - memory->block)),
        3 * input_count);
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
    const enum status status = check_own(instance, snapshot);
    if (status != STATUS_OK) {
        return status;
    }
    if (size < instance_serialized_size(instance)) {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "%zu bytes are too few for the saved state: %zu are expected", size,
                      instance_serialized_size(instance));
        return STATUS_INVALID_ARGUMENT;
    }
    struct codec codec = codec_writing(bytes, instance_serialized_size(instance));
    codec_begin(&codec, instance->description->guid);
    transfer_state(&codec, instance, &snapshot->tag, &snapshot->state, (char *)snapshot->memory);
    codec_end(&codec);
    return STATUS_OK;
}

static bool are_finite(const double values[], size_t count) {
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(values[i])) {
            return false;
        }
    }
    return true;
}

/* Parameters, inputs and states that could have been set. */
static bool are_settable(const struct instance *instance, const char *values) {
    const struct message_sink quiet = {0};
    for (size_t i = 0; i < instance->description->variable_count; i++) {
        const struct variable *variable = &instance->description->variables[i];
        const void *field = values + variable->offset;
        if (variable->owner != VARIABLE_OF_MODEL || variable->initial == INITIAL_CALCULATED) {
            continue;
        }
        const double value =
            variable->type == VARIABLE_FLOAT64 ? *(const double *)field : *(const int *)field;
        if (variable_check_value(variable, value, &quiet) != STATUS_OK) {
            return false;
        }
    }
    return true;
}

/* Counts that can be counted on from without overflow. */
static bool are_counts(const struct integrator_statistics *statistics) {
    const long counts[] = {statistics->steps, statistics->rhs_evaluations, statistics->failed_steps,
                           statistics->restarts};
    for (size_t i = 0; i < sizeof counts / sizeof counts[0]; i++) {
        if (counts[i] < 0 || counts[i] > LONG_MAX / 2) {
            return false;
        }
    }
    return isfinite(statistics->last_step);
}

/* Steps and method that the integrator can be given. */
static bool can_integrate(const struct instance *instance, const struct instance_state *state) {
    const double steps[] = {state->own.max_step, state->restart_step, state->next_step};
    for (size_t i = 0; i < sizeof steps / sizeof steps[0]; i++) {
        if (!(steps[i] >= 0.0 && isfinite(steps[i]))) {
            return false;
        }
    }
    return (instance->integrator == NULL || state->own.max_internal_steps >= 1) &&
           state->own.solver_method >= INTEGRATOR_CVODE_ADAMS &&
           state->own.solver_method < INTEGRATOR_METHODS;
}

/* A state that an instance can be in: a hash that fits does not prove it. */
static bool is_plausible(const struct instance *instance, const struct instance_state *state,
                         const char *block) {
    const struct instance_memory *memory = &instance->memory;
    const double times[] = {state->time.s, state->time.rest, state->own.time, state->restart_time.s,
                            state->restart_time.rest};
    // inputs at the current time may have overflowed on their way; they were not set
    const size_t coefficients = count_of(instance->model->inputs) * (POLYNOMIAL_DEGREE + 1);
    const double *pending =
        (const double *)(const void *)(block + ((char *)memory->pending - memory->block));
    const double *running = pending + 2 * coefficients;
    const double tolerance = state->own.effective_relative_tolerance;

    if ((int)state->phase < 0 || state->phase >= PHASE_COUNT ||
        !are_finite(times, sizeof times / sizeof times[0]) || !are_finite(pending, coefficients) ||
        !are_finite(running, coefficients) ||
        !(tolerance >= INSTANCE_FINEST_TOLERANCE && tolerance <= INSTANCE_COARSEST_TOLERANCE) ||
        !(state->own.relative_tolerance >= 0.0 && isfinite(state->own.relative_tolerance)) ||
        (state->experiment_defined &&
         instance_check_experiment(instance, &state->experiment) != STATUS_OK) ||
        !can_integrate(instance, state) || !isfinite(state->own.solver_last_step) ||
        !are_counts(&state->statistics) || state->steps_before_restart < 0 ||
        state->steps_before_restart > state->statistics.steps ||
        !are_settable(instance, block + (memory->values - memory->block))) {
        return false;
    }
    const long history = state->statistics.steps - state->steps_before_restart;
    return !state->has_history ||
           (history > 0 &&
            history <= INSTANCE_LONGEST_HISTORY + (long)state->own.max_internal_steps &&
            state->first_time > 0.0 && state->latest_time >= state->first_time &&
            isfinite(state->latest_time) && state->span >= state->latest_time &&
            are_settable(instance, block + (memory->held - memory->block)));
}

enum status instance_deserialize(struct instance *instance, const unsigned char bytes[],
                                 size_t size, struct instance_snapshot **snapshot) {
    struct instance_snapshot *read = NULL;
    struct codec codec = codec_reading(bytes, size);
    const char *fault =
        codec_check(&codec, instance->description->guid, instance_serialized_size(instance));
    if (fault == NULL) {
        const enum status status = instance_save(instance, 0, &read);
        if (status != STATUS_OK) {
            return status;
        }
        transfer_state(&codec, instance, &read->tag, &read->state, (char *)read->memory);
        if (codec.failed || !is_plausible(instance, &read->state, (const char *)read->memory)) {
            fault = "a value in it is impossible";
            instance_forget(instance, &read);
        }
    }
    if (fault != NULL) {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "the serialized state is refused: %s", fault);
        return STATUS_INVALID_ARGUMENT;
    }
    *snapshot = read;
    return STATUS_OK;
}
