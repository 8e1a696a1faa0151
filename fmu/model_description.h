/* The model description of this FMU; defined by the generated variables.c. */
#ifndef MODEL_DESCRIPTION_H
#define MODEL_DESCRIPTION_H

#include "variables.h"

extern const struct model_description model_description;

#endif
