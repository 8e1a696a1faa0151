/* Model description of this FMU; defined by the generated variables.c. */
#pragma once

#include "variables.h"

extern const struct model_description model_description;

/* Instantiation token of FMI 3.0; FMI 2.0 has the GUID of the description. */
extern const char model_token_fmi3[];
