#include "rp_equations.h"
#include "solvers.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

const struct rp_parameters problem_parameters = {
    .m1 = 2.0, .m2 = 1.0, .I1z = 0.1, .I2z = 0.05, .l1 = 0.5, .lc1 = 0.25, .a = 0.1, .g = 9.81};

void problem_rhs(const double x[4], const double u[2], double dx[4]) {
    dx[0] = x[2];
    dx[1] = x[3];
    arm_accelerations(&problem_parameters, x, x + 2, u, dx + 2);
}

static void sample_inputs(const struct problem *problem) {
    for (int i = 0; i < problem->steps; i++) {
        const double t = problem->kind == INPUTS_CHANGING ? problem->step * i : 0.0;
        const double size = problem->kind == INPUTS_ZERO ? 0.0 : 1.0;
        problem->inputs[i][0] = size * (12.0 + 3.0 * sin(5.0 * t));
        problem->inputs[i][1] = size * (4.0 + 2.0 * cos(7.0 * t));
    }
}

/* One step of the classical Runge-Kutta method, summed after Kahan; lost: what the sum still owes.
 */
static void runge_kutta_step(double h, const double u[2], double x[4], double lost[4]) {
    static const double at[4] = {0.0, 0.5, 0.5, 1.0};
    static const double weight[4] = {1.0 / 6, 1.0 / 3, 1.0 / 3, 1.0 / 6};
    double k[4] = {0.0};
    double sum[4] = {0.0};
    for (int stage = 0; stage < 4; stage++) {
        double xs[4];
        for (int j = 0; j < 4; j++) {
            xs[j] = x[j] + h * at[stage] * k[j];
        }
        problem_rhs(xs, u, k);
        for (int j = 0; j < 4; j++) {
            sum[j] += weight[stage] * k[j];
        }
    }
    for (int j = 0; j < 4; j++) {
        const double change = h * sum[j] - lost[j];
        const double moved = x[j] + change;
        lost[j] = (moved - x[j]) - change;
        x[j] = moved;
    }
}

/* Steps of 0.05 ms at most: their error, h^4 of some units, is below the rounding. */
static void solve(struct problem *problem) {
    const int parts = (int)ceil(problem->step / 5e-5 - 1e-6);
    double x[4];
    double lost[4] = {0.0};
    memcpy(x, problem->start, sizeof x);
    for (int i = 0; i < problem->steps; i++) {
        for (int part = 0; part < parts; part++) {
            runge_kutta_step(problem->step / parts, problem->inputs[i], x, lost);
        }
        memcpy(problem->reference[i], x, sizeof x);
    }
}

struct problem *problem_create(double step, int steps, enum problem_inputs kind) {
    struct problem *problem = allocate(1, sizeof *problem);
    *problem = (struct problem){
        .step = step,
        .steps = steps,
        .kind = kind,
        .start = {0.3, 0.2, 0.0, 0.0},
        .inputs = allocate((size_t)steps, sizeof problem->inputs[0]),
        .reference = allocate((size_t)steps, sizeof problem->reference[0]),
    };
    sample_inputs(problem);
    solve(problem);
    return problem;
}

void problem_destroy(struct problem *problem) {
    if (problem != NULL) {
        free(problem->inputs);
        free(problem->reference);
        free(problem);
    }
}

double problem_error(const struct problem *problem, double states[][4]) {
    double error = 0.0;
    for (int j = 0; j < 4; j++) {
        double largest = 1e-3;
        double difference = 0.0;
        for (int i = 0; i < problem->steps; i++) {
            largest = fmax(largest, fabs(problem->reference[i][j]));
            difference = fmax(difference, fabs(states[i][j] - problem->reference[i][j]));
        }
        error = fmax(error, difference / largest);
    }
    return error;
}
