#include "fmu_polynomials.h"

#include <unity.h>

const double fmu_slide_mass = 2.0;
const struct fmu_polynomial fmu_slide_forces[FMU_SLIDE_FORCES] = {
    {{1.5, 0.0, 0.0, 0.0}},  {{0.0, 4.0, 0.0, 0.0}},     {{0.0, 0.0, -9.0, 0.0}},
    {{0.0, 0.0, 0.0, 30.0}}, {{-1.0, 3.0, -20.0, 50.0}},
};

const struct fmu_polynomial fmu_torque = {{6.0, -40.0, 300.0, -2000.0}};
const struct fmu_polynomial fmu_force = {{-3.0, 25.0, 200.0, 5000.0}};

static const double finest_tolerance = 1e-12;

double fmu_polynomial_integral(const struct fmu_polynomial *polynomial, int order, double s) {
    double sum = 0.0;
    for (int k = 0; k < 4; k++) {
        double term = k + order < 0 ? 0.0 : polynomial->d[k];
        for (int i = 1; i <= k + order; i++) {
            term *= s / i;
        }
        sum += term;
    }
    return sum;
}

void fmu_set_polynomial(fmi2Component component, fmi2ValueReference reference,
                        const struct fmu_polynomial *polynomial) {
    fmu_set(component, reference, polynomial->d[0]);
    for (fmi2Integer k = 1; k < 4; k++) {
        if (polynomial->d[k] != 0.0) {
            ASSERT_OK(fmu.SetRealInputDerivatives(component, &reference, 1, &k, &polynomial->d[k]));
        }
    }
}

fmi2Component fmu_slide(struct fmu_log *log, double start) {
    const fmi2Component c = fmu_instantiate(log, false);
    fmu_set(c, RP_MANIPULATOR_a, 0.0);
    fmu_set(c, RP_MANIPULATOR_g, 0.0);
    fmu_set(c, RP_MANIPULATOR_m2, fmu_slide_mass);
    fmu_set(c, RP_MANIPULATOR_relative_tolerance, finest_tolerance);
    ASSERT_OK(fmu.SetupExperiment(c, fmi2False, 0.0, start, fmi2False, 0.0));
    return c;
}

void fmu_slide_begin(fmi2Component component) {
    ASSERT_OK(fmu.EnterInitializationMode(component));
    ASSERT_OK(fmu.ExitInitializationMode(component));
}

fmi2Component fmu_swinging(struct fmu_log *log) {
    const fmi2Component c = fmu_instantiate(log, false);
    fmu_set(c, RP_MANIPULATOR_relative_tolerance, finest_tolerance);
    fmu_set(c, RP_MANIPULATOR_dq1, 2.0);
    fmu_set(c, RP_MANIPULATOR_dq2, -0.5);
    fmu_initialize(c, 0.0, 0.0);
    return c;
}
