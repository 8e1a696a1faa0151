#include "effort.h"

/* pi = 0x1.921fb54442d18p+1 + 0x1.1a62633145c07p-53 within 2^-107 */
static const struct ball PI = {0x1.921fb54442d18p+1, 0x1.1a62633145c07p-53, 0x1p-107};

/* Of the cubic: u^(k) (t) step^k / k! with u^(k) (t) = sum of u^(k + j) t^j / j!. */
static struct ball cubic(const double derivatives[4], struct ball t, int k) {
    struct ball sum = ball_exact(0.0);
    for (int j = 3 - k; j >= 0; j--) {
        const struct ball rest = ball_quotient(ball_product(sum, t), ball_exact(j + 1.0));
        sum = ball_sum(ball_exact(derivatives[k + j]), rest);
    }
    return sum;
}

/* Adds A sin (w t + phase + k pi / 2) (w step)^k / k!. */
static void add_sine(const struct sine *sine, struct ball t, struct ball step, int last,
                     struct ball coefficients[ORDERS]) {
    const struct ball turn = ball_times(sine->frequency, ball_scaled(PI, 2.0));
    const struct ball angle = ball_sum(ball_product(turn, t), ball_exact(sine->phase));
    const struct ball w = ball_product(turn, step);
    struct ball s, c;
    ball_sine_and_cosine(angle, &s, &c);
    struct ball factor = ball_exact(sine->amplitude);
    for (int k = 0; k <= last; k++) {
        const struct ball turned = k % 2 ? c : s;
        const struct ball sign = k % 4 < 2 ? turned : ball_negative(turned);
        coefficients[k] = ball_sum(coefficients[k], ball_product(factor, sign));
        factor = ball_quotient(ball_product(factor, w), ball_exact(k + 1.0));
    }
}

void effort_series(const struct effort *effort, struct ball within, struct ball elapsed,
                   struct ball step, int last, struct ball coefficients[ORDERS]) {
    struct ball power = ball_exact(1.0);
    for (int k = 0; k <= last; k++) {
        coefficients[k] = ball_exact(0.0);
        if (k < 4) {
            coefficients[k] = ball_product(cubic(effort->derivatives, within, k), power);
            power = ball_quotient(ball_product(power, step), ball_exact(k + 1.0));
        }
    }
    for (int i = 0; i < effort->sine_count; i++) {
        add_sine(effort->sines + i, elapsed, step, last, coefficients);
    }
}
