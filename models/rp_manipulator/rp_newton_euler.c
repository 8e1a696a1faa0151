#include "rp_recursion.h"

static struct vector vector_of(const double v[3]) {
    return (struct vector){v[0], v[1], v[2]};
}

void rp_newton_euler_forward(const struct rp_parameters *p, const double q[2], const double dq[2],
                             const double ddq[2], struct rp_link_motion *motion) {
    const struct arm arm = arm_in_state(p, q, dq);
    const struct link_motion links = link_motion(&arm, ddq);
    write_vector(links.omega, motion->omega);
    write_vector(links.domega, motion->domega);
    write_vector(links.ac1, motion->ac1);
    write_vector(links.ae1, motion->ae1);
    write_vector(links.ac2, motion->ac2);
}

void rp_newton_euler_backward(const struct rp_parameters *p, const double q[2],
                              const struct rp_link_motion *motion, struct rp_joint_loads *loads) {
    const double dq[2] = {0.0, 0.0}; // in the motion already
    const struct arm arm = arm_in_state(p, q, dq);
    const struct link_motion links = {
        .omega = vector_of(motion->omega),
        .domega = vector_of(motion->domega),
        .ac1 = vector_of(motion->ac1),
        .ae1 = vector_of(motion->ae1),
        .ac2 = vector_of(motion->ac2),
    };
    struct joint_loads joints;
    link2_loads(&arm, &links, &joints);
    link1_loads(&arm, &links, &joints);
    write_loads(&joints, loads);
}

void rp_newton_euler(const struct rp_parameters *p, const double q[2], const double dq[2],
                     const double ddq[2], struct rp_joint_loads *loads) {
    struct rp_link_motion motion;
    rp_newton_euler_forward(p, q, dq, ddq, &motion);
    rp_newton_euler_backward(p, q, &motion, loads);
}
