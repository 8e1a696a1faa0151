/* Counts of an encoder: the nearest multiple of the resolution, of two the upper one. */
#include "rp_sensor.h"

#include <float.h>
#include <math.h>
#include <unity.h>

static void assert_counts(int expected, double position, double resolution) {
    TEST_ASSERT_EQUAL_INT(expected, rp_sensor_count(position, resolution));
}

static void test_counts_of_multiples(void) {
    for (int n = -1000; n <= 1000; n++) {
        assert_counts(n, n * 0.125, 0.125);
        assert_counts(n, n * 1e-12, 1e-12);
        assert_counts(n, n * 3e5, 3e5);
    }
}

/* With a resolution of 1/8 all quotients are exact. */
static void test_counts_change_halfway(void) {
    for (int n = -1000; n <= 1000; n++) {
        const double edge = (n + 0.5) * 0.125;
        assert_counts(n + 1, edge, 0.125);
        assert_counts(n, nextafter(edge, -INFINITY), 0.125);
        assert_counts(n + 1, nextafter(edge, INFINITY), 0.125);
    }
    assert_counts(0, 0.49999999999999994, 1.0); // the sum with 1/2 would be 1
    assert_counts(0, -0.5, 1.0);
    assert_counts(-1, nextafter(-0.5, -INFINITY), 1.0);
}

static void test_zeros_and_smallest_positions_count_nothing(void) {
    assert_counts(0, 0.0, 1e-6);
    assert_counts(0, -0.0, 1e-6);
    assert_counts(0, DBL_TRUE_MIN, 1e-12);
    assert_counts(0, -DBL_TRUE_MIN, 1e-12);
}

static void test_the_counter_stops_at_its_ends(void) {
    assert_counts(2147483646, 2147483646.25, 1.0);
    assert_counts(2147483647, 2147483646.5, 1.0);
    assert_counts(2147483647, 2147483647.75, 1.0);
    assert_counts(2147483647, 1e300, 1e-12);
    assert_counts(2147483647, INFINITY, 1.0);
    assert_counts(-2147483646, -2147483646.5, 1.0);
    assert_counts(-2147483647, -2147483646.75, 1.0);
    assert_counts(-2147483647, -2147483648.0, 1.0);
    assert_counts(-2147483647, -1e300, 1e-12);
    assert_counts(-2147483647, -INFINITY, 1.0);
}
