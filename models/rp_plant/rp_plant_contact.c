#include "rp_plant_contact.h"

#include "rp_plant_equations.h"

/* The side of the stop that the joint is in, or is on and moves into (direction: -1, 0, 1). */
static int side_of_contact(const struct rp_plant_parameters *p, int joint, double q,
                           int direction) {
    if (!rp_plant_has_contacts(p, joint)) {
        return 0;
    }
    if (q < p->lower[joint] || (q == p->lower[joint] && direction < 0)) {
        return 1;
    }
    return q > p->upper[joint] || (q == p->upper[joint] && direction > 0) ? -1 : 0;
}

static int sign_of(double x) {
    return (x > 0.0) - (x < 0.0);
}

static bool is_near_change(const struct rp_plant_parameters *p, int joint, int side, double dq) {
    return fabs(plant_push(p, side, joint, dq)) <= rp_plant_near(0.0);
}

static int contact_at(const struct rp_plant_parameters *p, int joint, int side, double dq,
                      int before) {
    if (side * before > 0 && is_near_change(p, joint, side, dq)) {
        return before;
    }
    const double push = plant_push(p, side, joint, dq);
    return side * (push > 0.0 ? RP_PLANT_PUSHED : RP_PLANT_LET_GO);
}

void rp_plant_find_contacts(const struct rp_plant_parameters *p, const double q[2],
                            const double dq[2], struct rp_plant_modes *modes) {
    for (int i = 0; i < 2; i++) {
        const int side = side_of_contact(p, i, q[i], sign_of(dq[i]));
        modes->contact[i] = contact_at(p, i, side, dq[i], modes->contact[i]);
    }
}

static bool is_at_rest_on_limit(const struct rp_plant_parameters *p, int joint, double q,
                                double dq) {
    return rp_plant_has_contacts(p, joint) && dq == 0.0 &&
           (q == p->lower[joint] || q == p->upper[joint]);
}

/* A joint that breaks away has no acceleration yet; a stuck one has none at all. */
static int first_direction(int mode, double ddq) {
    return plant_slides(mode) ? mode : sign_of(ddq);
}

void rp_plant_begin_contacts(const struct rp_plant_parameters *p, const double q[2],
                             const double dq[2], const struct rp_plant_inputs *inputs,
                             struct rp_plant_modes *modes) {
    const bool begins[2] = {is_at_rest_on_limit(p, 0, q[0], dq[0]),
                            is_at_rest_on_limit(p, 1, q[1], dq[1])};
    if (!begins[0] && !begins[1]) {
        return;
    }
    struct rp_plant_motion motion;
    rp_plant_motion(p, modes, q, dq, inputs, &motion);
    for (int i = 0; i < 2; i++) {
        if (begins[i]) {
            const int direction = first_direction(modes->joint[i], motion.ddq[i]);
            modes->contact[i] = side_of_contact(p, i, q[i], direction) * RP_PLANT_PUSHED;
        }
    }
}

bool rp_plant_contact_fits(const struct rp_plant_parameters *p, int joint, double q, double dq,
                           int contact) {
    if (!rp_plant_has_contacts(p, joint)) {
        return contact == RP_PLANT_APART;
    }
    if (contact == RP_PLANT_APART) {
        return q >= p->lower[joint] && q <= p->upper[joint];
    }
    const int side = sign_of(contact);
    return (side > 0 ? q <= p->lower[joint] : q >= p->upper[joint]) &&
           contact == contact_at(p, joint, side, dq, contact);
}

void rp_plant_turn_contact(const struct rp_plant_parameters *p, int joint, double *dq,
                           int *contact) {
    const int side = sign_of(*contact);
    if (is_near_change(p, joint, side, *dq)) {
        *dq = side / p->stop_damping[joint];
    }
    *contact = side * (abs(*contact) == RP_PLANT_PUSHED ? RP_PLANT_LET_GO : RP_PLANT_PUSHED);
}
