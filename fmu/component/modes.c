#include "modes.h"

/* The component is in this state where the instance has succeeded. */
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
