/* Loops of CVODE as a user would write them, and models with right-hand sides and Jacobians by
 * hand, which are also FMUs from equations (by_models.py). */
#define _POSIX_C_SOURCE 199309L // clock_gettime

#include "bench.h"

#include <math.h>
#include <nvector/nvector_serial.h>
#include <string.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>
#include <time.h>

double processor_time(void) {
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

double loop_run(const struct loop *loop, double x[]) {
    const bool is_stiff = loop->jacobian != NULL;
    SUNContext context;
    require(SUNContext_Create(NULL, &context) == 0, "no context");
    N_Vector states = N_VMake_Serial(loop->n, x, context);
    N_Vector absolute = N_VNew_Serial(loop->n, context);
    for (int i = 0; i < loop->n; i++) {
        NV_Ith_S(absolute, i) = 1e-2 * loop->tolerance * (loop->nominal ? loop->nominal[i] : 1.0);
    }
    void *cvode = CVodeCreate(is_stiff ? CV_BDF : CV_ADAMS, context);
    require(CVodeInit(cvode, loop->rhs, 0.0, states) == CV_SUCCESS &&
                CVodeSVtolerances(cvode, loop->tolerance, absolute) == CV_SUCCESS &&
                CVodeSetMaxNumSteps(cvode, 100000) == CV_SUCCESS,
            "no CVODE");
    SUNMatrix J = is_stiff ? SUNDenseMatrix(loop->n, loop->n, context) : NULL;
    SUNLinearSolver dense = is_stiff ? SUNLinSol_Dense(states, J, context) : NULL;
    SUNNonlinearSolver fixed_point = is_stiff ? NULL : SUNNonlinSol_FixedPoint(states, 0, context);
    const bool has_solver = is_stiff ? CVodeSetLinearSolver(cvode, dense, J) == CV_SUCCESS &&
                                           CVodeSetJacFn(cvode, loop->jacobian) == CV_SUCCESS
                                     : CVodeSetNonlinearSolver(cvode, fixed_point) == CV_SUCCESS;
    require(has_solver, "no solver");
    const double begin = processor_time();
    for (int i = 0; i < loop->steps; i++) {
        double reached;
        CVodeSetUserData(cvode, (void *)(loop->inputs + i * loop->input_count));
        if (loop->restarts) {
            CVodeReInit(cvode, loop->step * i, states);
        }
        require(CVode(cvode, loop->step * (i + 1), states, &reached, CV_NORMAL) == CV_SUCCESS,
                "CVode failed");
        if (loop->states != NULL) {
            memcpy(loop->states + i * loop->n, x, (size_t)loop->n * sizeof *x);
        }
    }
    const double elapsed = processor_time() - begin;

    SUNNonlinSolFree(fixed_point);
    SUNLinSolFree(dense);
    SUNMatDestroy(J);
    CVodeFree(&cvode);
    N_VDestroy(absolute);
    N_VDestroy(states);
    SUNContext_Free(&context);
    return elapsed;
}

/* ---- Models: rates dx, and their derivatives J, which begin as zeros, in columns */

enum { MASSES = 50, STARS = 7 };

static void lorenz(const double x[], double force, double dx[]) {
    dx[0] = 10.0 * (x[1] - x[0]);
    dx[1] = x[0] * (28.0 - x[2]) - x[1];
    dx[2] = x[0] * x[1] - 8.0 / 3.0 * x[2];
}

static void lorenz_slopes(const double x[], double force, double J[]) {
    const double columns[] = {-10.0, 28.0 - x[2], x[1], 10.0, -1.0, x[0], 0.0, -x[0], -8.0 / 3.0};
    memcpy(J, columns, sizeof columns);
}

static void cart(const double x[], double force, double dx[]) {
    const double s = sin(x[1]), c = cos(x[1]), w = x[3];
    const double a = (force + 0.1 * s * (0.5 * w * w + 9.81 * c)) / (1.0 + 0.1 * s * s);
    dx[0] = x[2], dx[1] = w, dx[2] = a, dx[3] = -2.0 * (a * c + 9.81 * s);
}

static void cart_slopes(const double x[], double force, double J[]) {
    const double s = sin(x[1]), c = cos(x[1]), w = x[3], inertia = 1.0 + 0.1 * s * s;
    const double pull = 0.5 * w * w + 9.81 * c, a = (force + 0.1 * s * pull) / inertia;
    const double a_phi = (0.1 * c * pull - 0.981 * s * s - 0.2 * a * s * c) / inertia;
    const double a_w = 0.1 * s * w / inertia;
    J[8] = J[13] = 1.0, J[6] = a_phi, J[14] = a_w;
    J[7] = -2.0 * (a_phi * c - a * s + 9.81 * c), J[15] = -2.0 * a_w * c;
}

/* Rates at which the gates m, h and n open and close. */
static void gates(double V, double opening[3], double closing[3]) {
    opening[0] = 0.1 * (V + 40.0) / (1.0 - exp(-0.1 * (V + 40.0)));
    closing[0] = 4.0 * exp((V + 65.0) / -18.0);
    opening[1] = 0.07 * exp(-0.05 * (V + 65.0));
    closing[1] = 1.0 / (1.0 + exp(-0.1 * (V + 35.0)));
    opening[2] = 0.01 * (V + 55.0) / (1.0 - exp(-0.1 * (V + 55.0)));
    closing[2] = 0.125 * exp((V + 65.0) / -80.0);
}

static void neuron(const double x[], double force, double dx[]) {
    const double V = x[0], m = x[1], h = x[2], n = x[3];
    double a[3], b[3];
    gates(V, a, b);
    dx[0] = 10.0 - 120.0 * m * m * m * h * (V - 50.0) - 36.0 * n * n * n * n * (V + 77.0) -
            0.3 * (V + 54.387);
    for (int i = 0; i < 3; i++) {
        dx[i + 1] = a[i] * (1.0 - x[i + 1]) - b[i] * x[i + 1];
    }
}

static void neuron_slopes(const double x[], double force, double J[]) {
    const double V = x[0], m = x[1], h = x[2], n = x[3], of_m = V + 40.0, of_n = V + 55.0;
    double a[3], b[3];
    gates(V, a, b);
    J[0] = -120.0 * m * m * m * h - 36.0 * n * n * n * n - 0.3;
    J[4] = -360.0 * m * m * h * (V - 50.0), J[8] = -120.0 * m * m * m * (V - 50.0);
    J[12] = -144.0 * n * n * n * (V + 77.0);
    const double a_V[] = {a[0] * (1.0 - a[0] + 0.1 * of_m) / of_m, -0.05 * a[1],
                          a[2] * (1.0 - 10.0 * a[2] + 0.1 * of_n) / of_n};
    const double b_V[] = {b[0] / -18.0, 0.1 * b[1] * (1.0 - b[1]), b[2] / -80.0};
    for (int i = 0; i < 3; i++) {
        J[i + 1] = a_V[i] * (1.0 - x[i + 1]) - b_V[i] * x[i + 1];
        J[5 * (i + 1)] = -a[i] - b[i];
    }
}

static void chain(const double x[], double force, double dx[]) {
    double before = 0.0;
    for (int i = 0; i < MASSES; i++) {
        const double e = i + 1 < MASSES ? x[i] - x[i + 1] : 0.0, f = 40.0 * e * (1.0 + e * e);
        dx[i] = x[MASSES + i];
        dx[MASSES + i] = before - f - 0.5 * dx[i];
        before = f;
    }
}

static void chain_slopes(const double x[], double force, double J[]) {
    double(*const column)[2 * MASSES] = (double(*)[2 * MASSES])(void *)J;
    for (int i = 0, v = MASSES; i < MASSES; i++, v++) {
        column[v][i] = 1.0, column[v][v] = -0.5;
        if (i > 0) {
            const double e = x[i - 1] - x[i], k = 40.0 * (1.0 + 3.0 * e * e);
            column[i - 1][v - 1] -= k, column[i][v - 1] += k;
            column[i - 1][v] += k, column[i][v] -= k;
        }
    }
}

static void stars(const double x[], double force, double dx[]) {
    enum { N = STARS };
    memcpy(dx, x + 2 * N, 2 * N * sizeof *dx);
    memset(dx + 2 * N, 0, 2 * N * sizeof *dx);
    for (int i = 0; i < N; i++) {
        for (int j = i + 1; j < N; j++) {
            const double a = x[j] - x[i], b = x[N + j] - x[N + i], d = a * a + b * b;
            const double w = 1.0 / (d * sqrt(d)), to_i = w * (j + 1), to_j = w * (i + 1);
            dx[2 * N + i] += to_i * a, dx[2 * N + j] -= to_j * a;
            dx[3 * N + i] += to_i * b, dx[3 * N + j] -= to_j * b;
        }
    }
}

typedef void calculation(const double x[], double force, double values[]);
static calculation *const rates[] = {lorenz, cart, neuron, chain, stars};
static calculation *const slopes[] = {lorenz_slopes, cart_slopes, neuron_slopes, chain_slopes};
static int model; // of the running loop

static int rhs(sunrealtype t, N_Vector x, N_Vector dx, void *force) {
    rates[model](N_VGetArrayPointer(x), *(double *)force, N_VGetArrayPointer(dx));
    return 0;
}

static int jacobian(sunrealtype t, N_Vector x, N_Vector dx, SUNMatrix J, void *force, N_Vector a,
                    N_Vector b, N_Vector c) {
    slopes[model](N_VGetArrayPointer(x), *(double *)force, SM_DATA_D(J));
    return 0;
}

double loop_run_model(int index, bool is_stiff, int n, int steps, double tolerance, double step,
                      const double nominal[], const double forces[], double x[]) {
    model = index;
    const struct loop loop = {
        rhs, is_stiff ? jacobian : NULL, n, tolerance, nominal, step, steps, 1, forces, steps > 1,
        NULL};
    return loop_run(&loop, x);
}
