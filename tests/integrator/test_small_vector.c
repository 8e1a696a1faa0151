/* Every operation of the small vector against N_Vector_Serial. */
#include "small_vector.h"

#include "allocations.h"

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

/* Runs a test at every length, also at those with special loops. */
static void at_every_length(void (*test)(void)) {
    for (sunindextype n = 1; n <= LONGEST; n++) {
        create(n);
        test();
        destroy();
    }
}

void setUp(void) {
    TEST_ASSERT_EQUAL_INT(0, SUNContext_Create(NULL, &context));
}

void tearDown(void) {
    SUNContext_Free(&context);
}

/* The result apart from the operands (2), or in place of one (0, 1). */
#define EACH_RESULT(z) for (int z = 0; z < 3; z++)

static void check_linear_sum(void) {
    static const double factors[] = {1.0, -1.0, 0.0, 2.5, -0.3};
    EACH_RESULT(z) {
        for (int i = 0; i < 5; i++) {
            for (int j = 0; j < 5; j++) {
                N_VLinearSum(factors[i], small[0][0], factors[j], small[1][0], small[z][0]);
                N_VLinearSum(factors[i], serial[0][0], factors[j], serial[1][0], serial[z][0]);
                assert_same(256.0 * 8.0 * DBL_EPSILON);
            }
        }
    }
}

static void check_elementwise(void) {
    EACH_RESULT(z) {
        N_VProd(small[0][0], small[1][0], small[z][0]);
        N_VProd(serial[0][0], serial[1][0], serial[z][0]);
        assert_same(0.0);
        N_VDiv(small[0][0], small[1][0], small[z][0]);
        N_VDiv(serial[0][0], serial[1][0], serial[z][0]);
        assert_same(0.0);
        N_VAbs(small[0][0], small[z][0]);
        N_VAbs(serial[0][0], serial[z][0]);
        assert_same(0.0);
        N_VInv(small[0][0], small[z][0]);
        N_VInv(serial[0][0], serial[z][0]);
        assert_same(0.0);
        N_VAddConst(small[0][0], 1.7, small[z][0]);
        N_VAddConst(serial[0][0], 1.7, serial[z][0]);
        assert_same(0.0);
        N_VConst(-3.1, small[z][0]);
        N_VConst(-3.1, serial[z][0]);
        assert_same(0.0);
        for (int half = -2; half < 5; half++) {
            const double factor = 0.5 * half;
            N_VScale(factor, small[0][0], small[z][0]);
            N_VScale(factor, serial[0][0], serial[z][0]);
            assert_same(0.0);
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
            TEST_ASSERT_EQUAL_INT(0, N_VLinearCombination(count, factors, small[0], small[z][0]));
            TEST_ASSERT_EQUAL_INT(0, N_VLinearCombination(count, factors, serial[0], serial[z][0]));
            assert_same(256.0 * 16.0 * DBL_EPSILON);
        }
    }
}

static void check_arrays(void) {
    static sunrealtype factors[COUNT] = {0.5, -2.0, 3.25, 1.0, -0.125};
    for (int count = 1; count <= COUNT; count++) {
        for (int z = 1; z < 3; z++) {
            N_VScaleAddMulti(count, factors, small[0][0], small[1], small[z]);
            N_VScaleAddMulti(count, factors, serial[0][0], serial[1], serial[z]);
            assert_same(0.0);
        }
        EACH_RESULT(z) {
            N_VScaleVectorArray(count, factors, small[0], small[z]);
            N_VScaleVectorArray(count, factors, serial[0], serial[z]);
            assert_same(0.0);
            N_VLinearSumVectorArray(count, 1.5, small[0], -0.25, small[1], small[z]);
            N_VLinearSumVectorArray(count, 1.5, serial[0], -0.25, serial[1], serial[z]);
            assert_same(0.0);
        }
    }
}

/* The terms of a linear combination, as coefficients of a polynomial, that of s^4 first. */
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

static void check_space(void) {
    sunindextype reals = -1;
    sunindextype integers = -1;
    N_VSpace(small[0][0], &reals, &integers);
    TEST_ASSERT_EQUAL_INT(length, reals);
    TEST_ASSERT_EQUAL_INT(1, integers);
}

static void test_space(void) {
    at_every_length(check_space);
}

static void test_linear_sum(void) {
    at_every_length(check_linear_sum);
}

static void test_elementwise_operations(void) {
    at_every_length(check_elementwise);
}

static void test_reductions(void) {
    at_every_length(check_reductions);
}

static void test_linear_combination(void) {
    at_every_length(check_linear_combination);
}

static void test_operations_on_arrays_of_vectors(void) {
    at_every_length(check_arrays);
}

static void test_polynomial_of_noted_terms(void) {
    at_every_length(check_polynomial);
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
    TEST_ASSERT_EQUAL_INT(SUNDIALS_NVEC_CUSTOM, N_VGetVectorID(small[0][0]));
    TEST_ASSERT_EQUAL_PTR(N_VGetArrayPointer(small[0][0]), small_vector_data(small[0][0]));
}

static void test_length(void) {
    at_every_length(check_length);
}

/* A NaN must not vanish in a norm: the integrator recognizes a failed step by it. */
static void test_nan_stays_in_the_norm(void) {
    create(4);
    N_VGetArrayPointer(small[0][0])[2] = NAN;
    TEST_ASSERT_TRUE(isnan(N_VWrmsNorm(small[0][0], small[1][0])));
    destroy();
}

static void test_a_vector_is_one_block_and_operations_take_none(void) {
    sunrealtype factors[COUNT] = {0.5, -2.0, 3.25, 1.0, -0.125};
    create(4);
    const long before = allocation_count();
    N_Vector another = N_VClone(small[0][0]);
    TEST_ASSERT_EQUAL_INT(before + 1, allocation_count());
    N_VLinearCombination(COUNT, factors, small[0], another);
    N_VScaleAddMulti(COUNT, factors, another, small[1], small[2]);
    TEST_ASSERT_TRUE(N_VWrmsNorm(another, small[1][0]) > 0.0);
    TEST_ASSERT_EQUAL_INT(before + 1, allocation_count());
    N_VDestroy(another);
    destroy();
}
