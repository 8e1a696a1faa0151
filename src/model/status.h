/* Status of a call and the message that explains it. One list holds every status, what a caller can
 * do about it, and its text. Messages go to one function that the owner of the instance supplies.
 */
#pragma once

#include "platform.h"

#include <stdarg.h>
#include <stddef.h>

/* Severity of a status, in rising order. */
enum severity {
    SEVERITY_NONE,
    SEVERITY_NOTICE,  /* done, but the user should know something */
    SEVERITY_DISCARD, /* refused or only partly done; the instance stays usable */
    SEVERITY_ERROR,   /* the instance must be reset or restored first */
};

#define STATUS_LIST(X)                                                                             \
    X(STATUS_OK, SEVERITY_NONE, "ok")                                                              \
    X(STATUS_COARSE_TOLERANCE, SEVERITY_NOTICE, "a tolerance is too coarse")                       \
    X(STATUS_INEXACT_GRADIENTS, SEVERITY_NOTICE, "gradients are not exact")                        \
    X(STATUS_NOT_FINITE, SEVERITY_DISCARD, "a value is not finite")                                \
    X(STATUS_OUT_OF_RANGE, SEVERITY_DISCARD, "a value is out of its range")                        \
    X(STATUS_TOO_MANY_STEPS, SEVERITY_DISCARD,                                                     \
      "the integrator took all internal steps allowed by max_internal_steps")                      \
    X(STATUS_TOO_MANY_EVENTS, SEVERITY_DISCARD, "there were too many events")                      \
    X(STATUS_NO_CONVERGENCE, SEVERITY_DISCARD, "the integrator cannot reach its tolerance")        \
    X(STATUS_ENDED, SEVERITY_DISCARD, "an event has ended the simulation")                         \
    X(STATUS_INVALID_ARGUMENT, SEVERITY_ERROR, "an argument is not valid")                         \
    X(STATUS_INVALID_PARAMETERS, SEVERITY_ERROR, "the parameters are inconsistent")                \
    X(STATUS_INVALID_TIME, SEVERITY_ERROR, "the times of a step do not fit")                       \
    X(STATUS_OUT_OF_MEMORY, SEVERITY_ERROR, "out of memory")                                       \
    X(STATUS_INTERNAL, SEVERITY_ERROR, "the integrator refused a call")

#define STATUS_CODE(code, severity, text) code,
enum status { STATUS_LIST(STATUS_CODE) };
#undef STATUS_CODE

enum severity status_severity(enum status status);

/* Returns a static text, never NULL. */
const char *status_text(enum status status);

/* ---- Messages ------------------------------------------------------------------------------- */

/* Receives a message: one finished line, valid during the call only. */
typedef void message_function(void *context, enum status status, const char *text);

struct message_sink {
    message_function *write; /* NULL to drop messages */
    void *context;
};

/* Formats like vsnprintf, but writes numbers alike on every platform and with no more digits than
 * needed: %.17g writes 0.8 and 0.30000000000000004. */
PRINTF_FORMAT(3, 0)
void message_format(char *text, size_t size, const char *format, va_list arguments);

PRINTF_FORMAT(3, 4)
void message_write(const struct message_sink *sink, enum status status, const char *format, ...);
