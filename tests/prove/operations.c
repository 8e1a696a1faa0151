/* Reads pairs of balls from standard input; writes for each all results, to be compared with exact
 * ones. */
#include "functions.h"

#include <stdio.h>

static void write_ball(struct ball x) {
    printf("%a %a %a ", x.hi, x.lo, x.radius);
}

int main(void) {
    struct ball x[2], y[2];
    while (scanf("%la %la %la %la %la %la", &x->hi, &x->lo, &x->radius, &y->hi, &y->lo,
                 &y->radius) == 6) {
        x[1] = *y;
        y[1] = *x;
        write_ball(ball_sum(*x, *y));
        write_ball(ball_difference(*x, *y));
        write_ball(ball_product(*x, *y));
        write_ball(ball_quotient(*x, *y));
        write_ball(ball_convolution(x, y, 1)); // x^2 + y^2
        for (size_t i = 0; i < sizeof(FUNCTIONS) / sizeof(FUNCTIONS[0]); i++) {
            write_ball(FUNCTIONS[i].of(*x));
        }
        printf("\n");
    }
    return 0;
}
