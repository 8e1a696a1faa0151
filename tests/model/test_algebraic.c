/* Newton's method and linear equations at their limits: units over twelve decades, singular
 * matrices, solutions that are far, noise, bounds. */
#include "algebraic.h"

#include <float.h>
#include <math.h>
#include <string.h>
#include <unity.h>

static const double pi = 3.141592653589793;
static const double one[] = {1.0, 1.0};
static const double nowhere_low[] = {-INFINITY, -INFINITY};
static const double nowhere_high[] = {INFINITY, INFINITY};

/* ---- Linear equations ----------------------------------------------------------------------- */

/* Hilbert's matrix of order 3, whose rows and columns have units from 1e-6 to 1e6. */
static void test_units_over_twelve_decades_cost_no_digit(void) {
    static const double row[] = {1e6, 1.0, 1e-6};
    static const double column[] = {1e-6, 1e6, 1.0};
    static const double x[] = {1.0, -2.0, 3.0};
    double matrix[3 * 4];
    double b[3] = {0.0};
    double found[3];
    int pivot[3];
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            matrix[3 * i + j] = row[i] * column[j] / (i + j + 1);
            b[i] += matrix[3 * i + j] * (x[j] / column[j]);
        }
    }
    algebraic_factorize(3, matrix, pivot);
    algebraic_substitute(3, matrix, pivot, b, found);
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, x[i], found[i] * column[i]);
    }
}

static void test_a_singular_matrix_has_no_solution(void) {
    double matrix[2 * 3] = {1.0, 2.0, 0.5, 1.0};
    const double b[] = {1.0, 0.5};
    double x[2];
    int pivot[2];
    algebraic_factorize(2, matrix, pivot);
    algebraic_substitute(2, matrix, pivot, b, x);
    TEST_ASSERT_TRUE(isnan(x[0]) && isnan(x[1]));
}

/* Of [[1, 1], [1, -1]] the inverse has halves: errors e give (e1 + e2) / 2. */
static void test_bounds_are_those_of_the_inverse(void) {
    double matrix[2 * 3] = {1.0, 1.0, 1.0, -1.0};
    const double e[] = {1e-3, 3e-3};
    double room[4];
    double bound[2];
    int pivot[2];
    algebraic_factorize(2, matrix, pivot);
    algebraic_bounds(2, matrix, pivot, e, room, bound);
    TEST_ASSERT_DOUBLE_WITHIN(1e-18, 2e-3, bound[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-18, 2e-3, bound[1]);
}

/* ---- Newton's method ------------------------------------------------------------------------ */

/* sin z = given */
static void sine(const double given[], bool is_free, const double z[], double r[], double slope[]) {
    r[0] = sin(z[0]) - given[0];
    if (slope != NULL) {
        slope[0] = cos(z[0]);
    }
}

/* u = Vt log(1 + i / Is) + R i, in A: i is 1e-12 or 1. */
static void diode(const double given[], bool is_free, const double i[], double r[],
                  double slope[]) {
    r[0] = 0.026 * log1p(i[0] / 1e-12) + 5.0 * i[0] - given[0];
    if (slope != NULL) {
        slope[0] = 0.026 / (1e-12 + i[0]) + 5.0;
    }
}

/* u = v + R Is (e^(v / Vt) - 1), in V: straight where v is far below 0. */
static void junction(const double given[], bool is_free, const double v[], double r[],
                     double slope[]) {
    r[0] = given[0] - v[0] - 2e-9 * expm1(v[0] / 0.046);
    if (slope != NULL) {
        slope[0] = -1.0 - 2e-9 / 0.046 * exp(v[0] / 0.046);
    }
}

/* z^2 = given */
static void square(const double given[], bool is_free, const double z[], double r[],
                   double slope[]) {
    r[0] = z[0] * z[0] - given[0];
    if (slope != NULL) {
        slope[0] = 2.0 * z[0];
    }
}

/* The intersection of a circle and a hyperbola: x^2 + y^2 = 4, x y = given. */
static void curves(const double given[], bool is_free, const double z[], double r[],
                   double slope[]) {
    r[0] = z[0] * z[0] + z[1] * z[1] - 4.0;
    r[1] = z[0] * z[1] - given[0];
    if (slope != NULL) {
        slope[0] = 2.0 * z[0];
        slope[1] = 2.0 * z[1];
        slope[2] = z[1];
        slope[3] = z[0];
    }
}

/* 1/(z - 0.3) = given */
static void pole(const double given[], bool is_free, const double z[], double r[], double slope[]) {
    r[0] = 1.0 / (z[0] - 0.3) - given[0];
    if (slope != NULL) {
        slope[0] = -1.0 / ((z[0] - 0.3) * (z[0] - 0.3));
    }
}

/* z + sqrt(z) = x where z > 0, and z - sqrt(-z) = x elsewhere; given: x, and whether z > 0. */
static void roots(const double given[], bool is_free, const double z[], double r[],
                  double slope[]) {
    const bool is_above = is_free ? z[0] > 0.0 : given[1] != 0.0;
    const double root = sqrt(is_above ? z[0] : -z[0]);
    r[0] = z[0] + (is_above ? root : -root) - given[0];
    if (slope != NULL) {
        slope[0] = 1.0 + 0.5 / root;
    }
}

typedef void equations(const double[], bool, const double[], double[], double[]);

static struct algebraic_report solved(int count, equations *evaluate, double given, bool is_near,
                                      double z[]) {
    const struct algebraic system = {"z", "equations", count,        false,
                                     one, nowhere_low, nowhere_high, evaluate};
    return algebraic_solve(&system, ALGEBRAIC_ROOM(2), &given, is_near, false, z);
}

static void test_a_solution_is_kept_bit_by_bit(void) {
    for (int k = 1; k < 200; k++) {
        const double given = 0.005 * k - 0.5;
        double z[] = {0.2};
        TEST_ASSERT_EQUAL(ALGEBRAIC_SOLVED, solved(1, sine, given, false, z).outcome);
        TEST_ASSERT_DOUBLE_WITHIN(1e-15, asin(given), z[0]);
        const double first = z[0];
        TEST_ASSERT_EQUAL(0, solved(1, sine, given, true, z).iterations);
        TEST_ASSERT_EQUAL_MEMORY(&first, z, sizeof first);
    }
}

/* Paths lead downhill from either side of the maximum of the sine, as exactly as residuals tell. */
static void test_paths_lead_to_the_near_solution(void) {
    double near[] = {0.2};
    TEST_ASSERT_EQUAL(ALGEBRAIC_SOLVED, solved(1, sine, 0.5, true, near).outcome);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, asin(0.5), near[0]);
    for (int k = 0; k < 100; k++) {
        const double guess = 1.45 + 0.002 * k;
        const double root = guess < 0.5 * pi ? asin(0.5) : pi - asin(0.5);
        double far[] = {guess};
        const enum algebraic_outcome outcome = solved(1, sine, 0.5, true, far).outcome;
        TEST_ASSERT_TRUE(outcome == ALGEBRAIC_SOLVED || fabs(guess - 0.5 * pi) < 0.01);
        TEST_ASSERT_TRUE(outcome != ALGEBRAIC_SOLVED ||
                         fabs(far[0] - root) <= 5.0 * DBL_EPSILON * root); // 1 is of sin
    }
}

static void test_currents_over_twelve_decades(void) {
    for (int k = -30; k <= 60; k++) {
        const double u = 0.1 * k;
        double i[] = {0.0};
        double none[] = {-1.0};
        const bool has_one = u > -0.5; // else i + Is is no double
        if (!has_one) {
            continue;
        }
        TEST_ASSERT_EQUAL(ALGEBRAIC_SOLVED, solved(1, diode, u, false, i).outcome);
        const double missed = 0.026 * log1p(i[0] / 1e-12) + 5.0 * i[0] - u;
        const double slope = 0.026 / (1e-12 + i[0]) + 5.0;
        const double rounding = 4.0 * DBL_EPSILON * (fabs(u) + fabs(slope * i[0]));
        TEST_ASSERT_DOUBLE_WITHIN(rounding, 0.0, missed);
        TEST_ASSERT_EQUAL(ALGEBRAIC_NOT_FINITE, solved(1, diode, u, false, none).outcome);
    }
}

/* A step from where equations are straight promises more than the next one keeps. */
static void test_small_solutions_are_exact_from_afar_too(void) {
    for (int k = 1; k < 100; k++) {
        const double given = 1e-12 * k * k;
        const double exact = given / (1.0 + 2e-9 / 0.046); // the next term is below 1e-25
        double v[] = {-0.1 * k};
        TEST_ASSERT_EQUAL(ALGEBRAIC_SOLVED, solved(1, junction, given, false, v).outcome);
        TEST_ASSERT_DOUBLE_WITHIN(2e-14 * exact + 1e-24, exact, v[0]);
    }
}

static void test_bisection_between_bounds(void) {
    static const double low[] = {-1.0};
    static const double high[] = {100.0};
    const struct algebraic system = {"z", "z**2 = 2", 1, false, one, low, high, square};
    const double given = 2.0;
    double z[] = {0.0}; // the slope is 0
    TEST_ASSERT_EQUAL(ALGEBRAIC_SOLVED,
                      algebraic_solve(&system, ALGEBRAIC_ROOM(1), &given, false, false, z).outcome);
    TEST_ASSERT_DOUBLE_WITHIN(DBL_EPSILON, sqrt(2.0), z[0]);
}

/* Its residual changes sign between the bounds, and is 0 at 1000.3 only. */
static void test_a_pole_is_no_solution(void) {
    static const double low[] = {-10.0};
    static const double high[] = {10.0};
    const struct algebraic system = {"z", "1/(z - 0.3) = u", 1, false, one, low, high, pole};
    const double given = 1e-3;
    double z[] = {0.0};
    char text[256];
    TEST_ASSERT_TRUE(
        algebraic_fails(&system, ALGEBRAIC_ROOM(1), &given, 2.0, z, text, sizeof text));
    TEST_ASSERT_NOT_NULL(strstr(text, "z: no solution at t = 2, largest residual 0."));
}

static void test_modes_follow_from_the_unknown(void) {
    const struct algebraic system = {"z",         "equations",  1,    true, one,
                                     nowhere_low, nowhere_high, roots};
    for (int k = -20; k <= 20; k++) {
        for (int g = -5; g <= 5; g++) {
            const double x = 0.1 * k;
            const double root = 0.5 * (sqrt(1.0 + 4.0 * fabs(x)) - 1.0);
            const double expected = x > 0.0 ? root * root : -root * root;
            double z[] = {0.3 * g};
            const double free[] = {x, 0.0};
            TEST_ASSERT_EQUAL(
                ALGEBRAIC_SOLVED,
                algebraic_solve(&system, ALGEBRAIC_ROOM(1), free, false, true, z).outcome);
            TEST_ASSERT_DOUBLE_WITHIN(1e-15, expected, z[0]);
            // in given modes the guess may be where the root is none
            const double held[] = {x, x > 0.0};
            z[0] = 0.3 * g;
            TEST_ASSERT_EQUAL(
                ALGEBRAIC_SOLVED,
                algebraic_solve(&system, ALGEBRAIC_ROOM(1), held, false, false, z).outcome);
            TEST_ASSERT_DOUBLE_WITHIN(1e-15, expected, z[0]);
        }
    }
}

static void test_failures_say_what_has_happened(void) {
    double z[] = {0.0};
    TEST_ASSERT_EQUAL(ALGEBRAIC_SINGULAR, solved(1, square, 2.0, false, z).outcome);
    TEST_ASSERT_TRUE(isnan(z[0]));
    z[0] = 0.7;
    const struct algebraic_report report = solved(1, square, -1.0, false, z);
    TEST_ASSERT_EQUAL(ALGEBRAIC_FAR, report.outcome);
    TEST_ASSERT_TRUE(report.residual >= 1.0 && report.iterations > 0);
    const struct algebraic system = {"z",         "z**2 = given", 1,     false, one,
                                     nowhere_low, nowhere_high,   square};
    const double given = -1.0;
    char text[200];
    z[0] = 0.7;
    TEST_ASSERT_TRUE(
        algebraic_fails(&system, ALGEBRAIC_ROOM(1), &given, 2.5, z, text, sizeof text));
    TEST_ASSERT_NOT_NULL(strstr(text, "z: no solution at t = 2.5, largest residual 1"));
}

static void test_two_equations(void) {
    for (int k = -19; k <= 19; k++) {
        const double given = 0.1 * k;
        double z[] = {2.0, 0.1};
        TEST_ASSERT_EQUAL(ALGEBRAIC_SOLVED, solved(2, curves, given, false, z).outcome);
        TEST_ASSERT_DOUBLE_WITHIN(1e-14, 4.0, z[0] * z[0] + z[1] * z[1]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-14, given, z[0] * z[1]);
    }
}
