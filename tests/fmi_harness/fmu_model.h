/* The model of the FMU that a program loads: the names of its variables in value_references.h. */
#ifndef FMU_MODEL_H
#define FMU_MODEL_H

#include "value_references.h"

#ifdef FMU_IS_PLANT
#define FMU_NAME(name)   RP_PLANT_##name
#define FMU_ENUMERATIONS RP_PLANT_solver_method, RP_PLANT_stops1, RP_PLANT_stops2, RP_PLANT_grasp
#else
#define FMU_NAME(name)   RP_MANIPULATOR_##name
#define FMU_ENUMERATIONS RP_MANIPULATOR_solver_method
#endif

#endif
