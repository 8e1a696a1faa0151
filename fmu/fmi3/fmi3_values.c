/* Values of variables (FMI 3.0, section 2.2.6.2). */
#include "fmi3_component.h"
#include "model_description.h"
#include "variable_access.h"

/* ---- Checks --------------------------------------------------------------------------------- */

bool fmi3_has_count(struct component *component, enum fmi3_call call, size_t count,
                    size_t expected) {
    if (component != NULL && count != expected) {
        component_fail(component, "%s: an array has %zu values: %zu are expected",
                       fmi3_call_rules[call].name, count, expected);
        return false;
    }
    return true;
}

bool fmi3_may_access(struct component *component, unsigned call, bool setting,
                     const fmi3ValueReference references[], size_t count) {
    if (component == NULL || component->state != STATE_INTERMEDIATE_UPDATE) {
        return true;
    }
    const struct fmi3_component *inside = (const struct fmi3_component *)component;
    if (!(setting ? inside->can_set : inside->can_get)) {
        component_fail(component, "%s: this intermediate update does not allow it",
                       fmi3_call_rules[call].name);
        return false;
    }
    for (size_t i = 0; references != NULL && i < count; i++) {
        const struct variable *variable = variable_find(&model_description, references[i]);
        if (variable == NULL || !inside->is_intermediate[variable - model_description.variables] ||
            (setting && variable->causality != CAUSALITY_INPUT)) {
            component_fail(component,
                           "%s: value reference %u is refused: in an intermediate update %s that "
                           "was named at instantiation is expected",
                           fmi3_call_rules[call].name, references[i],
                           setting ? "an input" : "a variable");
            return false;
        }
    }
    return true;
}

/* ---- Functions ------------------------------------------------------------------------------ */

/* Of one type; `access` reads or sets the values. */
#define FUNCTION(name, element, access)                                                            \
    fmi3Status name(fmi3Instance instance, const fmi3ValueReference valueReferences[],             \
                    size_t nValueReferences, element values[], size_t nValues) {                   \
        const enum fmi3_call call = CALL_##name;                                                   \
        if (!fmi3_has_count(instance, call, nValues, nValueReferences)) {                          \
            return fmi3Error;                                                                      \
        }                                                                                          \
        return fmi3_status(access);                                                                \
    }

/* Types that variables have, and their names in variable_access.h. */
#define OF_VARIABLES(Type, type)                                                                   \
    FUNCTION(fmi3Get##Type, fmi3##Type,                                                            \
             access_get_##type(instance, call, valueReferences, nValueReferences, values))         \
    FUNCTION(fmi3Set##Type, const fmi3##Type,                                                      \
             access_set_##type(instance, call, valueReferences, nValueReferences, values))
OF_VARIABLES(Float64, real)
OF_VARIABLES(Int32, int32)
OF_VARIABLES(Int64, enumeration)
OF_VARIABLES(Boolean, bool)

/* Types that no variable has. */
static enum component_status none(struct component *component, enum fmi3_call call, bool setting,
                                  const char *type, const fmi3ValueReference references[],
                                  size_t count, const void *values) {
    return fmi3_may_access(component, call, setting, references, count)
               ? access_none(component, call, type, references, count, values)
               : COMPONENT_ERROR;
}

#define OF_NONE(Type)                                                                              \
    FUNCTION(fmi3Get##Type, fmi3##Type,                                                            \
             none(instance, call, false, #Type, valueReferences, nValueReferences, values))        \
    FUNCTION(fmi3Set##Type, const fmi3##Type,                                                      \
             none(instance, call, true, #Type, valueReferences, nValueReferences, values))
OF_NONE(Float32)
OF_NONE(Int8)
OF_NONE(UInt8)
OF_NONE(Int16)
OF_NONE(UInt16)
OF_NONE(UInt32)
OF_NONE(UInt64)
OF_NONE(String)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                         size_t nValueReferences, size_t valueSizes[], fmi3Binary values[],
                         size_t nValues) {
    const enum fmi3_call call = CALL_fmi3GetBinary;
    if (!fmi3_has_count(instance, call, nValues, nValueReferences)) {
        return fmi3Error;
    }
    return fmi3_status(
        none(instance, call, false, "Binary", valueReferences, nValueReferences, values));
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                         size_t nValueReferences, const size_t valueSizes[],
                         const fmi3Binary values[], size_t nValues) {
    const enum fmi3_call call = CALL_fmi3SetBinary;
    if (!fmi3_has_count(instance, call, nValues, nValueReferences)) {
        return fmi3Error;
    }
    return fmi3_status(
        none(instance, call, true, "Binary", valueReferences, nValueReferences, values));
}
