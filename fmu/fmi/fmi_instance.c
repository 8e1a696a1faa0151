#include "fmi_instance.h"

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

static void send_one(const struct fmi_instance *fmi, enum fmi_status status,
                     enum log_category category, const char *raw) {
    if (fmi->is_logged[category]) {
        char text[LOG_TEXT_SIZE];
        make_harmless(fmi->adapter, raw, text);
        fmi->adapter->send(fmi, status, category_names[category], text);
    }
}

static void send_text(struct fmi_instance *fmi, enum fmi_status status, enum log_category category,
                      const char *raw) {
    fmi->is_logging = true;
    fmi->call_in_logger = NULL;
    send_one(fmi, status, category, raw);
    if (fmi->call_in_logger != NULL) { // once, because the logger may do it each time
        char refusal[LOG_TEXT_SIZE];
        (void)snprintf(refusal, sizeof refusal,
                       "%s is refused inside the logger: the instance is in the middle of a call",
                       fmi->call_in_logger);
        send_one(fmi, FMI_ERROR, LOG_STATUS_ERROR, refusal);
    }
    fmi->is_logging = false;
}

bool fmi_refuse_in_logger(struct fmi_instance *fmi, const char *call) {
    if (fmi->is_logging) {
        fmi->call_in_logger = call;
    }
    return fmi->is_logging;
}

void fmi_log(struct fmi_instance *fmi, enum fmi_status status, enum log_category category,
             const char *format, ...) {
    char raw[LOG_TEXT_SIZE];
    if (!fmi->is_logged[category]) {
        return;
    }
    va_list arguments;
    va_start(arguments, format);
    message_format(raw, sizeof raw, format, arguments);
    va_end(arguments);
    send_text(fmi, status, category, raw);
}

/* Sets a category, or all of them by the name logAll. Returns false if the name is unknown. */
static bool set_logged(struct fmi_instance *fmi, const char *name, bool on) {
    const bool all = strcmp(name, category_names[LOG_ALL]) == 0;
    bool found = false;
    for (int i = 0; i < LOG_CATEGORY_COUNT; i++) {
        if (all || strcmp(name, category_names[i]) == 0) {
            fmi->is_logged[i] = on;
            found = true;
        }
    }
    return found;
}

static void log_always(struct fmi_instance *fmi, unsigned categories) {
    for (int i = 0; i < LOG_CATEGORY_COUNT; i++) {
        fmi->is_logged[i] |= (categories & 1u << i) != 0;
    }
}

enum fmi_status fmi_set_logging(struct fmi_instance *fmi, bool on, size_t count,
                                const char *const names[]) {
    bool before[LOG_CATEGORY_COUNT];
    memcpy(before, fmi->is_logged, sizeof before);
    if (on || count == 0) {
        for (int i = 0; i < LOG_CATEGORY_COUNT; i++) {
            fmi->is_logged[i] = on && count == 0;
        }
    }
    for (size_t i = 0; i < count; i++) {
        if (names[i] == NULL || !set_logged(fmi, names[i], on)) {
            memcpy(fmi->is_logged, before, sizeof before);
            return fmi_fail(fmi,
                            "log category '%s' is unknown: the model description lists those "
                            "that exist",
                            names[i] != NULL ? names[i] : "");
        }
    }
    log_always(fmi, fmi->adapter->never_silent);
    return FMI_OK;
}

/* ---- Status --------------------------------------------------------------------------------- */

static const struct {
    enum fmi_status status;
    enum log_category category;
} of_severity[] = {
    [SEVERITY_NONE] = {FMI_OK, LOG_EVENTS},
    [SEVERITY_NOTICE] = {FMI_OK, LOG_STATUS_WARNING},
    [SEVERITY_DISCARD] = {FMI_DISCARD, LOG_STATUS_DISCARD},
    [SEVERITY_ERROR] = {FMI_ERROR, LOG_STATUS_ERROR},
};

static void log_instance_text(void *fmi, enum status status, const char *text) {
    const enum severity severity = status_severity(status);
    send_text(fmi, of_severity[severity].status, of_severity[severity].category, text);
}

static void note_error(struct fmi_instance *fmi) {
    if (fmi->state == STATE_INTERMEDIATE_UPDATE) {
        fmi->has_failed_inside = true;
    } else {
        fmi->state = fmi->adapter->after_error;
    }
}

enum fmi_status fmi_failure(struct fmi_instance *fmi, enum status status) {
    const enum fmi_status result = of_severity[status_severity(status)].status;
    // intermediate update mode knows no discard (FMI 3.0, section 4.2.2)
    if (result == FMI_DISCARD && fmi->state == STATE_INTERMEDIATE_UPDATE) {
        return fmi_fail(fmi, "the step fails: no value can be discarded in an "
                             "intermediate update");
    }
    if (result == FMI_ERROR) {
        note_error(fmi);
    }
    return result;
}

enum fmi_status fmi_fail(struct fmi_instance *fmi, const char *format, ...) {
    if (fmi_refuse_in_logger(fmi, "a call")) {
        return FMI_ERROR;
    }
    char raw[LOG_TEXT_SIZE];
    va_list arguments;
    va_start(arguments, format);
    message_format(raw, sizeof raw, format, arguments);
    va_end(arguments);
    send_text(fmi, FMI_ERROR, LOG_STATUS_ERROR, raw);
    note_error(fmi);
    return FMI_ERROR;
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

const char *fmi_kind_name(unsigned kinds) {
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

struct instance *fmi_enter(struct fmi_instance *fmi, unsigned call) {
    if (fmi == NULL) {
        return NULL;
    }
    const struct call_rule *rule = &fmi->adapter->rules[call];
    if (fmi_refuse_in_logger(fmi, rule->name)) {
        return NULL;
    }
    if (fmi->is_logged[LOG_ALL]) {
        fmi_log(fmi, FMI_OK, LOG_ALL, "%s", rule->name);
    }
    if ((fmi->kind & rule->kinds) == 0) {
        fmi_fail(fmi, "%s belongs to %s: the instance is one for %s", rule->name,
                 fmi_kind_name(rule->kinds), fmi_kind_name(fmi->kind));
        return NULL;
    }
    if ((fmi->state & rule->states) == 0) {
        fmi_fail(fmi, "%s is not allowed while the instance is %s", rule->name,
                 state_name(fmi->state));
        return NULL;
    }
    return fmi->instance;
}

bool fmi_refuse_arrays(struct fmi_instance *fmi, unsigned call, size_t count) {
    fmi_fail(fmi, "%s: an array is NULL, %zu values are expected", fmi->adapter->rules[call].name,
             count);
    return false;
}

enum fmi_status fmi_go_to(struct fmi_instance *fmi, enum fmi_state state, enum status status) {
    if (status != STATUS_OK) {
        return fmi_failure(fmi, status);
    }
    fmi->state = state;
    return FMI_OK;
}

enum fmi_status fmi_exit_initialization(struct fmi_instance *fmi, unsigned call) {
    struct instance *instance = fmi_enter(fmi, call);
    if (instance == NULL) {
        return FMI_ERROR;
    }
    const enum status status = instance_exit_initialization(instance);
    if (status == STATUS_OK) {
        fmi_log(fmi, FMI_OK, LOG_EVENTS, "initialized at t = %.17g", instance_time(instance));
    }
    // into event mode, if the importer handles events
    return fmi_go_to(fmi, fmi->kind == KIND_CO_SIMULATION ? STATE_STEP_COMPLETE : STATE_EVENT,
                     status);
}

enum fmi_status fmi_terminate(struct fmi_instance *fmi, unsigned call) {
    const struct instance *instance = fmi_enter(fmi, call);
    if (instance == NULL) {
        return FMI_ERROR;
    }
    fmi_log(fmi, FMI_OK, LOG_EVENTS, "terminated at t = %.17g", instance_time(instance));
    return fmi_go_to(fmi, STATE_TERMINATED, STATUS_OK);
}

enum fmi_status fmi_reset(struct fmi_instance *fmi, unsigned call) {
    struct instance *instance = fmi_enter(fmi, call);
    if (instance == NULL) {
        return FMI_ERROR;
    }
    instance_reset(instance);
    fmi_log(fmi, FMI_OK, LOG_EVENTS, "reset to the start values");
    return fmi_go_to(fmi, STATE_INSTANTIATED, STATUS_OK);
}

enum fmi_status fmi_access_none(struct fmi_instance *fmi, const char *type,
                                const unsigned references[], size_t count) {
    return count == 0 ? FMI_OK
                      : fmi_fail(fmi,
                                 "value reference %u is accessed as %s: %s has no variable "
                                 "of that type",
                                 references[0], type, model_description.name);
}

/* ---- Life ----------------------------------------------------------------------------------- */

void fmi_begin(struct fmi_instance *fmi, const struct adapter *adapter, enum fmi_kind kind,
               bool logging_on) {
    fmi->adapter = adapter;
    fmi->state = STATE_INSTANTIATED;
    fmi->kind = kind;
    log_always(fmi, logging_on ? ~0u : adapter->always_logged);
}

bool fmi_check_token(struct fmi_instance *fmi, const char *name, const char *token_name,
                     const char *token, const char *expected) {
    if (name == NULL || name[0] == '\0') {
        fmi_fail(fmi, "the instance name is missing: a name that is not empty is expected");
        return false;
    }
    if (token == NULL || strcmp(token, expected) != 0) {
        fmi_fail(fmi,
                 "the %s '%.100s' is refused: '%s' is expected, the model description "
                 "belongs to another build",
                 token_name, token != NULL ? token : "", expected);
        return false;
    }
    return true;
}

enum fmi_status fmi_create_instance(struct fmi_instance *fmi) {
    const struct message_sink sink = {.write = log_instance_text, .context = fmi};
    if (instance_create(&model_description, &sink, &fmi->instance) != STATUS_OK) {
        return FMI_ERROR;
    }
    if (fmi->kind == KIND_MODEL_EXCHANGE) {
        instance_integrate_outside(fmi->instance);
    }
    return FMI_OK;
}

void fmi_end(struct fmi_instance *fmi) {
    instance_destroy(fmi->instance);
}
