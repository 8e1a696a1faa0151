#include "snapshot.h"

#include "history.h"
#include "state.h"

#include <stdlib.h>
#include <string.h>

/* True if the snapshot belongs to the instance. Searches from both ends: masters free in the order
 * of saving or in reverse. */
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

enum status instance_check_own(const struct instance *instance,
                               const struct instance_snapshot *snapshot) {
    if (is_own(instance, snapshot)) {
        return STATUS_OK;
    }
    message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                  "the saved state is refused: it belongs to another instance");
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
        *snapshot = new_snapshot(instance);
        if (*snapshot == NULL) {
            return STATUS_OUT_OF_MEMORY;
        }
    } else if (instance_check_own(instance, *snapshot) != STATUS_OK) {
        return STATUS_INVALID_ARGUMENT;
    }
    instance_update_next_step(instance);
    (*snapshot)->tag = tag;
    (*snapshot)->state = instance->state;
    memcpy((*snapshot)->memory, instance->memory.block, instance->memory.size);
    return STATUS_OK;
}

/* Prepares the instance to continue from its new state and memory. Writes the fields that follow
 * from others: bytes do not have them. */
static enum status resume(struct instance *instance) {
    struct instance_state *state = &instance->state;
    state->own.time = state->time.s;
    instance_write_statistics(&state->statistics, &state->own);
    if (state->has_history) {
        state->latest_time = clock_difference(state->time, state->restart_time);
        state->horizon = instance_horizon(
            state, state->restart_time, state->first_time,
            polynomials_move(instance->memory.active_inputs, count_of(instance->model->inputs)));
    }
    instance->outputs_are_valid = false;
    instance->parameters_are_valid = false;
    instance->parameters_are_active = false;
    instance->indicators_are_active = false;
    instance->inputs_are_held = false;
    instance->history_is_lost = true;
    instance_update_tolerance(instance);
    if (!instance_has_integrator(instance)) {
        return STATUS_OK;
    }
    enum status status = STATUS_OK;
    if (instance_is_configured_otherwise(instance)) {
        status = instance_configure_integrator(instance);
    }
    *integrator_totals(instance->integrator) = state->statistics;
    return status;
}

enum status instance_restore(struct instance *instance, const struct instance_snapshot *snapshot) {
    const enum status status = instance_check_own(instance, snapshot);
    if (status != STATUS_OK) {
        return status;
    }
    instance->state = snapshot->state;
    memcpy(instance->memory.block, snapshot->memory, instance->memory.size);
    return resume(instance);
}

/* Copies the part of the state that a step writes, except values that follow from it. */
static inline void copy_state(struct instance_state *to, const struct instance_state *from) {
    enum { BEGIN = offsetof(struct instance_state, time) };
    memcpy((char *)to + BEGIN, (const char *)from + BEGIN, sizeof *to - BEGIN);
    to->own.event_count = from->own.event_count;
    to->own.last_event_time = from->own.last_event_time;
}

/* Copies the parts of the memory that a step writes. If inputs are held, it writes neither the next
 * inputs nor the current ones. */
static void copy_written(const struct instance_memory *memory, bool inputs_are_held, char *to,
                         const char *from) {
    const struct range restart = memory->written_at_restart;
    const size_t begin = inputs_are_held ? restart.offset : 0;
    const size_t end = restart.offset + restart.size;
    const size_t values = (size_t)(memory->values - memory->block) + memory->written.offset;
    memcpy(to + begin, from + begin, end - begin);
    memcpy(to + values, from + values, memory->written.size);
}

void instance_keep(struct instance *instance, struct instance_snapshot *snapshot) {
    copy_state(&snapshot->state, &instance->state);
    snapshot->history_is_lost = instance->history_is_lost;
    snapshot->inputs_are_held = instance->inputs_are_held;
    copy_written(&instance->memory, snapshot->inputs_are_held, (char *)snapshot->memory,
                 instance->memory.block);
}

enum status instance_undo(struct instance *instance, const struct instance_snapshot *snapshot) {
    copy_state(&instance->state, &snapshot->state);
    copy_written(&instance->memory, snapshot->inputs_are_held, instance->memory.block,
                 (const char *)snapshot->memory);
    if (snapshot->inputs_are_held) {
        memcpy(instance->memory.current_inputs, instance->memory.next_inputs,
               count_of(instance->model->inputs) * sizeof(struct polynomial));
    }
    const enum status status = resume(instance);
    // next_step, which instance_keep has not brought up to date, follows from the integrator
    return status == STATUS_OK && snapshot->state.has_history && !snapshot->history_is_lost
               ? instance_replay_history(instance)
               : status;
}

enum status instance_forget(struct instance *instance, struct instance_snapshot **snapshot) {
    const enum status status = instance_check_own(instance, *snapshot);
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

enum status instance_snapshot_tag(const struct instance *instance,
                                  const struct instance_snapshot *snapshot, unsigned *tag,
                                  enum phase *phase) {
    const enum status status = instance_check_own(instance, snapshot);
    if (status == STATUS_OK) {
        *tag = snapshot->tag;
        *phase = snapshot->state.phase;
    }
    return status;
}
