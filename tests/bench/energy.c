#include "bench.h"

#include <math.h>
#include <stdlib.h>

/* Motions without losses: their inputs do not change, so that these have a potential. */
static const struct motion {
    const char *name;
    double start[4];
    double u[2];
    double g; /* m/s^2 */
} motions[] = {
    // the slide falls, further and further
    {"free motion", {0.3, 0.2, 0.0, 0.0}, {0.0, 0.0}, 9.81},
    // the arm turns around and around, the slide goes in and out
    {"in the horizontal plane, the slide pulled inwards", {0.3, 0.2, 3.0, 0.0}, {0.0, -2.0}, 0.0},
};

static const double requested_tolerance = 1e-14;
enum { ROWS_A_DECADE = 8 };

struct energy {
    double total;
    double scale; /* the larger part of it, kinetic or potential */
};

static struct energy energy_of(const struct motion *motion, const double x[4]) {
    struct rp_parameters parameters = problem_parameters;
    parameters.g = motion->g;
    const double kinetic = rp_kinetic_energy(&parameters, x, x + 2);
    const double potential =
        rp_potential_energy(&parameters, x) - motion->u[0] * x[0] - motion->u[1] * x[1];
    return (struct energy){kinetic + potential, fmax(kinetic, fabs(potential))};
}

/* Drift: the difference from the energy at the start, over the largest scale so far. A row for each
 * eighth of a decade of steps, with the largest drift in it. */
static void report_drift(struct report *report, const struct motion *motion, const char *name,
                         double us, const struct problem *problem, double states[][4]) {
    const struct energy first = energy_of(motion, motion->start);
    double scale = first.scale;
    double largest = 0.0;
    double drift = 0.0; // largest since the last row
    int rows = 0;       // eighths of a decade from 1 step to the end of the next row
    for (int i = 0; i < problem->steps; i++) {
        const struct energy energy = energy_of(motion, states[i]);
        scale = fmax(scale, energy.scale);
        const double at_end = fabs(energy.total - first.total) / scale;
        drift = fmax(drift, at_end);
        largest = fmax(largest, at_end);
        const bool is_last = i + 1 == problem->steps;
        if (is_last || i + 1 >= pow(10.0, (double)rows / ROWS_A_DECADE)) {
            report_row(report, "energy", motion->name, name);
            report_number(report, "steps", i + 1);
            report_number(report, "drift", drift);
            report_number(report, "largest", largest);
            report_number(report, "at_end", at_end);
            report_number(report, "us", us);
            report_number(report, "end_q1", states[i][0]);
            report_row_end(report);
            drift = 0.0;
            rows = (int)floor(ROWS_A_DECADE * log10(i + 1.0) + 1e-9) + 1;
        }
    }
}

static void measure_motion(struct bench *bench, const struct motion *motion) {
    static const enum method methods[] = {CVODE_ADAMS, ERK, TAYLOR};
    struct problem *problem = problem_create_without_reference(1e-3, bench->quick ? 10000 : 1000000,
                                                               motion->start, motion->u, motion->g);
    double(*states)[4] = allocate((size_t)problem->steps, sizeof states[0]);
    for (size_t i = 0; i < sizeof methods / sizeof methods[0]; i++) {
        struct fmu_counts counts;
        const double seconds =
            fmu_run(&bench->fmu, problem, methods[i], requested_tolerance, states, &counts);
        report_drift(&bench->report, motion, method_names[methods[i]],
                     1e6 * seconds / problem->steps, problem, states);
    }
    if (mujoco_available()) {
        const double seconds = mujoco_run(problem, MUJOCO_RK4, 1, states);
        report_drift(&bench->report, motion, "MuJoCo RK4", 1e6 * seconds / problem->steps, problem,
                     states);
    }
    free(states);
    problem_destroy(problem);
}

void measure_energy(struct bench *bench) {
    for (size_t i = 0; i < sizeof motions / sizeof motions[0]; i++) {
        measure_motion(bench, &motions[i]);
    }
}
