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

bool fmi3_may_access(struct component *component, enum fmi3_call call, bool setting,
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

fmi3Status fmi3_access_status(struct component *component, enum component_status status) {
    if (status == COMPONENT_DISCARD && component->state == STATE_INTERMEDIATE_UPDATE) {
        status = component_fail(component, "the step fails: no value can be discarded in an "
                                           "intermediate update");
    }
    return fmi3_status(status);
}

static bool is_checked(fmi3Instance instance, enum fmi3_call call, bool setting,
                       const fmi3ValueReference references[], size_t count, size_t value_count) {
    return fmi3_has_count(instance, call, value_count, count) &&
           fmi3_may_access(instance, call, setting, references, count);
}

/* ---- Types that variables have --------------------------------------------------------------- */

#define ACCESS(Verb, verb, Type, type, value_type, setting)                                        \
    fmi3Status fmi3##Verb##Type(fmi3Instance instance, const fmi3ValueReference valueReferences[], \
                                size_t nValueReferences, value_type values[], size_t nValues) {    \
        const enum fmi3_call call = CALL_fmi3##Verb##Type;                                         \
        if (!is_checked(instance, call, setting, valueReferences, nValueReferences, nValues)) {    \
            return fmi3Error;                                                                      \
        }                                                                                          \
        return fmi3_access_status(                                                                 \
            instance,                                                                              \
            access_##verb##_##type(instance, call, valueReferences, nValueReferences, values));    \
    }

ACCESS(Get, get, Float64, real, fmi3Float64, false)
ACCESS(Set, set, Float64, real, const fmi3Float64, true)
ACCESS(Get, get, Int32, int32, fmi3Int32, false)
ACCESS(Set, set, Int32, int32, const fmi3Int32, true)
ACCESS(Get, get, Int64, enumeration, fmi3Int64, false)
ACCESS(Set, set, Int64, enumeration, const fmi3Int64, true)
ACCESS(Get, get, Boolean, bool, fmi3Boolean, false)
ACCESS(Set, set, Boolean, bool, const fmi3Boolean, true)

/* ---- Types that no variable has ---------------------------------------------------------------
 */

#define ACCESS_NONE(Verb, Type, value_type, setting)                                               \
    fmi3Status fmi3##Verb##Type(fmi3Instance instance, const fmi3ValueReference valueReferences[], \
                                size_t nValueReferences, value_type values[], size_t nValues) {    \
        const enum fmi3_call call = CALL_fmi3##Verb##Type;                                         \
        if (!is_checked(instance, call, setting, valueReferences, nValueReferences, nValues)) {    \
            return fmi3Error;                                                                      \
        }                                                                                          \
        return fmi3_status(                                                                        \
            access_none(instance, call, #Type, valueReferences, nValueReferences, values));        \
    }

ACCESS_NONE(Get, Float32, fmi3Float32, false)
ACCESS_NONE(Set, Float32, const fmi3Float32, true)
ACCESS_NONE(Get, Int8, fmi3Int8, false)
ACCESS_NONE(Set, Int8, const fmi3Int8, true)
ACCESS_NONE(Get, UInt8, fmi3UInt8, false)
ACCESS_NONE(Set, UInt8, const fmi3UInt8, true)
ACCESS_NONE(Get, Int16, fmi3Int16, false)
ACCESS_NONE(Set, Int16, const fmi3Int16, true)
ACCESS_NONE(Get, UInt16, fmi3UInt16, false)
ACCESS_NONE(Set, UInt16, const fmi3UInt16, true)
ACCESS_NONE(Get, UInt32, fmi3UInt32, false)
ACCESS_NONE(Set, UInt32, const fmi3UInt32, true)
ACCESS_NONE(Get, UInt64, fmi3UInt64, false)
ACCESS_NONE(Set, UInt64, const fmi3UInt64, true)
ACCESS_NONE(Get, String, fmi3String, false)
ACCESS_NONE(Set, String, const fmi3String, true)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                         size_t nValueReferences, size_t valueSizes[], fmi3Binary values[],
                         size_t nValues) {
    const enum fmi3_call call = CALL_fmi3GetBinary;
    (void)valueSizes;
    if (!is_checked(instance, call, false, valueReferences, nValueReferences, nValues)) {
        return fmi3Error;
    }
    return fmi3_status(
        access_none(instance, call, "Binary", valueReferences, nValueReferences, values));
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                         size_t nValueReferences, const size_t valueSizes[],
                         const fmi3Binary values[], size_t nValues) {
    const enum fmi3_call call = CALL_fmi3SetBinary;
    (void)valueSizes;
    if (!is_checked(instance, call, true, valueReferences, nValueReferences, nValues)) {
        return fmi3Error;
    }
    return fmi3_status(
        access_none(instance, call, "Binary", valueReferences, nValueReferences, values));
}
