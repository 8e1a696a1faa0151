/* What an fmi2Component points to, and the conversion of status, for the files of this adapter. */
#ifndef FMI2_COMPONENT_H
#define FMI2_COMPONENT_H

#include "component.h"
#include "fmi2_calls.h"

#include "fmi2Functions.h"

struct fmi2_component {
    struct component base;     /* first */
    fmi2CallbackLogger logger; /* NULL: no log */
    fmi2ComponentEnvironment environment;
    char name[];
};

_Static_assert((int)COMPONENT_OK == fmi2OK && (int)COMPONENT_WARNING == fmi2Warning &&
                   (int)COMPONENT_DISCARD == fmi2Discard && (int)COMPONENT_ERROR == fmi2Error &&
                   (int)COMPONENT_FATAL == fmi2Fatal,
               "a component_status is converted by a cast");

static inline fmi2Status fmi2_status(enum component_status status) {
    return (fmi2Status)status;
}

static inline fmi2Status fmi2_result(struct component *component, enum status status) {
    return fmi2_status(component_result(component, status));
}

#endif
