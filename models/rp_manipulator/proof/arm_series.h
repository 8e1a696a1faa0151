/* Taylor coefficients in balls: of efforts and of the arm's motion, with its derivatives along the
 * variables at the origin. */
#pragma once

#include "ball.h"

enum {
    STATES = 4,                      /* q1, q2, q1', q2' */
    PARAMETERS = 8,                  /* m1, m2, I1z, I2z, l1, lc1, a, g */
    VARIABLES = STATES + PARAMETERS, /* in this order */
    EFFORTS = 2,                     /* tau1, f2 */
    LAST_ORDER = 31,
    ORDERS = LAST_ORDER + 1,
    ARM_ROWS = 8,
    SINES = 16
};

struct arm_problem {
    double start;                     /* s */
    struct ball variables[VARIABLES]; /* at the start */
    int directions;                   /* 4, or 12 where parameters are uncertain */
    double cubic[EFFORTS][4]; /* value at the begin of a communication step, per s, s2, s3 */
    double sines[SINES][4];   /* effort, amplitude, frequency in Hz, phase in rad at time 0 */
    int sine_count;
};

/* Of a step, in s: from its begin to its end, and since the last communication point and `start`.
 */
struct step_times {
    struct ball length, within, elapsed;
};

/* A value and its derivatives along the first n variables. */
struct jet {
    int n;
    struct ball of[1 + VARIABLES];
};

/* Coefficients of t^k, times (the step)^k. */
struct arm_series {
    int directions;
    struct ball row[ARM_ROWS][1 + VARIABLES][ORDERS]; /* the states, then what they determine */
    struct jet a, g, per_m2, offset, per_inertia;
};

/* The first four are rows, too. */
enum variable { Q1, Q2, W, V, M1, M2, I1Z, I2Z, L1, LC1, A, G };
enum { L = STATES, P, S, C };

_Static_assert(G + 1 == VARIABLES && C + 1 == ARM_ROWS, "the variables and rows");

/* 2 pi = 0x1.921fb54442d18p+2 + 0x1.1a62633145c07p-52 within 2^-106 */
static const struct ball TURN = {0x1.921fb54442d18p+2, 0x1.1a62633145c07p-52, 0x1p-106};

/* Adds derivatives k of a sine, A w^k sin (w t + phase + k pi / 2). */
static void add_sine(const double sine[4], struct ball t, struct ball derivatives[ORDERS]) {
    const struct ball w = ball_product(ball_exact(sine[2]), TURN);
    struct ball factor = ball_exact(sine[1]), s, c;
    ball_sine_and_cosine(ball_sum(ball_product(w, t), ball_exact(sine[3])), &s, &c);
    for (int k = 0; k < ORDERS; k++) {
        const struct ball term = ball_product(factor, k % 2 ? c : s);
        derivatives[k] = ball_sum(derivatives[k], k % 4 < 2 ? term : ball_negative(term));
        factor = ball_product(factor, w);
    }
}

/* All orders of the efforts at a time after the begin of a step, or over all times of a ball. */
static void arm_efforts(const struct arm_problem *problem, const struct step_times *times,
                        struct ball after, struct ball efforts[EFFORTS][ORDERS]) {
    const struct ball within = ball_sum(times->within, after);
    for (int e = 0; e < EFFORTS; e++) {
        struct ball *u = efforts[e];
        for (int k = 0; k < ORDERS; k++) {
            u[k] = ball_exact(0.0);
            // derivative k of the cubic: the sum of u^(j) t^(j - k) / (j - k)!
            for (int j = 3; j >= k; j--) {
                u[k] = ball_quotient(ball_product(u[k], within), ball_exact(j - k + 1.0));
                u[k] = ball_sum(ball_exact(problem->cubic[e][j]), u[k]);
            }
        }
        for (int i = 0; i < problem->sine_count; i++) {
            if (problem->sines[i][0] == e) {
                add_sine(problem->sines[i], ball_sum(times->elapsed, after), u);
            }
        }
        struct ball power = ball_exact(1.0); // (the step)^k / k!
        for (int k = 0; k < (problem->sine_count > 0 ? ORDERS : 4); k++) {
            u[k] = ball_product(u[k], power);
            power = ball_quotient(ball_product(power, times->length), ball_exact(k + 1.0));
        }
    }
}

static struct jet plus(struct jet x, struct jet y) {
    for (int d = 0; d <= x.n; d++) {
        x.of[d] = ball_sum(x.of[d], y.of[d]);
    }
    return x;
}

static struct jet minus(struct jet x, struct jet y) {
    for (int d = 0; d <= x.n; d++) {
        x.of[d] = ball_difference(x.of[d], y.of[d]);
    }
    return x;
}

static struct jet scaled(struct ball factor, struct jet x) {
    for (int d = 0; d <= x.n; d++) {
        x.of[d] = ball_product(factor, x.of[d]);
    }
    return x;
}

/* The coefficient of an order of a row, with its derivatives; store writes it there. */
static struct jet coefficient(const struct arm_series *s, int row, int order) {
    struct jet x;
    x.n = s->directions;
    for (int d = 0; d <= x.n; d++) {
        x.of[d] = s->row[row][d][order];
    }
    return x;
}

static void store(struct arm_series *s, int row, int order, struct jet x) {
    for (int d = 0; d <= x.n; d++) {
        s->row[row][d][order] = x.of[d];
    }
}

/* Sum of x_(i + ahead) y_(n - i) over i = 0 .. n. */
static struct jet convolution(const struct arm_series *s, int x, int ahead, int y, int n) {
    struct jet sum;
    sum.n = s->directions;
    sum.of[0] = ball_convolution(s->row[x][0] + ahead, s->row[y][0], n);
    for (int d = 1; d <= sum.n; d++) {
        sum.of[d] = ball_sum(ball_convolution(s->row[x][d] + ahead, s->row[y][0], n),
                             ball_convolution(s->row[x][0] + ahead, s->row[y][d], n));
    }
    return sum;
}

/* Fast where x depends on few variables. */
static struct jet times(struct jet x, struct jet y) {
    const struct jet by_y = scaled(x.of[0], y);
    for (int d = 1; d <= x.n; d++) {
        const bool depends = x.of[d].hi != 0.0 || x.of[d].radius > 0.0;
        x.of[d] = depends ? ball_sum(ball_product(x.of[d], y.of[0]), by_y.of[d]) : by_y.of[d];
    }
    x.of[0] = by_y.of[0];
    return x;
}

/* f(x) of a function with its derivative there */
static struct jet composed(struct ball value, struct ball slope, struct jet x) {
    x = scaled(slope, x);
    x.of[0] = value;
    return x;
}

static struct jet reciprocal(struct jet x) {
    const struct ball value = ball_quotient(ball_exact(1.0), x.of[0]);
    return composed(value, ball_negative(ball_product(value, value)), x);
}

/* Order 0, with derivatives along the first `directions` variables. exact: from midpoints. */
static void arm_series_begin(struct arm_series *s, const struct arm_problem *problem,
                             const struct ball states[STATES], bool exact, int directions) {
    struct jet x[VARIABLES];
    s->directions = directions;
    for (int i = 0; i < VARIABLES; i++) {
        const struct ball value = i < STATES ? states[i] : problem->variables[i];
        x[i] = (struct jet){.n = directions, .of = {exact ? ball_midpoint(value) : value}};
        if (i < directions) {
            x[i].of[1 + i] = ball_exact(1.0);
        }
    }
    s->a = x[A];
    s->g = x[G];
    s->per_m2 = reciprocal(x[M2]);
    s->offset = times(s->per_m2, times(x[M1], x[LC1]));
    const struct jet bodies = times(s->per_m2, plus(x[I1Z], x[I2Z]));
    const struct jet fixed = plus(bodies, times(x[LC1], s->offset));
    const struct jet length = plus(x[L1], x[Q2]);
    s->per_inertia = reciprocal(plus(fixed, times(length, length)));

    struct ball sine, cosine;
    ball_sine_and_cosine(x[Q1].of[0], &sine, &cosine);
    for (int i = 0; i < STATES; i++) {
        store(s, i, 0, x[i]);
    }
    store(s, L, 0, length);
    store(s, P, 0, times(length, x[W]));
    store(s, S, 0, composed(sine, cosine, x[Q1]));
    store(s, C, 0, composed(cosine, ball_negative(sine), x[Q1]));
}

/* The next order of the motion, from 1 on, by the recurrences that ../rp_series.c derives, over m2:
 *     ((F / m2) w + L P)' = (tau1 + a f2) / m2 + a P w - g (m1 lc1 / m2 + L) cos q1
 *     (v - a w)'          = f2 / m2 + P w - g sin q1 */
static void arm_series_extend(struct arm_series *s, struct ball step,
                              struct ball efforts[EFFORTS][ORDERS], int k) {
    const int i = k - 1;
    const struct ball h = ball_quotient(step, ball_exact(k));
    store(s, Q1, k, scaled(h, coefficient(s, W, i)));
    store(s, Q2, k, scaled(h, coefficient(s, V, i)));
    store(s, L, k, coefficient(s, Q2, k));
    store(s, S, k, scaled(h, convolution(s, W, 0, C, i)));
    store(s, C, k, scaled(ball_negative(h), convolution(s, W, 0, S, i)));

    const struct jet push = plus(scaled(efforts[1][i], s->per_m2), convolution(s, P, 0, W, i));
    const struct jet arms =
        plus(times(s->offset, coefficient(s, C, i)), convolution(s, L, 0, C, i));
    const struct jet moment = plus(scaled(efforts[0][i], s->per_m2), times(s->a, push));
    const struct jet momentum = scaled(h, minus(moment, times(s->g, arms)));
    const struct jet slide = scaled(h, minus(push, times(s->g, coefficient(s, S, i))));

    // momentum of this order = (F / m2) w + L0 P + sum with P = L0 w + sum, solved for w
    const struct jet L0 = coefficient(s, L, 0);
    const struct jet L_w = convolution(s, L, 1, W, i);
    const struct jet known = plus(times(L0, L_w), convolution(s, L, 1, P, i));
    const struct jet w = times(s->per_inertia, minus(momentum, known));
    store(s, W, k, w);
    store(s, P, k, plus(times(L0, w), L_w));
    store(s, V, k, plus(slide, times(s->a, w)));
}

/* The value of a polynomial at the end of the step. */
static struct ball series_end(const struct ball coefficients[ORDERS], int order) {
    struct ball sum = coefficients[order];
    for (int k = order - 1; k >= 0; k--) {
        sum = ball_sum(sum, coefficients[k]);
    }
    return sum;
}
