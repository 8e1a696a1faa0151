/* What stands behind an fmi2Component: the instance, the FMI state it is in, and its logger. */
#ifndef COMPONENT_H
#define COMPONENT_H

#include "calls.h"
#include "instance.h"
#include "platform.h"

#include "fmi2Functions.h"

/* Log categories, in the order of their names in component.c. */
enum log_category {
    LOG_EVENTS,
    LOG_STATUS_WARNING,
    LOG_STATUS_DISCARD,
    LOG_STATUS_ERROR,
    LOG_STATUS_FATAL,
    LOG_ALL, /* of calls, which have no category of their own */
    LOG_CATEGORY_COUNT,
};

struct component {
    struct instance *instance;
    enum fmi_state state;
    fmi2Type kind;
    fmi2CallbackLogger logger; /* NULL: no log */
    fmi2ComponentEnvironment environment;
    char *name;
    bool is_logged[LOG_CATEGORY_COUNT];
};

/* Allocates a component; functions and name are copied. NULL where memory is short. */
struct component *component_create(const char *name, fmi2Type kind,
                                   const fmi2CallbackFunctions *functions, bool logging_on);
void component_destroy(struct component *component);

/* The component, where the call may run: c is not NULL, of the kind that the call belongs to and in
 * a state that calls.h allows it in. Otherwise NULL: it is said in the log, and the component is in
 * STATE_ERROR. */
struct component *component_enter(fmi2Component c, enum call call);

/* count values may be accessed: neither array is NULL where there are any. Otherwise fails. */
bool component_has_arrays(struct component *component, enum call call, size_t count,
                          const void *references, const void *values);

/* FMI status of a instance's status; an error takes the component into STATE_ERROR. */
fmi2Status component_status(struct component *component, enum status status);

/* Error that the adapter itself finds; takes the component into STATE_ERROR. */
PRINTF_FORMAT(2, 3) fmi2Status component_fail(struct component *component, const char *format, ...);

PRINTF_FORMAT(4, 5)
void component_log(const struct component *component, fmi2Status status, enum log_category category,
                   const char *format, ...);

/* Logs an error of a call that has no component yet; functions and name may be NULL. */
PRINTF_FORMAT(3, 4)
void component_log_refusal(const fmi2CallbackFunctions *functions, const char *name,
                           const char *format, ...);

/* Switches a category by name, logAll all of them; false where there is none of that name. */
bool component_set_logged(struct component *component, const char *category, bool on);

#endif
