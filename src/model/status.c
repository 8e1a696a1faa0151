#include "status.h"

enum severity status_severity(enum status status) {
    switch (status) {
#define STATUS_CASE(code, severity, text)                                                          \
    case code:                                                                                     \
        return severity;
        STATUS_LIST(STATUS_CASE) // NOLINT(bugprone-branch-clone): a row, a case
#undef STATUS_CASE
    }
    return SEVERITY_ERROR;
}

const char *status_text(enum status status) {
    switch (status) {
#define STATUS_CASE(code, severity, text)                                                          \
    case code:                                                                                     \
        return text;
        STATUS_LIST(STATUS_CASE)
#undef STATUS_CASE
    }
    return "unknown status";
}
