#include "fuzz_plant_checks.h"

#include "model_description.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define VALUE(values, name) fuzz_value(values, RP_PLANT_##name)
#define ITEM(values, name)  fuzz_integer_value(values, RP_PLANT_##name)

/* Values of one joint. */
struct joint {
    int number;
    double q, dq, ddq;
    double coulomb, breakaway, friction;
    double lower, upper, stop_force;
    bool has_stops;
    int mode;
};

#define JOINT(values, i)                                                                           \
    (struct joint) {                                                                               \
        .number = i, .q = VALUE(values, q##i), .dq = VALUE(values, dq##i),                         \
        .ddq = VALUE(values, ddq##i), .coulomb = VALUE(values, coulomb_friction##i),               \
        .breakaway = VALUE(values, breakaway_friction##i), .friction = VALUE(values, friction##i), \
        .lower = VALUE(values, lower##i), .upper = VALUE(values, upper##i),                        \
        .stop_force = VALUE(values, stop_force##i), .has_stops = ITEM(values, stops##i) == 2,      \
        .mode = ITEM(values, mode##i),                                                             \
    }

static void check_joint_stops(const struct joint *joint, double tolerance) {
    const double past = fmax(joint->lower - joint->q, joint->q - joint->upper);
    if (joint->has_stops && past > tolerance * (fabs(joint->q) + 0.01)) {
        fuzz_fail("joint %d is at %.17g, %g beyond its stops at %.17g and %.17g (mode %d, "
                  "velocity %g, tolerance %g)",
                  joint->number, joint->q, past, joint->lower, joint->upper, joint->mode, joint->dq,
                  tolerance);
    }
}

void fuzz_check_stops(const struct fuzz_values *values) {
    const double tolerance = VALUE(values, effective_relative_tolerance);
    const struct joint joints[2] = {JOINT(values, 1), JOINT(values, 2)};
    check_joint_stops(&joints[0], tolerance);
    check_joint_stops(&joints[1], tolerance);
}

static void check_mode(const struct joint *joint) {
    const bool is_held = joint->mode == 0;
    if (joint->mode < -1 || joint->mode > 2) {
        fuzz_fail("joint %d is in the mode %d", joint->number, joint->mode);
    }
    if (is_held && (joint->dq != 0.0 || joint->ddq != 0.0)) {
        fuzz_fail("joint %d is held and moves: velocity %g, acceleration %g", joint->number,
                  joint->dq, joint->ddq);
    }
}

static void check_forces(const struct joint *joint) {
    const double strongest = fmax(joint->coulomb, joint->breakaway);
    if (!(fabs(joint->friction) <= strongest * (1.0 + 1e-12))) {
        fuzz_fail("friction of joint %d is %g, more than %g", joint->number, joint->friction,
                  strongest);
    }
    if ((joint->mode == 1 || joint->mode == -1) && joint->friction * joint->mode < 0.0) {
        fuzz_fail("joint %d slides in the direction %d and its friction of %g drives it",
                  joint->number, joint->mode, joint->friction);
    }
    const bool pushes =
        joint->has_stops && ((joint->q == joint->lower && joint->stop_force > 0.0) ||
                             (joint->q == joint->upper && joint->stop_force < 0.0));
    if (joint->stop_force != 0.0 && !pushes) {
        fuzz_fail("a stop exerts %g on joint %d at %.17g, between %.17g and %.17g",
                  joint->stop_force, joint->number, joint->q, joint->lower, joint->upper);
    }
}

void fuzz_check_point(const struct fuzz_values *values) {
    const struct joint joints[2] = {JOINT(values, 1), JOINT(values, 2)};
    fuzz_check_stops(values);
    for (int i = 0; i < 2; i++) {
        check_mode(&joints[i]);
        check_forces(&joints[i]);
    }
    if (VALUE(values, last_event_time) > VALUE(values, time)) {
        fuzz_fail("the last event was at %.17g, after %.17g", VALUE(values, last_event_time),
                  VALUE(values, time));
    }
}

/* What an error of the states in the size of the integrator's weights changes of the energy. */
static double allowance(const struct fuzz_values *values) {
    const double r = VALUE(values, effective_relative_tolerance);
    const double dq1 = VALUE(values, dq1);
    const double dq2 = VALUE(values, dq2);
    const double w_dq1 = r * (fabs(dq1) + 0.01);
    const double w_dq2 = r * (fabs(dq2) + 0.01);
    const double D11 = VALUE(values, D11);
    const double D12 = fabs(VALUE(values, D12));
    const double D22 = VALUE(values, D22);
    const double by_q1 = fabs(VALUE(values, gravity1)) + fabs(VALUE(values, tau1));
    const double by_q2 =
        fabs(VALUE(values, gravity2)) + fabs(VALUE(values, f2)) + fabs(VALUE(values, coriolis2));
    const double momentum1 = D11 * (fabs(dq1) + w_dq1) + D12 * (fabs(dq2) + w_dq2);
    const double momentum2 = D12 * (fabs(dq1) + w_dq1) + D22 * (fabs(dq2) + w_dq2);
    return r * (by_q1 * (fabs(VALUE(values, q1)) + 0.01) +
                by_q2 * (fabs(VALUE(values, q2)) + 0.01)) +
           momentum1 * w_dq1 + momentum2 * w_dq2;
}

/* Magnitudes of the energies that may have been exchanged on the way. */
static double exchanged(const struct fuzz_values *values) {
    const double reach = VALUE(values, l1) + fabs(VALUE(values, a)) + fabs(VALUE(values, q2)) +
                         fabs(VALUE(values, payload_x)) + fabs(VALUE(values, payload_z)) + 1.0;
    const double mass = VALUE(values, m1) + VALUE(values, m2) + VALUE(values, payload_mass);
    return VALUE(values, kinetic_energy) +
           fabs(VALUE(values, g)) * mass * (reach + VALUE(values, lc1)) +
           fabs(VALUE(values, tau1)) + fabs(VALUE(values, f2));
}

static void check_sum(const char *name, double before, double after) {
    if (!(after >= before)) {
        fuzz_fail("%s falls from %.17g to %.17g", name, before, after);
    }
}

void fuzz_check_losses(const struct fuzz_values *before, const struct fuzz_values *after,
                       double tolerance) {
    const double impacts = VALUE(after, impact_loss) - VALUE(before, impact_loss);
    const double grasps = VALUE(after, grasp_loss) - VALUE(before, grasp_loss);
    const double moved1 = VALUE(after, q1) - VALUE(before, q1);
    const double moved2 = VALUE(after, q2) - VALUE(before, q2);
    const double work = VALUE(after, tau1) * moved1 + VALUE(after, f2) * moved2;
    const double gained = VALUE(after, total_energy) - VALUE(before, total_energy);
    const double scale = exchanged(before) + exchanged(after) + fabs(work) + impacts + grasps;
    const double steps = ITEM(after, solver_steps) - ITEM(before, solver_steps) + 1.0;
    const double bound = 1e4 * tolerance * scale + 1e-11 * scale +
                         100.0 * steps * (allowance(before) + allowance(after));
    check_sum("impact_loss", VALUE(before, impact_loss), VALUE(after, impact_loss));
    check_sum("grasp_loss", VALUE(before, grasp_loss), VALUE(after, grasp_loss));
    check_sum("event_count", ITEM(before, event_count), ITEM(after, event_count));
    if (gained + impacts + grasps - work > bound) {
        fuzz_fail("energy rises by %g, impacts take %g and grasps %g, the drives give %g only "
                  "(bound %g, %g steps, method %d, tolerance %g, time %.17g, %d events)",
                  gained, impacts, grasps, work, bound, steps, ITEM(after, solver_method),
                  tolerance, VALUE(after, time),
                  ITEM(after, event_count) - ITEM(before, event_count));
    }
}

void fuzz_check_event_text(const char *text, double earliest, double latest) {
    const char *const *names = model_description.model->events->indicator_names;
    const char *begin = strstr(text, "the step ended at t = ");
    double named = NAN;
    char name[32] = "";
    if (begin == NULL ||
        sscanf(begin, "the step ended at t = %lf: %31s", &named, name) != 2) { // NOLINT
        fuzz_fail("a step with too many events says '%s'", text);
    }
    bool is_known = false;
    for (size_t i = 0; i < model_description.indicator_count; i++) {
        is_known |= strcmp(name, names[i]) == 0;
    }
    if (!is_known || !(named >= earliest && named <= latest)) {
        fuzz_fail("a step with too many events between %.17g and %.17g says '%s'", earliest, latest,
                  text);
    }
}
