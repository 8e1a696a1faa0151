#include "shared_calls.h"

#include "continuous_states.h"
#include "derivatives.h"
#include "model_description.h"
#include "serialization.h"
#include "snapshot.h"
#include "values.h"

/* Enters this state if the instance has succeeded. */
static enum component_status go_to(struct component *component, enum fmi_state state,
                                   enum status status) {
    if (status == STATUS_OK) {
        component->state = state;
    }
    return component_result(component, status);
}

/* ---- Initialization ------------------------------------------------------------------------- */

enum component_status mode_setup_experiment(struct component *component, unsigned call,
                                            const struct instance_experiment *experiment) {
    if (!component_enter(component, call)) {
        return COMPONENT_ERROR;
    }
    return component_result(component, instance_setup_experiment(component->instance, experiment));
}

enum component_status mode_enter_initialization(struct component *component, unsigned call,
                                                const struct instance_experiment *experiment) {
    if (!component_enter(component, call)) {
        return COMPONENT_ERROR;
    }
    enum status status = STATUS_OK;
    if (experiment != NULL) {
        status = instance_setup_experiment(component->instance, experiment);
    }
    if (status == STATUS_OK) {
        status = instance_enter_initialization(component->instance);
    }
    return go_to(component, STATE_INITIALIZATION, status);
}

enum component_status mode_exit_initialization(struct component *component, unsigned call) {
    if (!component_enter(component, call)) {
        return COMPONENT_ERROR;
    }
    const enum status status = instance_exit_initialization(component->instance);
    if (status == STATUS_OK) {
        component_log(component, COMPONENT_OK, LOG_EVENTS, "initialized at t = %.17g",
                      instance_time(component->instance));
    }
    return go_to(component,
                 component->kind == KIND_CO_SIMULATION ? STATE_STEP_COMPLETE : STATE_EVENT, status);
}

/* ---- Simulation ----------------------------------------------------------------------------- */

enum component_status mode_enter_event(struct component *component, unsigned call) {
    if (!component_enter(component, call)) {
        return COMPONENT_ERROR;
    }
    instance_enter_event_mode(component->instance);
    return go_to(component, STATE_EVENT, STATUS_OK);
}

enum component_status mode_enter_continuous_time(struct component *component, unsigned call) {
    if (!component_enter(component, call)) {
        return COMPONENT_ERROR;
    }
    return go_to(component, STATE_CONTINUOUS_TIME,
                 instance_enter_continuous_time(component->instance));
}

enum component_status mode_update_discrete_states(struct component *component,
                                                  struct discrete_update *update) {
    return component_result(component,
                            instance_update_discrete_states(component->instance, update));
}

enum component_status mode_enter_step(struct component *component, unsigned call) {
    if (!component_enter(component, call)) {
        return COMPONENT_ERROR;
    }
    return go_to(component, STATE_STEP_COMPLETE, STATUS_OK);
}

/* ---- End ------------------------------------------------------------------------------------ */

enum component_status mode_terminate(struct component *component, unsigned call) {
    if (!component_enter(component, call)) {
        return COMPONENT_ERROR;
    }
    component_log(component, COMPONENT_OK, LOG_EVENTS, "terminated at t = %.17g",
                  instance_time(component->instance));
    return go_to(component, STATE_TERMINATED, STATUS_OK);
}

enum component_status mode_reset(struct component *component, unsigned call) {
    if (!component_enter(component, call)) {
        return COMPONENT_ERROR;
    }
    instance_reset(component->instance);
    component_log(component, COMPONENT_OK, LOG_EVENTS, "reset to the start values");
    return go_to(component, STATE_INSTANTIATED, STATUS_OK);
}

/* ---- Values --------------------------------------------------------------------------------- */

#define ACCESS(access, of_instance, setting, element)                                              \
    enum component_status access(struct component *component, unsigned call,                       \
                                 const unsigned references[], size_t count, element values[]) {    \
        if (!component_enter(component, call) ||                                                   \
            !component_check_arrays(component, call, count, references, values) ||                 \
            (component->state == STATE_INTERMEDIATE_UPDATE &&                                      \
             !component->adapter->check_access(component, call, setting, references, count))) {    \
            return COMPONENT_ERROR;                                                                \
        }                                                                                          \
        return component_result(component,                                                         \
                                of_instance(component->instance, references, count, values));      \
    }
#define GET_AND_SET(name, constant, element)                                                       \
    ACCESS(access_get_##name, instance_get_##name, false, element)                                 \
    ACCESS(access_set_##name, instance_set_##name, true, const element)
VALUE_TYPE_LIST(GET_AND_SET)
#undef GET_AND_SET
#undef ACCESS

enum component_status access_none(struct component *component, unsigned call, const char *type,
                                  const unsigned references[], size_t count, const void *values) {
    if (!component_enter(component, call) ||
        !component_check_arrays(component, call, count, references, values)) {
        return COMPONENT_ERROR;
    }
    if (count > 0) {
        return component_fail(component,
                              "value reference %u is accessed as %s: %s has no variable of that "
                              "type",
                              references[0], type, model_description.name);
    }
    return COMPONENT_OK;
}

/* ---- Derivatives ---------------------------------------------------------------------------- */

enum component_status access_set_input_derivatives(struct component *component, unsigned call,
                                                   const unsigned references[], size_t count,
                                                   const int orders[], const double values[]) {
    if (!component_enter(component, call) ||
        !component_check_arrays(component, call, count, references, values) ||
        !component_check_arrays(component, call, count, orders, orders)) {
        return COMPONENT_ERROR;
    }
    return component_result(component, instance_set_input_derivatives(
                                           component->instance, references, count, orders, values));
}

enum component_status access_get_output_derivatives(struct component *component, unsigned call,
                                                    const unsigned references[], size_t count,
                                                    const int orders[], double values[]) {
    if (!component_enter(component, call) ||
        !component_check_arrays(component, call, count, references, values) ||
        !component_check_arrays(component, call, count, orders, orders)) {
        return COMPONENT_ERROR;
    }
    return component_result(component, instance_get_output_derivatives(
                                           component->instance, references, count, orders, values));
}

enum component_status access_get_directional_derivative(struct component *component, unsigned call,
                                                        const unsigned unknowns[],
                                                        size_t unknown_count,
                                                        const unsigned knowns[], size_t known_count,
                                                        const double seed[], double result[]) {
    if (!component_enter(component, call) ||
        !component_check_arrays(component, call, unknown_count, unknowns, result) ||
        !component_check_arrays(component, call, known_count, knowns, seed)) {
        return COMPONENT_ERROR;
    }
    return component_result(component,
                            instance_get_directional_derivative(
                                component->instance, component->adapter->knowns, unknowns,
                                unknown_count, knowns, known_count, seed, result));
}

enum component_status access_get_adjoint_derivative(struct component *component, unsigned call,
                                                    const unsigned unknowns[], size_t unknown_count,
                                                    const unsigned knowns[], size_t known_count,
                                                    const double seed[], double result[]) {
    if (!component_enter(component, call) ||
        !component_check_arrays(component, call, unknown_count, unknowns, seed) ||
        !component_check_arrays(component, call, known_count, knowns, result)) {
        return COMPONENT_ERROR;
    }
    return component_result(
        component,
        instance_get_adjoint_derivative(component->instance, component->adapter->knowns, unknowns,
                                        unknown_count, knowns, known_count, seed, result));
}

/* ---- Time and continuous states ------------------------------------------------------------- */

enum component_status continuous_set_time(struct component *component, unsigned call, double time) {
    if (!component_enter(component, call)) {
        return COMPONENT_ERROR;
    }
    return component_result(component, instance_set_time(component->instance, time));
}

enum component_status continuous_set_states(struct component *component, unsigned call,
                                            const double x[], size_t count) {
    if (!component_enter(component, call) ||
        !component_check_arrays(component, call, count, x, x)) {
        return COMPONENT_ERROR;
    }
    return component_result(component, instance_set_states(component->instance, x, count));
}

enum component_status continuous_get_states(struct component *component, unsigned call, double x[],
                                            size_t count) {
    if (!component_enter(component, call) ||
        !component_check_arrays(component, call, count, x, x)) {
        return COMPONENT_ERROR;
    }
    return component_result(component, instance_get_states(component->instance, x, count));
}

enum component_status continuous_get_derivatives(struct component *component, unsigned call,
                                                 double dx[], size_t count) {
    if (!component_enter(component, call) ||
        !component_check_arrays(component, call, count, dx, dx)) {
        return COMPONENT_ERROR;
    }
    return component_result(component, instance_get_derivatives(component->instance, dx, count));
}

enum component_status continuous_get_nominals(struct component *component, unsigned call,
                                              double nominals[], size_t count) {
    if (!component_enter(component, call) ||
        !component_check_arrays(component, call, count, nominals, nominals)) {
        return COMPONENT_ERROR;
    }
    return component_result(component, instance_get_nominals(component->instance, nominals, count));
}

enum component_status continuous_get_indicators(struct component *component, unsigned call,
                                                double indicators[], size_t count) {
    const size_t expected = model_description.indicator_count;
    if (!component_enter(component, call) ||
        !component_check_arrays(component, call, count, indicators, indicators)) {
        return COMPONENT_ERROR;
    }
    if (count != expected) {
        return component_fail(component, "%zu event indicators are accessed: there are %zu", count,
                              expected);
    }
    return component_result(
        component,
        instance_get_real(component->instance, model_description.indicators, count, indicators));
}

enum component_status continuous_complete_step(struct component *component, unsigned call,
                                               const void *enters, const void *terminates,
                                               bool *is_event) {
    if (!component_enter(component, call) ||
        !component_check_arrays(component, call, 1, enters, terminates)) {
        return COMPONENT_ERROR;
    }
    *is_event = instance_complete_step(component->instance);
    return COMPONENT_OK;
}

/* ---- FMU state ------------------------------------------------------------------------------ */

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

enum component_status fmu_state_save(struct component *component, unsigned call, void **fmu_state) {
    if (!component_enter(component, call) ||
        !component_check_arrays(component, call, 1, fmu_state, fmu_state)) {
        return COMPONENT_ERROR;
    }
    struct instance_snapshot *snapshot = *fmu_state;
    const enum status status = instance_save(component->instance, tag_of(component), &snapshot);
    *fmu_state = snapshot;
    return component_result(component, status);
}

enum component_status fmu_state_restore(struct component *component, unsigned call,
                                        void *fmu_state) {
    if (!component_enter(component, call) ||
        !component_check_arrays(component, call, 1, fmu_state, fmu_state)) {
        return COMPONENT_ERROR;
    }
    unsigned tag = 0;
    enum phase phase = PHASE_COUNT;
    enum status status = instance_snapshot_tag(component->instance, fmu_state, &tag, &phase);
    if (status != STATUS_OK) {
        return component_result(component, status);
    }
    const unsigned state = state_in(component, tag, phase);
    if (state == 0) {
        return refuse_kind(component, call, tag);
    }
    status = instance_restore(component->instance, fmu_state);
    if (status == STATUS_OK) {
        component->state = (enum fmi_state)state;
    }
    return component_result(component, status);
}

enum component_status fmu_state_free(struct component *component, unsigned call, void **fmu_state) {
    if (!component_enter(component, call)) {
        return COMPONENT_ERROR;
    }
    if (fmu_state == NULL || *fmu_state == NULL) {
        return COMPONENT_OK;
    }
    struct instance_snapshot *snapshot = *fmu_state;
    const enum status status = instance_forget(component->instance, &snapshot);
    *fmu_state = snapshot;
    return component_result(component, status);
}

enum component_status fmu_state_size(struct component *component, unsigned call, void *fmu_state,
                                     size_t *size) {
    if (!component_enter(component, call) ||
        !component_check_arrays(component, call, 1, fmu_state, size)) {
        return COMPONENT_ERROR;
    }
    unsigned tag = 0;
    enum phase phase = PHASE_COUNT;
    const enum status status = instance_snapshot_tag(component->instance, fmu_state, &tag, &phase);
    if (status == STATUS_OK) {
        *size = instance_serialized_size(component->instance);
    }
    return component_result(component, status);
}

enum component_status fmu_state_serialize(struct component *component, unsigned call,
                                          void *fmu_state, unsigned char bytes[], size_t size) {
    if (!component_enter(component, call) ||
        !component_check_arrays(component, call, 1, fmu_state, bytes)) {
        return COMPONENT_ERROR;
    }
    return component_result(component,
                            instance_serialize(component->instance, fmu_state, bytes, size));
}

enum component_status fmu_state_deserialize(struct component *component, unsigned call,
                                            const unsigned char bytes[], size_t size,
                                            void **fmu_state) {
    if (!component_enter(component, call) ||
        !component_check_arrays(component, call, 1, bytes, fmu_state)) {
        return COMPONENT_ERROR;
    }
    struct instance_snapshot *snapshot = NULL;
    enum status status = instance_deserialize(component->instance, bytes, size, &snapshot);
    if (status != STATUS_OK) {
        return component_result(component, status);
    }
    unsigned tag = 0;
    enum phase phase = PHASE_COUNT;
    status = instance_snapshot_tag(component->instance, snapshot, &tag, &phase);
    if (status != STATUS_OK || state_in(component, tag, phase) == 0) {
        instance_forget(component->instance, &snapshot);
        return refuse_kind(component, call, tag);
    }
    *fmu_state = snapshot;
    return COMPONENT_OK;
}
