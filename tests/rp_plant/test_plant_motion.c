/* The model run by a simple method, Runge-Kutta steps of 1/2 ms with events found
 * by bisection: closed forms of friction and stops, and the balance of energy over random motions.
 * The core that runs models has its own tests; here any method serves. */
#include "last_text.h"
#include "plant_test_support.h"
#include "unity.h"

#include <math.h>
#include <string.h>

#define STEP     (1.0 / 2048.0)
#define RESOLVED 1e-13 /* an indicator has triggered that is below -RESOLVED */

enum {
    WORK = PLANT_STATES,
    ALL
}; /* states, then the energy that came from outside less friction */

static const struct model_events *events;
static struct rp_plant_values v;
static double now;                     /* s */
static double work;                    /* J */
static struct rp_plant_inputs at_zero; /* the inputs are at_zero + rate t */
static struct rp_plant_inputs rate;
static int event_count;

void setUp(void) {
    events = rp_plant_model.events;
    plant_test_start(&v);
    now = work = 0.0;
    event_count = 0;
    memset(&at_zero, 0, sizeof at_zero);
    memset(&rate, 0, sizeof rate);
}

static struct rp_plant_inputs inputs_at(double t) {
    struct rp_plant_inputs inputs = at_zero;
    for (int i = 0; i < 2; i++) {
        inputs.tau[i] += rate.tau[i] * t;
    }
    return inputs;
}

static struct rp_plant_values values_at(double t, const double y[ALL]) {
    struct rp_plant_values values = v;
    values.inputs = inputs_at(t);
    memcpy(values.q, y, sizeof values.q);
    memcpy(values.dq, y + 2, sizeof values.dq);
    return values;
}

static void rates(double t, const double y[ALL], double dy[ALL]) {
    struct rp_plant_values values = values_at(t, y);
    plant_test_outputs(&values);
    const double *w = values.inputs.wrench;
    memcpy(dy, values.dq, sizeof values.dq);
    memcpy(dy + 2, values.ddq, sizeof values.ddq);
    dy[WORK] = values.actuator_power - values.friction_power + w[0] * values.ee_velocity[0] +
               w[1] * values.ee_velocity[1] + w[2] * values.dq[0];
}

/* The classical method of fourth order. */
static void runge_kutta(const double start[ALL], double h, double end[ALL]) {
    static const double nodes[4] = {0.0, 0.5, 0.5, 1.0};
    static const double weights[4] = {1.0 / 6, 1.0 / 3, 1.0 / 3, 1.0 / 6};
    double slope[ALL] = {0.0};
    memcpy(end, start, sizeof(double[ALL]));
    for (int stage = 0; stage < 4; stage++) {
        double y[ALL];
        for (int i = 0; i < ALL; i++) {
            y[i] = start[i] + nodes[stage] * h * slope[i];
        }
        rates(now + nodes[stage] * h, y, slope);
        for (int i = 0; i < ALL; i++) {
            end[i] += weights[stage] * h * slope[i];
        }
    }
}

static bool triggers(double t, const double y[ALL], bool triggered[RP_PLANT_INDICATORS]) {
    double z[RP_PLANT_INDICATORS];
    double u[PLANT_INPUTS];
    const struct rp_plant_inputs inputs = inputs_at(t);
    bool any = false;
    memcpy(u, &inputs, sizeof u);
    ASSERT_OK(events->indicators(&v, t, y, u, z));
    for (int k = 0; k < RP_PLANT_INDICATORS; k++) {
        triggered[k] = z[k] < -RESOLVED;
        any = any || triggered[k];
    }
    return any;
}

static void update(const bool *triggered) {
    double du[PLANT_INPUTS];
    memcpy(du, &rate, sizeof du);
    v.inputs = inputs_at(now);
    plant_test_update_with(&v, triggered, du);
}

/* One step, or up to the first event in it, which is handled. True if one was. */
static bool advance(double h) {
    const double start[ALL] = {v.q[0], v.q[1], v.dq[0], v.dq[1], work};
    double end[ALL];
    bool triggered[RP_PLANT_INDICATORS];
    runge_kutta(start, h, end);
    const bool event = triggers(now + h, end, triggered);
    if (event) {
        double before = 0.0;
        while (h - before > 1e-16) {
            const double middle = 0.5 * (before + h);
            runge_kutta(start, middle, end);
            if (middle == before || middle == h) {
                break;
            }
            *(triggers(now + middle, end, triggered) ? &h : &before) = middle;
        }
        runge_kutta(start, h, end);
        (void)triggers(now + h, end, triggered);
        event_count++;
    }
    now += h;
    memcpy(v.q, end, sizeof v.q);
    memcpy(v.dq, end + 2, sizeof v.dq);
    work = end[WORK];
    v.inputs = inputs_at(now);
    if (event) {
        update(triggered);
    }
    return event;
}

static double time_of_next_event(void) {
    while (!advance(STEP)) {
        TEST_ASSERT_TRUE_MESSAGE(now < 20.0, "no event");
    }
    return now;
}

static void run_until(double stop) {
    while (stop - now > 1e-9) {
        (void)advance(fmin(STEP, stop - now));
    }
}

/* ---- Closed forms --------------------------------------------------------------------------- */

static void set_without_weight(double F1, double F2) {
    v.parameters.arm.g = 0.0;
    v.parameters.arm.a = 0.0;
    v.parameters.coulomb_friction[0] = F1;
    v.parameters.coulomb_friction[1] = F2;
}

/* A sliding mass stops at v0 m / F, after m v0^2 / (2 F). */
static void test_block_comes_to_rest(void) {
    set_without_weight(5.0, 3.0);
    v.dq[1] = 2.0;
    update(NULL);
    const double m = v.parameters.arm.m2;
    ASSERT_CLOSE(2.0 * m / 3.0, time_of_next_event(), 1e-10);
    ASSERT_CLOSE(m * 4.0 / 6.0, v.q[1], 1e-10);
    TEST_ASSERT_TRUE(events->is_at_rest(&v));
    const double q2 = v.q[1];
    run_until(2.0);
    TEST_ASSERT_TRUE(v.q[1] == q2 && event_count == 1);
}

/* With damping c at (m / c) ln(1 + c v0 / F). */
static void test_damped_block_comes_to_rest(void) {
    set_without_weight(5.0, 3.0);
    v.parameters.damping[1] = 4.0;
    v.dq[1] = -2.0;
    update(NULL);
    ASSERT_CLOSE(v.parameters.arm.m2 / 4.0 * log(11.0 / 3.0), time_of_next_event(), 1e-10);
    TEST_ASSERT_TRUE(events->is_at_rest(&v));
}

/* A force that grows as r t: joint 2 breaks away at F2 / r. Sliding, it loads joint 1 through the
 * offset with a (f2 - F2), until that breaks away at (F2 + F1 / |a|) / r. */
static void test_ramp_breaks_both_joints_away(void) {
    for (int side = -1; side <= 1; side += 2) {
        setUp();
        set_without_weight(0.5, 3.0);
        v.parameters.arm.a = 0.25 * side;
        rate.tau[1] = 4.0;
        update(NULL);
        ASSERT_CLOSE(3.0 / 4.0, time_of_next_event(), 1e-10);
        TEST_ASSERT_EQUAL_INT(RP_PLANT_STUCK, v.modes.joint[0]);
        TEST_ASSERT_EQUAL_INT(RP_PLANT_FORWARD, v.modes.joint[1]);
        ASSERT_CLOSE((3.0 + 0.5 / 0.25) / 4.0, time_of_next_event(), 1e-10);
        TEST_ASSERT_EQUAL_INT(side, v.modes.joint[0]);
        run_until(1.5);
        TEST_ASSERT_EQUAL_INT(2, event_count);
    }
}

/* Constant torque: joint 1 spins up until the slide is thrown out, at
 * J / (tau1 - F1) sqrt(F2 / (m2 L)). */
static void test_spin_throws_the_slide_out(void) {
    set_without_weight(0.5, 3.0);
    at_zero.tau[0] = 1.5;
    update(NULL);
    const double m2L = v.parameters.arm.m2 * v.parameters.arm.l1;
    const double J = rp_test_inertia(&v.parameters.arm, 0.0);
    ASSERT_CLOSE(J / 1.0 * sqrt(3.0 / m2L), time_of_next_event(), 1e-10);
    TEST_ASSERT_EQUAL_INT(RP_PLANT_FORWARD, v.modes.joint[1]);
}

/* A slide that falls h on its stop: impacts at t1 + 2 v1 (e + ... + e^(k-1)) / g, rest at
 * t1 (1 + e) / (1 - e) but for the bounces that are below the tolerance. */
static void test_bouncing_slide(void) {
    const double e = 0.5;
    const double g = v.parameters.arm.g;
    v.parameters.arm.a = 0.0;
    v.parameters.coulomb_friction[0] = 50.0;
    v.q[0] = RP_TEST_PI / 2.0;
    v.q[1] = 0.5;
    v.parameters.stops[1] = RP_PLANT_STOPS_RIGID;
    v.parameters.upper[1] = 1.0;
    v.parameters.restitution[1] = e;
    update(NULL);
    const double t1 = sqrt(2.0 * 0.5 / g);
    double expected = t1;
    double bounce = 2.0 * t1 * e;
    for (int k = 1; k <= 8; k++) {
        ASSERT_CLOSE(expected, time_of_next_event(), 1e-9);
        TEST_ASSERT_EQUAL_INT(RP_PLANT_FREE, v.modes.joint[1]);
        expected += bounce;
        bounce *= e;
    }
    while (v.modes.joint[1] != RP_PLANT_STUCK) {
        (void)time_of_next_event();
    }
    const double left_out = 2.0 * sqrt(2.0 * 1e-10 / g) / (1.0 - e);
    ASSERT_CLOSE(t1 * (1.0 + e) / (1.0 - e), now, left_out + 1e-9);
    ASSERT_CLOSE(v.parameters.arm.m2 * g * 0.5, v.sums.impact_loss, 1e-8);
    TEST_ASSERT_TRUE(v.q[1] == 0.0 && v.dq[1] == 0.0);
}

/* ---- Energy --------------------------------------------------------------------------------- */

struct energies {
    double total;
    double potential;
};

static struct energies energies_now(void) {
    struct rp_plant_values values = v;
    plant_test_outputs(&values);
    return (struct energies){values.total_energy, values.potential_energy};
}

/* Change of energy = work of drives and wrench - friction - impacts - grasp. Each motion sticks,
 * slides and strikes, and grasps a payload at rest half way. */
static void test_energy_is_balanced_over_random_motions(void) {
    struct rp_test_random random = {71};
    int events_in_all = 0;
    for (int n = 0; n < 40; n++) {
        setUp();
        plant_test_random_plant(&random, &v);
        v.modes.payload = RP_PLANT_UNDECIDED;
        v.payload_attached = 0;
        struct rp_plant_parameters *p = &v.parameters;
        p->arm.I1z += 0.5;
        p->arm.m2 += 0.5;
        p->grasp = RP_PLANT_AT_REST;
        at_zero = v.inputs;
        for (int i = 0; i < 2; i++) {
            p->coulomb_friction[i] += 0.5;
            if (p->breakaway_friction[i] > 0.0) {
                p->breakaway_friction[i] += 0.5;
            }
            p->stops[i] = RP_PLANT_STOPS_RIGID;
            p->restitution[i] = rp_test_uniform(&random, 0.0, 1.0);
            p->lower[i] = v.q[i] - 0.5;
            p->upper[i] = v.q[i] + 0.5;
            at_zero.tau[i] = rp_test_uniform(&random, -10.0, 10.0);
            rate.tau[i] = rp_test_uniform(&random, -20.0, 20.0);
        }
        update(NULL);
        const double start = energies_now().total + v.sums.impact_loss;
        run_until(0.5);
        const struct energies before = energies_now();
        v.payload_attached = 1;
        update(NULL);
        const double brought = energies_now().potential - before.potential; // by the payload
        run_until(1.0);

        const double losses = v.sums.impact_loss + v.sums.grasp_loss;
        const double end = energies_now().total;
        const double largest = fabs(start) + fabs(before.total) + fabs(end) + fabs(work) + losses;
        ASSERT_CLOSE(start + brought + work - losses, end, 1e-8 * largest);
        events_in_all += event_count;
    }
    TEST_ASSERT_GREATER_THAN_INT(200, events_in_all);
}
