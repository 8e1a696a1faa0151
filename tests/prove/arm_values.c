/* Reads states, parameters and the efforts' cubics of arms, and writes balls: coefficients of t^k
 * of the states' motion from the start, order by order from 1 on, then the outputs at the start. */
#include "arm_outputs.h"

#include <stdio.h>

enum { LAST = 8, NUMBERS = VARIABLES + 4 * EFFORTS };

static void write_ball(struct ball x) {
    printf(" %a %a %a", x.hi, x.lo, x.radius);
}

int main(void) {
    static struct arm_problem problem; // too large for the stack of every system
    static struct arm_series series;
    double numbers[NUMBERS];
    int count = 0;
    while (scanf("%la", &numbers[count]) == 1) {
        count = (count + 1) % NUMBERS;
        if (count > 0) {
            continue;
        }
        for (int i = 0; i < VARIABLES; i++) {
            problem.variables[i] = ball_exact(numbers[i]);
        }
        for (int i = 0; i < 4 * EFFORTS; i++) {
            problem.cubic[i / 4][i % 4] = numbers[VARIABLES + i];
        }
        const struct ball zero = ball_exact(0.0), second = ball_exact(1.0);
        const struct step_times times = {.length = second, .within = zero, .elapsed = zero};
        struct ball efforts[EFFORTS][ORDERS], at_start[EFFORTS], outputs[OUTPUTS];
        arm_efforts(&problem, &times, zero, efforts);
        arm_series_begin(&series, &problem, problem.variables, false, 0);
        for (int k = 1; k <= LAST; k++) {
            arm_series_extend(&series, second, efforts, k);
            for (int i = 0; i < STATES; i++) {
                write_ball(series.row[i][0][k]);
            }
        }
        arm_efforts_at(&problem, 0.0, zero, at_start);
        arm_outputs(&problem, problem.variables, at_start, outputs);
        for (int i = 0; i < OUTPUTS; i++) {
            write_ball(outputs[i]);
        }
        printf("\n");
    }
    return 0;
}
