/* Frames of sets: nearly orthogonal matrices, whose columns are the vectors frame[0] .. [3]. */
#include "step.h"

/* x - 2 v (v^T x) / (v^T v) for each of the vectors x */
static void reflect(const double v[STATES], double vectors[STATES][STATES]) {
    double square = 0.0;
    for (int i = 0; i < STATES; i++) {
        square += v[i] * v[i];
    }
    for (int j = 0; j < STATES && square > 0.0; j++) {
        double product = 0.0;
        for (int i = 0; i < STATES; i++) {
            product += v[i] * vectors[j][i];
        }
        for (int i = 0; i < STATES; i++) {
            vectors[j][i] -= 2.0 * product / square * v[i];
        }
    }
}

void frame_along(struct ball sides[STATES][STATES], const double radius[STATES],
                 double frame[STATES][STATES]) {
    double vectors[STATES][STATES], lengths[STATES] = {0}, mirrors[STATES][STATES] = {{0}};
    for (int j = 0; j < STATES; j++) {
        for (int i = 0; i < STATES; i++) {
            vectors[j][i] = sides[j][i].hi * radius[j];
            lengths[j] += vectors[j][i] * vectors[j][i];
            frame[j][i] = i == j ? 1.0 : 0.0;
        }
    }
    for (int k = 0; k < STATES - 1; k++) {
        int longest = 0;
        for (int j = 1; j < STATES; j++) {
            longest = lengths[j] > lengths[longest] ? j : longest;
        }
        lengths[longest] = -1.0;
        double square = 0.0;
        for (int i = k; i < STATES; i++) {
            mirrors[k][i] = vectors[longest][i];
            square += mirrors[k][i] * mirrors[k][i];
        }
        mirrors[k][k] += mirrors[k][k] < 0.0 ? -sqrt(square) : sqrt(square);
        reflect(mirrors[k], vectors);
    }
    for (int k = STATES - 2; k >= 0; k--) {
        reflect(mirrors[k], frame);
    }
}

/* The sum of all |I - Q^T Q|, not below its largest row sum. */
static double deviation(double frame[STATES][STATES]) {
    double sum = 0.0;
    for (int j = 0; j < STATES; j++) {
        struct ball axis[STATES];
        for (int i = 0; i < STATES; i++) {
            axis[i] = ball_exact(frame[j][i]);
        }
        for (int i = 0; i < STATES; i++) {
            const struct ball identity = ball_exact(i == j ? 1.0 : 0.0);
            sum += ball_largest(ball_difference(identity, ball_dot(frame[i], axis, STATES)));
        }
    }
    return sum * OUTWARD;
}

/* README.md derives the share of the inverse. */
double frame_coordinates(double frame[STATES][STATES], struct ball sides[STATES][STATES],
                         const double radius[STATES], const double rest[STATES],
                         double coordinates[STATES]) {
    const double e = deviation(frame);
    double all = 0.0;
    for (int i = 0; i < STATES; i++) {
        double sum = 0.0;
        for (int j = 0; j < STATES; j++) {
            sum += ball_largest(ball_dot(frame[i], sides[j], STATES)) * radius[j];
            sum += fabs(frame[i][j]) * rest[j];
        }
        coordinates[i] = (sum + TINY) * OUTWARD;
        all += coordinates[i];
    }
    const double share = e < 1.0 ? e / ((1.0 - e) * INWARD) : (double)INFINITY;
    for (int i = 0; i < STATES; i++) {
        coordinates[i] = (coordinates[i] + share * all * OUTWARD) * OUTWARD;
    }
    return e;
}
