/* Contacts with compliant stops, which follow from positions and velocities.
 *
 * The force is 0 where a contact begins or ends, but its slope jumps; the same holds where the
 * velocity out of a damped stop passes 1 / c, from where on the stop does not push. Both are
 * events, so that no internal step goes over a kink. */
#pragma once

#include "rp_plant.h"

#include <float.h>
#include <math.h>

/* Whether a joint can be in contact with a compliant stop. */
static inline bool rp_plant_has_contacts(const struct rp_plant_parameters *p, int joint) {
    return p->stops[joint] == RP_PLANT_STOPS_COMPLIANT;
}

/* How near its limit a quantity is at the event there: that is located far better, up to the
 * rounding of the limit. */
static inline double rp_plant_near(double limit) {
    return 1e-9 + 4.0 * DBL_EPSILON * fabs(limit);
}

/* Writes modes->contact from positions and velocities; it keeps what a damped stop does at the
 * velocity where that changes. A joint at rest exactly on a limit is apart. */
void rp_plant_find_contacts(const struct rp_plant_parameters *p, const double q[2],
                            const double dq[2], struct rp_plant_modes *modes);

/* After the joints' modes are decided: a joint at rest exactly on a limit is in contact where it
 * begins to move into the stop. */
void rp_plant_begin_contacts(const struct rp_plant_parameters *p, const double q[2],
                             const double dq[2], const struct rp_plant_inputs *inputs,
                             struct rp_plant_modes *modes);

/* True if a joint in this state can have the contact. */
bool rp_plant_contact_fits(const struct rp_plant_parameters *p, int joint, double q, double dq,
                           int contact);

/* The stop that a joint is in begins or ends to push: writes the contact that follows, and the
 * velocity at which this happens. */
void rp_plant_turn_contact(const struct rp_plant_parameters *p, int joint, double *dq,
                           int *contact);
