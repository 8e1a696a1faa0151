/* Taylor coefficients of the efforts of the plant's joints: drives, damping, friction, compliant
 * stops, wrench. For rp_plant_series.c, with the rows and constants that it shares. */
#ifndef RP_PLANT_SERIES_EFFORTS_H
#define RP_PLANT_SERIES_EFFORTS_H

#include "jet.h"
#include "platform.h"
#include "rp_plant_equations.h"
#include "rp_plant_model.h"

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
    double direction[2];         /* of a joint that slides: 1 or -1; else 0 */
    bool depends_on_velocity[2]; /* friction of the joint, where it slides */
    double per_vs[2];
    double m2, a, g, m1_lc1; /* m2, a: of link 2 with payload */
    double L0;
    double offset_z; /* m: of the payload */
    double mu, a_mu_b2;
    double per_m2, per_inertia; /* 1 over what stands before w_k */
};

/* Order k of the product of an input and a row. */
static inline double series_with_input(const struct series_motion *m, int input, const double x[],
                                       int k) {
    const double *u = m->origin->inputs[input];
    double sum = 0.0;
    for (int i = 0; i < SERIES_INPUT_LENGTH && i <= k; i++) {
        sum += u[i] * x[k - i];
    }
    return sum;
}

/* Adds Q1 = x fy - y fx + mz and Q2 = c1 fx + s1 fy. */
static inline void series_add_wrench(const struct series_motion *m, int k,
                                     double row[][SERIES_LENGTH], double effort[2]) {
    const double a = m->p->arm.a;
    const double L_c = jet_product(row[L], row[C], k) - m->offset_z * row[C][k];
    const double L_s = jet_product(row[L], row[S], k) - m->offset_z * row[S][k];
    row[X][k] = L_c - a * row[S][k];
    row[Y][k] = L_s + a * row[C][k];
    const double moment = series_with_input(m, FY, row[X], k) - series_with_input(m, FX, row[Y], k);
    effort[0] += moment + jet_input(m->origin, MZ, k);
    effort[1] += series_with_input(m, FX, row[C], k) + series_with_input(m, FY, row[S], k);
}

/* Order k of e = exp(-r^2), from e' = -2 r' (r e). */
static inline double series_exponential(const struct series_motion *m, int i, int k,
                                        double row[][SERIES_LENGTH]) {
    double *r = row[RATIO + i];
    double *rate = row[RATE + i];
    double *e = row[EXPONENTIAL + i];
    double *r_e = row[RATIO_E + i];
    r[k] = row[W + i][k] * m->per_vs[i];
    rate[k] = k * r[k];
    if (k == 0) {
        e[0] = exp(-r[0] * r[0]);
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

/* As plant_sliding_friction. */
ALWAYS_INLINE double series_sliding_friction(const struct series_motion *m, int i, int k,
                                             double row[][SERIES_LENGTH]) {
    const double coulomb = m->p->coulomb_friction[i];
    if (!m->depends_on_velocity[i]) {
        return k == 0 ? coulomb : 0.0;
    }
    const double e = series_exponential(m, i, k, row);
    const double breakaway = m->p->breakaway_friction[i];
    return k == 0 ? breakaway * e + coulomb * (1.0 - e) : (breakaway - coulomb) * e;
}

/* As plant_compliant_force:  s k (d + c (d d')) with d' = -s q', s: the side */
static inline double series_compliant_force(const struct series_motion *m, int i, int k,
                                            double row[][SERIES_LENGTH]) {
    const int contact = m->modes.contact[i];
    if (abs(contact) != RP_PLANT_PUSHED) {
        return 0.0;
    }
    const double *q = row[Q1 + i];
    double *d = row[DEPTH + i];
    d[k] = -contact * q[k];
    if (k == 0) {
        d[0] = plant_penetration(m->p, contact, i, q[0]);
    }
    const double damped = m->p->stop_damping[i] * jet_product(d, row[W + i], k);
    return m->p->stop_stiffness[i] * (contact * d[k] - damped);
}

/* Order k of the effort of a joint, without the wrench. Inline, as most of it is left out for most
 * joints. */
ALWAYS_INLINE double series_effort(const struct series_motion *m, int i, int k,
                                   double row[][SERIES_LENGTH]) {
    double effort = jet_input(m->origin, i, k) - m->p->damping[i] * row[W + i][k];
    if (m->direction[i] != 0.0) {
        effort -= m->direction[i] * series_sliding_friction(m, i, k, row);
    }
    if (m->modes.contact[i] != RP_PLANT_APART) {
        effort += series_compliant_force(m, i, k, row);
    }
    return effort;
}

#endif
