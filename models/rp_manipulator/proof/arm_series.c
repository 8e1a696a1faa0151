/* The recurrences of ../rp_series.c, in balls: its comment derives them. */
#include "arm_series.h"

enum row { Q1, Q2, W, V, L, P, S, C };

_Static_assert(C + 1 == ARM_ROWS, "the rows");

/* ---- Jets ----------------------------------------------------------------------------------- */

typedef struct ball (*operation)(struct ball, struct ball);

static struct jet each(int n, operation apply, const struct jet *x, const struct jet *y) {
    struct jet result = {{{0}}};
    for (int d = 0; d <= n; d++) {
        result.of[d] = apply(x->of[d], y->of[d]);
    }
    return result;
}

static struct jet plus(int n, struct jet x, struct jet y) {
    return each(n, ball_sum, &x, &y);
}

static struct jet minus(int n, struct jet x, struct jet y) {
    return each(n, ball_difference, &x, &y);
}

static struct jet scaled(int n, struct ball factor, struct jet x) {
    for (int d = 0; d <= n; d++) {
        x.of[d] = ball_product(factor, x.of[d]);
    }
    return x;
}

static struct jet times(int n, struct jet x, struct jet y) {
    struct jet result = {{{0}}};
    result.of[0] = ball_product(x.of[0], y.of[0]);
    for (int d = 1; d <= n; d++) {
        result.of[d] = ball_sum(ball_product(x.of[d], y.of[0]), ball_product(x.of[0], y.of[d]));
    }
    return result;
}

/* Of a parameter, which does not depend on the states. */
static struct jet times_parameter(int n, struct jet p, struct jet y) {
    struct jet result = {{{0}}};
    for (int d = 0; d <= n; d++) {
        result.of[d] = ball_product(p.of[0], y.of[d]);
        if (d > STATES) {
            result.of[d] = ball_sum(ball_product(p.of[d], y.of[0]), result.of[d]);
        }
    }
    return result;
}

/* (1 / y)' = -y' / y^2 */
static struct jet reciprocal(int n, struct jet y) {
    struct jet result = {{{0}}};
    result.of[0] = ball_quotient(ball_exact(1.0), y.of[0]);
    const struct ball square = ball_product(result.of[0], result.of[0]);
    for (int d = 1; d <= n; d++) {
        result.of[d] = ball_negative(ball_product(y.of[d], square));
    }
    return result;
}

/* ---- Series --------------------------------------------------------------------------------- */

static struct jet coefficient(const struct arm_series *s, enum row row, int order) {
    struct jet x = {{{0}}};
    for (int d = 0; d <= s->directions; d++) {
        x.of[d] = s->row[row][d][order];
    }
    return x;
}

static void store(struct arm_series *s, enum row row, int order, struct jet x) {
    for (int d = 0; d <= s->directions; d++) {
        s->row[row][d][order] = x.of[d];
    }
}

/* Sum of x_(i + ahead) y_(n - i) over i = 0 .. n. */
static struct jet convolution(const struct arm_series *s, enum row x, int ahead, enum row y,
                              int n) {
    struct jet sum = {{{0}}};
    sum.of[0] = ball_convolution(s->row[x][0] + ahead, s->row[y][0], n);
    for (int d = 1; d <= s->directions; d++) {
        sum.of[d] = ball_sum(ball_convolution(s->row[x][d] + ahead, s->row[y][0], n),
                             ball_convolution(s->row[x][0] + ahead, s->row[y][d], n));
    }
    return sum;
}

static struct jet parameter(const struct arm_origin *origin, int index) {
    struct jet p = {{{0}}};
    p.of[0] = origin->parameters[index];
    for (int d = STATES; d < origin->directions; d++) {
        p.of[1 + d] = ball_exact(origin->along[d - STATES] == index ? 1.0 : 0.0);
    }
    return p;
}

static void take_parameters(struct arm_series *s, const struct arm_origin *origin) {
    const int n = s->directions;
    const struct jet m1 = parameter(origin, 0), lc1 = parameter(origin, 5);
    s->m2 = parameter(origin, 1);
    s->l1 = parameter(origin, 4);
    s->a = parameter(origin, 6);
    s->g = parameter(origin, 7);
    s->m1_lc1 = times(n, m1, lc1);
    s->per_m2 = reciprocal(n, s->m2);
    const struct jet bodies = plus(n, parameter(origin, 2), parameter(origin, 3));
    s->fixed_inertia = plus(n, times(n, s->m1_lc1, lc1), bodies);
}

void arm_series_begin(struct arm_series *s, const struct arm_origin *origin) {
    const int n = s->directions = origin->directions;
    take_parameters(s, origin);
    for (enum row i = Q1; i <= V; i++) {
        struct jet x = {{{0}}};
        x.of[0] = origin->states[i];
        for (int d = 0; d < n; d++) {
            x.of[1 + d] = ball_exact(d == (int)i ? 1.0 : 0.0);
        }
        store(s, i, 0, x);
    }
    const struct jet q1 = coefficient(s, Q1, 0), q2 = coefficient(s, Q2, 0);
    struct jet sine = {{{0}}}, cosine = {{{0}}};
    ball_sine_and_cosine(q1.of[0], &sine.of[0], &cosine.of[0]);
    for (int d = 1; d <= n; d++) {
        sine.of[d] = ball_product(cosine.of[0], q1.of[d]);
        cosine.of[d] = ball_negative(ball_product(sine.of[0], q1.of[d]));
    }
    const struct jet length = plus(n, s->l1, q2);
    store(s, S, 0, sine);
    store(s, C, 0, cosine);
    store(s, L, 0, length);
    store(s, P, 0, times(n, length, coefficient(s, W, 0)));
    const struct jet slide = times_parameter(n, s->m2, times(n, length, length));
    s->per_inertia = reciprocal(n, plus(n, s->fixed_inertia, slide));
}

void arm_series_extend(struct arm_series *s, struct ball step, struct ball efforts[EFFORTS][ORDERS],
                       int k) {
    const int n = s->directions;
    const int i = k - 1;
    const struct ball h = ball_quotient(step, ball_exact(k));
    store(s, Q1, k, scaled(n, h, coefficient(s, W, i)));
    store(s, Q2, k, scaled(n, h, coefficient(s, V, i)));
    store(s, L, k, coefficient(s, Q2, k));
    store(s, S, k, scaled(n, h, convolution(s, W, 0, C, i)));
    store(s, C, k, scaled(n, ball_negative(h), convolution(s, W, 0, S, i)));

    struct jet tau1 = {{{0}}}, f2 = {{{0}}};
    tau1.of[0] = efforts[0][i];
    f2.of[0] = efforts[1][i];
    const struct jet P_w = convolution(s, P, 0, W, i);
    const struct jet L_c = convolution(s, L, 0, C, i);
    const struct jet weight = plus(n, times_parameter(n, s->m1_lc1, coefficient(s, C, i)),
                                   times_parameter(n, s->m2, L_c));
    const struct jet push = plus(n, f2, times_parameter(n, s->m2, P_w));
    const struct jet turning =
        minus(n, plus(n, tau1, times_parameter(n, s->a, push)), times_parameter(n, s->g, weight));
    const struct jet sliding = minus(n, plus(n, times_parameter(n, s->per_m2, f2), P_w),
                                     times_parameter(n, s->g, coefficient(s, S, i)));
    const struct jet N = scaled(n, h, turning);
    const struct jet y = scaled(n, h, sliding);

    const struct jet L0 = coefficient(s, L, 0);
    const struct jet L_w = convolution(s, L, 1, W, i);
    const struct jet L_P = convolution(s, L, 1, P, i);
    const struct jet known = times_parameter(n, s->m2, plus(n, times(n, L0, L_w), L_P));
    const struct jet w = times(n, minus(n, N, known), s->per_inertia);
    store(s, W, k, w);
    store(s, P, k, plus(n, times(n, L0, w), L_w));
    store(s, V, k, plus(n, y, times_parameter(n, s->a, w)));
}
