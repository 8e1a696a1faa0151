/* Which parameters and start values the plant refuses. */
#ifndef RP_PLANT_CHECK_H
#define RP_PLANT_CHECK_H

#include "status.h"

#include <stddef.h>

/* check_parameters of struct model, for struct rp_plant_values. */
enum status rp_plant_check_parameters(const void *values, char *text, size_t size);

#endif
