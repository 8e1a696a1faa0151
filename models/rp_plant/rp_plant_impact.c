#include "rp_plant_impact.h"

#include <math.h>

/* The impact whose impulses are at the struck joints only. D_ii - D_ij^2 / D_jj is written by the
 * determinant: it cannot come out negative. */
static void strike(const struct rp_plant_inertia *inertia, const bool struck[2],
                   const double restitution[2], const double dq[2],
                   struct rp_plant_impact *impact) {
    const double(*D)[2] = inertia->D;
    double change[2] = {0.0, 0.0};
    for (int i = 0; i < 2; i++) {
        impact->dq[i] = dq[i];
        impact->impulse[i] = 0.0;
        if (struck[i]) {
            change[i] = -(1.0 + restitution[i]) * dq[i];
            impact->dq[i] = 0.0 - restitution[i] * dq[i];
        }
    }
    if (struck[0] && struck[1]) {
        for (int i = 0; i < 2; i++) {
            impact->impulse[i] = D[i][0] * change[0] + D[i][1] * change[1];
        }
    } else if (struck[0] || struck[1]) {
        const int i = struck[0] ? 0 : 1;
        const int other = 1 - i;
        impact->dq[other] = dq[other] - D[other][i] / D[other][other] * change[i];
        impact->impulse[i] = inertia->determinant / D[other][other] * change[i];
    }
    impact->loss = 0.0;
    for (int i = 0; i < 2; i++) {
        impact->loss -= 0.5 * impact->impulse[i] * (1.0 - restitution[i]) * dq[i];
    }
}

/* By how much a velocity is into a stop, or an impulse towards it, as a velocity. */
static double misfit(const struct rp_plant_inertia *inertia, const bool contact[2],
                     const struct rp_plant_contacts *contacts, const bool struck[2],
                     const double dq[2], const struct rp_plant_impact *impact) {
    double largest = 0.0;
    for (int i = 0; i < 2; i++) {
        const double after = impact->dq[i] + contacts->restitution[i] * dq[i];
        const double pushed = struck[i] ? impact->impulse[i] / inertia->D[i][i] : after;
        if (contact[i]) {
            largest = fmax(largest, -contacts->side[i] * pushed);
        }
    }
    return largest;
}

void rp_plant_impact(const struct rp_plant_inertia *inertia,
                     const struct rp_plant_contacts *contacts, const double dq[2],
                     struct rp_plant_impact *impact) {
    bool contact[2];
    for (int i = 0; i < 2; i++) {
        contact[i] = contacts->side[i] != 0 && contacts->side[i] * dq[i] <= 0.0;
    }
    double least = INFINITY;
    for (int set = 0; set < 4; set++) {
        const bool struck[2] = {(set & 1) != 0, (set & 2) != 0};
        if ((struck[0] && !contact[0]) || (struck[1] && !contact[1])) {
            continue;
        }
        struct rp_plant_impact tried;
        strike(inertia, struck, contacts->restitution, dq, &tried);
        const double missed = misfit(inertia, contact, contacts, struck, dq, &tried);
        if (missed < least) {
            least = missed;
            *impact = tried;
        }
    }
}

void rp_plant_catch(const struct rp_plant_inertia *inertia, const bool caught[2],
                    const double dq[2], struct rp_plant_impact *impact) {
    static const double plastic[2] = {0.0, 0.0};
    strike(inertia, caught, plastic, dq, impact);
}

/* The loss, written as two kinetic energies: of the arm at the velocities it loses, and of the
 * payload at those it gets; neither is negative. */
double rp_plant_grasp_at_rest(const struct rp_plant_parameters *p, const double q[2],
                              const double dq[2], double dq_after[2]) {
    struct rp_plant_inertia before;
    struct rp_plant_inertia after;
    rp_plant_inertia(p, false, q[1], &before);
    rp_plant_inertia(p, true, q[1], &after);

    // D+ (q'- - q'+) = (D+ - D-) q'-: no more than the payload changes is calculated
    double gained[2];
    for (int i = 0; i < 2; i++) {
        gained[i] =
            (after.D[i][0] - before.D[i][0]) * dq[0] + (after.D[i][1] - before.D[i][1]) * dq[1];
    }
    const double lost[2] = {
        (after.D[1][1] * gained[0] - after.D[0][1] * gained[1]) / after.determinant,
        (after.D[0][0] * gained[1] - after.D[1][0] * gained[0]) / after.determinant,
    };
    for (int i = 0; i < 2; i++) {
        dq_after[i] = dq[i] - lost[i];
    }

    // the payload turns about z0 and moves with its point of link 2
    const double across = p->arm.a + p->payload_x;
    const double L = p->arm.l1 + q[1] + p->payload_z;
    const double along_slide = dq_after[1] - across * dq_after[0];
    const double along_short_side = L * dq_after[0];
    const double speed2 = along_slide * along_slide + along_short_side * along_short_side;
    const double payload =
        0.5 * (p->payload_mass * speed2 + p->payload_inertia * dq_after[0] * dq_after[0]);
    return payload + rp_plant_kinetic_energy(p, false, q, lost);
}
