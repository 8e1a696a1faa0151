/* What the motion of the arm conserves, through the instance and the integrator. */
#include "rp_model.h"
#include "run_instance.h"
#include "value_references.h"

void setUp(void) {
    create_instance();
}

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
