/* Motions of the arm through the instance and the integrator: what they conserve, and values so
 * extreme that the integrator's own arithmetic underflows or overflows, where a step is right or
 * refused, never wrong. */
#include "each_method.h"
#include "rp_model.h"
#include "run_instance.h"
#include "value_references.h"

#include <float.h>

void setUp(void) {
    create_instance();
}

/* ---- Conservation --------------------------------------------------------------------------- */

static double momentum(void) {
    return get(RP_MANIPULATOR_D11) * get(RP_MANIPULATOR_dq1) +
           get(RP_MANIPULATOR_D12) * get(RP_MANIPULATOR_dq2);
}

static const double tolerances[] = {1e-6, 1e-8, 1e-10};

static void test_free_motion_conserves_energy(void) {
    for (int k = 0; k < 3; k++) {
        instance_reset(instance);
        set(RP_MANIPULATOR_q1, -1.2);
        set(RP_MANIPULATOR_dq1, 2.0);
        set(RP_MANIPULATOR_dq2, -3.0);
        initialize(tolerances[k]);
        const double start = get(RP_MANIPULATOR_total_energy);
        double scale = 0.0;
        double drift = 0.0;
        for (int i = 0; i < 500; i++) {
            ASSERT_OK(instance_do_step(instance, 0.01 * i, 0.01));
            scale = fmax(scale, fabs(get(RP_MANIPULATOR_kinetic_energy)) +
                                    fabs(get(RP_MANIPULATOR_potential_energy)));
            drift = fmax(drift, fabs(get(RP_MANIPULATOR_total_energy) - start));
        }
        TEST_ASSERT_TRUE(drift <= 100.0 * tolerances[k] * scale);
    }
}

/* In the horizontal plane q1 is cyclic: dT/dq1' is constant without torque, whatever f2 does inside
 * the arm; f2 does work, so energy changes meanwhile. */
static void test_horizontal_motion_conserves_the_generalized_momentum(void) {
    for (int k = 0; k < 3; k++) {
        instance_reset(instance);
        set(RP_MANIPULATOR_g, 0.0);
        set(RP_MANIPULATOR_q1, 0.4);
        set(RP_MANIPULATOR_dq1, 3.0);
        set(RP_MANIPULATOR_dq2, -0.5);
        initialize(tolerances[k]);
        const double start = momentum();
        double scale = 0.0;
        double drift = 0.0;
        double dq1 = 0.0;
        for (int i = 0; i < 500; i++) {
            set(RP_MANIPULATOR_f2, -9.0 * get(RP_MANIPULATOR_q2));
            ASSERT_OK(instance_do_step(instance, 0.01 * i, 0.01));
            scale = fmax(scale, fabs(get(RP_MANIPULATOR_kinetic_energy)));
            drift = fmax(drift, fabs(momentum() - start));
            dq1 = fmax(dq1, fabs(get(RP_MANIPULATOR_dq1) - 3.0));
        }
        // N.m.s against J: rates are a few rad/s
        TEST_ASSERT_TRUE(drift <= 100.0 * tolerances[k] * scale);
        TEST_ASSERT_TRUE(dq1 > 0.3);
    }
}

static void test_the_energy_gained_is_the_work_of_the_efforts(void) {
    const double torque = 1.5;
    const double force = 12.0;
    initialize(1e-8);
    set(RP_MANIPULATOR_tau1, torque);
    set(RP_MANIPULATOR_f2, force);
    const double start = get(RP_MANIPULATOR_total_energy);
    for (int i = 0; i < 200; i++) {
        ASSERT_OK(instance_do_step(instance, 0.01 * i, 0.01));
        const double work = torque * get(RP_MANIPULATOR_q1) + force * get(RP_MANIPULATOR_q2);
        const double scale = fabs(get(RP_MANIPULATOR_kinetic_energy)) +
                             fabs(get(RP_MANIPULATOR_potential_energy)) + fabs(work);
        TEST_ASSERT_TRUE(fabs(get(RP_MANIPULATOR_total_energy) - start - work) <= 1e-6 * scale);
    }
}

static void test_joint_loads_that_drive_are_the_efforts(void) {
    initialize(1e-8);
    for (int i = 0; i < 200; i++) {
        const double torque = 2.0 * sin(0.1 * i);
        const double force = 9.0 * cos(0.07 * i);
        set(RP_MANIPULATOR_tau1, torque);
        set(RP_MANIPULATOR_f2, force);
        ASSERT_OK(instance_do_step(instance, 0.01 * i, 0.01));
        const double scale = 1.0 + fabs(get(RP_MANIPULATOR_f1_x)) + fabs(get(RP_MANIPULATOR_f2_x));
        TEST_ASSERT_DOUBLE_WITHIN(1e-13 * scale, torque, get(RP_MANIPULATOR_tau1_y));
        TEST_ASSERT_DOUBLE_WITHIN(1e-13 * scale, force, get(RP_MANIPULATOR_f2_z));
    }
}

/* ---- Extremes ------------------------------------------------------------------------------- */

static void begin(void) {
    set_integer(RP_MANIPULATOR_solver_method, method);
    initialize(0.0);
}

/* The horizontal plane without offset: only link 2 moves, at constant velocity or acceleration. */
static void start_sliding(double dq2, double f2) {
    instance_reset(instance);
    set(RP_MANIPULATOR_g, 0.0);
    set(RP_MANIPULATOR_a, 0.0);
    set(RP_MANIPULATOR_dq2, dq2);
    set(RP_MANIPULATOR_f2, f2);
    begin();
}

EACH_METHOD static void test_a_huge_speed_is_integrated_or_refused(void) {
    for (int exponent = 0; exponent <= 304; exponent += 4) {
        const double dq2 = pow(10.0, exponent);
        const double h = 1e-3;
        start_sliding(dq2, 0.0);
        const enum status status = instance_do_step(instance, 0.0, h);
        TEST_ASSERT_TRUE(status_severity(status) <= SEVERITY_DISCARD);
        TEST_ASSERT_DOUBLE_WITHIN(1e-7 * dq2 * h, dq2 * instance_time(instance),
                                  get(RP_MANIPULATOR_q2));
        // ARKODE gives up where its first guess of a step is too long by more than it may shrink it
        TEST_ASSERT_TRUE(status == STATUS_OK || exponent > (method == INTEGRATOR_ERK ? 40 : 100));
    }
}

EACH_METHOD static void test_a_huge_force_is_integrated_or_refused(void) {
    for (int exponent = 0; exponent <= 304; exponent += 4) {
        const double f2 = pow(10.0, exponent);
        start_sliding(0.0, f2);
        for (int i = 0; i < 3; i++) {
            const enum status status = instance_do_step(instance, instance_time(instance), 2e-3);
            const double t = instance_time(instance);
            TEST_ASSERT_TRUE(status_severity(status) <= SEVERITY_DISCARD);
            TEST_ASSERT_DOUBLE_WITHIN(1e-7 * f2 * 4e-6, 0.5 * f2 * t * t, get(RP_MANIPULATOR_q2));
            if (status != STATUS_OK) {
                break;
            }
        }
    }
}

EACH_METHOD static void test_tiny_steps_are_done_or_refused(void) {
    for (int exponent = -323; exponent <= -1; exponent++) {
        const double h = pow(10.0, exponent);
        start_sliding(1.0, 0.0);
        const enum status status = instance_do_step(instance, 0.0, h);
        TEST_ASSERT_TRUE(status_severity(status) <= SEVERITY_DISCARD);
        TEST_ASSERT_DOUBLE_WITHIN(1e-7 * h + DBL_TRUE_MIN, instance_time(instance),
                                  get(RP_MANIPULATOR_q2));
        // solvers square their step, which underflows below 1e-150 s; erk refuses such steps
        TEST_ASSERT_TRUE(status == STATUS_OK ||
                         exponent < (method == INTEGRATOR_ERK ? -100 : -150));
        if (method <= INTEGRATOR_CVODE_BDF && exponent < -150) {
            // the same step with an observer would take another number of internal steps
            TEST_ASSERT_EQUAL_INT(STATUS_NO_CONVERGENCE, status);
        }
    }
}

EACH_METHOD static void test_the_state_is_that_of_the_time_reached(void) {
    set(RP_MANIPULATOR_l1, 1e212);
    set(RP_MANIPULATOR_g, -9e-20);
    begin();
    const enum status status = instance_do_step(instance, 0.0, 4e209);
    // the arm is so long that it does not move: only the Runge-Kutta method finds that; the Taylor
    // method gets as far as its limit of steps lets it
    const double reached = instance_time(instance);
    TEST_ASSERT_EQUAL_INT(method == INTEGRATOR_ERK ? SEVERITY_NONE : SEVERITY_DISCARD,
                          status_severity(status));
    if (method == INTEGRATOR_TAYLOR) {
        TEST_ASSERT_TRUE(reached > 0.0 && reached < 4e209);
    } else {
        TEST_ASSERT_EQUAL_DOUBLE(status == STATUS_OK ? 4e209 : 0.0, reached);
    }
    TEST_ASSERT_TRUE(isfinite(get(RP_MANIPULATOR_q1)) && isfinite(get(RP_MANIPULATOR_q2)));
}
