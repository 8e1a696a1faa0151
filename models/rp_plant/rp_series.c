/* Recurrences for the coefficients of a motion, from the equations of motion (13).
 *
 * With w = q1', v = q2', L = l1 + q2, P = L w and the inertia without the slide
 * F = m1 lc1^2 + I1z + I2z, the momentum about the joint is N = J w = F w + m2 L P, and that along
 * the slide m2 y with y = v - a w. (14) plus a times (15), and (15) over m2, are
 *
 *   N' = tau1 + a f2 + a m2 P w - g c1 (m1 lc1 + m2 L)          y' = f2 / m2 + P w - g s1
 *
 * because N' = J w' + 2 m2 L v w and P' = L w' + v w. With s1' = w c1 and c1' = -w s1 all right
 * sides are products of two series, (x z)_n = sum of x_i z_(n-i), and a derivative gives
 * x_k = (time_scale / k) (x')_(k-1). N and P at order k contain the unknown w_k:
 *
 *   P_k = L_0 w_k + sum of L_(i+1) w_(k-1-i)
 *   N_k = F w_k + m2 (L_0 P_k + sum of L_(i+1) P_(k-1-i))
 *
 * which F + m2 L_0^2 = J at the origin solves for w_k. It is above 0 for valid parameters. */
#include "rp_series.h"

#include "platform.h"
#include "rp_equations.h"

#include <math.h>
#include <stddef.h>

enum row { Q1, Q2, W, V, L, P, S, C };

_Static_assert(C + 1 == RP_SERIES_ROWS, "the rows");

/* Sums over i = 0 .. n of a product of two series, x_i z_(n-i), or x_(i+1) z_(n-i) where `ahead`
 * stands in the name. */
struct products {
    double P_w, L_c, w_s, w_c;
    double ahead_L_w, ahead_L_P;
};

static inline struct products products_of_order(double row[][SERIES_LENGTH], int n) {
    struct products sum = {0};
    for (int i = 0; i <= n; i++) {
        const int j = n - i;
        sum.P_w += row[P][i] * row[W][j];
        sum.L_c += row[L][i] * row[C][j];
        sum.w_s += row[W][i] * row[S][j];
        sum.w_c += row[W][i] * row[C][j];
        sum.ahead_L_w += row[L][i + 1] * row[W][j];
        sum.ahead_L_P += row[L][i + 1] * row[P][j];
    }
    return sum;
}

/* What the states of the origin determine. */
static void begin(const struct arm_parameters *p, double row[][SERIES_LENGTH]) {
    row[L][0] = p->l1 + row[Q2][0];
    row[P][0] = row[L][0] * row[W][0];
    row[S][0] = sin(row[Q1][0]);
    row[C][0] = cos(row[Q1][0]);
}

/* Right sides of N' and y' of order n that the efforts give. */
ALWAYS_INLINE void efforts(const struct series_origin *origin, const struct arm_parameters *p,
                           const double friction[2], int n, double effort[2]) {
    effort[0] = 0.0;
    effort[1] = 0.0;
    if (n >= SERIES_INPUT_LENGTH) {
        return;
    }
    double tau1 = origin->inputs[0][n];
    double f2 = origin->inputs[1][n];
    if (friction == NULL) {
        effort[1] = f2 / p->m2;
    } else {
        tau1 -= n == 0 ? friction[0] : 0.0;
        f2 -= n == 0 ? friction[1] : 0.0;
        effort[1] = f2 * (1.0 / p->m2); // rounded as in the plant's other modes
    }
    effort[0] = tau1 + p->a * f2;
}

ALWAYS_INLINE void extend_with(const struct arm_parameters *parameters, const double friction[2],
                               const struct series_origin *origin, int first, int last,
                               double row[][SERIES_LENGTH]) {
    // a copy, which no coefficient overwrites
    const struct arm_parameters p = *parameters;
    if (first == 0) {
        begin(&p, row);
    }
    const double L0 = row[L][0];
    const double per_J0 = 1.0 / (arm_fixed_inertia(&p) + p.m2 * L0 * L0);
    const double m1_lc1 = p.m1 * p.lc1;
    const double a_m2 = p.a * p.m2;
    for (int k = first > 0 ? first : 1; k <= last; k++) {
        const int n = k - 1;
        const double h = origin->time_scale / k;
        row[Q1][k] = h * row[W][n];
        row[Q2][k] = h * row[V][n];
        row[L][k] = row[Q2][k];

        double effort[2];
        efforts(origin, &p, friction, n, effort);
        const struct products sum = products_of_order(row, n);
        const double weight = p.g * (m1_lc1 * row[C][n] + p.m2 * sum.L_c);
        const double N = h * (effort[0] + a_m2 * sum.P_w - weight);
        const double y = h * (effort[1] + sum.P_w - p.g * row[S][n]);
        row[S][k] = h * sum.w_c;
        row[C][k] = -h * sum.w_s;
        row[W][k] = (N - p.m2 * (L0 * sum.ahead_L_w + sum.ahead_L_P)) * per_J0;
        row[P][k] = L0 * row[W][k] + sum.ahead_L_w;
        row[V][k] = y + p.a * row[W][k];
    }
}

void rp_series_extend(const struct arm_parameters *parameters, const double friction[2],
                      const struct series_origin *origin, int first, int last,
                      double row[][SERIES_LENGTH]) {
    if (friction == NULL) {
        extend_with(parameters, NULL, origin, first, last, row); // compiled without friction
    } else {
        extend_with(parameters, friction, origin, first, last, row);
    }
}
