#include "component.h"

#include "model_description.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* ---- Log ------------------------------------------------------------------------------------ */

enum { LOG_TEXT_SIZE = 1024 };

static const char *const category_names[LOG_CATEGORY_COUNT] = {
    [LOG_EVENTS] = "logEvents",
    [LOG_STATUS_WARNING] = "logStatusWarning",
    [LOG_STATUS_DISCARD] = "logStatusDiscard",
    [LOG_STATUS_ERROR] = "logStatusError",
    [LOG_STATUS_FATAL] = "logStatusFatal",
    [LOG_ALL] = "logAll",
};

static bool continues_character(char c) {
    return ((unsigned char)c & 0xc0) == 0x80;
}

/* Returns the length of a text in UTF-8 without a last character that has been cut. */
static size_t whole_length(const char *text, size_t length) {
    size_t begin = length;
    while (begin > 0 && continues_character(text[begin - 1])) {
        begin--;
    }
    const unsigned char first = begin > 0 ? (unsigned char)text[begin - 1] : 0;
    const size_t needed = first >= 0xf0 ? 3 : first >= 0xe0 ? 2 : first >= 0xc0 ? 1 : 0;
    return length - begin < needed ? begin - 1 : length;
}

/* Makes a text harmless that importers search for references to variables, or pass to printf:
 * doubles characters with a meaning there. Line ends become blanks, other control characters '?'.
 */
static void make_harmless(const struct adapter *adapter, const char *text,
                          char out[LOG_TEXT_SIZE]) {
    size_t length = 0;
    for (; *text != '\0' && length < LOG_TEXT_SIZE - 2; text++) {
        const bool is_blank = strchr("\t\n\r", *text) != NULL;
        const bool is_control = (unsigned char)*text < ' ' || *text == 0x7f;
        out[length] = *text;
        if (is_blank || is_control) {
            out[length] = is_blank ? ' ' : '?';
        } else if (strchr(adapter->doubled, *text) != NULL) {
            out[++length] = *text;
        }
        length++;
    }
    out[whole_length(out, length)] = '\0';
}

static void send_one(const struct component *component, enum component_status status,
                     enum log_category category, const char *raw) {
    if (component->is_logged[category]) {
        char text[LOG_TEXT_SIZE];
        make_harmless(component->adapter, raw, text);
        component->adapter->send(component, status, category_names[category], text);
    }
}

static void send_text(struct component *component, enum component_status status,
                      enum log_category category, const char *raw) {
    component->is_logging = true;
    component->call_in_logger = NULL;
    send_one(component, status, category, raw);
    if (component->call_in_logger != NULL) { // once, because the logger may do it each time
        char refusal[LOG_TEXT_SIZE];
        (void)snprintf(refusal, sizeof refusal,
                       "%s is refused inside the logger: the instance is in the middle of a call",
                       component->call_in_logger);
        send_one(component, COMPONENT_ERROR, LOG_STATUS_ERROR, refusal);
    }
    component->is_logging = false;
}

bool component_refuse_in_logger(struct component *component, const char *call) {
    if (component->is_logging) {
        component->call_in_logger = call;
    }
    return component->is_logging;
}

void component_log(struct component *component, enum component_status status,
                   enum log_category category, const char *format, ...) {
    char raw[LOG_TEXT_SIZE];
    if (!component->is_logged[category]) {
        return;
    }
    va_list arguments;
    va_start(arguments, format);
    message_format(raw, sizeof raw, format, arguments);
    va_end(arguments);
    send_text(component, status, category, raw);
}

/* Sets a category, or all of them by the name logAll. Returns false if the name is unknown. */
static bool set_logged(struct component *component, const char *name, bool on) {
    const bool all = strcmp(name, category_names[LOG_ALL]) == 0;
    bool found = false;
    for (int i = 0; i < LOG_CATEGORY_COUNT; i++) {
        if (all || strcmp(name, category_names[i]) == 0) {
            component->is_logged[i] = on;
            found = true;
        }
    }
    return found;
}

static void log_always(struct component *component, unsigned categories) {
    for (int i = 0; i < LOG_CATEGORY_COUNT; i++) {
        component->is_logged[i] |= (categories & 1u << i) != 0;
    }
}

enum component_status component_set_logging(struct component *component, bool on, size_t count,
                                            const char *const names[]) {
    bool before[LOG_CATEGORY_COUNT];
    memcpy(before, component->is_logged, sizeof before);
    if (on || count == 0) {
        for (int i = 0; i < LOG_CATEGORY_COUNT; i++) {
            component->is_logged[i] = on && count == 0;
        }
    }
    for (size_t i = 0; i < count; i++) {
        if (names[i] == NULL || !set_logged(component, names[i], on)) {
            memcpy(component->is_logged, before, sizeof before);
            return component_fail(component,
                                  "log category '%s' is unknown: the model description lists those "
                                  "that exist",
                                  names[i] != NULL ? names[i] : "");
        }
    }
    log_always(component, component->adapter->never_silent);
    return COMPONENT_OK;
}

/* ---- Status --------------------------------------------------------------------------------- */

static const struct {
    enum component_status status;
    enum log_category category;
} of_severity[] = {
    [SEVERITY_NONE] = {COMPONENT_OK, LOG_EVENTS},
    [SEVERITY_NOTICE] = {COMPONENT_OK, LOG_STATUS_WARNING},
    [SEVERITY_DISCARD] = {COMPONENT_DISCARD, LOG_STATUS_DISCARD},
    [SEVERITY_ERROR] = {COMPONENT_ERROR, LOG_STATUS_ERROR},
};

static void log_instance_text(void *component, enum status status, const char *text) {
    const enum severity severity = status_severity(status);
    send_text(component, of_severity[severity].status, of_severity[severity].category, text);
}

static void note_error(struct component *component) {
    if (component->state == STATE_INTERMEDIATE_UPDATE) {
        component->has_failed_inside = true;
    } else {
        component->state = component->adapter->after_error;
    }
}

enum component_status component_failure(struct component *component, enum status status) {
    const enum component_status result = of_severity[status_severity(status)].status;
    // intermediate update mode knows no discard (FMI 3.0, section 4.2.2)
    if (result == COMPONENT_DISCARD && component->state == STATE_INTERMEDIATE_UPDATE) {
        return component_fail(component, "the step fails: no value can be discarded in an "
                                         "intermediate update");
    }
    if (result == COMPONENT_ERROR) {
        note_error(component);
    }
    return result;
}

enum component_status component_fail(struct component *component, const char *format, ...) {
    if (component_refuse_in_logger(component, "a call")) {
        return COMPONENT_ERROR;
    }
    char raw[LOG_TEXT_SIZE];
    va_list arguments;
    va_start(arguments, format);
    message_format(raw, sizeof raw, format, arguments);
    va_end(arguments);
    send_text(component, COMPONENT_ERROR, LOG_STATUS_ERROR, raw);
    note_error(component);
    return COMPONENT_ERROR;
}

/* ---- Calls ---------------------------------------------------------------------------------- */

static const char *state_name(enum fmi_state state) {
    switch (state) {
    case STATE_INSTANTIATED:
        return "instantiated";
    case STATE_INITIALIZATION:
        return "in initialization mode";
    case STATE_TERMINATED:
        return "terminated";
    case STATE_ERROR:
        return "in the error state";
    case STATE_STEP_COMPLETE:
        return "between steps";
    case STATE_STEP_FAILED:
        return "after a failed step";
    case STATE_EVENT:
        return "in event mode";
    case STATE_CONTINUOUS_TIME:
        return "in continuous-time mode";
    case STATE_INTERMEDIATE_UPDATE:
        return "in intermediate update mode";
    }
    return "in no known state";
}

const char *component_kind_name(unsigned kinds) {
    switch (kinds) {
    case KIND_MODEL_EXCHANGE:
        return "Model Exchange";
    case KIND_CO_SIMULATION_WITH_EVENTS:
        return "Co-Simulation with event mode";
    case KIND_MODEL_EXCHANGE | KIND_CO_SIMULATION_WITH_EVENTS:
        return "Model Exchange and to Co-Simulation with event mode";
    default:
        return "Co-Simulation";
    }
}

struct instance *component_enter(struct component *component, unsigned call) {
    if (component == NULL) {
        return NULL;
    }
    const struct call_rule *rule = &component->adapter->rules[call];
    if (component_refuse_in_logger(component, rule->name)) {
        return NULL;
    }
    if (component->is_logged[LOG_ALL]) {
        component_log(component, COMPONENT_OK, LOG_ALL, "%s", rule->name);
    }
    if ((component->kind & rule->kinds) == 0) {
        component_fail(component, "%s belongs to %s: the instance is one for %s", rule->name,
                       component_kind_name(rule->kinds), component_kind_name(component->kind));
        return NULL;
    }
    if ((component->state & rule->states) == 0) {
        component_fail(component, "%s is not allowed while the instance is %s", rule->name,
                       state_name(component->state));
        return NULL;
    }
    return component->instance;
}

bool component_check_arrays(struct component *component, unsigned call, size_t count,
                            const void *first, const void *second) {
    if (count == 0 || (first != NULL && second != NULL)) {
        return true;
    }
    component_fail(component, "%s: an array is NULL, %zu values are expected",
                   component->adapter->rules[call].name, count);
    return false;
}

enum component_status component_go_to(struct component *component, enum fmi_state state,
                                      enum status status) {
    if (status != STATUS_OK) {
        return component_failure(component, status);
    }
    component->state = state;
    return COMPONENT_OK;
}

enum component_status component_exit_initialization(struct component *component, unsigned call) {
    struct instance *instance = component_enter(component, call);
    if (instance == NULL) {
        return COMPONENT_ERROR;
    }
    const enum status status = instance_exit_initialization(instance);
    if (status == STATUS_OK) {
        component_log(component, COMPONENT_OK, LOG_EVENTS, "initialized at t = %.17g",
                      instance_time(instance));
    }
    // into event mode, if the importer handles events
    return component_go_to(
        component, component->kind == KIND_CO_SIMULATION ? STATE_STEP_COMPLETE : STATE_EVENT,
        status);
}

enum component_status component_terminate(struct component *component, unsigned call) {
    const struct instance *instance = component_enter(component, call);
    if (instance == NULL) {
        return COMPONENT_ERROR;
    }
    component_log(component, COMPONENT_OK, LOG_EVENTS, "terminated at t = %.17g",
                  instance_time(instance));
    return component_go_to(component, STATE_TERMINATED, STATUS_OK);
}

enum component_status component_reset(struct component *component, unsigned call) {
    struct instance *instance = component_enter(component, call);
    if (instance == NULL) {
        return COMPONENT_ERROR;
    }
    instance_reset(instance);
    component_log(component, COMPONENT_OK, LOG_EVENTS, "reset to the start values");
    return component_go_to(component, STATE_INSTANTIATED, STATUS_OK);
}

enum component_status component_access_none(struct component *component, const char *type,
                                            const unsigned references[], size_t count) {
    return count == 0 ? COMPONENT_OK
                      : component_fail(component,
                                       "value reference %u is accessed as %s: %s has no variable "
                                       "of that type",
                                       references[0], type, model_description.name);
}

/* ---- Life ----------------------------------------------------------------------------------- */

void component_begin(struct component *component, const struct adapter *adapter, enum fmi_kind kind,
                     bool logging_on) {
    component->adapter = adapter;
    component->state = STATE_INSTANTIATED;
    component->kind = kind;
    log_always(component, logging_on ? ~0u : adapter->always_logged);
}

bool component_check_token(struct component *component, const char *name, const char *token_name,
                           const char *token, const char *expected) {
    if (name == NULL || name[0] == '\0') {
        component_fail(component,
                       "the instance name is missing: a name that is not empty is expected");
        return false;
    }
    if (token == NULL || strcmp(token, expected) != 0) {
        component_fail(component,
                       "the %s '%.100s' is refused: '%s' is expected, the model description "
                       "belongs to another build",
                       token_name, token != NULL ? token : "", expected);
        return false;
    }
    return true;
}

enum component_status component_create_instance(struct component *component) {
    const struct message_sink sink = {.write = log_instance_text, .context = component};
    if (instance_create(&model_description, &sink, &component->instance) != STATUS_OK) {
        return COMPONENT_ERROR;
    }
    if (component->kind == KIND_MODEL_EXCHANGE) {
        instance_integrate_outside(component->instance);
    }
    return COMPONENT_OK;
}

void component_end(struct component *component) {
    instance_destroy(component->instance);
}
