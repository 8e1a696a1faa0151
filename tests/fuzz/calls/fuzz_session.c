#include "fuzz_session.h"

#include <stdlib.h>
#include <string.h>

/* ---- Instances ------------------------------------------------------------------------------- */

struct fuzz_instance *fuzz_session_instance(struct fuzz_session *session) {
    const unsigned selector = fuzz_byte(session->input);
    struct fuzz_instance **instance = &session->instances[selector % FUZZ_INSTANCES];
    if (*instance == NULL) {
        const fmi2Type kind = selector & 0x80 ? fmi2ModelExchange : fmi2CoSimulation;
        const bool has_varieties = kind == fmi2CoSimulation && fuzz_choose_variety != NULL;
        const unsigned variety = has_varieties ? selector / 4 % FUZZ_VARIETIES : 0;
        *instance = fuzz_instance_create(kind, variety, selector & 0x40, selector & 0x20);
        fuzz_limit_steps(*instance, FUZZ_MAX_INTERNAL_STEPS);
    }
    return *instance;
}

void fuzz_session_free_instance(struct fuzz_session *session, struct fuzz_instance *instance) {
    for (size_t i = 0; i < FUZZ_STATES; i++) {
        if (session->states[i].owner == instance) {
            session->states[i] = (struct fuzz_state){0};
        }
    }
    for (size_t i = 0; i < FUZZ_INSTANCES; i++) {
        if (session->instances[i] == instance) {
            session->instances[i] = NULL;
        }
    }
    fuzz_instance_free(instance);
}

void fuzz_session_end(struct fuzz_session *session) {
    for (size_t i = 0; i < FUZZ_INSTANCES; i++) {
        fuzz_instance_free(session->instances[i]);
    }
    for (size_t i = 0; i < FUZZ_SERIALIZED; i++) {
        free(session->serialized[i].bytes);
    }
}

/* ---- States ---------------------------------------------------------------------------------- */

/* Any place for a state, empty or not. */
static struct fuzz_state *any_place(struct fuzz_session *session) {
    return &session->states[fuzz_below(session->input, FUZZ_STATES)];
}

/* Mostly a state of the instance, where it has one; else any place. */
static struct fuzz_state *any_state(struct fuzz_session *session,
                                    const struct fuzz_instance *instance) {
    const unsigned selector = fuzz_byte(session->input);
    for (unsigned i = 0; i < FUZZ_STATES && selector >= 64; i++) {
        struct fuzz_state *state = &session->states[(selector + i) % FUZZ_STATES];
        if (state->handle != NULL && state->owner == instance) {
            return state;
        }
    }
    return &session->states[selector % FUZZ_STATES];
}

static struct fuzz_serialized *any_serialized(struct fuzz_session *session) {
    return &session->serialized[fuzz_below(session->input, FUZZ_SERIALIZED)];
}

/* A state is served to the instance that made it, and refused to any other. */
static void check_owner(const struct fuzz_state *state, const struct fuzz_instance *instance,
                        fmi2Status status, const char *what) {
    const bool is_own = state->owner == instance;
    if (status != (is_own ? fmi2OK : fmi2Error)) {
        fuzz_fail("%s with a state of %s instance has the status %d", what,
                  is_own ? "the" : "another", (int)status);
    }
}

void fuzz_call_GetFMUstate(struct fuzz_session *session, struct fuzz_instance *instance) {
    struct fuzz_state *state = any_place(session);
    const struct fuzz_state before = *state;
    const struct fuzz_instance now = *instance;
    if (state->handle == NULL) {
        state->owner = instance;
    }
    const fmi2Status status = FUZZ_CHECKED(instance, GetFMUstate, &state->handle);
    check_owner(state, instance, status, "fmi2GetFMUstate");
    if (before.handle != NULL && state->handle != before.handle) {
        fuzz_fail("fmi2GetFMUstate replaces the handle that it is given");
    }
    if (status == fmi2OK) {
        state->in_error = now.in_error;
        state->time = now.time;
    }
}

void fuzz_call_SetFMUstate(struct fuzz_session *session, struct fuzz_instance *instance) {
    const struct fuzz_state *state = any_state(session, instance);
    if (state->handle == NULL) {
        return;
    }
    const fmi2Status status = FUZZ_CHECKED(instance, SetFMUstate, state->handle);
    check_owner(state, instance, status, "fmi2SetFMUstate");
    if (status == fmi2OK) {
        instance->in_error = state->in_error;
        instance->time = state->time;
    }
}

void fuzz_call_FreeFMUstate(struct fuzz_session *session, struct fuzz_instance *instance) {
    struct fuzz_state *state = any_state(session, instance);
    if (state->handle == NULL) {
        FUZZ_CHECKED(instance, FreeFMUstate, &state->handle);
        return;
    }
    const fmi2Status status = FUZZ_CHECKED(instance, FreeFMUstate, &state->handle);
    check_owner(state, instance, status, "fmi2FreeFMUstate");
    if ((state->handle == NULL) != (status == fmi2OK)) {
        fuzz_fail("fmi2FreeFMUstate leaves the wrong handle");
    }
    if (status == fmi2OK) {
        *state = (struct fuzz_state){0};
    }
}

void fuzz_call_SerializedFMUstateSize(struct fuzz_session *session,
                                      struct fuzz_instance *instance) {
    const struct fuzz_state *state = any_state(session, instance);
    size_t size = 0;
    if (state->handle != NULL) {
        const fmi2Status status =
            FUZZ_CHECKED(instance, SerializedFMUstateSize, state->handle, &size);
        check_owner(state, instance, status, "fmi2SerializedFMUstateSize");
    }
}

void fuzz_call_SerializeFMUstate(struct fuzz_session *session, struct fuzz_instance *instance) {
    const struct fuzz_state *state = any_state(session, instance);
    struct fuzz_serialized *serialized = any_serialized(session);
    size_t needed = 0;
    if (state->handle == NULL ||
        FUZZ_CHECKED(state->owner, SerializedFMUstateSize, state->handle, &needed) != fmi2OK) {
        return;
    }
    const unsigned selector = fuzz_byte(session->input);
    const size_t size = selector < 128   ? needed
                        : selector < 192 ? needed + selector % 8
                                         : needed - 1 - selector % 4;
    fmi2Byte *bytes = fuzz_array(size, 1);
    const fmi2Status status = FUZZ_CHECKED(instance, SerializeFMUstate, state->handle, bytes, size);
    if (size < needed && status != fmi2Error) {
        fuzz_fail("fmi2SerializeFMUstate into %zu bytes of %zu has the status %d", size, needed,
                  (int)status);
    }
    if (size >= needed) {
        check_owner(state, instance, status, "fmi2SerializeFMUstate");
    }
    if (status != fmi2OK) {
        free(bytes);
        return;
    }
    free(serialized->bytes);
    *serialized = (struct fuzz_serialized){.bytes = bytes,
                                           .size = needed,
                                           .kind = instance->kind,
                                           .variety = instance->variety,
                                           .in_error = state->in_error,
                                           .time = state->time};
}

void fuzz_call_DeSerializeFMUstate(struct fuzz_session *session, struct fuzz_instance *instance) {
    struct fuzz_state *state = any_place(session);
    const struct fuzz_serialized *serialized = any_serialized(session);
    if (state->handle != NULL || serialized->bytes == NULL) {
        return;
    }
    const unsigned selector = fuzz_byte(session->input);
    const size_t size = selector < 224 ? serialized->size : serialized->size * (selector % 32) / 32;
    fmi2Byte *bytes = fuzz_array(size > 0 ? size : 1, 1); // nothing lies behind them
    memcpy(bytes, serialized->bytes, size);
    const fmi2Status status =
        FUZZ_CHECKED(instance, DeSerializeFMUstate, bytes, size, &state->handle);
    const unsigned other_variety = serialized->variety ^ instance->variety;
    const bool is_same_kind =
        serialized->kind == instance->kind && (other_variety & FUZZ_EVENT_MODE) == 0;
    const bool fits = size == serialized->size && is_same_kind;
    if (status != (fits ? fmi2OK : fmi2Error) || (state->handle != NULL) != fits) {
        fuzz_fail("fmi2DeSerializeFMUstate of %zu bytes of %zu, of a state of %s kind, has the "
                  "status %d",
                  size, serialized->size, is_same_kind ? "the same" : "another", (int)status);
    }
    if (fits) {
        state->owner = instance;
        state->in_error = serialized->in_error;
        state->time = serialized->time;
    }
    free(bytes);
}
