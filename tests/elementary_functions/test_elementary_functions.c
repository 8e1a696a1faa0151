/* The elementary functions that are linked into the FMUs: within a unit in the last place of the
 * system's in long double (atan2: two), and equal to the system's where the result is exact. */
#define _DEFAULT_SOURCE // RTLD_DEFAULT

#include <dlfcn.h>
#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

typedef double unary(double x);
typedef double binary(double x, double y);

void sincos(double x, double *sine, double *cosine);

/* By a pointer that the compiler cannot see through: calls, not its own code. */
static unary *volatile own_unary;
static binary *volatile own_binary;

static char about[100];

/* ---- Arguments ------------------------------------------------------------------------------ */

enum { RANDOM = 20000 };

static const double special[] = {
    0.0,         -0.0,      1.0,      -1.0,     0.5,       1.5,      2.5,
    -2.5,        DBL_MIN,   -DBL_MIN, 5e-324,   DBL_MAX,   -DBL_MAX, 1e-8,
    0x1p52,      -0x1.8p51, 0x1p53,   INFINITY, -INFINITY, NAN,      0x1.921fbp0,
    0x1.921fcp1, 1e15,      -1e22,    0x1p-27,  0x1p-26,   3.0,      4503599627370495.5};
enum { SPECIAL = sizeof special / sizeof special[0] };

static uint64_t random_state;

static uint64_t random_bits(void) {
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return random_state >> 11; // 53 bits
}

/* Of both signs and magnitudes from 2^lowest to 2^highest. */
static double random_number(int lowest, int highest) {
    const double fraction = 1.0 + (double)(random_bits() >> 1) * 0x1p-52;
    const int exponent = lowest + (int)(random_bits() % (uint64_t)(highest - lowest));
    return ldexp(random_bits() % 2 == 0 ? fraction : -fraction, exponent);
}

void setUp(void) {
    random_state = 1;
}

/* ---- Comparison ----------------------------------------------------------------------------- */

static void *find_in_system(const char *name) {
    void *found = dlsym(RTLD_DEFAULT, name);
    TEST_ASSERT_NOT_NULL_MESSAGE(found, name);
    return found;
}

/* The system's function of this name, which is not the own one. */
static unary *unary_of_system(const char *name, unary *own) {
    void *const found = find_in_system(name);
    unary *function = NULL;
    memcpy(&function, &found, sizeof found);
    TEST_ASSERT_TRUE_MESSAGE(own != function, name);
    return function;
}

static binary *binary_of_system(const char *name, binary *own) {
    void *const found = find_in_system(name);
    binary *function = NULL;
    memcpy(&function, &found, sizeof found);
    TEST_ASSERT_TRUE_MESSAGE(own != function, name);
    return function;
}

static void assert_same(double expected, double actual) {
    if (isnan(expected)) {
        TEST_ASSERT_TRUE_MESSAGE(isnan(actual), about);
        return;
    }
    TEST_ASSERT_EQUAL_MEMORY_MESSAGE(&expected, &actual, sizeof expected, about);
}

/* Valgrind calculates in double whatever the type. */
static bool long_double_is_longer(void) {
    const volatile long double one = 1.0L;
    return one + LDBL_EPSILON != one;
}

static void assert_close(long double expected, double units, double actual) {
    if (!long_double_is_longer()) {
        return; // expected is itself off, and by more
    }
    const double nearest = (double)expected;
    if (!isfinite(nearest) || nearest == 0.0) {
        assert_same(nearest, actual);
        return;
    }
    const double size = fmax(fabs(nearest), DBL_MIN);
    const double bound = units * ldexp(DBL_EPSILON, ilogb(size));
    TEST_ASSERT_TRUE_MESSAGE(fabsl((long double)actual - expected) <= (long double)bound, about);
}

static void compare_unary(const char *name, unary *own, long double (*exact)(long double),
                          int lowest, int highest) {
    own_unary = own;
    (void)unary_of_system(name, own);
    for (int i = 0; i < SPECIAL + RANDOM; i++) {
        const double x = i < SPECIAL ? special[i] : random_number(lowest, highest);
        snprintf(about, sizeof about, "%s(%.17g)", name, x);
        assert_close(exact((long double)x), 1.0, own_unary(x));
    }
}

static void compare_binary(const char *name, binary *own,
                           long double (*exact)(long double, long double), double units, int lowest,
                           int highest) {
    own_binary = own;
    (void)binary_of_system(name, own);
    for (int i = 0; i < SPECIAL * SPECIAL + RANDOM; i++) {
        const bool is_special = i < SPECIAL * SPECIAL;
        const double x = is_special ? special[i % SPECIAL] : random_number(lowest, highest);
        const double y = is_special ? special[i / SPECIAL] : random_number(lowest, highest);
        snprintf(about, sizeof about, "%s(%.17g, %.17g)", name, x, y);
        assert_close(exact((long double)x, (long double)y), units, own_binary(x, y));
    }
}

/* ---- Tests ---------------------------------------------------------------------------------- */

static void test_sine_and_cosine(void) {
    compare_unary("sin", sin, sinl, -30, 60);
    compare_unary("cos", cos, cosl, -30, 60);
}

/* A compiler may make one call of two. */
static void test_sine_and_cosine_in_one_call_have_the_same_bits(void) {
    for (int i = 0; i < SPECIAL + 10 * RANDOM; i++) {
        const double x = i < SPECIAL ? special[i] : random_number(-40, 60);
        double sine = 0.0;
        double cosine = 0.0;
        snprintf(about, sizeof about, "sincos(%.17g)", x);
        sincos(x, &sine, &cosine);
        own_unary = sin;
        assert_same(own_unary(x), sine);
        own_unary = cos;
        assert_same(own_unary(x), cosine);
    }
}

static void test_arc_tangent(void) {
    compare_binary("atan2", atan2, atan2l, 2.0, -30, 30);
}

static void test_power_and_exponential(void) {
    compare_binary("pow", pow, powl, 1.0, -8, 8);
    compare_unary("exp", exp, expl, -30, 10);
}

static void test_logarithm(void) {
    compare_unary("log", log, logl, -1000, 1000);
    compare_unary("log", log, logl, -1, 1); // near its root
}

static void test_exact_functions_of_one_argument(void) {
    unary *const own[] = {sqrt, floor, ceil, fabs};
    const char *const names[] = {"sqrt", "floor", "ceil", "fabs"};
    for (size_t k = 0; k < sizeof own / sizeof own[0]; k++) {
        unary *const expected = unary_of_system(names[k], own[k]);
        own_unary = own[k];
        for (int i = 0; i < SPECIAL + RANDOM; i++) {
            const double x = i < SPECIAL ? special[i] : random_number(-60, 60);
            snprintf(about, sizeof about, "%s(%.17g)", names[k], x);
            assert_same(expected(x), own_unary(x));
        }
    }
}

/* But for zeros of two signs, of which fmin and fmax may return either. */
static void test_exact_functions_of_two_arguments(void) {
    binary *const own[] = {fmin, fmax, remainder};
    const char *const names[] = {"fmin", "fmax", "remainder"};
    for (size_t k = 0; k < sizeof own / sizeof own[0]; k++) {
        binary *const expected = binary_of_system(names[k], own[k]);
        own_binary = own[k];
        for (int i = 0; i < SPECIAL * SPECIAL + RANDOM; i++) {
            const bool is_special = i < SPECIAL * SPECIAL;
            const double x = is_special ? special[i % SPECIAL] : random_number(-40, 40);
            const double y = is_special ? special[i / SPECIAL] : random_number(-40, 40);
            snprintf(about, sizeof about, "%s(%.17g, %.17g)", names[k], x, y);
            if (k < 2 && x == 0.0 && y == 0.0) {
                TEST_ASSERT_TRUE_MESSAGE(own_binary(x, y) == 0.0, about);
            } else {
                assert_same(expected(x, y), own_binary(x, y));
            }
        }
    }
}

static void test_the_lesser_zero_is_the_negative_one(void) {
    own_binary = fmin;
    TEST_ASSERT_TRUE(signbit(own_binary(0.0, -0.0)) && signbit(own_binary(-0.0, 0.0)));
    own_binary = fmax;
    TEST_ASSERT_FALSE(signbit(own_binary(0.0, -0.0)) || signbit(own_binary(-0.0, 0.0)));
}
