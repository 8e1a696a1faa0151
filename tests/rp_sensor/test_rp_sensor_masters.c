/* Ticks under masters that compute their times in different ways. In whole numbers of a decimal
 * unit it is exact which ticks a step has and how old each sample is. What differs in doubles is
 * rounding, and changes neither. */
#include "continuous_states.h"
#include "model_description.h"
#include "one_instance.h"
#include "value_references.h"

#include <float.h>
#include <stdio.h>
#include <string.h>

enum master {
    SUMS,              /* t += h */
    PRODUCTS,          /* t = start + i h */
    DECIMALS,          /* t is read from decimal numbers */
    SUMS_OF_TIMES,     /* t += h, and the step is the difference of its times */
    PRODUCTS_OF_TIMES, /* t = start + i h, likewise */
    MASTERS,
};

static const char *const names[MASTERS] = {"sums", "products", "decimals", "sums of times",
                                           "products of times"};

/* What a run is made of; whole numbers count units of 1 / per_second s. */
struct grid {
    enum master master;
    double per_second;
    int64_t start;
    int64_t period; /* of the ticks */
    int64_t length; /* of the steps; of some of them where they vary */
    bool varies;    /* steps of 1 to 3 lengths */
    bool returns_early;
};

static double seconds(const struct grid *grid, int64_t units) {
    return (double)units / grid->per_second; // as strtod reads the decimal number
}

static uint64_t random_state;

static int64_t random_of(int64_t count) {
    random_state = random_state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (int64_t)((random_state >> 33) % (uint64_t)count);
}

void setUp(void) {
    random_state = 40;
}

/* A sensor whose count is the position, at the start of the grid. */
static void start_sensor(const struct grid *grid) {
    create(&model_description);
    setup(instance, seconds(grid, grid->start), INFINITY);
    set(RP_SENSOR_sample_time, seconds(grid, grid->period));
    set(RP_SENSOR_resolution1, 1.0);
    set_int(RP_SENSOR_max_internal_steps, 1000000);
    ASSERT_OK(instance_enter_initialization(instance));
    set(RP_SENSOR_q1, -1.0);
    ASSERT_OK(instance_exit_initialization(instance));
}

/* To t + h, which the importer reaches by several steps where the sensor returns early. Returns the
 * shortest of them. */
static double step(const struct grid *grid, double t, double h) {
    const struct step_options options = {.at_event =
                                             grid->returns_early ? EVENTS_END : EVENTS_PASSED};
    const double end = t + h;
    double left = h;
    double shortest = h;
    while (left > 0.0) {
        shortest = fmin(shortest, left);
        ASSERT_OK(instance_do_step(instance, t, left, &options));
        t = instance_time(instance);
        left = t == end ? 0.0 : end - t;
    }
    return shortest;
}

/* The ticks in (start, end] by the master's own times, where these have drifted too far from the
 * grid for a tick at the end of a step to be told: fewest and most. */
static void count_ticks(const struct grid *grid, double end, double h, int64_t counts[2]) {
    const long double passed = (long double)end - seconds(grid, grid->start);
    const long double period = seconds(grid, grid->period);
    counts[0] = (int64_t)floorl((passed - 0.011L * h) / period);
    counts[1] = (int64_t)floorl((passed + 0.011L * h) / period);
}

/* Steps until the count; how many of them had ticks that are exact. */
static int run(const struct grid *grid, int count) {
    char text[160];
    (void)snprintf(text, sizeof text, "%s: unit 1/%g s, start %lld, period %lld, steps %lld",
                   names[grid->master], grid->per_second, (long long)grid->start,
                   (long long)grid->period, (long long)grid->length);
    start_sensor(grid);
    double t = seconds(grid, grid->start);
    int64_t units = 0; // since the start
    int64_t sampled = -1;
    int64_t ticks = 0;
    int exact = 0;
    double drift = 0.0; // the largest so far, against the smallest step
    for (int i = 0; i < count; i++) {
        const int64_t steps = grid->varies ? 1 + random_of(3) : 1;
        const double h = seconds(grid, steps * grid->length);
        units += steps * grid->length;
        double next = t + h;
        if (grid->master == PRODUCTS || grid->master == PRODUCTS_OF_TIMES) {
            next = seconds(grid, grid->start) +
                   (double)(units / grid->length) * seconds(grid, grid->length);
        } else if (grid->master == DECIMALS) {
            next = seconds(grid, grid->start + units);
        }
        const bool is_difference =
            grid->master == SUMS_OF_TIMES || grid->master == PRODUCTS_OF_TIMES;
        set(RP_SENSOR_q1, i);
        const double shortest = step(grid, t, is_difference ? next - t : h);

        const long double ideal = (long double)(grid->start + units) / grid->per_second;
        drift = fmax(drift, (double)fabsl(next - ideal) / seconds(grid, grid->length));
        int64_t expected[2] = {units / grid->period, units / grid->period};
        if (drift < 0.009) {
            TEST_ASSERT_TRUE_MESSAGE(shortest > 0.01 * h, text); // none makes up for rounding
            exact++;
        } else {
            count_ticks(grid, next, h, expected);
        }
        const int64_t counted = instance->state.own.event_count;
        if (counted < expected[0] || counted > expected[1]) {
            (void)snprintf(text + strlen(text), sizeof text - strlen(text), ": step %d", i);
            TEST_FAIL_MESSAGE(text);
        }
        if (counted > ticks) {
            sampled = i;
            ticks = counted;
        }
        TEST_ASSERT_EQUAL_INT_MESSAGE(sampled, (int)get(RP_SENSOR_q1_measured), text);
        t = next;
    }
    return exact;
}

/* A sum of milliseconds is 1e-9 s off after 334 585 of them. */
static void test_half_a_million_milliseconds(void) {
    for (int n = 0; n <= MASTERS; n++) {
        const struct grid grid = {.master = (enum master)(n % MASTERS),
                                  .per_second = 1e3,
                                  .period = 1,
                                  .length = 1,
                                  .returns_early = n == MASTERS};
        TEST_ASSERT_EQUAL_INT(500000, run(&grid, 500000));
    }
}

static void test_random_grids(void) {
    static const double units[] = {1e6, 1e4, 3e3, 1e3, 7.0, 1.0};
    static const double starts[] = {0.0, -1e3, 1e6, -1e6, 1.7e9};
    for (int n = 0; n < 150; n++) {
        struct grid grid = {
            .master = (enum master)(n % MASTERS),
            .per_second = units[random_of(6)],
            .period = 1 + random_of(200),
            .length = 1 + random_of(30), // so that no tick is within a hundredth of a step
            .varies = random_of(2) == 1,
            .returns_early = random_of(2) == 1,
        };
        const double start = starts[random_of(5)];
        if (fabs(start) > 1e3) { // doubles are far apart there
            grid.per_second = fmin(grid.per_second, fabs(start) > 1e6 ? 1e3 : 1e4);
        }
        grid.start = (int64_t)(start * grid.per_second) + random_of(1000);
        if (random_of(4) == 0) {
            grid.length = grid.period;
        }
        const int exact = run(&grid, 10000);
        const bool is_sum = grid.master == SUMS || grid.master == SUMS_OF_TIMES;
        TEST_ASSERT_TRUE(fabs(start) > 1e3 || exact == 10000);
        TEST_ASSERT_TRUE(is_sum || fabs(start) > 1e6 || exact == 10000);
    }
}

/* An importer that integrates outside goes on its own grid, and to the times of ticks that are not
 * on it. Times that differ by rounding are one time to it. */
static void test_model_exchange_on_a_grid_of_products(void) {
    static const double starts[] = {0.0, 1e6, 1.7e9};
    for (int s = 0; s < 3; s++) {
        const struct grid grid = {
            .per_second = 1e3, .start = (int64_t)(1e3 * starts[s]), .period = 3};
        start_sensor(&grid);
        instance_integrate_outside(instance);
        double next = seconds(&grid, grid.start + grid.period);
        for (int i = 1; i <= 100000; i++) {
            const double t = starts[s] + i * 1e-3;
            set(RP_SENSOR_q1, i);
            ASSERT_OK(instance_enter_continuous_time(instance));
            ASSERT_OK(instance_set_time(instance, t));
            if (fabs(t - next) <= 2.0 * DBL_EPSILON * t) {
                struct discrete_update update;
                instance_enter_event_mode(instance);
                ASSERT_OK(instance_update_discrete_states(instance, &update));
                next = update.next_time;
                TEST_ASSERT_FALSE(update.is_incomplete);
            } else {
                instance_enter_event_mode(instance);
            }
            TEST_ASSERT_EQUAL_INT(i / 3, instance->state.own.event_count);
            TEST_ASSERT_EQUAL_INT(i < 3 ? -1 : i - i % 3, (int)get(RP_SENSOR_q1_measured));
        }
    }
}
