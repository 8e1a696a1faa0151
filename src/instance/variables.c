#include "variables.h"

enum status variable_refuse_value(const struct variable *variable, double value,
                                  const struct message_sink *sink) {
    if (!isfinite(value)) {
        message_write(sink, STATUS_NOT_FINITE, "%s = %g is refused: a finite value is expected",
                      variable->name, value);
        return STATUS_NOT_FINITE;
    }
    message_write(sink, STATUS_OUT_OF_RANGE,
                  "%s = %.17g is refused: a value from %g to %g is expected", variable->name, value,
                  variable->min, variable->max);
    return STATUS_OUT_OF_RANGE;
}

const char *variable_type_name(enum variable_type type) {
    switch (type) {
    case VARIABLE_FLOAT64:
        return "float64";
    case VARIABLE_INT32:
        return "int32";
    case VARIABLE_ENUMERATION:
        return "enumeration";
    case VARIABLE_BOOLEAN:
        break;
    }
    return "boolean";
}
