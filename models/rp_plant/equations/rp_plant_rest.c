#include "rp_plant_rest.h"

#include <math.h>

/* D a = forces in the rows of the joints that move, a = 0 in the others. */
static void accelerate(const struct rp_plant_inertia *inertia, const bool moves[2],
                       const double forces[2], double a[2]) {
    const double(*D)[2] = inertia->D;
    if (moves[0] && moves[1]) {
        a[0] = (D[1][1] * forces[0] - D[0][1] * forces[1]) / inertia->determinant;
        a[1] = (D[0][0] * forces[1] - D[1][0] * forces[0]) / inertia->determinant;
        return;
    }
    for (int i = 0; i < 2; i++) {
        a[i] = moves[i] ? forces[i] / D[i][i] : 0.0;
    }
}

/* By how much friction and stop of a joint that stays fall short: a closed stop takes any push
 * towards it. */
static double missing_hold(double reaction, double breakaway, int closed) {
    return (closed == 0 ? fabs(reaction) : closed * reaction) - breakaway;
}

double rp_plant_rest_misfit(const struct rp_plant_rest *rest, const int pattern[2],
                            struct rp_plant_outcome *outcome) {
    const double(*D)[2] = rest->inertia.D;
    double driving[2];
    bool moves[2];
    for (int i = 0; i < 2; i++) {
        outcome->pattern[i] = pattern[i];
        moves[i] = !rest->at_rest[i] || pattern[i] != 0;
        driving[i] = rest->forces[i] - pattern[i] * rest->breakaway[i];
    }
    accelerate(&rest->inertia, moves, driving, outcome->ddq);

    double misfit = -INFINITY;
    for (int i = 0; i < 2; i++) {
        const double other = D[i][1 - i] * outcome->ddq[1 - i];
        outcome->reaction[i] = 0.0;
        if (!rest->at_rest[i]) {
            continue;
        }
        if (pattern[i] == -rest->closed[i] && pattern[i] != 0) {
            return INFINITY;
        }
        double missing;
        if (pattern[i] == 0) {
            outcome->reaction[i] = rest->forces[i] - other;
            missing = missing_hold(outcome->reaction[i], rest->breakaway[i], rest->closed[i]);
        } else {
            outcome->reaction[i] = pattern[i] * rest->breakaway[i];
            missing = -pattern[i] * D[i][i] * outcome->ddq[i];
            // a joint that leaves without an acceleration stays
            missing = missing == 0.0 ? INFINITY : missing;
        }
        const double scale = fabs(rest->forces[i]) + fabs(other) + rest->breakaway[i];
        const double relative = scale > 0.0 ? missing / scale : missing;
        misfit = relative > misfit ? relative : misfit;
    }
    return misfit;
}

void rp_plant_rest_decide(const struct rp_plant_rest *rest, struct rp_plant_outcome *outcome) {
    // staying comes first
    static const int order[3] = {0, 1, -1};
    const int count[2] = {rest->at_rest[0] ? 3 : 1, rest->at_rest[1] ? 3 : 1};
    double least = rp_plant_rest_misfit(rest, (const int[2]){0, 0}, outcome);
    for (int k = 1; k < count[0] * count[1] && !(least <= 0.0); k++) {
        struct rp_plant_outcome tried;
        const int pattern[2] = {order[k / count[1]], order[k % count[1]]};
        const double misfit = rp_plant_rest_misfit(rest, pattern, &tried);
        if (misfit < least) {
            least = misfit;
            *outcome = tried;
        }
    }
}
