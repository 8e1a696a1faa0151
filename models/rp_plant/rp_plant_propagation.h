/* Derivatives of everything that the plant calculates, along a curve of its parameters, inputs and
 * states, in the modes that hold at the point. */
#ifndef RP_PLANT_PROPAGATION_H
#define RP_PLANT_PROPAGATION_H

#include "rp_plant_model.h"

/* As rp_propagate in rp_propagation.h. A curve does not change modes: the derivatives are those of
 * the equations in the given modes, on the side of a closed stop or of the limit of its friction
 * where the point lies. */
void rp_plant_propagate(const struct rp_plant_values *values, const struct rp_plant_modes *modes,
                        struct rp_plant_values *first, struct rp_plant_values *second);

#endif
