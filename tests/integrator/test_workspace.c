#include "last_text.h"
#include "workspace.h"

#include "allocator.h"
#include "integrator.h"
#include "method.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#define COUNT(array) (sizeof(array) / sizeof(array)[0])

static struct workspace workspace;

void setUp(void) {
    TEST_ASSERT_TRUE(workspace_create(&workspace, 1024));
}

void tearDown(void) {
    (void)allocator_stop();
    workspace_destroy(&workspace);
}

static bool is_inside(const void *memory, const struct workspace *of) {
    return (uintptr_t)memory - (uintptr_t)of->block < of->size;
}

/* By whatever function they are asked for. */
static void test_blocks_are_zeroed_aligned_and_apart(void) {
    static const size_t sizes[] = {1, 7, 16, 17, 100, 0, 8};
    unsigned char *last_end = NULL;
    memset(workspace.block, 0xa5, workspace.size);
    workspace_enter(&workspace);
    for (size_t i = 0; i < 3 * COUNT(sizes); i++) {
        const size_t size = sizes[i / 3];
        unsigned char *taken = i % 3 == 0   ? workspace_malloc(size)
                               : i % 3 == 1 ? workspace_calloc(size, 1)
                                            : workspace_realloc(NULL, size);
        TEST_ASSERT_NOT_NULL(taken);
        TEST_ASSERT_TRUE(is_inside(taken, &workspace));
        TEST_ASSERT_EQUAL_UINT(0, (uintptr_t)taken % _Alignof(max_align_t));
        TEST_ASSERT_TRUE(taken >= last_end);
        for (size_t k = 0; k < size; k++) {
            TEST_ASSERT_EQUAL_UINT8(0, taken[k]);
        }
        last_end = taken + size;
    }
    workspace_leave(&workspace);
}

static void test_no_more_than_there_is_is_given_out(void) {
    workspace_enter(&workspace);
    TEST_ASSERT_NULL(workspace_malloc(1025));
    TEST_ASSERT_NULL(workspace_malloc(SIZE_MAX));
    TEST_ASSERT_NULL(workspace_calloc(10, 110));
    TEST_ASSERT_NULL(workspace_calloc(SIZE_MAX / 2 + 2, 2)); // a product that overflows
    TEST_ASSERT_NULL(workspace_calloc(2, SIZE_MAX / 2 + 2));
    TEST_ASSERT_EQUAL_UINT(0, workspace.used);
    TEST_ASSERT_NOT_NULL(workspace_malloc(1000));
    const size_t used = workspace.used;
    TEST_ASSERT_NOT_NULL(workspace_malloc(15));
    TEST_ASSERT_NULL(workspace_malloc(1));
    TEST_ASSERT_NULL(workspace_malloc(0));
    workspace_cut(&workspace, used);
    TEST_ASSERT_NOT_NULL(workspace_malloc(15));
    workspace_leave(&workspace);
    for (int i = 0; i < 2; i++) {
        workspace_destroy(&workspace);
        TEST_ASSERT_NULL(workspace.block);
        TEST_ASSERT_EQUAL_UINT64(0, workspace.size);
        TEST_ASSERT_EQUAL_UINT64(0, workspace.used);
    }
}

static void test_only_the_workspace_entered_last_gives(void) {
    struct workspace inner;
    TEST_ASSERT_TRUE(workspace_create(&inner, 64));
    TEST_ASSERT_NULL(workspace_malloc(1));
    workspace_enter(&workspace);
    TEST_ASSERT_EQUAL_PTR(workspace.block, workspace_malloc(1));
    workspace_enter(&inner);
    TEST_ASSERT_EQUAL_PTR(inner.block, workspace_malloc(1));
    TEST_ASSERT_NULL(workspace_malloc(64));
    workspace_leave(&inner);
    TEST_ASSERT_TRUE(is_inside(workspace_malloc(1), &workspace));
    workspace_leave(&workspace);
    TEST_ASSERT_NULL(workspace_malloc(1));
    TEST_ASSERT_EQUAL_UINT(inner.size, 64);
    workspace_destroy(&inner);
}

/* The program's own allocations stay its own, and there are no others. */
static void test_what_was_given_out_comes_back_only_as_a_whole(void) {
    workspace_enter(&workspace);
    const long calls = allocator_calls();
    void *volatile own = malloc(10);
    TEST_ASSERT_FALSE(is_inside(own, &workspace));
    free(own);
    TEST_ASSERT_EQUAL_UINT(0, workspace.used);
    const long outstanding = allocator_outstanding();
    void *taken = workspace_malloc(500);
    const size_t used = workspace.used;
    workspace_free(taken);
    workspace_free(NULL);
    TEST_ASSERT_EQUAL_UINT(used, workspace.used);
    TEST_ASSERT_NULL(workspace_malloc(600));
    TEST_ASSERT_EQUAL_INT(calls + 1, allocator_calls());
    TEST_ASSERT_EQUAL_INT(outstanding, allocator_outstanding());
    workspace_cut(&workspace, 0);
    TEST_ASSERT_EQUAL_PTR(taken, workspace_malloc(600));
    workspace_leave(&workspace);
}

static void test_a_block_that_grows_keeps_what_is_in_it(void) {
    workspace_enter(&workspace);
    char *grown = workspace_realloc(NULL, 4);
    memcpy(grown, "xyz", 4);
    memset(workspace_malloc(40), 'a', 40);
    grown = workspace_realloc(grown, 500);
    TEST_ASSERT_TRUE(is_inside(grown, &workspace));
    TEST_ASSERT_EQUAL_STRING("xyz", grown);
    grown = workspace_realloc(grown, 2);
    TEST_ASSERT_EQUAL_MEMORY("xy", grown, 2);
    TEST_ASSERT_NULL(workspace_realloc(grown, 5000));
    TEST_ASSERT_EQUAL_MEMORY("xy", grown, 2);
    workspace_leave(&workspace);
}

/* As many threads as there is room for hold their workspaces until all of them have entered; the
 * others have to wait for that. */
enum { THREADS = 300, ROOM = 256 };

struct holder {
    struct workspace workspace;
    unsigned mistakes;
};

static struct holder holders[THREADS];
static atomic_int left_to_enter;

static void *hold(void *holder_pointer) {
    struct holder *holder = holder_pointer;
    holder->mistakes += workspace_malloc(1) != NULL;
    workspace_enter(&holder->workspace);
    for (size_t i = 0; i < 100; i++) {
        char *taken = workspace_malloc(16);
        holder->mistakes += taken != holder->workspace.block + 16 * i;
    }
    if (atomic_fetch_sub(&left_to_enter, 1) > 0) {
        while (atomic_load(&left_to_enter) > 0) {
            sched_yield();
        }
    }
    workspace_leave(&holder->workspace);
    holder->mistakes += workspace_malloc(1) != NULL;
    return NULL;
}

static void test_each_thread_has_its_own_workspace(void) {
    static pthread_t threads[THREADS];
    atomic_store(&left_to_enter, ROOM);
    for (size_t i = 0; i < THREADS; i++) {
        TEST_ASSERT_TRUE(workspace_create(&holders[i].workspace, 4096));
        TEST_ASSERT_EQUAL_INT(0, pthread_create(&threads[i], NULL, hold, &holders[i]));
    }
    for (size_t i = 0; i < THREADS; i++) {
        TEST_ASSERT_EQUAL_INT(0, pthread_join(threads[i], NULL));
        TEST_ASSERT_EQUAL_UINT(0, holders[i].mistakes);
        workspace_destroy(&holders[i].workspace);
    }
}

static void test_without_memory_the_workspace_is_empty(void) {
    struct workspace empty;
    allocator_fail(1, ALLOCATOR_ONE);
    const bool is_created = workspace_create(&empty, 64);
    TEST_ASSERT_EQUAL_INT(1, allocator_stop());
    TEST_ASSERT_FALSE(is_created);
    workspace_enter(&empty);
    TEST_ASSERT_NULL(workspace_malloc(0));
    TEST_ASSERT_NULL(workspace_malloc(1));
    workspace_leave(&empty);
    workspace_destroy(&empty);
}

/* ---- As the integrator has it --------------------------------------------------------------- */

static enum status decay(double t, const double x[], double dx[], void *count) {
    for (size_t i = 0; i < *(const size_t *)count; i++) {
        dx[i] = -x[i];
    }
    return STATUS_OK;
}

static size_t gradients; // copies among the states

static enum status decay_jacobian(double t, const double x[], double J[], void *count) {
    const size_t n = *(const size_t *)count / (1 + gradients);
    memset(J, 0, n * n * sizeof(double));
    for (size_t i = 0; i < n; i++) {
        J[i * n + i] = -1.0;
    }
    return STATUS_OK;
}

static enum status decay_series(double t, double time_scale, int first, int last,
                                double row[][SERIES_LENGTH], void *count) {
    for (size_t i = 0; i < *(const size_t *)count; i++) {
        for (int k = first > 0 ? first : 1; k <= last; k++) {
            row[i][k] = -time_scale / k * row[i][k - 1];
        }
    }
    return STATUS_OK;
}

static struct ode decay_of(size_t *count) {
    return (struct ode){.state_count = *count,
                        .gradient_count = (unsigned)gradients,
                        .rhs = decay,
                        .jacobian = decay_jacobian,
                        .series = decay_series,
                        .series_row_count = *count,
                        .context = count};
}

/* Methods in this order: every pair follows one another. */
static void test_the_workspace_of_an_integrator_is_enough(void) {
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
        const struct ode ode = decay_of(&n);
        const struct message_sink quiet = {0};
        struct integrator *integrator = NULL;
        const long before = allocator_calls();
        for (size_t i = 0; i < n; i++) {
            x[i] = 1.0;
        }
        ASSERT_OK(integrator_create(&ode, &quiet, &integrator));
        for (size_t i = 0; i < COUNT(methods); i++) {
            const struct integrator_settings settings = {methods[i], 1e-8, tolerances, 0.0};
            double reached = 0.0;
            ASSERT_OK(integrator_configure(integrator, &settings));
            ASSERT_OK(
                integrator_restart(integrator, x, &(struct integrator_start){.horizon = 10.0}));
            ASSERT_OK(integrator_advance(integrator, 1.0, 1000, &reached, x));
        }
        TEST_ASSERT_EQUAL_INT(before + 2, allocator_calls()); // the handle and its workspace
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
    struct workspace whole;
    void *memory = NULL;
    TEST_ASSERT_TRUE(workspace_create(&whole, method->memory_size(ode)));
    workspace_enter(&whole);
    ASSERT_OK(method->create(&problem, &memory));
    workspace_leave(&whole);
    method->destroy(memory);
    const size_t used = whole.used;
    workspace_destroy(&whole);
    return used;
}

/* Returns the largest number of bytes that a method takes; *size: the number that it wants. */
static size_t most_bytes_taken(const struct ode *ode, size_t *size) {
    size_t most = 0;
    *size = 0;
    for (size_t i = 0; i < COUNT(all_methods); i++) {
        const size_t taken = bytes_taken(all_methods[i], ode);
        const size_t wanted = all_methods[i]->memory_size(ode);
        most = taken > most ? taken : most;
        *size = wanted > *size ? wanted : *size;
    }
    return most;
}

static void test_the_workspace_of_gradients_is_enough(void) {
    for (size_t n = 1; n <= 20; n++) {
        for (gradients = 1; gradients <= 20; gradients++) {
            size_t count = n * (1 + gradients);
            struct ode ode = decay_of(&count);
            ode.indicator_count = gradients % 2; // CVODE takes a series where there are events
            size_t size = 0;
            TEST_ASSERT_TRUE(most_bytes_taken(&ode, &size) <= size);
        }
    }
    gradients = 0;
}

static void test_the_workspace_of_an_integrator_is_no_larger_than_needed(void) {
    for (size_t n = 1; n <= 100; n++) {
        const struct ode ode = decay_of(&n);
        size_t size = 0;
        const size_t most = most_bytes_taken(&ode, &size);
        TEST_ASSERT_TRUE(most <= size);
        TEST_ASSERT_TRUE(size <= most + 320);
    }
}
