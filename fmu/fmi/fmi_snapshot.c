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

static unsigned tag_of(const struct fmi_instance *fmi) {
    return (unsigned)fmi->state | (unsigned)fmi->kind << TAG_KIND_SHIFT |
           (fmi->adapter->version - TAG_VERSION_0) << TAG_VERSION_SHIFT;
}

static unsigned version_in(unsigned tag) {
    return (tag >> TAG_VERSION_SHIFT) + TAG_VERSION_0;
}

/* Returns the FMI states that an FMI instance of this kind can be in while its instance is in a
 * phase; each of them is also possible after an error. */
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

/* Returns the FMI state of a snapshot, if an FMI instance like this one can be in it; otherwise 0.
 */
static unsigned state_in(const struct fmi_instance *fmi, unsigned tag, enum phase phase) {
    const struct adapter *adapter = fmi->adapter;
    const unsigned state = tag & TAG_STATE_MASK;
    const unsigned states = states_of(fmi->kind, phase) & adapter->states;
    const bool is_one_bit = state != 0 && (state & (state - 1)) == 0;
    const bool is_same_kind = (tag >> TAG_KIND_SHIFT & TAG_KIND_MASK) == (unsigned)fmi->kind &&
                              version_in(tag) == adapter->version;
    return is_one_bit && is_same_kind && states != 0 ? state & (states | adapter->after_error) : 0;
}

static enum fmi_status refuse_kind(struct fmi_instance *fmi, unsigned call, unsigned tag) {
    if (version_in(tag) != fmi->adapter->version) {
        return fmi_fail(
            fmi, "%s: the saved state is refused: it is one of FMI %u, the instance of FMI %u",
            fmi->adapter->rules[call].name, version_in(tag), fmi->adapter->version);
    }
    return fmi_fail(fmi, "%s: the saved state is refused: an instance for %s cannot be in it",
                    fmi->adapter->rules[call].name, fmi_kind_name(fmi->kind));
}

enum fmi_status fmi_snapshot_save(struct fmi_instance *fmi, unsigned call, void **handle) {
    struct instance *instance = fmi_enter_with(fmi, call, 1, handle, handle);
    if (instance == NULL) {
        return FMI_ERROR;
    }
    struct instance_snapshot *snapshot = *handle;
    const enum status status = instance_save(instance, tag_of(fmi), &snapshot);
    *handle = snapshot;
    return fmi_result(fmi, status);
}

enum fmi_status fmi_snapshot_restore(struct fmi_instance *fmi, unsigned call, void *handle) {
    struct instance *instance = fmi_enter_with(fmi, call, 1, handle, handle);
    if (instance == NULL) {
        return FMI_ERROR;
    }
    unsigned tag = 0;
    enum phase phase = PHASE_COUNT;
    enum status status = instance_snapshot_tag(instance, handle, &tag, &phase);
    if (status != STATUS_OK) {
        return fmi_result(fmi, status);
    }
    const unsigned state = state_in(fmi, tag, phase);
    if (state == 0) {
        return refuse_kind(fmi, call, tag);
    }
    status = instance_restore(instance, handle);
    if (status == STATUS_OK) {
        fmi->state = (enum fmi_state)state;
    }
    return fmi_result(fmi, status);
}

enum fmi_status fmi_snapshot_free(struct fmi_instance *fmi, unsigned call, void **handle) {
    struct instance *instance = fmi_enter(fmi, call);
    if (instance == NULL) {
        return FMI_ERROR;
    }
    if (handle == NULL || *handle == NULL) {
        return FMI_OK;
    }
    struct instance_snapshot *snapshot = *handle;
    const enum status status = instance_forget(instance, &snapshot);
    *handle = snapshot;
    return fmi_result(fmi, status);
}

enum fmi_status fmi_snapshot_size(struct fmi_instance *fmi, unsigned call, void *handle,
                                  size_t *size) {
    struct instance *instance = fmi_enter_with(fmi, call, 1, handle, size);
    if (instance == NULL) {
        return FMI_ERROR;
    }
    unsigned tag = 0;
    enum phase phase = PHASE_COUNT;
    const enum status status = instance_snapshot_tag(instance, handle, &tag, &phase);
    if (status == STATUS_OK) {
        *size = instance_serialized_size(instance);
    }
    return fmi_result(fmi, status);
}

enum fmi_status fmi_snapshot_serialize(struct fmi_instance *fmi, unsigned call, void *handle,
                                       unsigned char bytes[], size_t size) {
    struct instance *instance = fmi_enter_with(fmi, call, 1, handle, bytes);
    if (instance == NULL) {
        return FMI_ERROR;
    }
    return fmi_result(fmi, instance_serialize(instance, handle, bytes, size));
}

enum fmi_status fmi_snapshot_deserialize(struct fmi_instance *fmi, unsigned call,
                                         const unsigned char bytes[], size_t size, void **handle) {
    struct instance *instance = fmi_enter_with(fmi, call, 1, bytes, handle);
    if (instance == NULL) {
        return FMI_ERROR;
    }
    struct instance_snapshot *snapshot = NULL;
    enum status status = instance_deserialize(instance, bytes, size, &snapshot);
    if (status != STATUS_OK) {
        return fmi_result(fmi, status);
    }
    unsigned tag = 0;
    enum phase phase = PHASE_COUNT;
    status = instance_snapshot_tag(instance, snapshot, &tag, &phase);
    if (status != STATUS_OK || state_in(fmi, tag, phase) == 0) {
        instance_forget(instance, &snapshot);
        return refuse_kind(fmi, call, tag);
    }
    *handle = snapshot;
    return FMI_OK;
}
