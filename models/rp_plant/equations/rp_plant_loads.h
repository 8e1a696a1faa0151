/* Loads of the plant's joints: force and moment that each link receives through its joint, in
 * frames 1 and 2 as in rp_manipulator.h. Drives with their armature, damping, friction and stops
 * act through the joints; the wrench and the payload do not. */
#ifndef RP_PLANT_LOADS_H
#define RP_PLANT_LOADS_H

#include "rp_plant_equations.h"
#include "rp_recursion.h"

/* The recursion for link 2 with payload takes moments about a point that lies by the payload's
 * offset from the end of link 1, where (20) has it: the moment of f2 is moved there. The wrench
 * (w, m) at the end effector, r from the end of link 1, carries a part of link 2. */
static inline void plant_link2_loads(const struct plant *plant, const struct link_motion *motion,
                                     const real wrench[3], struct joint_loads *loads) {
    const struct arm *hand = &plant->hand;
    const struct vector offset = {plant->offset_x, 0.0, plant->offset_z};
    const struct vector r = {0.0, 0.0, hand->q[1]};
    const struct vector w = {
        .x = hand->c1 * wrench[1] - hand->s1 * wrench[0],
        .y = 0.0,
        .z = hand->c1 * wrench[0] + hand->s1 * wrench[1],
    };
    const struct vector m = {0.0, wrench[2], 0.0};

    link2_loads(&plant->arm, motion, loads);
    const struct vector moved = vector_minus(loads->tau2, vector_cross(loads->f2, offset));
    loads->tau2 = vector_minus(moved, vector_plus(vector_cross(r, w), m));
    loads->f2 = vector_minus(loads->f2, w);
}

/* driven: what drives, armature, damping, friction and stops exert on the joints. The loads take
 * their derivatives from there, as the manipulator's do from its efforts. */
static inline struct joint_loads plant_loads(const struct plant *plant, const real wrench[3],
                                             const real driven[2], const real ddq[2]) {
    const struct link_motion motion = link_motion(&plant->arm, ddq);
    struct joint_loads loads;
    plant_link2_loads(plant, &motion, wrench, &loads);
    loads.f2.z = moving_as(loads.f2.z, driven[1]);
    link1_loads(&plant->hand, &motion, &loads);
    loads.tau1.y = moving_as(loads.tau1.y, driven[0]);
    return loads;
}

#endif
