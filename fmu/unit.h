/* The one unit of an FMU; defined by the generated variables.c. */
#ifndef UNIT_H
#define UNIT_H

#include "variables.h"

extern const struct unit unit;

#endif
