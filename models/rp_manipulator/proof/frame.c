#include "frame.h"

/* Order of the columns by their lengths, the longest one first. */
static void order_by_length(double matrix[STATES][STATES], int order[STATES]) {
    double squares[STATES] = {0};
    for (int j = 0; j < STATES; j++) {
        order[j] = j;
        for (int i = 0; i < STATES; i++) {
            squares[j] += matrix[i][j] * matrix[i][j];
        }
    }
    for (int j = 1; j < STATES; j++) {
        const int column = order[j];
        int k = j;
        for (; k > 0 && squares[order[k - 1]] < squares[column]; k--) {
            order[k] = order[k - 1];
        }
        order[k] = column;
    }
}

/* x - 2 v (v^T x) / (v^T v), in the rows from `first` on, for every column x */
static void reflect(const double v[STATES], int first, double matrix[STATES][STATES]) {
    double square = 0.0;
    for (int i = first; i < STATES; i++) {
        square += v[i] * v[i];
    }
    if (!(square > 0.0)) {
        return;
    }
    for (int j = 0; j < STATES; j++) {
        double product = 0.0;
        for (int i = first; i < STATES; i++) {
            product += v[i] * matrix[i][j];
        }
        for (int i = first; i < STATES; i++) {
            matrix[i][j] -= 2.0 * product / square * v[i];
        }
    }
}

void frame_along(struct ball columns[STATES][STATES], const double sizes[STATES],
                 double frame[STATES][STATES]) {
    double matrix[STATES][STATES];
    for (int i = 0; i < STATES; i++) {
        for (int j = 0; j < STATES; j++) {
            matrix[i][j] = columns[i][j].hi * sizes[j];
            frame[i][j] = i == j ? 1.0 : 0.0;
        }
    }
    int order[STATES];
    order_by_length(matrix, order);
    double mirrors[STATES][STATES] = {{0}};
    for (int k = 0; k < STATES - 1; k++) {
        double square = 0.0;
        for (int i = k; i < STATES; i++) {
            mirrors[k][i] = matrix[i][order[k]];
            square += mirrors[k][i] * mirrors[k][i];
        }
        mirrors[k][k] += mirrors[k][k] < 0.0 ? -sqrt(square) : sqrt(square);
        reflect(mirrors[k], k, matrix);
    }
    for (int k = STATES - 2; k >= 0; k--) {
        reflect(mirrors[k], k, frame);
    }
}

/* Of frame^T columns. */
static struct ball transposed_product(double frame[STATES][STATES],
                                      struct ball columns[STATES][STATES], int i, int j) {
    struct ball sum = ball_exact(0.0);
    for (int k = 0; k < STATES; k++) {
        sum = ball_sum(sum, ball_times(frame[k][i], columns[k][j]));
    }
    return sum;
}

/* The sum of all |I - frame^T frame|, not below its largest row sum. */
static double deviation(double frame[STATES][STATES]) {
    struct ball columns[STATES][STATES];
    for (int i = 0; i < STATES; i++) {
        for (int j = 0; j < STATES; j++) {
            columns[i][j] = ball_exact(frame[i][j]);
        }
    }
    double sum = 0.0;
    for (int i = 0; i < STATES; i++) {
        for (int j = 0; j < STATES; j++) {
            const struct ball identity = ball_exact(i == j ? 1.0 : 0.0);
            const struct ball product = transposed_product(frame, columns, i, j);
            sum += ball_largest(ball_difference(identity, product));
        }
    }
    return sum * OUTWARD;
}

/* With E = I - frame^T frame, frame^-1 = (I - E)^-1 frame^T and (I - E)^-1 = I + E (I - E)^-1.
 * Where the row sums of |E| are at most e < 1, those of E (I - E)^-1 are at most e / (1 - e). */
double frame_coordinates(double frame[STATES][STATES], struct ball columns[STATES][STATES],
                         const double sizes[STATES], const double rest[STATES],
                         double coordinates[STATES]) {
    const double e = deviation(frame);
    double all = 0.0;
    for (int i = 0; i < STATES; i++) {
        double sum = 0.0;
        for (int j = 0; j < STATES; j++) {
            sum += ball_largest(transposed_product(frame, columns, i, j)) * sizes[j];
            sum += fabs(frame[j][i]) * rest[j];
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
