#include "problem.h"

/* 0 x is 0 for finite values only. */
bool problem_are_finite(const double values[], size_t count) {
    double sum = 0.0;
    for (size_t i = 0; i < count; i++) {
        sum += 0.0 * values[i];
    }
    return sum == 0.0;
}

static enum status checked(struct problem *problem, double t, enum status status,
                           const double values[], size_t count) {
    if (status == STATUS_OK && problem_are_finite(values, count)) {
        return STATUS_OK;
    }
    problem->failed_at = t;
    return STATUS_NOT_FINITE;
}

enum status problem_rhs(struct problem *problem, double t, const double x[], double dx[]) {
    const struct ode *ode = &problem->ode;
    problem->evaluation_count++;
    return checked(problem, t, ode->rhs(t, x, dx, ode->context), dx, ode->state_count);
}

enum status problem_jacobian(struct problem *problem, double t, const double x[], double J[]) {
    const struct ode *ode = &problem->ode;
    return checked(problem, t, ode->jacobian(t, x, J, ode->context), J,
                   ode->state_count * ode->state_count);
}

bool problem_is_stuck(const struct problem *problem) {
    return problem->failed_at >= problem->reached;
}
