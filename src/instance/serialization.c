#include "serialization.h"

#include "plausibility.h"
#include "snapshot.h"
#include "state.h"

#include <limits.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

static const char magic[8] = {'C', 'O', 'S', 'I', 'M', 'S', 'T', 'A'};
enum { FORMAT_VERSION = 3, HASH_SIZE = 8 };

/* Reader, writer or counter of the fields of a serialized state, with one sequence of calls for all
 * three. */
struct codec {
    enum { CODEC_COUNTING, CODEC_WRITING, CODEC_READING } mode;
    unsigned char *to;         /* CODEC_WRITING */
    const unsigned char *from; /* CODEC_READING */
    size_t size;               /* bytes available */
    size_t at;                 /* bytes done */
    bool is_cut_off;           /* true if there were too few bytes */
    const char *bad_field; /* name of the first field with a value that its type does not have; NULL
                              if there is none */
};

/* ---- Bytes ---------------------------------------------------------------------------------- */

static void transfer_bytes(struct codec *codec, void *bytes, size_t count) {
    if (codec->mode != CODEC_COUNTING && count > codec->size - codec->at) {
        codec->is_cut_off = true;
        return;
    }
    if (codec->mode == CODEC_WRITING) {
        memcpy(codec->to + codec->at, bytes, count);
    } else if (codec->mode == CODEC_READING) {
        memcpy(bytes, codec->from + codec->at, count);
    }
    codec->at += count;
}

static void transfer_number(struct codec *codec, uint64_t *number, size_t byte_count) {
    unsigned char bytes[8] = {0};
    for (size_t i = 0; i < byte_count; i++) {
        bytes[i] = (unsigned char)(*number >> (8 * i));
    }
    transfer_bytes(codec, bytes, byte_count);
    *number = 0;
    for (size_t i = 0; i < byte_count; i++) {
        *number |= (uint64_t)bytes[i] << (8 * i);
    }
}

/* Returns the hash FNV-1a, 64 bit (G. Fowler, L. C. Noll, K.-P. Vo). Any change of one byte changes
 * it. */
static uint64_t hash(const unsigned char *bytes, size_t count) {
    uint64_t value = 0xcbf29ce484222325u;
    for (size_t i = 0; i < count; i++) {
        value = (value ^ bytes[i]) * 0x100000001b3u;
    }
    return value;
}

/* ---- Around the fields ---------------------------------------------------------------------- */

/* Writes or counts the bytes before the fields. */
static void codec_begin(struct codec *codec, const char *guid) {
    unsigned char start[sizeof magic];
    memcpy(start, magic, sizeof magic);
    uint64_t version = FORMAT_VERSION;
    uint64_t length = codec->size;
    uint64_t guid_length = strlen(guid);
    transfer_bytes(codec, start, sizeof start);
    transfer_number(codec, &version, 4);
    transfer_number(codec, &length, 4);
    transfer_number(codec, &guid_length, 4);
    for (; *guid != '\0'; guid++) {
        unsigned char c = (unsigned char)*guid;
        transfer_bytes(codec, &c, 1);
    }
}

/* Writes or counts the bytes after the fields. */
static void codec_end(struct codec *codec) {
    uint64_t value = codec->mode == CODEC_WRITING ? hash(codec->to, codec->at) : 0;
    transfer_number(codec, &value, HASH_SIZE);
}

/* Reads and checks all but the fields, and goes to the first of them. Returns NULL, or the fault as
 * a text. length: bytes expected in all. */
static const char *codec_check(struct codec *codec, const char *guid, size_t length) {
    unsigned char start[sizeof magic] = {0};
    uint64_t version = 0;
    uint64_t stated_length = 0;
    uint64_t guid_length = 0;
    transfer_bytes(codec, start, sizeof start);
    transfer_number(codec, &version, 4);
    transfer_number(codec, &stated_length, 4);
    transfer_number(codec, &guid_length, 4);
    if (codec->is_cut_off) {
        return "it is cut off";
    }
    if (memcmp(start, magic, sizeof magic) != 0) {
        return "it is not a saved state of such a model";
    }
    if (version != FORMAT_VERSION) {
        return "it has another version of the format, 3 is expected";
    }
    const size_t guid_size = strlen(guid);
    if (guid_length != guid_size || codec->size - codec->at < guid_size ||
        memcmp(codec->from + codec->at, guid, guid_size) != 0) {
        return "its GUID belongs to another model";
    }
    if (stated_length != codec->size || codec->size != length) {
        return "it has the wrong length";
    }

    struct codec end = *codec;
    uint64_t stated_hash = 0;
    end.at = codec->size - HASH_SIZE;
    transfer_number(&end, &stated_hash, HASH_SIZE);
    if (stated_hash != hash(codec->from, codec->size - HASH_SIZE)) {
        return "it is damaged, its checksum does not fit";
    }
    codec->at += guid_size;
    return NULL;
}

/* ---- Fields ---------------------------------------------------------------------------------
 * These functions read, write or count one field, 8 bytes. If the value read is none of the type,
 * *value stays and the field is the bad one, unless there is one already. name: static text. */

static void codec_real(struct codec *codec, double *value) {
    uint64_t bits;
    memcpy(&bits, value, sizeof bits);
    transfer_number(codec, &bits, 8);
    memcpy(value, &bits, sizeof bits);
}

/* Two's complement. */
static void codec_int64(struct codec *codec, int64_t *value) {
    uint64_t bits = (uint64_t)*value;
    transfer_number(codec, &bits, 8);
    memcpy(value, &bits, sizeof bits);
}

/* A value outside the bounds leaves the old one and is noted. */
static int64_t transfer_integer(struct codec *codec, const char *name, int64_t value,
                                int64_t smallest, int64_t largest) {
    int64_t read = value;
    codec_int64(codec, &read);
    if (read < smallest || read > largest) {
        codec->bad_field = codec->bad_field != NULL ? codec->bad_field : name;
        return value;
    }
    return read;
}

static void codec_int(struct codec *codec, const char *name, int *value) {
    *value = (int)transfer_integer(codec, name, *value, INT_MIN, INT_MAX);
}

static void codec_unsigned(struct codec *codec, const char *name, unsigned *value) {
    *value = (unsigned)transfer_integer(codec, name, *value, 0, UINT_MAX);
}

static void codec_bool(struct codec *codec, const char *name, bool *value) {
    *value = transfer_integer(codec, name, *value, 0, 1) != 0;
}

/* ---- The state ------------------------------------------------------------------------------ */

static void transfer_experiment(struct codec *codec, struct instance_experiment *experiment) {
    codec_real(codec, &experiment->start_time);
    codec_bool(codec, "stop_time_defined", &experiment->stop_time_defined);
    codec_real(codec, &experiment->stop_time);
    codec_bool(codec, "tolerance_defined", &experiment->tolerance_defined);
    codec_real(codec, &experiment->tolerance);
}

/* Transfers what does not follow from other fields (instance_restore). */
static void transfer_own(struct codec *codec, struct instance_values *own) {
    codec_real(codec, &own->relative_tolerance);
    codec_int(codec, "max_internal_steps", &own->max_internal_steps);
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

/* Transfers parameters, inputs and states. */
static void transfer_values(struct codec *codec, const struct instance *instance, char *values) {
    for (size_t i = 0; i < instance->description->variable_count; i++) {
        const struct variable *variable = &instance->description->variables[i];
        const bool is_calculated =
            variable->initial == INITIAL_CALCULATED && !instance_is_state(instance, variable);
        void *field = values + variable->offset;
        if (variable->owner != VARIABLE_OF_MODEL || is_calculated ||
            variable_is_discrete_state(variable)) { // transfer_kept has these
            continue;
        }
        if (variable->type == VARIABLE_FLOAT64) {
            codec_real(codec, field);
        } else {
            codec_int(codec, variable->name, field);
        }
    }
}

/* Transfers modes, discrete states and anchors, declared as variables or not. */
static void transfer_kept(struct codec *codec, const struct model *model, char *values) {
    const struct model_events events = events_of(model);
    int *modes = (int *)(void *)(values + events.modes.offset);
    double *kept = doubles_of(values, events.discrete_states);
    for (size_t i = 0; i < events.modes.size / sizeof *modes; i++) {
        codec_int(codec, "a mode", &modes[i]);
    }
    for (size_t i = 0; i < count_of(events.discrete_states); i++) {
        codec_real(codec, &kept[i]);
    }
    for (size_t i = 0; i < count_of(model->anchors); i++) {
        codec_real(codec, &doubles_of(values, model->anchors)[i]);
    }
}

/* Transfers the event at which the last step ended. */
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

/* Transfers a value structure, except values that the outputs of the model calculate. */
static void transfer_structure(struct codec *codec, const struct instance *instance, char *values) {
    transfer_values(codec, instance, values);
    transfer_kept(codec, instance->model, values);
}

/* Transfers all fields, in one order for reading, writing and counting. */
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
    codec_real(codec, &state->first_time);
    codec_real(codec, &state->passed_time);
    transfer_statistics(codec, &state->statistics);
    codec_int64(codec, &state->steps_before_restart);
    codec_real(codec, &state->restart_step);
    codec_real(codec, &state->next_step);
    codec_bool(codec, "restart_continues", &state->restart_continues);
    codec_bool(codec, "restart_after_event", &state->restart_after_event);
    transfer_structure(codec, instance, block + (memory->values - memory->block));
    transfer_structure(codec, instance, block + (memory->restart_values - memory->block));
    // the three arrays of inputs lie side by side
    transfer_polynomials(
        codec, (struct polynomial *)(void *)(block + ((char *)memory->next_inputs - memory->block)),
        3 * input_count);
    for (size_t i = 0; i < instance_noted_inputs(instance->model); i++) {
        char *noted = block + ((char *)&memory->largest_inputs[i] - memory->block);
        codec_real(codec, (double *)(void *)noted);
    }
    if (instance->model->events != NULL) {
        transfer_event_point(codec, instance->model, state,
                             (bool *)(void *)(block + ((char *)memory->unhandled - memory->block)));
    }
}

/* ---- Interface ------------------------------------------------------------------------------ */

size_t instance_serialized_size(const struct instance *instance) {
    // counting writes nothing, so that any state will do
    struct instance_state state = instance->state;
    unsigned tag = 0;
    struct codec codec = {.mode = CODEC_COUNTING};
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
    struct codec codec = {
        .mode = CODEC_WRITING, .to = bytes, .size = instance_serialized_size(instance)};
    codec_begin(&codec, instance->description->guid);
    transfer_state(&codec, instance, &snapshot->tag, &snapshot->state, (char *)snapshot->memory);
    codec_end(&codec);
    return STATUS_OK;
}

enum status instance_deserialize(struct instance *instance, const unsigned char bytes[],
                                 size_t size, struct instance_snapshot **snapshot) {
    struct codec codec = {.mode = CODEC_READING, .from = bytes, .size = size};
    const char *fault =
        codec_check(&codec, instance->description->guid, instance_serialized_size(instance));
    if (fault != NULL) {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "the serialized state is refused: %s", fault);
        return STATUS_INVALID_ARGUMENT;
    }

    // read over a copy of the instance: calculated values are not among the bytes
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
