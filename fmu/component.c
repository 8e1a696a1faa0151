#include "component.h"

#include "model_description.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const category_names[LOG_CATEGORY_COUNT] = {
    [LOG_EVENTS] = "logEvents",
    [LOG_STATUS_WARNING] = "logStatusWarning",
    [LOG_STATUS_DISCARD] = "logStatusDiscard",
    [LOG_STATUS_ERROR] = "logStatusError",
    [LOG_STATUS_FATAL] = "logStatusFatal",
    [LOG_ALL] = "logAll",
};

/* ---- Logging -------------------------------------------------------------------------------- */

enum { TEXT_SIZE = 1024 };

/* Importers may pass a text to printf, resolve #r<reference># in it, or do neither: '%' and control
 * characters are replaced and '#' is doubled. */
static void harmless(const char *text, char out[TEXT_SIZE]) {
    size_t length = 0;
    for (; *text != '\0' && length < TEXT_SIZE - 2; text++) {
        char c = *text;
        if (c == '%' || (unsigned char)c < ' ' || c == 0x7f) {
            c = '?';
        }
        out[length++] = c;
        if (c == '#') {
            out[length++] = '#';
        }
    }
    out[length] = '\0';
}

static void send(fmi2CallbackLogger logger, fmi2ComponentEnvironment environment, const char *name,
                 fmi2Status status, enum log_category category, const char *format,
                 va_list arguments) {
    char raw[TEXT_SIZE];
    char text[TEXT_SIZE];
    (void)vsnprintf(raw, sizeof raw, format, arguments);
    harmless(raw, text);
    logger(environment, name, status, category_names[category], text);
}

void component_log(const struct component *component, fmi2Status status, enum log_category category,
                   const char *format, ...) {
    if (component->logger == NULL || !component->is_logged[category]) {
        return;
    }
    va_list arguments;
    va_start(arguments, format);
    send(component->logger, component->environment, component->name, status, category, format,
         arguments);
    va_end(arguments);
}

void component_log_refusal(const fmi2CallbackFunctions *functions, const char *name,
                           const char *format, ...) {
    if (functions == NULL || functions->logger == NULL) {
        return;
    }
    va_list arguments;
    va_start(arguments, format);
    send(functions->logger, functions->componentEnvironment, name != NULL ? name : "", fmi2Error,
         LOG_STATUS_ERROR, format, arguments);
    va_end(arguments);
}

bool component_set_logged(struct component *component, const char *category, bool on) {
    bool found = false;
    const bool all = strcmp(category, category_names[LOG_ALL]) == 0;
    for (int i = 0; i < LOG_CATEGORY_COUNT; i++) {
        if (all || strcmp(category, category_names[i]) == 0) {
            component->is_logged[i] = on;
            found = true;
        }
    }
    return found;
}

/* Status messages are sent even with logging off; what merely tells the course of events is not. */
static void set_initial_logging(struct component *component, bool logging_on) {
    for (int i = 0; i < LOG_CATEGORY_COUNT; i++) {
        component->is_logged[i] = logging_on || (i != LOG_EVENTS && i != LOG_ALL);
    }
}

/* ---- Status --------------------------------------------------------------------------------- */

static const struct {
    fmi2Status fmi_status;
    enum log_category category;
} of_severity[] = {
    [SEVERITY_NONE] = {fmi2OK, LOG_EVENTS},
    [SEVERITY_NOTICE] = {fmi2OK, LOG_STATUS_WARNING},
    [SEVERITY_DISCARD] = {fmi2Discard, LOG_STATUS_DISCARD},
    [SEVERITY_ERROR] = {fmi2Error, LOG_STATUS_ERROR},
};

static void log_instance_text(void *component, enum status status, const char *text) {
    const enum severity severity = status_severity(status);
    component_log(component, of_severity[severity].fmi_status, of_severity[severity].category, "%s",
                  text);
}

fmi2Status component_status(struct component *component, enum status status) {
    const fmi2Status fmi_status = of_severity[status_severity(status)].fmi_status;
    if (fmi_status == fmi2Error) {
        component->state = STATE_ERROR;
    }
    return fmi_status;
}

fmi2Status component_fail(struct component *component, const char *format, ...) {
    char text[TEXT_SIZE];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    component_log(component, fmi2Error, LOG_STATUS_ERROR, "%s", text);
    component->state = STATE_ERROR;
    return fmi2Error;
}

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
    }
    return "in no known state";
}

struct component *component_enter(fmi2Component c, enum call call) {
    static const char *const kind_names[] = {"any kind", "Co-Simulation", "Model Exchange"};
    struct component *component = c;
    if (component == NULL) {
        return NULL;
    }
    const struct call_rule *rule = &call_rules[call];
    const enum call_kind kind =
        component->kind == fmi2CoSimulation ? CO_SIMULATION : MODEL_EXCHANGE;
    if (component->is_logged[LOG_ALL]) {
        component_log(component, fmi2OK, LOG_ALL, "%s", rule->name);
    }
    if (rule->kind != ANY_KIND && rule->kind != kind) {
        component_fail(component, "%s belongs to %s: the instance is one for %s", rule->name,
                       kind_names[rule->kind], kind_names[kind]);
        return NULL;
    }
    if (((unsigned)component->state & rule->allowed) == 0) {
        component_fail(component, "%s is not allowed while the instance is %s", rule->name,
                       state_name(component->state));
        return NULL;
    }
    return component;
}

bool component_has_arrays(struct component *component, enum call call, size_t count,
                          const void *references, const void *values) {
    if (count > 0 && (references == NULL || values == NULL)) {
        component_fail(component, "%s: an array is NULL, %zu values are expected",
                       call_rules[call].name, count);
        return false;
    }
    return true;
}

/* ---- Life ----------------------------------------------------------------------------------- */

struct component *component_create(const char *name, fmi2Type kind,
                                   const fmi2CallbackFunctions *functions, bool logging_on) {
    struct component *component = calloc(1, sizeof *component);
    if (component == NULL) {
        return NULL;
    }
    component->state = STATE_INSTANTIATED;
    component->kind = kind;
    component->logger = functions->logger;
    component->environment = functions->componentEnvironment;
    set_initial_logging(component, logging_on);

    const size_t size = strlen(name) + 1;
    component->name = malloc(size);
    if (component->name == NULL) {
        component_destroy(component);
        return NULL;
    }
    memcpy(component->name, name, size);

    const struct message_sink sink = {.write = log_instance_text, .context = component};
    if (instance_create(&model_description, &sink, &component->instance) != STATUS_OK) {
        component_destroy(component);
        return NULL;
    }
    return component;
}

void component_destroy(struct component *component) {
    if (component == NULL) {
        return;
    }
    instance_destroy(component->instance);
    free(component->name);
    free(component);
}
