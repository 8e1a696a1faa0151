/* What a communication step of the FMU costs, against the plain loop of CVodeReInit and CVode on
 * N_Vector_Serial that a user of CVODE would write, at the tolerance that the FMU runs at.
 *
 *     bench PATH/RPManipulator.so [repeats]
 *
 * The FMU is called through its own functions. Both do the same steps with the same inputs, taking
 * turns; a figure is the median of the repeats. Errors are against Runge-Kutta steps so short that
 * their error is the rounding. */
#define _POSIX_C_SOURCE 199309L // clock_gettime

#include "fmu_library.h"
#include "rp_manipulator.h"
#include "value_references.h"

#include <cvode/cvode.h>
#include <malloc.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sundials/sundials_context.h>
#include <sundials/sundials_version.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>
#include <time.h>

#if SUNDIALS_VERSION_MAJOR >= 7
#define NO_COMMUNICATOR SUN_COMM_NULL
#else
#define NO_COMMUNICATOR NULL
#endif

enum { LONGEST_RUN = 2000, MOST_REPEATS = 101 };

static const struct rp_parameters parameters = {
    .m1 = 2.0, .m2 = 1.0, .I1z = 0.1, .I2z = 0.05, .l1 = 0.5, .lc1 = 0.25, .a = 0.1, .g = 9.81};
static const double x_start[4] = {0.3, 0.2, 0.0, 0.0};

struct work {
    const char *name;
    double step; /* s */
    int steps;
    bool changing; /* inputs are sampled sines; otherwise constant */
    double tolerance;
};

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void require(bool condition, const char *what) {
    if (!condition) {
        fprintf(stderr, "bench: %s\n", what);
        exit(1);
    }
}

/* tau1 in N.m, f2 in N */
static void inputs_of(const struct work *work, int i, double u[2]) {
    const double t = work->changing ? work->step * i : 0.0;
    u[0] = 12.0 + 3.0 * sin(5.0 * t);
    u[1] = 4.0 + 2.0 * cos(7.0 * t);
}

static void rhs(const double x[4], const double u[2], double dx[4]) {
    dx[0] = x[2];
    dx[1] = x[3];
    rp_forward_dynamics(&parameters, x, x + 2, u, dx + 2);
}

/* Those of all steps, so that no figure has the time of a sine in it. */
static double inputs[LONGEST_RUN][2];

static void prepare_inputs(const struct work *work) {
    for (int i = 0; i < work->steps; i++) {
        inputs_of(work, i, inputs[i]);
    }
}

/* ---- Reference ------------------------------------------------------------------------------ */

/* Steps of 0.05 ms: their error, h^4 of some units, is below the rounding. */
static void solve(const struct work *work, double states[][4]) {
    const int parts = (int)lround(work->step / 5e-5);
    const double h = work->step / parts;
    double x[4];
    double lost[4] = {0.0}; // of the sum (Kahan)
    memcpy(x, x_start, sizeof x);
    for (int i = 0; i < work->steps; i++) {
        const double *u = inputs[i];
        for (int part = 0; part < parts; part++) {
            static const double at[4] = {0.0, 0.5, 0.5, 1.0};
            static const double weight[4] = {1.0 / 6, 1.0 / 3, 1.0 / 3, 1.0 / 6};
            double k[4] = {0.0};
            double sum[4] = {0.0};
            for (int stage = 0; stage < 4; stage++) {
                double xs[4];
                for (int j = 0; j < 4; j++) {
                    xs[j] = x[j] + h * at[stage] * k[j];
                }
                rhs(xs, u, k);
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
        memcpy(states[i], x, sizeof x);
    }
}

/* Largest error of a state over the largest value of that state. */
static double error_of(const struct work *work, double states[][4], double reference[][4]) {
    double error = 0.0;
    for (int j = 0; j < 4; j++) {
        double largest = 1e-3;
        double difference = 0.0;
        for (int i = 0; i < work->steps; i++) {
            largest = fmax(largest, fabs(reference[i][j]));
            difference = fmax(difference, fabs(states[i][j] - reference[i][j]));
        }
        error = fmax(error, difference / largest);
    }
    return error;
}

/* ---- The plain loop ------------------------------------------------------------------------- */

static int plain_rhs(sunrealtype t, N_Vector x, N_Vector dx, void *u) {
    (void)t;
    rhs(N_VGetArrayPointer(x), u, N_VGetArrayPointer(dx));
    return 0;
}

/* s for all steps */
static double run_plain(const struct work *work, double tolerance, double states[][4]) {
    double u[2];
    SUNContext context;
    require(SUNContext_Create(NO_COMMUNICATOR, &context) == 0, "no context");
    N_Vector x = N_VNew_Serial(4, context);
    N_Vector absolute = N_VNew_Serial(4, context);
    N_VConst(1e-2 * tolerance, absolute);
    memcpy(N_VGetArrayPointer(x), x_start, sizeof x_start);
    void *cvode = CVodeCreate(CV_ADAMS, context);
    SUNNonlinearSolver solver = SUNNonlinSol_FixedPoint(x, 0, context);
    require(CVodeInit(cvode, plain_rhs, 0.0, x) == CV_SUCCESS &&
                CVodeSVtolerances(cvode, tolerance, absolute) == CV_SUCCESS &&
                CVodeSetUserData(cvode, u) == CV_SUCCESS &&
                CVodeSetMaxNumSteps(cvode, 100000) == CV_SUCCESS &&
                CVodeSetNonlinearSolver(cvode, solver) == CV_SUCCESS,
            "no CVODE");

    const double begin = now();
    for (int i = 0; i < work->steps; i++) {
        double reached;
        memcpy(u, inputs[i], sizeof u);
        if (work->changing) {
            CVodeReInit(cvode, work->step * i, x);
        }
        require(CVode(cvode, work->step * (i + 1), x, &reached, CV_NORMAL) == CV_SUCCESS,
                "CVode failed");
        memcpy(states[i], N_VGetArrayPointer(x), sizeof states[i]);
    }
    const double elapsed = now() - begin;

    SUNNonlinSolFree(solver);
    CVodeFree(&cvode);
    N_VDestroy(absolute);
    N_VDestroy(x);
    SUNContext_Free(&context);
    return elapsed;
}

/* ---- The FMU -------------------------------------------------------------------------------- */

static void log_text(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                     fmi2String category, fmi2String text, ...) {
    (void)environment;
    (void)name;
    (void)status;
    (void)category;
    fprintf(stderr, "bench: %s\n", text);
}

static const fmi2CallbackFunctions callbacks = {.logger = log_text};

static fmi2Component start(const struct fmu_functions *fmu, const struct work *work, int method) {
    static const fmi2ValueReference states[] = {RP_MANIPULATOR_q1, RP_MANIPULATOR_q2,
                                                RP_MANIPULATOR_dq1, RP_MANIPULATOR_dq2};
    static const fmi2ValueReference solver_method = RP_MANIPULATOR_solver_method;
    fmi2Component c =
        fmu->Instantiate("bench", fmi2CoSimulation, RP_MANIPULATOR_GUID, "", &callbacks, 0, 0);
    require(c != NULL, "not instantiated");
    require(fmu->SetReal(c, states, 4, x_start) == fmi2OK &&
                fmu->SetInteger(c, &solver_method, 1, &method) == fmi2OK &&
                fmu->SetupExperiment(c, 1, work->tolerance, 0.0, 0, 0.0) == fmi2OK &&
                fmu->EnterInitializationMode(c) == fmi2OK &&
                fmu->ExitInitializationMode(c) == fmi2OK,
            "not initialized");
    return c;
}

struct counts {
    double effective_tolerance;
    double internal_steps; /* per step */
    double evaluations;
};

static double run_fmu(const struct fmu_functions *fmu, const struct work *work, int method,
                      double states[][4], struct counts *counts) {
    static const fmi2ValueReference references[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_f2};
    static const fmi2ValueReference outputs[] = {RP_MANIPULATOR_q1, RP_MANIPULATOR_q2,
                                                 RP_MANIPULATOR_dq1, RP_MANIPULATOR_dq2};
    static const fmi2ValueReference totals[] = {RP_MANIPULATOR_solver_steps,
                                                RP_MANIPULATOR_solver_rhs_evaluations};
    static const fmi2ValueReference tolerance = RP_MANIPULATOR_effective_relative_tolerance;
    fmi2Component c = start(fmu, work, method);
    const double begin = now();
    for (int i = 0; i < work->steps; i++) {
        const bool done = fmu->SetReal(c, references, 2, inputs[i]) == fmi2OK &&
                          fmu->DoStep(c, work->step * i, work->step, 1) == fmi2OK &&
                          fmu->GetReal(c, outputs, 4, states[i]) == fmi2OK;
        require(done, "a step failed");
    }
    const double elapsed = now() - begin;
    int total[2];
    require(fmu->GetInteger(c, totals, 2, total) == fmi2OK &&
                fmu->GetReal(c, &tolerance, 1, &counts->effective_tolerance) == fmi2OK,
            "no counts");
    counts->internal_steps = (double)total[0] / work->steps;
    counts->evaluations = (double)total[1] / work->steps;
    fmu->FreeInstance(c);
    return elapsed;
}

/* ---- Table ---------------------------------------------------------------------------------- */

static int by_value(const void *a, const void *b) {
    const double x = *(const double *)a;
    const double y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double values[], int count) {
    qsort(values, (size_t)count, sizeof values[0], by_value);
    return values[count / 2];
}

enum { PLAIN, ADAMS, BDF, ERK, RUNS };
static const char *const run_names[RUNS] = {"plain loop", "cvode_adams", "cvode_bdf", "erk"};

/* must: ratio to reach, of Adams and of erk; 0: none */
static void compare(const struct fmu_functions *fmu, const struct work *work,
                    const double must[RUNS], int repeats) {
    static double states[LONGEST_RUN][4];
    static double reference[LONGEST_RUN][4];
    double seconds[RUNS][MOST_REPEATS];
    double errors[RUNS];
    struct counts counts[RUNS] = {{0}};
    prepare_inputs(work);
    solve(work, reference);
    run_fmu(fmu, work, ADAMS, states, &counts[ADAMS]);
    for (int repeat = 0; repeat < repeats; repeat++) {
        for (int run = 0; run < RUNS; run++) {
            seconds[run][repeat] = run == PLAIN
                                       ? run_plain(work, counts[ADAMS].effective_tolerance, states)
                                       : run_fmu(fmu, work, run, states, &counts[run]);
            errors[run] = error_of(work, states, reference);
        }
    }
    printf("\n%s, tolerance %g, runs at %g\n", work->name, work->tolerance,
           counts[ADAMS].effective_tolerance);
    const double plain = median(seconds[PLAIN], repeats);
    for (int run = 0; run < RUNS; run++) {
        const double elapsed = median(seconds[run], repeats);
        const double ratio = elapsed / plain;
        printf("  %-12s %8.2f us %7.3f", run_names[run], 1e6 * elapsed / work->steps, ratio);
        if (must[run] > 0.0) {
            printf("  must %5.2f %-6s", must[run], ratio <= must[run] ? "ok" : "MISSED");
        } else {
            printf("%19s", "");
        }
        printf(" error %8.1e", errors[run]);
        if (run != PLAIN) {
            printf("  %5.1f steps, %5.1f evaluations", counts[run].internal_steps,
                   counts[run].evaluations);
        }
        printf("\n");
    }
}

/* Instantiate to free, and what an instance that runs has allocated. */
static void measure_life(const struct fmu_functions *fmu, const struct work *work, int repeats) {
    for (int method = ADAMS; method < RUNS; method++) {
        double seconds[MOST_REPEATS];
        for (int repeat = 0; repeat < repeats; repeat++) {
            const double begin = now();
            for (int i = 0; i < 100; i++) {
                fmu->FreeInstance(start(fmu, work, method));
            }
            seconds[repeat] = (now() - begin) / 100.0;
        }
        const size_t before = mallinfo2().uordblks;
        fmi2Component c = start(fmu, work, method);
        require(fmu->DoStep(c, 0.0, work->step, 1) == fmi2OK, "a step failed");
        const size_t after = mallinfo2().uordblks;
        fmu->FreeInstance(c);
        const double elapsed = 1e6 * median(seconds, repeats);
        const double kib = (double)(after - before) / 1024.0;
        printf("  %-12s instantiate to free %6.1f us (must 30 %s), memory %5.1f KiB (must 32 "
               "%s)\n",
               run_names[method], elapsed, elapsed <= 30.0 ? "ok" : "MISSED", kib,
               kib <= 32.0 ? "ok" : "MISSED");
    }
}

int main(int count, char **arguments) {
    require(count >= 2, "usage: bench PATH/RPManipulator.so [repeats]");
    const int wanted = count > 2 ? atoi(arguments[2]) : 21;
    const int repeats = wanted < 1 ? 1 : wanted > MOST_REPEATS ? MOST_REPEATS : wanted;
    struct fmu_functions fmu;
    require(fmu_library_open(arguments[1], &fmu) != NULL, "the FMU cannot be loaded");

    static const struct {
        struct work work;
        double must[RUNS];
    } table[] = {
        {{"1 ms steps, inputs changing", 1e-3, 2000, true, 1e-8}, {[ADAMS] = 0.5, [ERK] = 0.15}},
        {{"10 ms steps, inputs changing", 1e-2, 200, true, 1e-8}, {[ADAMS] = 0.5, [ERK] = 0.2}},
        {{"1 ms steps, inputs constant", 1e-3, 2000, false, 1e-8}, {[ADAMS] = 0.6}},
        {{"10 ms steps, inputs constant", 1e-2, 200, false, 1e-8}, {0}},
        {{"1 ms steps, inputs changing", 1e-3, 2000, true, 1e-5}, {0}},
        {{"1 ms steps, inputs changing", 1e-3, 2000, true, 1e-11}, {0}},
        {{"one step of 2 s", 2.0, 1, false, 1e-8}, {0}},
    };
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        compare(&fmu, &table[i].work, table[i].must, repeats);
    }
    printf("\n");
    measure_life(&fmu, &table[0].work, repeats);
    return 0;
}
