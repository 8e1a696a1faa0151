#include "oscillator_by_hand.h"

#include <math.h>
#include <stdio.h>

/* ---- The model ------------------------------------------------------------------------------ */

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
            row[X][k] = origin->time_scale / k * row[V][k - 1];
            row[V][k] = origin->time_scale / k * row[A][k - 1];
        }
        const double u = k < SERIES_INPUT_LENGTH ? origin->inputs[0][k] : 0.0;
        row[A][k] = -values->omega * values->omega * row[X][k] + values->gain * u;
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
static enum status derivatives(const void *values_pointer, double t, double dt, void *first_pointer,
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
    .dx = {offsetof(struct oscillator_values, v), 2 * sizeof(double)},
    .right_hand_side = right_hand_side,
    .jacobian = jacobian,
    .series = &series,
    .outputs = outputs,
    .derivatives = derivatives,
    .check_parameters = check_parameters,
};

/* ---- Its variables --------------------------------------------------------------------------- */

#define OF_MODEL(field)                                                                            \
    VARIABLE_FLOAT64, VARIABLE_OF_MODEL, offsetof(struct oscillator_values, field)
#define OF_INSTANCE(type, field) type, VARIABLE_OF_INSTANCE, offsetof(struct instance_values, field)
#define PARAMETER                CAUSALITY_PARAMETER, VARIABILITY_TUNABLE, INITIAL_EXACT
#define FIXED                    CAUSALITY_PARAMETER, VARIABILITY_FIXED, INITIAL_EXACT
#define STATE                    CAUSALITY_OUTPUT, VARIABILITY_CONTINUOUS, INITIAL_EXACT
#define INPUT                    CAUSALITY_INPUT, VARIABILITY_CONTINUOUS, INITIAL_NONE
#define OUTPUT                   CAUSALITY_OUTPUT, VARIABILITY_CONTINUOUS, INITIAL_CALCULATED
#define COUNTER                  CAUSALITY_LOCAL, VARIABILITY_DISCRETE, INITIAL_CALCULATED
#define TIME                     CAUSALITY_INDEPENDENT, VARIABILITY_CONTINUOUS, INITIAL_NONE
#define ANY                      -INFINITY, INFINITY, 1.0

static const struct variable variables[] = {
    {0, "time", OF_INSTANCE(VARIABLE_FLOAT64, time), TIME, 0.0, ANY},
    {1, "omega", OF_MODEL(omega), PARAMETER, 2.0, -10.0, 100.0, 1.0},
    {2, "gain", OF_MODEL(gain), FIXED, 1.0, ANY},
    {10, "x", OF_MODEL(x), STATE, 1.0, ANY},
    {11, "v", OF_MODEL(v), STATE, 0.0, ANY},
    {20, "u", OF_MODEL(u), INPUT, 0.0, ANY},
    {30, "energy", OF_MODEL(energy), OUTPUT, 0.0, ANY},
    {31, "a", OF_MODEL(a), OUTPUT, 0.0, ANY},
    {80, "steps", OF_INSTANCE(VARIABLE_INT32, solver_steps), COUNTER, 0.0, ANY},
    {81, "evaluations", OF_INSTANCE(VARIABLE_INT32, solver_rhs_evaluations), COUNTER, 0.0, ANY},
    {82, "relative_tolerance", OF_INSTANCE(VARIABLE_FLOAT64, relative_tolerance), FIXED, 0.0, 0.0,
     INFINITY, 1.0},
    {83, "max_internal_steps", OF_INSTANCE(VARIABLE_INT32, max_internal_steps), FIXED, 100000.0,
     1.0, INFINITY, 1.0},
    {84, "effective_relative_tolerance",
     OF_INSTANCE(VARIABLE_FLOAT64, effective_relative_tolerance), CAUSALITY_LOCAL,
     VARIABILITY_FIXED, INITIAL_CALCULATED, 0.0, ANY},
    {90, "solver_method", OF_INSTANCE(VARIABLE_ENUMERATION, solver_method), FIXED, 1.0, 1.0, 4.0,
     1.0},
    {91, "max_step", OF_INSTANCE(VARIABLE_FLOAT64, max_step), FIXED, 0.0, 0.0, INFINITY, 1.0},
};

static const short row_of_reference[] = {
    0,  1,  2,  -1, -1, -1, -1, -1, -1, -1, 3,  4,  -1, -1, -1, -1, -1, -1, -1, -1, 5,  -1, -1,
    -1, -1, -1, -1, -1, -1, -1, 6,  7,  -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1,
    -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1,
    -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, 8,  9,  10, 11, 12, -1, -1, -1, -1, -1, 13, 14,
};

const struct model_description oscillator_description = {
    .name = "Oscillator",
    .guid = "{oscillator}",
    .default_tolerance = 1e-8,
    .model = &oscillator_model,
    .variables = variables,
    .variable_count = sizeof variables / sizeof variables[0],
    .row_of_reference = row_of_reference,
    .reference_count = sizeof row_of_reference / sizeof row_of_reference[0],
};

/* ---- Its solution ---------------------------------------------------------------------------- */

void oscillator_solution(double omega, double u, double t, const double start[2], double end[2]) {
    const double rest = u / (omega * omega);
    const double c = cos(omega * t);
    const double s = sin(omega * t);
    const double x = rest + (start[0] - rest) * c + start[1] / omega * s;
    const double v = -(start[0] - rest) * omega * s + start[1] * c;
    end[0] = x;
    end[1] = v;
}
