#include "reserve.h"

#include "allocator.h"
#include "method.h"

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

static bool is_inside(const void *memory, const struct reserve *of) {
    return (uintptr_t)memory - (uintptr_t)of->block < of->size;
}

static void test_blocks_are_zeroed_aligned_and_apart(void) {
    const size_t sizes[] = {1, 7, 16, 17, 100, 0, 8};
    unsigned char *last_end = NULL;
    memset(reserve.block, 0xa5, reserve.size);
    reserve_enter(&reserve);
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        unsigned char *taken = reserve_malloc(sizes[i]);
        TEST_ASSERT_NOT_NULL(taken);
        TEST_ASSERT_TRUE(is_inside(taken, &reserve));
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
    TEST_ASSERT_NOT_NULL(reserve_malloc(100));
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
    TEST_ASSERT_NULL(reserve_malloc(1025));
    TEST_ASSERT_NULL(reserve_malloc(SIZE_MAX));
    TEST_ASSERT_NOT_NULL(reserve_malloc(1000));
    const size_t used = reserve.used;
    TEST_ASSERT_NOT_NULL(reserve_malloc(15));
    TEST_ASSERT_NULL(reserve_malloc(1));
    TEST_ASSERT_NULL(reserve_malloc(0));
    reserve_cut(&reserve, used);
    TEST_ASSERT_NOT_NULL(reserve_malloc(15));
    reserve_leave(&reserve);
}

static void test_only_the_reserve_entered_last_gives(void) {
    struct reserve inner;
    TEST_ASSERT_TRUE(reserve_create(&inner, 64));
    TEST_ASSERT_NULL(reserve_malloc(1));
    reserve_enter(&reserve);
    TEST_ASSERT_EQUAL_PTR(reserve.block, reserve_malloc(1));
    reserve_enter(&inner);
    TEST_ASSERT_EQUAL_PTR(inner.block, reserve_malloc(1));
    TEST_ASSERT_NULL(reserve_malloc(64));
    reserve_leave(&inner);
    TEST_ASSERT_TRUE(is_inside(reserve_malloc(1), &reserve));
    reserve_leave(&reserve);
    TEST_ASSERT_NULL(reserve_malloc(1));
    TEST_ASSERT_EQUAL_UINT(inner.size, 64);
    reserve_destroy(&inner);
}

static void test_the_program_s_own_allocations_stay_its_own(void) {
    reserve_enter(&reserve);
    const long before = allocator_calls();
    void *volatile own = malloc(10);
    TEST_ASSERT_NOT_NULL(own);
    TEST_ASSERT_FALSE(is_inside(own, &reserve));
    free(own);
    TEST_ASSERT_EQUAL_INT(before + 1, allocator_calls());
    TEST_ASSERT_EQUAL_UINT(0, reserve.used);
    reserve_leave(&reserve);
}

static void test_what_was_given_out_comes_back_only_as_a_whole(void) {
    reserve_enter(&reserve);
    const long calls = allocator_calls();
    const long outstanding = allocator_outstanding();
    void *taken = reserve_malloc(500);
    const size_t used = reserve.used;
    reserve_free(taken);
    reserve_free(NULL);
    TEST_ASSERT_EQUAL_UINT(used, reserve.used);
    TEST_ASSERT_NULL(reserve_malloc(600));
    TEST_ASSERT_EQUAL_INT(calls, allocator_calls());
    TEST_ASSERT_EQUAL_INT(outstanding, allocator_outstanding());
    reserve_cut(&reserve, 0);
    TEST_ASSERT_EQUAL_PTR(taken, reserve_malloc(600));
    reserve_leave(&reserve);
}

static void test_an_array_is_zeroed_and_inside(void) {
    memset(reserve.block, 0xa5, reserve.size);
    reserve_enter(&reserve);
    const unsigned char *taken = reserve_calloc(10, 40);
    TEST_ASSERT_TRUE(is_inside(taken, &reserve));
    TEST_ASSERT_EACH_EQUAL_UINT8(0, taken, 400);
    TEST_ASSERT_NULL(reserve_calloc(10, 80));
    TEST_ASSERT_TRUE(is_inside(reserve_calloc(10, 0), &reserve));
    reserve_leave(&reserve);
}

static void test_a_product_that_overflows_is_no_small_block(void) {
    reserve_enter(&reserve);
    TEST_ASSERT_NULL(reserve_calloc(SIZE_MAX / 2 + 2, 2));
    TEST_ASSERT_NULL(reserve_calloc(2, SIZE_MAX / 2 + 2));
    TEST_ASSERT_EQUAL_UINT(0, reserve.used);
    reserve_leave(&reserve);
}

static void test_a_block_that_grows_keeps_what_is_in_it(void) {
    reserve_enter(&reserve);
    char *grown = reserve_realloc(NULL, 4);
    memcpy(grown, "xyz", 4);
    memset(reserve_malloc(40), 'a', 40);
    grown = reserve_realloc(grown, 500);
    TEST_ASSERT_TRUE(is_inside(grown, &reserve));
    TEST_ASSERT_EQUAL_STRING("xyz", grown);
    grown = reserve_realloc(grown, 2);
    TEST_ASSERT_EQUAL_MEMORY("xy", grown, 2);
    TEST_ASSERT_NULL(reserve_realloc(grown, 5000));
    TEST_ASSERT_EQUAL_MEMORY("xy", grown, 2);
    reserve_leave(&reserve);
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
    holder->mistakes += reserve_malloc(1) != NULL;
    reserve_enter(&holder->reserve);
    for (size_t i = 0; i < 100; i++) {
        char *taken = reserve_malloc(16);
        holder->mistakes += taken != holder->reserve.block + 16 * i;
    }
    if (atomic_fetch_sub(&left_to_enter, 1) > 0) {
        while (atomic_load(&left_to_enter) > 0) {
            sched_yield();
        }
    }
    reserve_leave(&holder->reserve);
    holder->mistakes += reserve_malloc(1) != NULL;
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
    TEST_ASSERT_NULL(reserve_malloc(0));
    TEST_ASSERT_NULL(reserve_malloc(1));
    reserve_leave(&empty);
    reserve_destroy(&empty);
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

static enum status decay_series(double t, double unit, int first, int last,
                                double row[][SERIES_LENGTH], void *count) {
    (void)t;
    for (size_t i = 0; i < *(const size_t *)count; i++) {
        for (int k = first > 0 ? first : 1; k <= last; k++) {
            row[i][k] = -unit / k * row[i][k - 1];
        }
    }
    return STATUS_OK;
}

/* Methods in this order: every pair follows one another. */
static void test_the_reserve_of_an_integrator_is_enough(void) {
    enum { MOST = 100 };
    static const enum integrator_method methods[] = {
        INTEGRATOR_CVODE_ADAMS, INTEGRATOR_CVODE_BDF,   INTEGRATOR_ERK,       INTEGRATOR_TAYLOR,
        INTEGRATOR_CVODE_ADAMS, INTEGRATOR_ERK,         INTEGRATOR_CVODE_BDF, INTEGRATOR_TAYLOR,
        INTEGRATOR_ERK,         INTEGRATOR_CVODE_ADAMS, INTEGRATOR_TAYLOR,    INTEGRATOR_CVODE_BDF,
        INTEGRATOR_CVODE_ADAMS};
    static double x[MOST];
    static double tolerances[MOST];
    for (size_t i = 0; i < MOST; i++) {
        tolerances[i] = 1e-10;
    }
    for (size_t n = 1; n <= MOST; n += n < 20 ? 1 : 20) {
        const struct ode ode = {.state_count = n,
                                .rhs = decay,
                                .jacobian = decay_jacobian,
                                .series = decay_series,
                                .series_row_count = n,
                                .context = &n};
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
            TEST_ASSERT_EQUAL_INT(
                STATUS_OK,
                integrator_restart(integrator, x, &(struct integrator_start){.span = 10.0}));
            TEST_ASSERT_EQUAL_INT(STATUS_OK,
                                  integrator_advance(integrator, 1.0, 1000, &reached, x));
        }
        TEST_ASSERT_EQUAL_INT(before + 2, allocator_calls()); // the handle and its reserve
        integrator_destroy(integrator);
    }
}

static const struct method *const all_methods[] = {
#define METHOD_ENTRY(code, symbol) &(symbol),
    INTEGRATOR_METHOD_LIST(METHOD_ENTRY)
#undef METHOD_ENTRY
};

static size_t bytes_taken(const struct method *method, const struct ode *ode) {
    struct problem problem = {.ode = *ode};
    struct reserve whole;
    void *memory = NULL;
    TEST_ASSERT_TRUE(reserve_create(&whole, method->memory_size(ode)));
    reserve_enter(&whole);
    TEST_ASSERT_EQUAL_INT(STATUS_OK, method->create(&problem, &memory));
    reserve_leave(&whole);
    method->destroy(memory);
    const size_t used = whole.used;
    reserve_destroy(&whole);
    return used;
}

static void test_the_reserve_of_an_integrator_is_no_larger_than_needed(void) {
    for (size_t n = 1; n <= 100; n++) {
        const struct ode ode = {.state_count = n,
                                .rhs = decay,
                                .jacobian = decay_jacobian,
                                .series = decay_series,
                                .series_row_count = n,
                                .context = &n};
        size_t size = 0;
        size_t most = 0;
        for (size_t i = 0; i < sizeof all_methods / sizeof all_methods[0]; i++) {
            const size_t taken = bytes_taken(all_methods[i], &ode);
            const size_t wanted = all_methods[i]->memory_size(&ode);
            most = taken > most ? taken : most;
            size = wanted > size ? wanted : size;
        }
        TEST_ASSERT_TRUE(most <= size);
        TEST_ASSERT_TRUE(size <= most + 320);
    }
}
