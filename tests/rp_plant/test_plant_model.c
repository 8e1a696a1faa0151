/* What struct model promises, of the plant at random points in all modes: derivatives are what
 * differences give, the Jacobian is what derivatives give, what is integrated is what is output,
 * nothing is read that is not given, and results are written as a whole, whatever stood there
 * before. Of other models: test_all_is_written.py. */
#include "last_text.h"
#include "rp_plant_model.h"
#include "rp_plant_modes.h"
#include "rp_test_support.h"

#include <float.h>
#include <math.h>
#include <string.h>
#include <unity.h>

enum { DOUBLES = sizeof(struct rp_plant_values) / sizeof(double), STATES = 4, INPUTS = 5 };
enum { INDICATORS = 16, ROWS = 128, POINTS = 2000 };

union point {
    double all[DOUBLES];
    struct rp_plant_values plant;
};

/* Doubles of the value structure. */
#define PLACE(field) (offsetof(struct rp_plant_values, field) / sizeof(double))
struct doubles {
    size_t first, end;
};
static const struct doubles known_ranges[] = {{0, PLACE(parameters.stops)},
                                              {PLACE(parameters.lower), PLACE(parameters.grasp)},
                                              {PLACE(inputs), PLACE(payload_attached)},
                                              {PLACE(q), PLACE(dx)}};
static const struct doubles calculated_ranges[] = {
    {PLACE(dx), PLACE(sums)}, {PLACE(D), PLACE(D[1][0])}, {PLACE(D[1][1]), DOUBLES}};

static struct rp_test_random random_source;
static const struct model *const model = &rp_plant_model;
static union point at, first, second;
static double now;
static size_t knowns[DOUBLES], fields[DOUBLES]; /* places */
static int known_count, field_count;

static double uniform(double low, double high) {
    return rp_test_uniform(&random_source, low, high);
}

static int one_of(int count) {
    return (int)(rp_test_random_bits(&random_source) % (unsigned)count);
}

static double sign(void) {
    return one_of(2) == 0 ? 1.0 : -1.0;
}

/* ---- Points --------------------------------------------------------------------------------- */

/* A feature that is off: what is 0 stays 0 on curves. */
static void sometimes_zero(double *values, int count) {
    for (int i = 0; i < count; i++) {
        values[i] = one_of(4) == 0 ? 0.0 : values[i];
    }
}

static void place_plant(int n) {
    struct rp_plant_values *v = &at.plant;
    struct rp_plant_parameters *p = &v->parameters;
    sometimes_zero(p->armature, 4); // and damping
    sometimes_zero(&p->payload_mass, 4);
    v->payload_attached = one_of(2);
    v->modes.payload = v->payload_attached == 1 ? RP_PLANT_ATTACHED : RP_PLANT_RELEASED;
    if (n % 5 == 0) { // modes follow from velocities
        v->modes.payload = RP_PLANT_UNDECIDED;
    }
    p->grasp = RP_PLANT_GRASP_KEEP_VELOCITY;
    for (int i = 0; i < 2; i++) {
        p->breakaway_friction[i] = one_of(3) == 0 ? 0.0 : 2.0 * p->coulomb_friction[i];
        p->coulomb_friction[i] *= one_of(3);
        p->breakaway_friction[i] += p->coulomb_friction[i];
        p->stops[i] = RP_PLANT_STOPS_NONE + one_of(n % 5 == 0 ? 2 : 3);
        const bool is_decided = n % 5 != 0 && rp_plant_can_stick(p, i);
        v->modes.joint[i] = is_decided ? one_of(4) - 1 : RP_PLANT_FREE;
        if (v->modes.joint[i] == RP_PLANT_STUCK) {
            v->dq[i] = 0.0;
        }
        if (p->stops[i] == RP_PLANT_STOPS_COMPLIANT) {
            v->modes.contact[i] = one_of(5) - 2;
        }
        p->lower[i] = v->q[i] - (v->modes.contact[i] > 0 ? -0.25 : 1.0);
        p->upper[i] = v->q[i] + (v->modes.contact[i] < 0 ? -0.25 : 1.0);
    }
}

static int places(size_t range_count, const struct doubles ranges[], size_t list[DOUBLES]) {
    int count = 0;
    for (size_t k = 0; k < range_count; k++) {
        for (size_t i = ranges[k].first; i < ranges[k].end; i++) {
            list[count++] = i;
        }
    }
    return count;
}

/* Knowns of magnitudes 0.5 to 2, inputs and states with any sign, as the model places them; a curve
 * that changes each by half of its value in a unit of time at most, or only one of them. */
static void next_point(int n) {
    memset(&at, 0, sizeof at);
    memset(&first, 0, sizeof first);
    memset(&second, 0, sizeof second);
    now = 3.0;
    for (int k = 0; k < known_count; k++) {
        const bool has_sign =
            knowns[k] * sizeof(double) >= model->parameters.offset + model->parameters.size;
        at.all[knowns[k]] = uniform(0.5, 2.0) * (has_sign ? sign() : 1.0);
    }
    place_plant(n);
    ASSERT_OK(model->outputs(&at, now));
    const int alone = one_of(known_count);
    for (int k = 0; k < known_count; k++) {
        const double size = n % 2 == 0 || k == alone ? at.all[knowns[k]] : 0.0;
        first.all[knowns[k]] = size * uniform(-0.5, 0.5);
        second.all[knowns[k]] = size * uniform(-0.5, 0.5);
    }
}

static void poison(union point *point, size_t offset, size_t size) {
    memset((char *)point + offset, 0xff, size); // NaN
}

static void poison_calculated(union point *point) {
    for (int k = 0; k < field_count; k++) {
        poison(point, fields[k] * sizeof(double), sizeof(double));
    }
}

/* ---- Properties ----------------------------------------------------------------------------- */

/* The slope of values at -4 h ... 4 h, by differences of order 8. Over this part of a curve knowns
 * change by 0.2 percent, angles of a circle by some hundredths: what is left out is below 1e-16 of
 * the values, so that the rounding of their terms counts, by 2.1 / h. */
static const double h = 1.0 / 1024, speed = 0.25; /* of the time */

static double slope(const union point points[9], size_t i) {
    static const double weights[4] = {4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0};
    double sum = 0.0;
    for (int k = 4; k >= 1; k--) {
        sum += weights[k - 1] * (points[4 + k].all[i] - points[4 - k].all[i]);
    }
    return sum / h;
}

/* Second derivatives are those along curves on which parameters rest. */
static void check_derivatives(bool parameters_rest) {
    static union point values[9], rates[9];
    if (parameters_rest) {
        memset((char *)&first + model->parameters.offset, 0, model->parameters.size);
        memset((char *)&second + model->parameters.offset, 0, model->parameters.size);
    }
    union point rate = first, curvature = second;
    ASSERT_OK(model->derivatives(&at, now, speed, &rate, parameters_rest ? &curvature : NULL));
    for (int n = 0; n < 9; n++) {
        const double t = (n - 4) * h;
        values[n] = at;
        rates[n] = first;
        for (int k = 0; k < known_count; k++) {
            const size_t i = knowns[k];
            values[n].all[i] += t * (first.all[i] + 0.5 * t * second.all[i]);
            rates[n].all[i] += t * second.all[i];
        }
        ASSERT_OK(model->outputs(&values[n], now + t * speed));
        ASSERT_OK(model->derivatives(&values[n], now + t * speed, speed, &rates[n], NULL));
    }
    double scale = 1.0; // of the largest: fields are sums of terms that others show
    for (int k = 0; k < field_count; k++) {
        const size_t i = fields[k];
        scale = fmax(scale, fmax(fabs(values[4].all[i]), fabs(rate.all[i])));
        scale = parameters_rest ? fmax(scale, fabs(curvature.all[i])) : scale;
    }
    for (int k = 0; k < field_count; k++) {
        const double bound = 128 * DBL_EPSILON / h * scale;
        ASSERT_CLOSE(slope(values, fields[k]), rate.all[fields[k]], bound);
        if (parameters_rest) {
            ASSERT_CLOSE(slope(rates, fields[k]), curvature.all[fields[k]], bound);
        }
    }
}

/* Whatever stands in the calculated fields before. Without second derivatives the first are the
 * same. */
static void check_what_is_read(void) {
    union point clean = at, clean_first = first, clean_second = second;
    union point dirty = at, dirty_first = first, dirty_second = second, alone = first;
    poison_calculated(&dirty);
    poison_calculated(&dirty_first);
    poison_calculated(&dirty_second);
    poison_calculated(&alone);
    ASSERT_OK(model->derivatives(&dirty, now, speed, &dirty_first, &dirty_second));
    ASSERT_OK(model->derivatives(&dirty, now, speed, &alone, NULL));
    ASSERT_OK(model->outputs(&clean, now));
    ASSERT_OK(model->derivatives(&clean, now, speed, &clean_first, &clean_second));
    ASSERT_OK(model->outputs(&dirty, now));
    TEST_ASSERT_EQUAL_MEMORY(&clean, &dirty, model->values_size);
    TEST_ASSERT_EQUAL_MEMORY(&clean_first, &dirty_first, model->values_size);
    TEST_ASSERT_EQUAL_MEMORY(&clean_first, &alone, model->values_size);
    TEST_ASSERT_EQUAL_MEMORY(&clean_second, &dirty_second, model->values_size);
}

/* The point with NaN for all that pure functions take from their arguments, x and u. */
static union point without_arguments(double x[STATES], double u[INPUTS]) {
    union point given = at;
    memcpy(x, (char *)&at + model->states.offset, model->states.size);
    memcpy(u, (char *)&at + model->inputs.offset, model->inputs.size);
    poison_calculated(&given);
    poison(&given, model->states.offset, model->states.size);
    poison(&given, model->inputs.offset, model->inputs.size);
    return given;
}

/* The right-hand side and the Jacobian take states and inputs from their arguments: what outputs
 * and derivatives give. A joint that is stuck rests. */
static void check_integration(void) {
    double x[STATES], u[INPUTS], dx[STATES], J[STATES * STATES];
    const size_t count = model->states.size / sizeof(double);
    union point expected = at;
    const union point given = without_arguments(x, u);
    ASSERT_OK(model->outputs(&expected, now));
    memset(dx, 0xff, sizeof dx);
    ASSERT_OK(model->right_hand_side(&given, now, x, u, dx));
    TEST_ASSERT_EQUAL_MEMORY((char *)&expected + model->dx.offset, dx, model->dx.size);
    memset(J, 0xff, sizeof J);
    ASSERT_OK(model->jacobian(&given, now, x, u, J));
    for (size_t j = 0; j < count; j++) {
        union point column;
        memset(&column, 0, sizeof column);
        const double one = 1.0;
        memcpy((char *)&column + model->states.offset + j * sizeof one, &one, sizeof one);
        ASSERT_OK(model->derivatives(&at, now, 0.0, &column, NULL));
        const double *rate =
            (const double *)(const void *)((const char *)&column + model->dx.offset);
        const bool rests = at.plant.modes.joint[j % 2] == RP_PLANT_STUCK;
        for (size_t i = 0; i < count; i++) {
            const double expected_slope = rests ? 0.0 : rate[i];
            ASSERT_CLOSE(expected_slope, J[i + count * j], 1e-13 * (1.0 + fabs(expected_slope)));
        }
    }
}

/* An indicator's fields of its kind. */
static void check_indicator(const struct indicator *indicator, double z) {
    unsigned char rises;
    memcpy(&rises, &indicator->rises, 1); // another value than 0 and 1 is none of a bool
    switch (indicator->kind) {
    case INDICATOR_UNUSED:
        TEST_ASSERT_TRUE(z == 1.0);
        return;
    case INDICATOR_OF_STATE:
        TEST_ASSERT_LESS_THAN_size_t(model->states.size / sizeof(double), indicator->state);
        TEST_ASSERT_TRUE(rises <= 1 && isfinite(indicator->factor) && isfinite(indicator->offset));
        return;
    case INDICATOR_OF_MODEL:
        TEST_ASSERT_TRUE(isfinite(indicator->offset));
        return;
    default:
        TEST_FAIL_MESSAGE("an indicator of no kind");
    }
}

static void check_events(void) {
    const struct model_events *events = model->events;
    double x[STATES], u[INPUTS], z[INDICATORS], reach[STATES];
    struct indicator described[INDICATORS];
    const union point given = without_arguments(x, u);
    TEST_ASSERT_TRUE(events->next_time == NULL || !isnan(events->next_time(&given)));
    TEST_ASSERT_LESS_OR_EQUAL_size_t(INDICATORS, events->indicator_count);
    if (events->indicator_count > 0) {
        memset(described, 0xff, sizeof described);
        memset(z, 0xff, sizeof z);
        events->describe(&at, described);
        ASSERT_OK(events->indicators(&given, now, x, u, z));
    }
    for (size_t i = 0; i < events->indicator_count; i++) {
        TEST_ASSERT_TRUE(isfinite(z[i]));
        check_indicator(&described[i], z[i]);
    }
    memset(reach, 0xff, sizeof reach);
    if (events->reach != NULL) {
        events->reach(&given, x, reach);
    }
    for (size_t i = 0; events->reach != NULL && i < model->states.size / sizeof(double); i++) {
        TEST_ASSERT_TRUE(reach[i] >= 0.0);
    }
}

static void begin_series(double rows[ROWS][SERIES_LENGTH]) {
    memset(rows, 0xff, sizeof(double[ROWS][SERIES_LENGTH])); // NaN: what is read has been written
    for (size_t i = 0; i < model->states.size / sizeof(double); i++) {
        rows[i][0] = ((const double *)(const void *)((const char *)&at + model->states.offset))[i];
    }
}

/* Any number of orders at once gives the same bits. */
static void check_series(int n) {
    static double at_once[ROWS][SERIES_LENGTH], rows[ROWS][SERIES_LENGTH];
    double inputs[INPUTS][SERIES_INPUT_LENGTH];
    for (int i = 0; i < INPUTS; i++) {
        for (int k = 0; k < SERIES_INPUT_LENGTH; k++) {
            inputs[i][k] = uniform(-2.0, 2.0);
        }
    }
    const struct series_origin origin = {
        .values = &at,
        .t = now,
        .time_scale = 1.0 / 64,
        .inputs = (const double(*)[SERIES_INPUT_LENGTH])inputs,
    };
    TEST_ASSERT_LESS_OR_EQUAL_size_t(ROWS, model->series->row_count);
    begin_series(at_once);
    begin_series(rows);
    ASSERT_OK(model->series->extend(&origin, 0, SERIES_LENGTH - 1, at_once));
    for (int from = 0, last; from < SERIES_LENGTH; from = last + 1) {
        last = from + (n == 0 ? 0 : one_of(5));
        last = last < SERIES_LENGTH ? last : SERIES_LENGTH - 1;
        ASSERT_OK(model->series->extend(&origin, from, last, rows));
    }
    TEST_ASSERT_EQUAL_MEMORY(at_once, rows, model->series->row_count * sizeof rows[0]);
    for (size_t i = 0; i < model->states.size / sizeof(double); i++) {
        for (int k = 0; k < SERIES_LENGTH; k++) {
            TEST_ASSERT_FALSE(isnan(rows[i][k]));
        }
    }
}

static void test_the_model_keeps_its_promises(void) {
    random_source.state = 41;
    known_count = places(sizeof known_ranges / sizeof *known_ranges, known_ranges, knowns);
    field_count =
        places(sizeof calculated_ranges / sizeof *calculated_ranges, calculated_ranges, fields);
    for (int n = 0; n < POINTS; n++) {
        next_point(n);
        check_what_is_read();
        check_integration();
        check_events();
        check_series(n);
        check_derivatives(false);
        check_derivatives(true);
    }
}
