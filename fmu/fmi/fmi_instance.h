/* The part of an FMI instance that all versions share: its state, its kind, its log and the rules
 * of its calls. It knows no version: each adapter gives a struct adapter, makes its own structure
 * begin with a struct fmi_instance, and converts status and types. */
#pragma once

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
    KIND_CO_SIMULATION_WITH_EVENTS = 1 << 2, /* the importer handles events in event mode */
};

/* Rule of a call: the kinds and states of an instance that allow it. Each FMI version has a table
 * of these rules in its own folder. */
struct call_rule {
    const char *name;
    unsigned kinds;  /* bits of enum fmi_kind */
    unsigned states; /* bits of enum fmi_state */
};

/* Status of a call, with the numbers of fmi2Status and fmi3Status. */
enum fmi_status {
    FMI_OK = 0,
    FMI_WARNING = 1,
    FMI_DISCARD = 2,
    FMI_ERROR = 3,
    FMI_FATAL = 4,
};

/* Log categories, in the order of their names in fmi_instance.c. */
enum log_category {
    LOG_EVENTS,
    LOG_STATUS_WARNING,
    LOG_STATUS_DISCARD,
    LOG_STATUS_ERROR,
    LOG_STATUS_FATAL,
    LOG_ALL, /* also for calls, for which the standard has no category */
    LOG_CATEGORY_COUNT,
};

struct fmi_instance;

/* Decisions of a version of FMI. Categories are bits of 1 << enum log_category. */
struct adapter {
    unsigned version;              /* 2 for FMI 2.0 */
    const struct call_rule *rules; /* by the version's own numbers of calls */
    unsigned states;               /* states of the version, as bits of enum fmi_state */
    enum fmi_state after_error;    /* state after an error */
    unsigned always_logged; /* categories sent although an instance was made with logging off */
    unsigned never_silent;  /* categories that fmi_set_logging cannot switch off */
    const char *doubled;    /* characters that must be doubled to stand for themselves in a text */

    /* Sends a finished text to the importer. */
    void (*send)(const struct fmi_instance *fmi, enum fmi_status status, const char *category,
                 const char *text);
};

struct fmi_instance {
    const struct adapter *adapter;
    struct instance *instance;
    enum fmi_state state;
    enum fmi_kind kind;
    /* True after an error in intermediate update mode, which leads to the state after errors when
     * the step returns: until then nothing may free it. */
    bool has_failed_inside;
    bool is_logging; /* true while the importer's logger is running, inside another call */
    bool is_logged[LOG_CATEGORY_COUNT];
    const char *call_in_logger; /* a call from inside the logger; NULL if there is none */
};

/* ---- Life ----------------------------------------------------------------------------------- */

/* Begins an FMI instance, which must be zeroed, so that fmi_fail can log; adapter must outlive
 * it.
 */
NONNULL void fmi_begin(struct fmi_instance *fmi, const struct adapter *adapter, enum fmi_kind kind,
                       bool logging_on);

/* Returns true if the name and the token are right; otherwise fails as fmi_fail. expected:
 * the token of the model description; token_name: its name in this version. */
MUST_CHECK NONNULL_ARGUMENTS(1, 3, 5) bool fmi_check_token(struct fmi_instance *fmi,
                                                           const char *name, const char *token_name,
                                                           const char *token, const char *expected);

/* Makes the instance. On failure nothing has to be freed. */
MUST_CHECK NONNULL enum fmi_status fmi_create_instance(struct fmi_instance *fmi);

/* Frees the instance. */
NONNULL void fmi_end(struct fmi_instance *fmi);

/* ---- Calls ---------------------------------------------------------------------------------- */

/* Begins a call. Returns the instance that it is for; NULL, after fmi_fail, if it may not
 * run: the FMI instance is NULL, of another kind, or in a state in which the rule does not allow
 * it.
 */
MUST_CHECK struct instance *fmi_enter(struct fmi_instance *fmi, unsigned call);

/* Refuses a call from inside the importer's logger, while the instance is in the middle of another
 * call; it changes nothing. A message says so after the logger's own. Returns true if it has
 * refused the call. */
MUST_CHECK NONNULL bool fmi_refuse_in_logger(struct fmi_instance *fmi, const char *call);

/* Fails as fmi_fail: an array of a call is NULL. Returns false. */
NONNULL bool fmi_refuse_arrays(struct fmi_instance *fmi, unsigned call, size_t count);

/* Returns true if neither array is NULL, unless count is 0. Otherwise fails as fmi_fail. */
MUST_CHECK static inline bool fmi_check_arrays(struct fmi_instance *fmi, unsigned call,
                                               size_t count, const void *first,
                                               const void *second) {
    return (first != NULL && second != NULL) || count == 0 || fmi_refuse_arrays(fmi, call, count);
}

/* Begins a call with two arrays of count values: fmi_enter and fmi_check_arrays. */
MUST_CHECK static inline struct instance *fmi_enter_with(struct fmi_instance *fmi, unsigned call,
                                                         size_t count, const void *first,
                                                         const void *second) {
    struct instance *instance = fmi_enter(fmi, call);
    return instance != NULL && fmi_check_arrays(fmi, call, count, first, second) ? instance : NULL;
}

/* Does the same as fmi_result for a status other than STATUS_OK. */
NONNULL enum fmi_status fmi_failure(struct fmi_instance *fmi, enum status status);

/* Converts a status of the instance, which has sent its message. An error leads to the state after
 * errors; in intermediate update mode it is noted. */
NONNULL static inline enum fmi_status fmi_result(struct fmi_instance *fmi, enum status status) {
    return status == STATUS_OK ? FMI_OK : fmi_failure(fmi, status);
}

/* Ends a call that leads to this FMI state, with the status of the instance. */
NONNULL enum fmi_status fmi_go_to(struct fmi_instance *fmi, enum fmi_state state,
                                  enum status status);

/* The calls in which both versions log an event. */
enum fmi_status fmi_exit_initialization(struct fmi_instance *fmi, unsigned call);
enum fmi_status fmi_terminate(struct fmi_instance *fmi, unsigned call);
enum fmi_status fmi_reset(struct fmi_instance *fmi, unsigned call);

/* Accesses a type that no variable has: succeeds only if no value is asked for. */
NONNULL_ARGUMENTS(1, 2)
enum fmi_status fmi_access_none(struct fmi_instance *fmi, const char *type,
                                const unsigned references[], size_t count);

/* Fails with an error that the adapter finds: logs it, goes to the same state as fmi_result,
 * returns FMI_ERROR. Inside the importer's logger it changes nothing. */
NONNULL PRINTF_FORMAT(2, 3) enum fmi_status
    fmi_fail(struct fmi_instance *fmi, const char *format, ...);

/* Returns "Co-Simulation" or "Model Exchange"; kinds: bits of enum fmi_kind. */
const char *fmi_kind_name(unsigned kinds);

/* ---- Log ------------------------------------------------------------------------------------ */

NONNULL PRINTF_FORMAT(4, 5) void fmi_log(struct fmi_instance *fmi, enum fmi_status status,
                                         enum log_category category, const char *format, ...);

/* Sets which categories are sent: all of them if there are no names; otherwise on sends exactly
 * these, off removes them. Fails as fmi_fail, with nothing changed, at a name that is NULL or
 * unknown. */
NONNULL_ARGUMENTS(1)
enum fmi_status fmi_set_logging(struct fmi_instance *fmi, bool on, size_t count,
                                const char *const names[]);
