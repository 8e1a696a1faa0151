/* Every operation of the small vector against N_Vector_Serial. */
#include "small_vector.h"

#include <float.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>
#include <unity.h>

enum { LONGEST = 9, COUNT = 5 };

static SUNContext context;
static sunindextype length;
static N_Vector small[3][COUNT];  /* three arrays of vectors, for two operands and a result */
static N_Vector serial[3][COUNT]; /* the same numbers */

/* Numbers of both signs and many magnitudes, never 0. */
static double number(int array, int k, sunindextype i) {
    const double phase = 1.0 + array + 3.7 * k + 11.3 * (double)i;
    return sin(phase) * exp2(8.0 * cos(2.3 * phase)) + copysign(0.01, sin(phase));
}

static void fill(void) {
    for (int array = 0; array < 3; array++) {
        for (int k = 0; k < COUNT; k++) {
            for (sunindextype i = 0; i < length; i++) {
                const double value = number(array, k, i);
                N_VGetArrayPointer(small[array][k])[i] = value;
                N_VGetArrayPointer(serial[array][k])[i] = value;
            }
        }
    }
}

static void create(sunindextype n) {
    length = n;
    for (int array = 0; array < 3; array++) {
        for (int k = 0; k < COUNT; k++) {
            small[array][k] =
                array + k == 0 ? small_vector_create(n, context) : N_VClone(small[0][0]);
            serial[array][k] = N_VNew_Serial(n, context);
            TEST_ASSERT_NOT_NULL(small[array][k]);
            for (sunindextype i = 0; i < n; i++) {
                TEST_ASSERT_TRUE(N_VGetArrayPointer(small[array][k])[i] == 0.0);
            }
        }
    }
    // each fused operation is there, as in the small vector
    N_VEnableFusedOps_Serial(serial[0][0], SUNTRUE);
    fill();
}

static void destroy(void) {
    for (int array = 0; array < 3; array++) {
        for (int k = 0; k < COUNT; k++) {
            N_VDestroy(small[array][k]);
            N_VDestroy(serial[array][k]);
        }
    }
}

/* All arrays hold the same, bit for bit or, where the serial one factors out, to a rounding of the
 * largest term. */
static void assert_same(double rounding) {
    for (int array = 0; array < 3; array++) {
        for (int k = 0; k < COUNT; k++) {
            for (sunindextype i = 0; i < length; i++) {
                const double expected = N_VGetArrayPointer(serial[array][k])[i];
                const double actual = N_VGetArrayPointer(small[array][k])[i];
                TEST_ASSERT_TRUE(fabs(actual - expected) <= rounding);
            }
        }
    }
    fill();
}

void setUp(void) {
    TEST_ASSERT_EQUAL_INT(0, SUNContext_Create(NULL, &context));
}

void tearDown(void) {
    SUNContext_Free(&context);
}

/* The operation on the small vectors and on the serial ones, and what they give. */
#define COMPARE(rounding, operation)                                                               \
    do {                                                                                           \
        N_Vector(*of)[COUNT] = small;                                                              \
        operation;                                                                                 \
        of = serial;                                                                               \
        operation;                                                                                 \
        assert_same(rounding);                                                                     \
    } while (0)

/* The result apart from the operands (2), or in place of one (0, 1). */
#define EACH_RESULT(z) for (int z = 0; z < 3; z++)

static void check_linear_sum(void) {
    static const double factors[] = {1.0, -1.0, 0.0, 2.5, -0.3};
    EACH_RESULT(z) {
        for (int i = 0; i < 5; i++) {
            for (int j = 0; j < 5; j++) {
                COMPARE(256.0 * 8.0 * DBL_EPSILON,
                        N_VLinearSum(factors[i], of[0][0], factors[j], of[1][0], of[z][0]));
            }
        }
    }
}

static void check_elementwise(void) {
    EACH_RESULT(z) {
        COMPARE(0.0, N_VProd(of[0][0], of[1][0], of[z][0]));
        COMPARE(0.0, N_VDiv(of[0][0], of[1][0], of[z][0]));
        COMPARE(0.0, N_VAbs(of[0][0], of[z][0]));
        COMPARE(0.0, N_VInv(of[0][0], of[z][0]));
        COMPARE(0.0, N_VAddConst(of[0][0], 1.7, of[z][0]));
        COMPARE(0.0, N_VConst(-3.1, of[z][0]));
        for (int half = -2; half < 5; half++) {
            const double factor = 0.5 * half;
            COMPARE(0.0, N_VScale(factor, of[0][0], of[z][0]));
        }
    }
}

static void check_reductions(void) {
    TEST_ASSERT_TRUE(N_VDotProd(small[0][0], small[1][0]) ==
                     N_VDotProd(serial[0][0], serial[1][0]));
    TEST_ASSERT_TRUE(N_VMaxNorm(small[0][0]) == N_VMaxNorm(serial[0][0]));
    TEST_ASSERT_TRUE(N_VMin(small[0][0]) == N_VMin(serial[0][0]));
    TEST_ASSERT_TRUE(N_VWrmsNorm(small[0][0], small[1][0]) ==
                     N_VWrmsNorm(serial[0][0], serial[1][0]));
}

static void check_linear_combination(void) {
    // an int for SUNDIALS 6 and 7 alike
    static sunrealtype factors[COUNT] = {0.5, -2.0, 3.25, 1.0, -0.125};
    for (int count = 1; count <= COUNT; count++) {
        for (int z = 0; z < 2; z++) { // in place of the first operand, and apart
            COMPARE(
                256.0 * 16.0 * DBL_EPSILON,
                TEST_ASSERT_EQUAL_INT(0, N_VLinearCombination(count, factors, of[0], of[z][0])));
        }
    }
}

static void check_arrays(void) {
    static sunrealtype factors[COUNT] = {0.5, -2.0, 3.25, 1.0, -0.125};
    for (int count = 1; count <= COUNT; count++) {
        for (int z = 1; z < 3; z++) {
            COMPARE(0.0, N_VScaleAddMulti(count, factors, of[0][0], of[1], of[z]));
        }
        EACH_RESULT(z) {
            COMPARE(0.0, N_VScaleVectorArray(count, factors, of[0], of[z]));
            COMPARE(0.0, N_VLinearSumVectorArray(count, 1.5, of[0], -0.25, of[1], of[z]));
        }
    }
}

/* The terms of a linear combination, as coefficients of a polynomial, of s^4 first. */
static void check_polynomial(void) {
    sunrealtype powers[COUNT];
    struct small_vector_terms terms = {0};
    for (int k = 0; k < COUNT; k++) {
        powers[k] = pow(-0.75, COUNT - 1 - k);
    }
    small_vector_note_terms(small[2][0], &terms);
    N_VLinearCombination(COUNT, powers, small[0], small[2][0]);
    small_vector_note_terms(small[2][0], NULL);
    N_VLinearCombination(COUNT, powers, serial[0], serial[2][0]);
    TEST_ASSERT_EQUAL_INT(COUNT, terms.count);
    for (int k = 0; k < COUNT; k++) {
        TEST_ASSERT_EQUAL_PTR(small_vector_data(small[0][k]), terms.data[k]);
    }
    N_VConst(0.0, small[2][0]);
    small_vector_polynomial(&terms, -0.75, (size_t)length, small_vector_data(small[2][0]));
    assert_same(COUNT * 256.0 * DBL_EPSILON);
}

static void test_more_terms_than_there_is_room_for_are_not_noted(void) {
    sunrealtype factors[SMALL_VECTOR_MOST_TERMS + 1] = {1.0};
    N_Vector same[SMALL_VECTOR_MOST_TERMS + 1];
    struct small_vector_terms terms = {.count = 1};
    create(4);
    for (int k = 0; k <= SMALL_VECTOR_MOST_TERMS; k++) {
        same[k] = small[0][0];
    }
    small_vector_note_terms(small[1][0], &terms);
    N_VLinearCombination(SMALL_VECTOR_MOST_TERMS + 1, factors, same, small[1][0]);
    TEST_ASSERT_EQUAL_INT(0, terms.count);
    N_VLinearCombination(SMALL_VECTOR_MOST_TERMS, factors, same, small[1][0]);
    TEST_ASSERT_EQUAL_INT(SMALL_VECTOR_MOST_TERMS, terms.count);
    destroy();
}

static void check_length(void) {
    sunindextype reals = 0;
    sunindextype integers = 0;
    TEST_ASSERT_EQUAL_INT(length, N_VGetLength(small[0][0]));
    N_VSpace(small[0][0], &reals, &integers);
    TEST_ASSERT_EQUAL_INT(length, reals);
    TEST_ASSERT_EQUAL_INT(1, integers);
    TEST_ASSERT_EQUAL_INT(SUNDIALS_NVEC_CUSTOM, N_VGetVectorID(small[0][0]));
    TEST_ASSERT_EQUAL_PTR(N_VGetArrayPointer(small[0][0]), small_vector_data(small[0][0]));
}

static void test_operations_at_every_length(void) {
    static void (*const checks[])(void) = {
        check_length,     check_linear_sum,         check_elementwise,
        check_reductions, check_linear_combination, check_arrays,
        check_polynomial};
    for (size_t i = 0; i < sizeof checks / sizeof checks[0]; i++) {
        for (sunindextype n = 1; n <= LONGEST; n++) {
            create(n);
            checks[i]();
            destroy();
        }
    }
}

/* A NaN must not vanish in a norm: the integrator recognizes a failed step by it. */
static void test_nan_stays_in_the_norm(void) {
    create(4);
    N_VGetArrayPointer(small[0][0])[2] = NAN;
    TEST_ASSERT_TRUE(isnan(N_VWrmsNorm(small[0][0], small[1][0])));
    destroy();
}
