#include "reserve.h"

#include "allocator.h"
#include "integrator.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

static struct reserve reserve;

void setUp(void) {
    TEST_ASSERT_TRUE(reserve_create(&reserve, 1024));
}

void tearDown(void) {
    (void)allocator_stop();
    reserve_destroy(&reserve);
}

static bool is_inside(const void *memory) {
    return reserve_rest(memory) > 0;
}

static void test_blocks_are_zeroed_aligned_and_apart(void) {
    const size_t sizes[] = {1, 7, 16, 17, 100, 0, 8};
    unsigned char *last_end = NULL;
    memset(reserve.block, 0xa5, reserve.size);
    reserve_enter(&reserve);
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        unsigned char *taken = reserve_take(sizes[i]);
        TEST_ASSERT_NOT_NULL(taken);
        TEST_ASSERT_TRUE(is_inside(taken));
        TEST_ASSERT_EQUAL_UINT(0, (uintptr_t)taken % _Alignof(max_align_t));
        TEST_ASSERT_TRUE(taken >= last_end);
        for (size_t k = 0; k < sizes[i]; k++) {
            TEST_ASSERT_EQUAL_UINT8(0, taken[k]);
        }
        last_end = taken + sizes[i];
    }
    reserve_leave(&reserve);
}

static void test_a_destroyed_reserve_is_empty(void) {
    reserve_enter(&reserve);
    TEST_ASSERT_NOT_NULL(reserve_take(100));
    reserve_leave(&reserve);
    for (int i = 0; i < 2; i++) {
        reserve_destroy(&reserve);
        TEST_ASSERT_NULL(reserve.block);
        TEST_ASSERT_EQUAL_UINT64(0, reserve.size);
        TEST_ASSERT_EQUAL_UINT64(0, reserve.used);
    }
}

static void test_no_more_than_there_is_is_given_out(void) {
    reserve_enter(&reserve);
    TEST_ASSERT_NULL(reserve_take(1025));
    TEST_ASSERT_NULL(reserve_take(SIZE_MAX));
    TEST_ASSERT_NOT_NULL(reserve_take(1000));
    const size_t used = reserve.used;
    TEST_ASSERT_NOT_NULL(reserve_take(15));
    TEST_ASSERT_NULL(reserve_take(1));
    TEST_ASSERT_NULL(reserve_take(0));
    reserve_cut(&reserve, used);
    TEST_ASSERT_NOT_NULL(reserve_take(15));
    reserve_leave(&reserve);
}

static void test_the_reserve_entered_last_gives(void) {
    struct reserve inner;
    TEST_ASSERT_TRUE(reserve_create(&inner, 64));
    TEST_ASSERT_NULL(reserve_take(1));
    TEST_ASSERT_FALSE(is_inside(reserve.block));
    reserve_enter(&reserve);
    void *outside = reserve_take(1);
    reserve_enter(&inner);
    TEST_ASSERT_TRUE(is_inside(outside));
    TEST_ASSERT_EQUAL_PTR(inner.block, reserve_take(1));
    reserve_leave(&inner);
    TEST_ASSERT_TRUE(is_inside(outside));
    reserve_leave(&reserve);
    TEST_ASSERT_FALSE(is_inside(outside));
    reserve_destroy(&inner);
}

/* As many threads as there is room for hold their reserves until all of them have entered; the
 * others have to wait for that. */
enum { THREADS = 300, ROOM = 256 };

struct holder {
    struct reserve reserve;
    unsigned mistakes;
};

static struct holder holders[THREADS];
static atomic_int left_to_enter;

static void *hold(void *holder_pointer) {
    struct holder *holder = holder_pointer;
    holder->mistakes += reserve_take(1) != NULL;
    reserve_enter(&holder->reserve);
    for (size_t i = 0; i < 100; i++) {
        char *taken = reserve_take(16);
        holder->mistakes += taken != holder->reserve.block + 16 * i || is_inside(reserve.block);
    }
    if (atomic_fetch_sub(&left_to_enter, 1) > 0) {
        while (atomic_load(&left_to_enter) > 0) {
            sched_yield();
        }
    }
    reserve_leave(&holder->reserve);
    holder->mistakes += reserve_take(1) != NULL;
    return NULL;
}

static void test_each_thread_has_its_own_reserve(void) {
    static pthread_t threads[THREADS];
    atomic_store(&left_to_enter, ROOM);
    for (size_t i = 0; i < THREADS; i++) {
        TEST_ASSERT_TRUE(reserve_create(&holders[i].reserve, 4096));
        TEST_ASSERT_EQUAL_INT(0, pthread_create(&threads[i], NULL, hold, &holders[i]));
    }
    for (size_t i = 0; i < THREADS; i++) {
        TEST_ASSERT_EQUAL_INT(0, pthread_join(threads[i], NULL));
        TEST_ASSERT_EQUAL_UINT(0, holders[i].mistakes);
        reserve_destroy(&holders[i].reserve);
    }
}

static void test_without_memory_the_reserve_is_empty(void) {
    struct reserve empty;
    allocator_fail(1, ALLOCATOR_ONE);
    const bool is_created = reserve_create(&empty, 64);
    TEST_ASSERT_EQUAL_INT(1, allocator_stop());
    TEST_ASSERT_FALSE(is_created);
    reserve_enter(&empty);
    TEST_ASSERT_NULL(reserve_take(1));
    TEST_ASSERT_FALSE(is_inside(&empty));
    reserve_leave(&empty);
    reserve_destroy(&empty);
}

/* ---- As the allocator of a program ---------------------------------------------------------- */

static void test_allocations_come_from_the_reserve_while_there_is_room(void) {
    void *volatile before = malloc(10);
    reserve_enter(&reserve);
    void *volatile taken = malloc(500);
    void *volatile cleared = calloc(10, 40);
    void *volatile beyond = malloc(500);
    void *volatile cleared_beyond = calloc(10, 50);
    TEST_ASSERT_TRUE(is_inside(taken));
    TEST_ASSERT_TRUE(is_inside(cleared));
    TEST_ASSERT_NOT_NULL(beyond);
    TEST_ASSERT_FALSE(is_inside(beyond));
    TEST_ASSERT_NOT_NULL(cleared_beyond);
    TEST_ASSERT_FALSE(is_inside(cleared_beyond));
    const long outstanding = allocator_outstanding();
    free(taken);
    free(cleared);
    TEST_ASSERT_EQUAL_INT(outstanding, allocator_outstanding());
    free(beyond);
    free(cleared_beyond);
    free(before);
    TEST_ASSERT_EQUAL_INT(outstanding - 3, allocator_outstanding());
    reserve_leave(&reserve);
}

static void test_within_an_empty_one_allocations_are_the_program_s_own(void) {
    struct reserve none = {0};
    reserve_enter(&reserve);
    void *volatile taken = malloc(10);
    reserve_enter(&none);
    void *volatile own = malloc(10);
    TEST_ASSERT_TRUE(is_inside(taken));
    TEST_ASSERT_FALSE(is_inside(own));
    const long outstanding = allocator_outstanding();
    free(taken); // from the outer one: nothing happens
    TEST_ASSERT_EQUAL_INT(outstanding, allocator_outstanding());
    reserve_leave(&none);
    reserve_leave(&reserve);
    free(own);
}

static void test_a_block_that_grows_keeps_what_is_in_it(void) {
    char *volatile outside = realloc(NULL, 4);
    memcpy(outside, "abc", 4);
    reserve_enter(&reserve);
    char *volatile inside = realloc(NULL, 4);
    TEST_ASSERT_TRUE(is_inside(inside));
    memcpy(inside, "xyz", 4);
    inside = realloc(inside, 500);
    TEST_ASSERT_TRUE(is_inside(inside));
    TEST_ASSERT_EQUAL_STRING("xyz", inside);
    inside = realloc(inside, 5000);
    TEST_ASSERT_FALSE(is_inside(inside));
    TEST_ASSERT_EQUAL_STRING("xyz", inside);
    outside = realloc(outside, 5000);
    TEST_ASSERT_FALSE(is_inside(outside));
    TEST_ASSERT_EQUAL_STRING("abc", outside);
    reserve_leave(&reserve);
    free(inside);
    free(outside);
}

static void test_a_product_that_overflows_is_no_small_block(void) {
    volatile size_t half = SIZE_MAX / 2 + 2;
    reserve_enter(&reserve);
    allocator_fail(1, ALLOCATOR_ALL); // a sanitizer would stop the program
    void *volatile none = calloc(half, 2);
    TEST_ASSERT_EQUAL_INT(1, allocator_stop());
    TEST_ASSERT_NULL(none);
    reserve_leave(&reserve);
}

/* ---- As the integrator has it --------------------------------------------------------------- */

static enum status decay(double t, const double x[], double dx[], void *count) {
    (void)t;
    for (size_t i = 0; i < *(const size_t *)count; i++) {
        dx[i] = -x[i];
    }
    return STATUS_OK;
}

static enum status decay_jacobian(double t, const double x[], double J[], void *count) {
    const size_t n = *(const size_t *)count;
    (void)t;
    (void)x;
    memset(J, 0, n * n * sizeof(double));
    for (size_t i = 0; i < n; i++) {
        J[i * n + i] = -1.0;
    }
    return STATUS_OK;
}

/* Methods in this order: every pair follows one another. */
static void test_the_reserve_of_an_integrator_is_enough(void) {
    enum { MOST = 100 };
    static const enum integrator_method methods[] = {
        INTEGRATOR_CVODE_ADAMS, INTEGRATOR_CVODE_BDF, INTEGRATOR_ERK,        INTEGRATOR_CVODE_ADAMS,
        INTEGRATOR_ERK,         INTEGRATOR_CVODE_BDF, INTEGRATOR_CVODE_ADAMS};
    static double x[MOST];
    static double tolerances[MOST];
    for (size_t i = 0; i < MOST; i++) {
        tolerances[i] = 1e-10;
    }
    for (size_t n = 1; n <= MOST; n += n < 20 ? 1 : 20) {
        const struct ode ode = {n, decay, decay_jacobian, &n};
        const struct message_sink quiet = {0};
        struct integrator *integrator = NULL;
        const long before = allocator_calls();
        for (size_t i = 0; i < n; i++) {
            x[i] = 1.0;
        }
        TEST_ASSERT_EQUAL_INT(STATUS_OK, integrator_create(&ode, &quiet, &integrator));
        for (size_t i = 0; i < sizeof methods / sizeof methods[0]; i++) {
            const struct integrator_settings settings = {methods[i], 1e-8, tolerances, 0.0};
            double reached = 0.0;
            TEST_ASSERT_EQUAL_INT(STATUS_OK, integrator_configure(integrator, &settings));
            TEST_ASSERT_EQUAL_INT(STATUS_OK, integrator_restart(integrator, x, 10.0, 0.0));
            TEST_ASSERT_EQUAL_INT(STATUS_OK,
                                  integrator_advance(integrator, 1.0, 1000, &reached, x));
        }
        TEST_ASSERT_EQUAL_INT(before + 2, allocator_calls()); // the handle and its reserve
        integrator_destroy(integrator);
    }
}
