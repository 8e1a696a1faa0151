#include "fuzz_physics.h"

#include <float.h>
#include <math.h>

#define VALUE(values, name) fuzz_value(values, RP_MANIPULATOR_##name)

/* ---- Newton-Euler ---------------------------------------------------------------------------- */

/* terms: sum of magnitudes; factors: what a value that underflowed is multiplied with at most. */
static void check_load(const char *name, double load, double effort, double terms, double factors,
                       const struct fuzz_values *values) {
    // a dozen roundings a term
    const double bound = 64.0 * (DBL_EPSILON * terms + DBL_TRUE_MIN * factors);
    if (isfinite(terms) && !(fabs(load - effort) <= bound)) {
        fuzz_fail(
            "%s = %.17g by Newton-Euler, %.17g by Euler-Lagrange, bound %g (m1 %g m2 %g I1z %g "
            "I2z %g l1 %g lc1 %g a %g g %g q %g %g dq %g %g)",
            name, load, effort, bound, VALUE(values, m1), VALUE(values, m2), VALUE(values, I1z),
            VALUE(values, I2z), VALUE(values, l1), VALUE(values, lc1), VALUE(values, a),
            VALUE(values, g), VALUE(values, q1), VALUE(values, q2), VALUE(values, dq1),
            VALUE(values, dq2));
    }
}

void fuzz_check_newton_euler(const struct fuzz_values *values, bool inputs_are_held) {
    const double m1 = VALUE(values, m1);
    const double m2 = VALUE(values, m2);
    const double lc1 = VALUE(values, lc1);
    const double a = fabs(VALUE(values, a));
    const double g = fabs(VALUE(values, g));
    const double inertia = VALUE(values, I1z) + VALUE(values, I2z);
    const double dq1 = fabs(VALUE(values, dq1));
    const double dq2 = fabs(VALUE(values, dq2));
    const double ddq1 = fabs(VALUE(values, ddq1));
    const double ddq2 = fabs(VALUE(values, ddq2));
    // after a step in which an input moved, it reads as the value at the step's beginning
    const double tau1 = inputs_are_held ? VALUE(values, tau1) : 0.0;
    const double f2 = inputs_are_held ? VALUE(values, f2) : 0.0;
    // (24), (25) and (22) of the notes with each term by its magnitude; L = l1 + q2 in its parts
    const double L = VALUE(values, l1) + fabs(VALUE(values, q2));
    const double along_x = m2 * (L * ddq1 + a * dq1 * dq1 + 2.0 * dq1 * dq2 + g);
    const double along_z = m2 * (ddq2 + a * ddq1 + L * dq1 * dq1 + g) + fabs(f2);
    const double about_y = L * along_x + 2.0 * lc1 * along_x + m1 * lc1 * (lc1 * ddq1 + g) +
                           a * along_z + inertia * ddq1 + fabs(tau1) + L * m2 * dq1 * a * dq1;
    const double lengths = 1.0 + L + lc1 + a;
    const double factors = (1.0 + dq1 + dq2) * (1.0 + lengths * (lengths * (m1 + m2) + inertia));
    const double by_lagrange1 = VALUE(values, D11) * VALUE(values, ddq1) +
                                VALUE(values, D12) * VALUE(values, ddq2) +
                                VALUE(values, coriolis1) + VALUE(values, gravity1);
    const double by_lagrange2 = VALUE(values, D12) * VALUE(values, ddq1) +
                                VALUE(values, D22) * VALUE(values, ddq2) +
                                VALUE(values, coriolis2) + VALUE(values, gravity2);
    check_load("tau1_y", VALUE(values, tau1_y), by_lagrange1, about_y, factors, values);
    check_load("f2_z", VALUE(values, f2_z), by_lagrange2, along_z, factors, values);
    if (inputs_are_held) {
        check_load("tau1_y", VALUE(values, tau1_y), tau1, about_y, factors, values);
        check_load("f2_z", VALUE(values, f2_z), f2, along_z, factors, values);
    }
}

/* ---- Energy ---------------------------------------------------------------------------------- */

/* Work of the held inputs between two points, and its magnitude: exact but for rounding. */
static double work(const struct fuzz_values *from, const struct fuzz_values *to) {
    return VALUE(to, tau1) * (VALUE(to, q1) - VALUE(from, q1)) +
           VALUE(to, f2) * (VALUE(to, q2) - VALUE(from, q2));
}

static double energies(const struct fuzz_values *values) {
    return fabs(VALUE(values, kinetic_energy)) + fabs(VALUE(values, potential_energy));
}

/* Largest |K| + |P| of the points seen, integral of |power| between them, and how much E - work
 * changes with the states: over one step. */
struct balance {
    double energies;
    double moved;
    double allowance; /* from the errors that the integrator accepts in each internal step */
    double rounding;  /* of the terms that make up E and the work */
};

/* As on the model's page: the integrator's tolerance from the requested one. */
static double effective_tolerance(const struct fuzz_values *values, double tolerance) {
    static const double divisors[] = {0.0, 500.0, 500.0, 100.0, 10.0}; // by solver_method
    const int method = fuzz_integer_value(values, RP_MANIPULATOR_solver_method);
    const double used = fmin(tolerance, 1e-4); // of what an experiment asks for
    const double effective = fmin(fmax(used / divisors[method], 1e-14), 1e-2);
    const double told = VALUE(values, effective_relative_tolerance);
    if (!(fabs(told - effective) <= 1e-12 * effective)) {
        fuzz_fail("the effective tolerance is %g, not %g", told, effective);
    }
    return effective;
}

/* tolerance: the requested one. */
static void see(struct balance *balance, double tolerance, const struct fuzz_values *values) {
    // weights of the error test: effective tolerance times |x| + 0.01 nominal values, which are 1
    const double effective = effective_tolerance(values, tolerance);
    const double w_q1 = effective * (fabs(VALUE(values, q1)) + 0.01);
    const double w_q2 = effective * (fabs(VALUE(values, q2)) + 0.01);
    const double w_dq1 = effective * (fabs(VALUE(values, dq1)) + 0.01);
    const double w_dq2 = effective * (fabs(VALUE(values, dq2)) + 0.01);
    // derivatives of E - work by the states; those by velocities are of second order at rest
    const double D11 = VALUE(values, D11);
    const double D12 = VALUE(values, D12);
    const double D22 = VALUE(values, D22);
    const double by_q1 = fabs(VALUE(values, gravity1) - VALUE(values, tau1));
    const double by_q2 =
        fabs(VALUE(values, coriolis2)) + fabs(VALUE(values, gravity2) - VALUE(values, f2));
    const double by_dq1 =
        fabs(D11 * VALUE(values, dq1) + D12 * VALUE(values, dq2)) + D11 * w_dq1 + fabs(D12) * w_dq2;
    const double by_dq2 =
        fabs(D12 * VALUE(values, dq1) + D22 * VALUE(values, dq2)) + D22 * w_dq2 + fabs(D12) * w_dq1;
    // of the terms of P and K, which may cancel
    const double weights =
        VALUE(values, m1) * VALUE(values, lc1) +
        VALUE(values, m2) * (VALUE(values, l1) + fabs(VALUE(values, a)) + fabs(VALUE(values, q2)));
    const double rounding = 8.0 * DBL_EPSILON *
                            (energies(values) + fabs(VALUE(values, g)) * weights +
                             fabs(VALUE(values, tau1) * VALUE(values, q1)) +
                             fabs(VALUE(values, f2) * VALUE(values, q2)) +
                             by_q2 * VALUE(values, l1) + fabs(by_dq2 * VALUE(values, dq2)));

    balance->energies = fmax(balance->energies, energies(values));
    balance->allowance =
        fmax(balance->allowance, by_q1 * w_q1 + by_q2 * w_q2 + by_dq1 * w_dq1 + by_dq2 * w_dq2);
    balance->rounding = fmax(balance->rounding, rounding);
}

/* Checks the step in parts: the values at its ends may not be enough. */
static void see_parts(struct balance *balance, struct fuzz_instance *instance, fmi2FMUstate saved,
                      double tolerance, double length) {
    enum { PARTS = 64 };
    const double end = instance->time;
    double moved = 0.0;
    struct fuzz_values from;
    struct fuzz_values to;
    fmi2FMUstate now = fuzz_save(instance);
    fuzz_restore(instance, saved, end - length);
    fuzz_read(instance, &from);
    for (int i = 0; i < PARTS && fuzz_step(instance, length / PARTS) == fmi2OK; i++) {
        fuzz_read(instance, &to);
        see(balance, tolerance, &to);
        moved += fabs(work(&from, &to));
        from = to;
    }
    balance->moved = fmax(balance->moved, moved);
    fuzz_restore(instance, now, end);
    fuzz_forget(instance, &now);
}

static double bound_of(const struct balance *balance, double tolerance, double internal_steps) {
    return 1000.0 * tolerance * (balance->energies + balance->moved) +
           2.0 * (internal_steps + 1.0) * balance->allowance + balance->rounding;
}

void fuzz_check_energy(struct fuzz_instance *instance, fmi2FMUstate saved, double tolerance,
                       double length, const struct fuzz_values *before,
                       const struct fuzz_values *after) {
    const double done = work(before, after);
    const double gained = VALUE(after, total_energy) - VALUE(before, total_energy);
    const double error = fabs(gained - done);
    const double internal_steps = fuzz_integer_value(after, RP_MANIPULATOR_solver_steps) -
                                  fuzz_integer_value(before, RP_MANIPULATOR_solver_steps);
    struct balance balance = {.moved = fabs(done)};
    see(&balance, tolerance, before);
    see(&balance, tolerance, after);
    if (error <= bound_of(&balance, tolerance, internal_steps)) {
        return;
    }
    see_parts(&balance, instance, saved, tolerance, length);
    if (error <= bound_of(&balance, tolerance, internal_steps)) {
        return;
    }
    fuzz_fail("energy: over a step of %g s with %g internal ones by method %d at tolerance %g, dE "
              "%.17g and work %.17g differ by %g: bound %g, of it for tolerance %g, for internal "
              "steps %g, for rounding %g",
              length, internal_steps, fuzz_integer_value(after, RP_MANIPULATOR_solver_method),
              tolerance, gained, done, error, bound_of(&balance, tolerance, internal_steps),
              1000.0 * tolerance * (balance.energies + balance.moved),
              2.0 * (internal_steps + 1.0) * balance.allowance, balance.rounding);
}
