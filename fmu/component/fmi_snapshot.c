#include "fmi_snapshot.h"

#include "serialization.h"
#include "snapshot.h"

/* Tag of a saved state: the FMI state and kind of its instance, and its version of FMI. */
enum {
    TAG_STATE_MASK = 0xffff,
    TAG_KIND_SHIFT = 16,
    TAG_KIND_MASK = 0xff,
    TAG_VERSION_SHIFT = 24,
    TAG_VERSION_0 = 2, /* the version whose number in a tag is 0 */
};

static unsigned tag_of(const struct component *component) {
    return (unsigned)component->state | (unsigned)component->kind << TAG_KIND_SHIFT |
           (component->adapter->version - TAG_VERSION_0) << TAG_VERSION_SHIFT;
}

static unsigned version_in(unsigned tag) {
    return (tag >> TAG_VERSION_SHIFT) + TAG_VERSION_0;
}

/* Returns the FMI states that a component of this kind can be in while its instance is in a phase;
 * each of them is also possible after an error. */
static unsigned states_of(enum fmi_kind kind, enum phase phase) {
    const bool steps = kind != KIND_MODEL_EXCHANGE;
    switch (phase) {
    case PHASE_INSTANTIATED:
        return STATE_INSTANTIATED;
    case PHASE_INITIALIZATION:
        return STATE_INITIALIZATION;
    case PHASE_STEPPING:
        return STATE_TERMINATED | (steps ? STATE_STEP_COMPLETE | STATE_STEP_FAILED : 0) |
               (kind != KIND_CO_SIMULATION ? STATE_EVENT : 0);
    case PHASE_CONTINUOUS_TIME:
        return steps ? 0 : STATE_CONTINUOUS_TIME | STATE_TERMINATED;
    case PHASE_COUNT:
        break;
    }
    return 0;
}

/* Returns the FMI state of a snapshot, if a component like this one can be in it; otherwise 0. */
static unsigned state_in(const struct component *component, unsigned tag, enum phase phase) {
    const struct adapter *adapter = component->adapter;
    const unsigned state = tag & TAG_STATE_MASK;
    const unsigned states = states_of(component->kind, phase) & adapter->states;
    const bool is_one_bit = state != 0 && (state & (state - 1)) == 0;
    const bool is_same_kind =
        (tag >> TAG_KIND_SHIFT & TAG_KIND_MASK) == (unsigned)component->kind &&
        version_in(tag) == adapter->version;
    return is_one_bit && is_same_kind && states != 0 ? state & (states | adapter->after_error) : 0;
}

static enum component_status refuse_kind(struct component *component, unsigned call, unsigned tag) {
    if (version_in(tag) != component->adapter->version) {
        return component_fail(
            component,
            "%s: the saved state is refused: it is one of FMI %u, the instance of FMI %u",
            component->adapter->rules[call].name, version_in(tag), component->adapter->version);
    }
    return component_fail(
        component, "%s: the saved state is refused: an instance for %s cannot be in it",
        component->adapter->rules[call].name, component_kind_name(component->kind));
}

enum component_status fmi_snapshot_save(struct component *component, unsigned call, void **handle) {
    struct instance *instance = component_enter_with(component, call, 1, handle, handle);
    if (instance == NULL) {
        return COMPONENT_ERROR;
    }
    struct instance_snapshot *snapshot = *handle;
    const enum status status = instance_save(instance, tag_of(component), &snapshot);
    *handle = snapshot;
    return component_result(component, status);
}

enum component_status fmi_snapshot_restore(struct component *component, unsigned call,
                                           void *handle) {
    struct instance *instance = component_enter_with(component, call, 1, handle, handle);
    if (instance == NULL) {
        return COMPONENT_ERROR;
    }
    unsigned tag = 0;
    enum phase phase = PHASE_COUNT;
    enum status status = instance_snapshot_tag(instance, handle, &tag, &phase);
    if (status != STATUS_OK) {
        return component_result(component, status);
    }
    const unsigned state = state_in(component, tag, phase);
    if (state == 0) {
        return refuse_kind(component, call, tag);
    }
    status = instance_restore(instance, handle);
    if (status == STATUS_OK) {
        component->state = (enum fmi_state)state;
    }
    return component_result(component, status);
}

enum component_status fmi_snapshot_free(struct component *component, unsigned call, void **handle) {
    struct instance *instance = component_enter(component, call);
    if (instance == NULL) {
        return COMPONENT_ERROR;
    }
    if (handle == NULL || *handle == NULL) {
        return COMPONENT_OK;
    }
    struct instance_snapshot *snapshot = *handle;
    const enum status status = instance_forget(instance, &snapshot);
    *handle = snapshot;
    return component_result(component, status);
}

enum component_status fmi_snapshot_size(struct component *component, unsigned call, void *handle,
                                        size_t *size) {
    struct instance *instance = component_enter_with(component, call, 1, handle, size);
    if (instance == NULL) {
        return COMPONENT_ERROR;
    }
    unsigned tag = 0;
    enum phase phase = PHASE_COUNT;
    const enum status status = instance_snapshot_tag(instance, handle, &tag, &phase);
    if (status == STATUS_OK) {
        *size = instance_serialized_size(instance);
    }
    return component_result(component, status);
}

enum component_status fmi_snapshot_serialize(struct component *component, unsigned call,
                                             void *handle, unsigned char bytes[], size_t size) {
    struct instance *instance = component_enter_with(component, call, 1, handle, bytes);
    if (instance == NULL) {
        return COMPONENT_ERROR;
    }
    return component_result(component, instance_serialize(instance, handle, bytes, size));
}

enum component_status fmi_snapshot_deserialize(struct component *component, unsigned call,
                                               const unsigned char bytes[], size_t size,
                                               void **handle) {
    struct instance *instance = component_enter_with(component, call, 1, bytes, handle);
    if (instance == NULL) {
        return COMPONENT_ERROR;
    }
    struct instance_snapshot *snapshot = NULL;
    enum status status = instance_deserialize(instance, bytes, size, &snapshot);
    if (status != STATUS_OK) {
        return component_result(component, status);
    }
    unsigned tag = 0;
    enum phase phase = PHASE_COUNT;
    status = instance_snapshot_tag(instance, snapshot, &tag, &phase);
    if (status != STATUS_OK || state_in(component, tag, phase) == 0) {
        instance_forget(instance, &snapshot);
        return refuse_kind(component, call, tag);
    }
    *handle = snapshot;
    return COMPONENT_OK;
}
