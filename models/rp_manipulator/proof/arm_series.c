#include "arm_series.h"

/* The first four are rows, too. */
enum variable { Q1, Q2, W, V, M1, M2, I1Z, I2Z, L1, LC1, A, G };
enum { L = STATES, P, S, C };

_Static_assert(G + 1 == VARIABLES && C + 1 == ARM_ROWS, "the variables and rows");

/* ---- Efforts -------------------------------------------------------------------------------- */

/* pi = 0x1.921fb54442d18p+1 + 0x1.1a62633145c07p-53 within 2^-107 */
static const struct ball PI = {0x1.921fb54442d18p+1, 0x1.1a62633145c07p-53, 0x1p-107};

/* Adds A sin (w t + phase + k pi / 2) (w step)^k / k!. */
static void add_sine(const struct sine *sine, struct ball t, struct ball step,
                     struct ball coefficients[ORDERS]) {
    const struct ball turn = ball_times(sine->frequency, ball_scaled(PI, 2.0));
    const struct ball angle = ball_sum(ball_product(turn, t), ball_exact(sine->phase));
    const struct ball w = ball_product(turn, step);
    struct ball s, c;
    ball_sine_and_cosine(angle, &s, &c);
    struct ball factor = ball_exact(sine->amplitude);
    for (int k = 0; k < ORDERS; k++) {
        const struct ball turned = k % 2 ? c : s;
        const struct ball sign = k % 4 < 2 ? turned : ball_negative(turned);
        coefficients[k] = ball_sum(coefficients[k], ball_product(factor, sign));
        factor = ball_quotient(ball_product(factor, w), ball_exact(k + 1.0));
    }
}

void effort_series(const struct effort *effort, struct ball within, struct ball elapsed,
                   struct ball step, struct ball coefficients[ORDERS]) {
    struct ball power = ball_exact(1.0);
    for (int k = 0; k < ORDERS; k++) {
        coefficients[k] = ball_exact(0.0);
        // the cubic's u^(k) (t) step^k / k!, with u^(k) (t) = sum of u^(j) t^(j - k) / (j - k)!
        for (int j = 3; j >= k; j--) {
            const struct ball rest = ball_product(coefficients[k], within);
            coefficients[k] = ball_sum(ball_exact(effort->derivatives[j]),
                                       ball_quotient(rest, ball_exact(j - k + 1.0)));
        }
        if (k < 4) {
            coefficients[k] = ball_product(coefficients[k], power);
            power = ball_quotient(ball_product(power, step), ball_exact(k + 1.0));
        }
    }
    for (int i = 0; i < effort->sine_count; i++) {
        add_sine(effort->sines + i, elapsed, step, coefficients);
    }
}

/* ---- Jets ----------------------------------------------------------------------------------- */

static struct jet plus(struct jet x, struct jet y) {
    for (int d = 0; d <= x.n; d++) {
        x.of[d] = ball_sum(x.of[d], y.of[d]);
    }
    return x;
}

static struct jet scaled(struct ball factor, struct jet x) {
    for (int d = 0; d <= x.n; d++) {
        x.of[d] = ball_product(factor, x.of[d]);
    }
    return x;
}

static struct jet minus(struct jet x, struct jet y) {
    for (int d = 0; d <= x.n; d++) {
        x.of[d] = ball_difference(x.of[d], y.of[d]);
    }
    return x;
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

/* (1 / y)' = -y' / y^2 */
static struct jet reciprocal(struct jet y) {
    const struct ball value = ball_quotient(ball_exact(1.0), y.of[0]);
    y = scaled(ball_negative(ball_product(value, value)), y);
    y.of[0] = value;
    return y;
}

/* ---- Series --------------------------------------------------------------------------------- */

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

void arm_series_begin(struct arm_series *s, const struct ball variables[VARIABLES],
                      int directions) {
    struct jet x[VARIABLES];
    s->directions = directions;
    for (int i = 0; i < VARIABLES; i++) {
        x[i] = (struct jet){.n = directions, .of = {variables[i]}};
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
    ball_sine_and_cosine(variables[Q1], &sine, &cosine);
    struct jet of_sine = scaled(cosine, x[Q1]), of_cosine = scaled(ball_negative(sine), x[Q1]);
    of_sine.of[0] = sine;
    of_cosine.of[0] = cosine;
    const struct jet rows[] = {x[Q1],   x[Q2],    x[W], x[V], length, times(length, x[W]),
                               of_sine, of_cosine};
    for (int i = 0; i < ARM_ROWS; i++) {
        store(s, i, 0, rows[i]);
    }
}

/* The recurrences of ../rp_series.c, which derives them, over m2:
 *     ((F / m2) w + L P)' = (tau1 + a f2) / m2 + a P w - g (m1 lc1 / m2 + L) cos q1
 *     (v - a w)'          = f2 / m2 + P w - g sin q1 */
void arm_series_extend(struct arm_series *s, struct ball step, struct ball efforts[EFFORTS][ORDERS],
                       int k) {
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
