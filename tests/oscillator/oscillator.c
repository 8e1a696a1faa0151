#include "oscillator.h"

#include "jet.h"

#include <stdio.h>

static enum status right_hand_side(const void *values_pointer, double t, const double x[],
                                   const double u[], double dx[]) {
    const struct oscillator_values *values = values_pointer;
    dx[0] = x[1];
    dx[1] = -values->omega * values->omega * x[0] + values->gain * u[0];
    return STATUS_OK;
}

static enum status jacobian(const void *values_pointer, double t, const double x[],
                            const double u[], double J[]) {
    const struct oscillator_values *values = values_pointer;
    J[0] = 0.0;
    J[1] = -values->omega * values->omega;
    J[2] = 1.0;
    J[3] = 0.0;
    return STATUS_OK;
}

enum row { X, V, A, ROWS };

/* x' = v, v' = a = -omega^2 x + gain u, order by order. */
static enum status extend(const struct series_origin *origin, int first, int last,
                          double row[][SERIES_LENGTH]) {
    const struct oscillator_values *values = origin->values;
    for (int k = first; k <= last; k++) {
        if (k > 0) {
            row[X][k] = jet_integral(row[V], origin->time_scale, k);
            row[V][k] = jet_integral(row[A], origin->time_scale, k);
        }
        row[A][k] =
            -values->omega * values->omega * row[X][k] + values->gain * jet_input(origin, 0, k);
    }
    return STATUS_OK;
}

static const struct series series = {.row_count = ROWS, .extend = extend};

static enum status outputs(void *values_pointer, double t) {
    struct oscillator_values *values = values_pointer;
    const double stretch = values->omega * values->x;
    values->a = -values->omega * stretch + values->gain * values->u;
    values->energy = 0.5 * (values->v * values->v + stretch * stretch);
    return STATUS_OK;
}

/* Product rule, twice, for a = -omega^2 x + gain u and energy = (v^2 + omega^2 x^2) / 2 with omega
 * and gain constant along the curve. */
static enum status propagate(const void *values_pointer, double t, double dt, void *first_pointer,
                             void *second_pointer) {
    const struct oscillator_values *p = values_pointer;
    struct oscillator_values *d = first_pointer;
    struct oscillator_values *dd = second_pointer;
    const double omega2 = p->omega * p->omega;
    d->a = -omega2 * d->x + p->gain * d->u;
    d->energy = p->v * d->v + omega2 * p->x * d->x;
    if (dd != NULL) {
        dd->a = -omega2 * dd->x + p->gain * dd->u;
        dd->energy = d->v * d->v + p->v * dd->v + omega2 * (d->x * d->x + p->x * dd->x);
    }
    return STATUS_OK;
}

static enum status check_parameters(const void *values_pointer, char *text, size_t size) {
    const struct oscillator_values *values = values_pointer;
    if (values->omega > 0.0) {
        return STATUS_OK;
    }
    snprintf(text, size, "omega = %g is refused: it must be above 0", values->omega);
    return STATUS_INVALID_PARAMETERS;
}

const struct model oscillator_model = {
    .values_size = sizeof(struct oscillator_values),
    .parameters = {offsetof(struct oscillator_values, omega), 2 * sizeof(double)},
    .inputs = {offsetof(struct oscillator_values, u), sizeof(double)},
    .states = {offsetof(struct oscillator_values, x), 2 * sizeof(double)},
    .derivatives = {offsetof(struct oscillator_values, v), 2 * sizeof(double)},
    .right_hand_side = right_hand_side,
    .jacobian = jacobian,
    .series = &series,
    .outputs = outputs,
    .propagate = propagate,
    .check_parameters = check_parameters,
};
