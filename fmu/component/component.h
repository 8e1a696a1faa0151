/* What all versions of FMI share of an instance: its state, its kind, its log and the rules of its
 * calls. Knows no version: the adapter of one gives a struct adapter, makes its own structure begin
 * with a struct component, and converts status and types. */
#ifndef COMPONENT_H
#define COMPONENT_H

#include "derivatives.h"
#include "instance.h"

/* States of an instance in FMI, one bit each. */
enum fmi_state {
    STATE_INSTANTIATED = 1 << 0,
    STATE_INITIALIZATION = 1 << 1,
    STATE_TERMINATED = 1 << 2,
    STATE_ERROR = 1 << 3,
    // Co-Simulation
    STATE_STEP_COMPLETE = 1 << 4,
    STATE_STEP_FAILED = 1 << 5,
    // Model Exchange, and Co-Simulation with event mode
    STATE_EVENT = 1 << 6,
    // Model Exchange
    STATE_CONTINUOUS_TIME = 1 << 7,
    // Co-Simulation, inside a step
    STATE_INTERMEDIATE_UPDATE = 1 << 8,
};

enum fmi_kind {
    KIND_MODEL_EXCHANGE = 1 << 0,
    KIND_CO_SIMULATION = 1 << 1,
    KIND_CO_SIMULATION_WITH_EVENTS = 1 << 2, /* the importer handles events, in event mode */
};

/* In which state an instance of which kind may call a function. Each FMI version has a table of
 * these rules in its own folder. */
struct call_rule {
    const char *name;
    unsigned kinds;  /* bits of enum fmi_kind */
    unsigned states; /* bits of enum fmi_state */
};

/* The numbers are those of fmi2Status and fmi3Status. */
enum component_status {
    COMPONENT_OK = 0,
    COMPONENT_WARNING = 1,
    COMPONENT_DISCARD = 2,
    COMPONENT_ERROR = 3,
    COMPONENT_FATAL = 4,
};

/* Log categories, in the order of their names in component.c. */
enum log_category {
    LOG_EVENTS,
    LOG_STATUS_WARNING,
    LOG_STATUS_DISCARD,
    LOG_STATUS_ERROR,
    LOG_STATUS_FATAL,
    LOG_ALL, /* also of calls, for which the standard has no category */
    LOG_CATEGORY_COUNT,
};

enum { LOG_TEXT_SIZE = 1024 };

struct component;

/* What a version of FMI decides. Categories are bits of 1 << enum log_category. */
struct adapter {
    unsigned version;              /* 2 for FMI 2.0 */
    const struct call_rule *rules; /* by the version's own numbers of calls */
    unsigned states;               /* bits of enum fmi_state: those that the version has */
    enum fmi_state after_error;    /* the state that an error leads to */
    unsigned always_logged;        /* categories sent by an instance made with logging off, too */
    unsigned never_silent;         /* categories that component_set_logging cannot switch off */
    enum known_kinds knowns;       /* of directional and adjoint derivatives */
    const char *doubled;           /* characters of a text that stand for themselves only twice */

    /* In intermediate update mode: whether these values may be read or set; if not, it fails as
     * component_fail. NULL: the version has no such mode. */
    bool (*check_access)(struct component *component, unsigned call, bool setting,
                         const unsigned references[], size_t count);

    /* Sends a finished text to the importer. */
    void (*send)(const struct component *component, enum component_status status,
                 const char *category, const char *text);
};

struct component {
    const struct adapter *adapter;
    struct instance *instance;
    enum fmi_state state;
    enum fmi_kind kind;
    bool has_failed_inside; /* an error in intermediate update mode, which leads to the state after
                               errors when the step returns: until then nothing may free it */
    bool is_logging;        /* the importer's logger is running, inside another call */
    const char *call_in_logger; /* a call that came from there; NULL: none */
    bool is_logged[LOG_CATEGORY_COUNT];
};

/* ---- Life ----------------------------------------------------------------------------------- */

/* True if there may be an instance with this name and this token (that of the model description:
 * expected), which the version calls token_name. Otherwise text says why not. */
MUST_CHECK NONNULL_ARGUMENTS(2, 4,
                             5) bool component_check_token(const char *name, const char *token_name,
                                                           const char *token, const char *expected,
                                                           char text[LOG_TEXT_SIZE]);

/* component: zeroed; adapter must outlive it. On failure nothing has to be freed. */
MUST_CHECK NONNULL enum component_status component_begin(struct component *component,
                                                         const struct adapter *adapter,
                                                         enum fmi_kind kind, bool logging_on);

/* Frees what component_begin allocated. */
NONNULL void component_end(struct component *component);

/* ---- Calls ---------------------------------------------------------------------------------- */

/* True if the call may run: the component is not NULL, of the right kind and in a state that the
 * rule allows. Otherwise it fails as component_fail. */
MUST_CHECK bool component_enter(struct component *component, unsigned call);

/* True if the call comes from inside the importer's logger. It is refused and changes nothing: the
 * instance is in the middle of another call. A message says so after that of the logger. */
MUST_CHECK NONNULL bool component_refuse_in_logger(struct component *component, const char *call);

/* Reports what is wrong with the arrays as component_fail does; always false. */
NONNULL bool component_refuse_arrays(struct component *component, unsigned call, size_t count);

/* True if count values may be accessed: neither array is NULL, unless count is 0. Otherwise it
 * fails as component_fail. */
MUST_CHECK NONNULL_ARGUMENTS(1) static inline bool component_check_arrays(
    struct component *component, unsigned call, size_t count, const void *references,
    const void *values) {
    return count == 0 || (references != NULL && values != NULL) ||
           component_refuse_arrays(component, call, count);
}

/* As component_result, for a status other than STATUS_OK. */
NONNULL enum component_status component_failure(struct component *component, enum status status);

/* Converts a status of the instance, which has sent its message. An error leads to the state after
 * errors; in intermediate update mode it is noted. */
NONNULL static inline enum component_status component_result(struct component *component,
                                                             enum status status) {
    return status == STATUS_OK ? COMPONENT_OK : component_failure(component, status);
}

/* An error that the adapter finds: logs it, leads to where component_result does, returns
 * COMPONENT_ERROR. Inside the importer's logger it changes nothing. */
NONNULL PRINTF_FORMAT(2, 3) enum component_status
    component_fail(struct component *component, const char *format, ...);

/* "Co-Simulation" or "Model Exchange"; kinds: bits of enum fmi_kind. */
const char *component_kind_name(unsigned kinds);

/* ---- Log ------------------------------------------------------------------------------------ */

NONNULL PRINTF_FORMAT(4, 5) void component_log(struct component *component,
                                               enum component_status status,
                                               enum log_category category, const char *format, ...);

const char *component_category_name(enum log_category category);

/* Sets which categories are sent: with no names all of them; otherwise `on` adds to none, off takes
 * away. Fails as component_fail, with nothing changed, at a name that is NULL or unknown. */
NONNULL_ARGUMENTS(1)
enum component_status component_set_logging(struct component *component, bool on, size_t count,
                                            const char *const names[]);

/* Makes a text harmless that importers search for references to variables, or pass to printf:
 * doubles what means something to them. Line ends become blanks, other control characters '?'. */
NONNULL void component_make_harmless(const struct adapter *adapter, const char *text,
                                     char out[LOG_TEXT_SIZE]);

#endif
