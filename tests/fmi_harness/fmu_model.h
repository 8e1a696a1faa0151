/* The model of the FMU that a program loads: the names of its variables in value_references.h. */
#ifndef FMU_MODEL_H
#define FMU_MODEL_H

#include <stdbool.h>

#ifdef FMU_IS_LINKED // with the program: any model, by its description
#include "model_description.h"

#define FMU_GUID       model_description.guid
#define FMU_TOKEN_FMI3 model_token_fmi3
#define FMU_INPUTS     -1u, -1u // no names

static inline bool fmu_is_enumeration(unsigned reference) {
    const struct variable *variable = variable_find(&model_description, reference);
    return variable != NULL && variable->type == VARIABLE_ENUMERATION;
}

#else
#include "value_references.h"

#if defined FMU_IS_PLANT
#define FMU_NAME(name)   RP_PLANT_##name
#define FMU_ENUMERATIONS RP_PLANT_solver_method, RP_PLANT_stops1, RP_PLANT_stops2, RP_PLANT_grasp
#define FMU_INPUTS       RP_PLANT_tau1, RP_PLANT_f2
#elif defined FMU_IS_SENSOR
#define FMU_NAME(name)   RP_SENSOR_##name
#define FMU_ENUMERATIONS -1u // none
#define FMU_INPUTS       RP_SENSOR_q1, RP_SENSOR_q2
#elif defined FMU_IS_WHEEL
#define FMU_NAME(name)   WHEEL_##name
#define FMU_ENUMERATIONS WHEEL_solver_method
#define FMU_INPUTS       WHEEL_speed, -1u
#else
#define FMU_NAME(name)   RP_MANIPULATOR_##name
#define FMU_ENUMERATIONS RP_MANIPULATOR_solver_method
#define FMU_INPUTS       RP_MANIPULATOR_tau1, RP_MANIPULATOR_f2
#endif

#define FMU_GUID       FMU_NAME(GUID)
#define FMU_TOKEN_FMI3 FMU_NAME(TOKEN_FMI3)

static inline bool fmu_is_enumeration(unsigned reference) {
    static const unsigned enumerations[] = {FMU_ENUMERATIONS};
    for (unsigned i = 0; i < sizeof enumerations / sizeof enumerations[0]; i++) {
        if (reference == enumerations[i]) {
            return true;
        }
    }
    return false;
}

#endif

/* Of the variable time, in every model. */
enum { FMU_TIME = 0 };

#endif
