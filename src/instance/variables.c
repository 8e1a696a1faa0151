#include "variables.h"

#include <math.h>

bool variable_is_settable(const struct variable *variable, enum phase phase) {
    const bool is_input = variable->causality == CAUSALITY_INPUT;
    switch (phase) {
    case PHASE_INSTANTIATED:
    case PHASE_INITIALIZATION:
        return is_input || variable->initial == INITIAL_EXACT;
    case PHASE_STEPPING:
        return is_input || (variable->causality == CAUSALITY_PARAMETER &&
                            variable->variability == VARIABILITY_TUNABLE);
    case PHASE_CONTINUOUS_TIME:
        return is_input && variable->variability == VARIABILITY_CONTINUOUS;
    case PHASE_COUNT:
        break;
    }
    return false;
}

enum status variable_check_value(const struct variable *variable, double value,
                                 const struct message_sink *sink) {
    if (!isfinite(value)) {
        message_write(sink, STATUS_NOT_FINITE, "%s = %g is refused: a finite value is expected",
                      variable->name, value);
        return STATUS_NOT_FINITE;
    }
    if (value < variable->min || value > variable->max) {
        message_write(sink, STATUS_OUT_OF_RANGE,
                      "%s = %.17g is refused: a value from %g to %g is expected", variable->name,
                      value, variable->min, variable->max);
        return STATUS_OUT_OF_RANGE;
    }
    return STATUS_OK;
}

const char *variable_type_name(enum variable_type type) {
    switch (type) {
    case VARIABLE_FLOAT64:
        return "float64";
    case VARIABLE_INT32:
        return "int32";
    case VARIABLE_ENUMERATION:
        break;
    }
    return "enumeration";
}
