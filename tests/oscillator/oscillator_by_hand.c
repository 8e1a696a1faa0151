/* The oscillator's table of variables, written by hand, and its solution: for the tests of src/,
 * which must not depend on the generator. */
#include "oscillator_by_hand.h"

#include <math.h>

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

void oscillator_solution(double omega, double u, double t, const double start[2], double end[2]) {
    const double rest = u / (omega * omega);
    const double c = cos(omega * t);
    const double s = sin(omega * t);
    const double x = rest + (start[0] - rest) * c + start[1] / omega * s;
    const double v = -(start[0] - rest) * omega * s + start[1] * c;
    end[0] = x;
    end[1] = v;
}
