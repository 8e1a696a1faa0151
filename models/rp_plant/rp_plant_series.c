/* Recurrences for the coefficients of a motion in given modes. Symbols are those of rp_series.c,
 * with link 2 and its payload as one body and the armature b1 in J. With the armature b2 and the
 * efforts E_i = tau_i + Q_i - d_i q_i' - f_i + p_i, row 1 plus a times row 2 of the equations of
 * motion, and row 2 over m2, are
 *
 *   (N + a b2 v)' = E1 + a E2 + a m2 P w - g c1 (m1 lc1 + m2 L)
 *   (v - a w + (b2 / m2) v)' = E2 / m2 + P w - g s1
 *
 * Their right sides give coefficient k of what stands in the brackets, R1 and R2. With
 * N_k = J_0 w_k + K, where K has the terms that are known, and mu = m2 / (m2 + b2),
 *
 *   (J_0 + a^2 mu b2) w_k = R1 - K - a mu b2 R2          v_k = mu (R2 + a w_k)
 *
 * Where joint 1 is stuck, w_k = 0 and v_k is the same. Where joint 2 is stuck, v_k = 0, and row 1
 * gives w_k:
 *
 *   (N + m2 a^2 w)' = E1 - g c1 (m1 lc1 + m2 L) + m2 g a s1
 *
 * The reaction of a stuck joint is the rest of its row of the equations, as in plant_motion. */
#include "jet.h"
#include "platform.h"
#include "rp_plant_equations.h"
#include "rp_plant_model.h"
#include "rp_plant_modes.h"
#include "rp_series.h"

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Inputs: tau1, f2, and the wrench. */
enum { FX = 2, FY, MZ };

/* Rows of the series: those of the manipulator come first. Pairs: of joint 1 and of joint 2. */
enum row {
    Q1,
    Q2,
    W,
    V,
    L,
    P,
    S,
    C,
    X, // end effector, where there is a wrench
    Y,
    RATIO,                     // r = q' / vs of a sliding joint whose friction depends on it
    RATE = RATIO + 2,          // k r_k
    EXPONENTIAL = RATE + 2,    // e = exp(-r^2)
    RATIO_E = EXPONENTIAL + 2, // r e
    FORWARD = RATIO_E + 2,     // indicators of a stuck joint
    BACKWARD = FORWARD + 2,
    DEPTH = BACKWARD + 2, // penetration of a compliant stop
    ROWS = DEPTH + 2
};

/* What all orders share. */
struct series_motion {
    const struct series_origin *origin;
    const struct rp_plant_parameters *p;
    struct rp_plant_modes modes;
    bool has_wrench;
    bool depends_on_velocity[2]; /* true if the joint slides with such friction */
    double direction[2];         /* of a joint that slides: 1 or -1; else 0 */
    double per_vs[2];
    double m2, a, g, m1_lc1; /* m2, a: of link 2 with payload */
    double L0;
    double offset_z; /* m: of the payload */
    double mu, a_mu_b2;
    double per_m2, per_inertia; /* 1 over what stands before w_k */
};

_Static_assert(X == (int)RP_SERIES_ROWS, "the rows of the manipulator come first");

/* Where q' is so many times vs, friction is as of a fast joint: exp(-36) of the difference is
 * left. */
static const double fast = 6.0;

/* ---- Efforts of the joints: drives, damping, friction, compliant stops, wrench --------------- */

/* Returns order k of the product of an input and a row. */
static double series_with_input(const struct series_motion *m, int input, const double x[], int k) {
    const double *u = m->origin->inputs[input];
    double sum = 0.0;
    for (int i = 0; i < SERIES_INPUT_LENGTH && i <= k; i++) {
        sum += u[i] * x[k - i];
    }
    return sum;
}

static void series_add_wrench(const struct series_motion *m, int k, double row[][SERIES_LENGTH],
                              double effort[2]) {
    const double a = m->p->arm.a;
    const double L_c = jet_product(row[L], row[C], k) - m->offset_z * row[C][k];
    const double L_s = jet_product(row[L], row[S], k) - m->offset_z * row[S][k];
    row[X][k] = L_c - a * row[S][k];
    row[Y][k] = L_s + a * row[C][k];
    double Q[2];
    plant_wrench_sums(series_with_input(m, FY, row[X], k), series_with_input(m, FX, row[Y], k),
                      jet_input(m->origin, MZ, k), series_with_input(m, FX, row[C], k),
                      series_with_input(m, FY, row[S], k), Q);
    effort[0] += Q[0];
    effort[1] += Q[1];
}

/* Returns order k of plant_stribeck_decay: e' = -2 r' (r e). */
ALWAYS_INLINE double series_exponential(const struct series_motion *m, int i, int k,
                                        double row[][SERIES_LENGTH]) {
    double *r = row[RATIO + i];
    double *rate = row[RATE + i];
    double *e = row[EXPONENTIAL + i];
    double *r_e = row[RATIO_E + i];
    r[k] = row[W + i][k] * m->per_vs[i];
    rate[k] = k * r[k];
    if (k == 0) {
        e[0] = plant_stribeck_decay(r[0]);
        r_e[0] = r[0] * e[0];
        return e[0];
    }
    double rate_r_e = 0.0;
    double product = 0.0;
    for (int j = 1; j <= k; j++) {
        rate_r_e += rate[j] * r_e[k - j];
        product += r[j] * e[k - j];
    }
    e[k] = -2.0 / k * rate_r_e;
    r_e[k] = product + r[0] * e[k];
    return e[k];
}

/* Returns order k of plant_friction. */
ALWAYS_INLINE double series_friction(const struct series_motion *m, int i, int k,
                                     double row[][SERIES_LENGTH]) {
    if (!plant_slides(m->modes.joint[i])) {
        return 0.0;
    }
    const double coulomb = m->p->coulomb_friction[i];
    if (!m->depends_on_velocity[i]) {
        return k == 0 ? m->direction[i] * coulomb : 0.0;
    }
    const double breakaway = m->p->breakaway_friction[i];
    const double e = series_exponential(m, i, k, row);
    return m->direction[i] *
           (k == 0 ? plant_stribeck(breakaway, coulomb, e) : (breakaway - coulomb) * e);
}

/* Returns order k of plant_compliant_force. */
ALWAYS_INLINE double series_compliant_force(const struct series_motion *m, int i, int k,
                                            double row[][SERIES_LENGTH]) {
    const int contact = m->modes.contact[i];
    if (contact == RP_PLANT_APART || abs(contact) != RP_PLANT_PUSHED) {
        return 0.0;
    }
    const double q = row[Q1 + i][k];
    double *d = row[DEPTH + i];
    const double lower = k == 0 ? m->p->lower[i] : 0.0, upper = k == 0 ? m->p->upper[i] : 0.0;
    d[k] = plant_penetration(contact, lower, upper, q);
    const double damped = plant_push(m->p, contact, i, d[k], jet_product(d, row[W + i], k));
    return plant_stop_force(m->p, contact, i, damped, 1.0);
}

/* Returns order k of plant_effort, without the wrench. Inline, as most of it is left out for most
 * joints. */
ALWAYS_INLINE double series_effort(const struct series_motion *m, int i, int k,
                                   double row[][SERIES_LENGTH]) {
    const double friction = series_friction(m, i, k, row);
    const double stop = series_compliant_force(m, i, k, row);
    const double applied = jet_input(m->origin, i, k);
    return plant_effort(m->p, &m->modes, i, row[W + i][k], applied, friction, stop);
}

/* ---- Constants ------------------------------------------------------------------------------ */

static bool has_wrench(const struct series_origin *origin) {
    const double *first = origin->inputs[FX];
    uint64_t any = 0;
    for (const double *u = first; u < first + 3 * (ptrdiff_t)SERIES_INPUT_LENGTH; u++) {
        uint64_t bits;
        memcpy(&bits, u, sizeof bits);
        any |= bits; // one branch for all
    }
    return any << 1 != 0; // without the signs of zeros
}

static bool is_stuck(const struct series_motion *m, int joint) {
    return m->modes.joint[joint] == RP_PLANT_STUCK;
}

/* Joint 1 does not turn: w and P are 0 in all orders. */
static bool stands_still(const struct series_motion *m, double row[][SERIES_LENGTH]) {
    return is_stuck(m, 0) && row[W][0] == 0.0;
}

/* Returns the direction of a joint that slides, 1 or -1; else 0. */
static int direction_of(const struct series_motion *m, int joint) {
    const int mode = m->modes.joint[joint];
    return mode == RP_PLANT_FREE ? 0 : mode;
}

static bool has_breakaway(const struct rp_plant_parameters *p, int joint) {
    return p->breakaway_friction[joint] > p->coulomb_friction[joint];
}

static bool has_payload(const struct series_motion *m) {
    return m->modes.payload == RP_PLANT_ATTACHED &&
           (m->p->payload_mass > 0.0 || m->p->payload_inertia > 0.0);
}

/* True if the manipulator moves alike, up to constant friction. */
static bool is_plain(const struct series_motion *m) {
    const struct rp_plant_parameters *p = m->p;
    return !m->depends_on_velocity[0] && !m->depends_on_velocity[1] && !is_stuck(m, 0) &&
           !is_stuck(m, 1) && m->modes.contact[0] == RP_PLANT_APART &&
           m->modes.contact[1] == RP_PLANT_APART &&
           p->armature[0] + p->armature[1] + p->damping[0] + p->damping[1] == 0.0 &&
           !m->has_wrench && !has_payload(m);
}

/* The bodies at this q2. */
static void set_bodies(struct series_motion *m, double q2) {
    const struct rp_plant_parameters *p = m->p;
    const struct arm_parameters *arm = &p->arm;
    double m2 = arm->m2;
    double a = arm->a;
    m->L0 = arm->l1 + q2;
    double J = arm_fixed_inertia(arm) + m2 * m->L0 * m->L0;
    m->offset_z = 0.0;
    if (has_payload(m)) {
        struct plant plant = {
            .arm = {.m1 = arm->m1,
                    .m2 = m2,
                    .I1z = arm->I1z,
                    .I2z = arm->I2z,
                    .l1 = arm->l1,
                    .lc1 = arm->lc1,
                    .a = a,
                    .L = m->L0,
                    .J = J,
                    .q = {0.0, q2}},
        };
        plant_attach(&plant, p);
        m2 = plant.arm.m2;
        a = plant.arm.a;
        J = plant.arm.J;
        m->L0 = plant.arm.L;
        m->offset_z = plant.offset_z;
    }
    const double b2 = p->armature[1];
    const double J0 = J + p->armature[0];
    for (int i = 0; i < 2; i++) {
        m->direction[i] = direction_of(m, i);
        m->per_vs[i] = m->depends_on_velocity[i] ? 1.0 / p->stribeck_velocity[i] : 0.0;
    }
    m->m2 = m2;
    m->a = a;
    m->g = arm->g;
    m->m1_lc1 = arm->m1 * arm->lc1;
    m->mu = b2 > 0.0 ? m2 / (m2 + b2) : 1.0;
    m->a_mu_b2 = a * m->mu * b2;
    m->per_m2 = 1.0 / m2;
    m->per_inertia = 1.0 / (J0 + a * (is_stuck(m, 1) ? a * m2 : m->a_mu_b2));
}

static void begin_motion(const struct series_origin *origin, double row[][SERIES_LENGTH],
                         struct series_motion *m) {
    const struct rp_plant_values *values = origin->values;
    m->origin = origin;
    m->p = &values->parameters;
    if (!rp_plant_modes_are_decided(values, &m->modes)) {
        const double(*u)[SERIES_INPUT_LENGTH] = origin->inputs;
        const struct rp_plant_inputs inputs = {{u[0][0], u[1][0]}, {u[FX][0], u[FY][0], u[MZ][0]}};
        rp_plant_first_modes(values, (const double[]){row[Q1][0], row[Q2][0]},
                             (const double[]){row[W][0], row[V][0]}, &inputs, &m->modes);
    }
    m->has_wrench = has_wrench(origin);
    for (int i = 0; i < 2; i++) {
        m->depends_on_velocity[i] = plant_slides(m->modes.joint[i]) && has_breakaway(m->p, i) &&
                                    fabs(row[W + i][0]) < (fast + 1.0) * m->p->stribeck_velocity[i];
    }
}

/* ---- Motion --------------------------------------------------------------------------------- */

/* Sums over i = 0 .. n of a product of two series, x_i z_(n-i), or x_(i+1) z_(n-i) where `ahead`
 * stands in the name. */
struct products {
    double P_w, L_c, w_s, w_c;
    double ahead_L_w, ahead_L_P;
};

static inline struct products products_of_order(double row[][SERIES_LENGTH], double next_L, int n) {
    struct products sum = {0};
    for (ptrdiff_t i = 0, j = n; i < n; i++, j--) {
        sum.P_w += row[P][i] * row[W][j];
        sum.L_c += row[L][i] * row[C][j];
        sum.w_s += row[W][i] * row[S][j];
        sum.w_c += row[W][i] * row[C][j];
        sum.ahead_L_w += row[L][i + 1] * row[W][j];
        sum.ahead_L_P += row[L][i + 1] * row[P][j];
    }
    sum.P_w += row[P][n] * row[W][0];
    sum.L_c += row[L][n] * row[C][0];
    sum.w_s += row[W][n] * row[S][0];
    sum.w_c += row[W][n] * row[C][0];
    sum.ahead_L_w += next_L * row[W][0];
    sum.ahead_L_P += next_L * row[P][0];
    return sum;
}

/* What follows from the orders up to n: coefficients of order n + 1, and terms of order n. */
struct next {
    double q1, L, s, c, w, v, P;
    double effort[2];
    double P_w, weight; /* weight: g c1 (m1 lc1 + m2 L) */
};

static inline struct next next_order(const struct series_motion *m, int n,
                                     double row[][SERIES_LENGTH]) {
    const double h = m->origin->time_scale / (n + 1);
    struct next next = {
        .q1 = h * row[W][n],
        .L = h * row[V][n],
        .effort = {series_effort(m, 0, n, row), series_effort(m, 1, n, row)},
    };
    if (m->has_wrench) {
        series_add_wrench(m, n, row, next.effort);
    }
    struct products sum = {.L_c = row[L][n] * row[C][0]};
    if (!stands_still(m, row)) {
        sum = products_of_order(row, next.L, n);
    }
    const double L0 = row[L][0];
    next.s = h * sum.w_c;
    next.c = -h * sum.w_s;
    next.P_w = sum.P_w;
    next.weight = m->g * (m->m1_lc1 * row[C][n] + m->m2 * sum.L_c);
    const double known = m->m2 * (L0 * sum.ahead_L_w + sum.ahead_L_P);
    const double R2 = h * (next.effort[1] * m->per_m2 + sum.P_w - m->g * row[S][n]);
    if (is_stuck(m, 1)) {
        const double fall = m->m2 * m->g * m->a * row[S][n];
        const double R = h * (next.effort[0] - next.weight + fall);
        next.w = is_stuck(m, 0) ? 0.0 : (R - known) * m->per_inertia;
    } else {
        const double pushed = next.effort[0] + m->a * next.effort[1];
        const double R1 = h * (pushed + m->a * m->m2 * sum.P_w - next.weight);
        next.w = is_stuck(m, 0) ? 0.0 : (R1 - known - m->a_mu_b2 * R2) * m->per_inertia;
        next.v = m->mu * (R2 + m->a * next.w);
    }
    next.P = L0 * next.w + sum.ahead_L_w;
    return next;
}

static inline void write_order(const struct series_motion *m, int k, const struct next *next,
                               double row[][SERIES_LENGTH]) {
    row[Q1][k] = next->q1;
    row[Q2][k] = next->L;
    row[L][k] = next->L;
    row[W][k] = next->w;
    row[V][k] = next->v;
    row[P][k] = next->P;
    row[S][k] = next->s;
    row[C][k] = next->c;
}

/* ---- Indicators ----------------------------------------------------------------------------- */

/* Of joints that stick, with both sides in use; others have no indicator of the model. */
static void write_indicators(const struct series_motion *m, int k, const struct next *next,
                             double row[][SERIES_LENGTH]) {
    const double rate = (k + 1) / m->origin->time_scale;
    const double a_m2 = m->a * m->m2;
    const double P_v = stands_still(m, row) ? 0.0 : jet_product(row[P], row[V], k);
    const double coriolis = 2.0 * m->m2 * P_v;
    const double fall = m->g * row[S][k];
    const double reaction[2] = {
        next->effort[0] - coriolis - next->weight + a_m2 * (fall + rate * next->v),
        next->effort[1] + m->m2 * (next->P_w - fall) + a_m2 * rate * next->w,
    };
    for (int i = 0; i < 2; i++) {
        if (is_stuck(m, i)) {
            double z[2];
            plant_stuck_indicators(0, k == 0 ? plant_breakaway(m->p, i) : 0.0, reaction[i], z);
            row[FORWARD + i][k] = z[0];
            row[BACKWARD + i][k] = z[1];
        }
    }
}

/* ---- Series --------------------------------------------------------------------------------- */

static void begin_rows(const struct series_motion *m, double row[][SERIES_LENGTH]) {
    row[L][0] = m->L0;
    row[P][0] = row[L][0] * row[W][0];
    row[S][0] = sin(row[Q1][0]);
    row[C][0] = cos(row[Q1][0]);
}

/* Extends the series of any motion. */
static NOINLINE void extend_any(struct series_motion *m, int first, int last,
                                double row[][SERIES_LENGTH]) {
    set_bodies(m, row[Q2][0]);
    if (first == 0) {
        begin_rows(m, row);
    }
    // indicators of an order take what follows from it
    const bool sticks = is_stuck(m, 0) || is_stuck(m, 1);
    const int end = sticks ? last + 1 : last;
    for (int n = first > 0 ? first - 1 : 0; n < end; n++) {
        const struct next next = next_order(m, n, row);
        if (sticks && n >= first) {
            write_indicators(m, n, &next, row);
        }
        if (n < last) {
            write_order(m, n + 1, &next, row);
        }
    }
}

static enum status extend(const struct series_origin *origin, int first, int last,
                          double row[][SERIES_LENGTH]) {
    struct series_motion m;
    begin_motion(origin, row, &m);
    if (is_plain(&m)) {
        const double *coulomb = m.p->coulomb_friction;
        const double friction[2] = {direction_of(&m, 0) * coulomb[0],
                                    direction_of(&m, 1) * coulomb[1]};
        const bool slides = m.modes.joint[0] != RP_PLANT_FREE || m.modes.joint[1] != RP_PLANT_FREE;
        rp_series_extend(&m.p->arm, slides ? friction : NULL, origin, first, last, row);
        return STATUS_OK;
    }
    extend_any(&m, first, last, row);
    return STATUS_OK;
}

/* Over steps in which the velocity changes by vs at most, the series shows the friction near rest.
 * Those of a fast joint, which show nothing of it, end before. */
void rp_plant_reach(const void *values_pointer, const double x[], double reach[]) {
    const struct rp_plant_values *values = values_pointer;
    const struct rp_plant_parameters *p = &values->parameters;
    for (int i = 0; i < 2; i++) {
        const bool is_sliding = plant_slides(values->modes.joint[i]);
        const double vs = p->stribeck_velocity[i];
        const double above_fast = fabs(x[2 + i]) - fast * vs;
        reach[i] = INFINITY;
        reach[2 + i] = INFINITY;
        if (is_sliding && has_breakaway(p, i)) {
            reach[2 + i] = above_fast > vs ? above_fast : vs;
        }
    }
}

/* 0 where the indicator is never of the model. */
static const size_t row_of_indicator[RP_PLANT_INDICATORS] = {
    FORWARD, BACKWARD, 0, 0, FORWARD + 1, BACKWARD + 1, 0, 0, 0, 0,
};

const struct series rp_plant_series = {
    .row_count = ROWS, .row_of_indicator = row_of_indicator, .extend = extend};
