#include "fuzz_plant_settings.h"

static void set_reals(struct fuzz_instance *instance, const fmi2ValueReference references[],
                      size_t count, const double values[]) {
    if (FUZZ_CHECKED(instance, SetReal, references, count, values) != fmi2OK) {
        fuzz_fail("valid values are refused: %s", instance->text);
    }
}

static void set_item(struct fuzz_instance *instance, fmi2ValueReference reference,
                     fmi2Integer item) {
    if (FUZZ_CHECKED(instance, SetInteger, &reference, 1, &item) != fmi2OK) {
        fuzz_fail("a valid item is refused: %s", instance->text);
    }
}

double fuzz_signed(struct fuzz_input *input, double low, double high) {
    const unsigned selector = fuzz_byte(input);
    if (selector < 48) {
        return 0.0;
    }
    const double magnitude = fuzz_magnitude(input, low, high);
    return selector % 2 == 0 ? magnitude : -magnitude;
}

static double not_negative(struct fuzz_input *input, double low, double high) {
    return fuzz_below(input, 3) == 0 ? 0.0 : fuzz_magnitude(input, low, high);
}

void fuzz_plant_set_arm(struct fuzz_input *input, struct fuzz_instance *instance) {
    static const fmi2ValueReference references[] = {RP_PLANT_m1,  RP_PLANT_m2, RP_PLANT_I1z,
                                                    RP_PLANT_I2z, RP_PLANT_l1, RP_PLANT_lc1,
                                                    RP_PLANT_a,   RP_PLANT_g};
    double values[8];
    for (int i = 0; i < 6; i++) {
        values[i] = fuzz_magnitude(input, 1e-2, 10.0);
    }
    values[6] = fuzz_signed(input, 1e-3, 1.0);
    values[7] = fuzz_below(input, 2) == 0 ? 9.81 : fuzz_signed(input, 1e-2, 20.0);
    set_reals(instance, references, 8, values);
}

/* ---- Groups ---------------------------------------------------------------------------------- */

static void set_friction(struct fuzz_input *input, struct fuzz_instance *instance, int joint) {
    static const fmi2ValueReference references[2][3] = {
        {RP_PLANT_coulomb_friction1, RP_PLANT_breakaway_friction1, RP_PLANT_stribeck_velocity1},
        {RP_PLANT_coulomb_friction2, RP_PLANT_breakaway_friction2, RP_PLANT_stribeck_velocity2},
    };
    const double coulomb = not_negative(input, 1e-3, 100.0);
    const double excess = not_negative(input, 1e-3, 2.0);
    const double breakaway = excess == 0.0 ? 0.0 : coulomb * (1.0 + excess) + (coulomb == 0.0);
    const double values[] = {coulomb, breakaway, fuzz_magnitude(input, 1e-2, 10.0)};
    set_reals(instance, references[joint], 3, values);
}

static void set_stops(struct fuzz_input *input, struct fuzz_instance *instance, int joint,
                      double limits[2]) {
    static const fmi2ValueReference references[2][3] = {
        {RP_PLANT_lower1, RP_PLANT_upper1, RP_PLANT_restitution1},
        {RP_PLANT_lower2, RP_PLANT_upper2, RP_PLANT_restitution2},
    };
    static const double restitutions[] = {0.0, 0.0, 0.3, 0.5, 0.8, 0.9, 0.99, 1.0};
    static const fmi2ValueReference kinds[] = {RP_PLANT_stops1, RP_PLANT_stops2};
    const double middle = fuzz_signed(input, 1e-2, 2.0);
    const double half = fuzz_magnitude(input, 1e-3, 3.0);
    const double values[] = {middle - half, middle + half, restitutions[fuzz_below(input, 8)]};
    set_reals(instance, references[joint], 3, values);
    set_item(instance, kinds[joint], fuzz_below(input, 3) == 0 ? 1 : 2);
    limits[0] = values[0];
    limits[1] = values[1];
}

static void set_drive(struct fuzz_input *input, struct fuzz_instance *instance, int joint) {
    static const fmi2ValueReference references[2][2] = {
        {RP_PLANT_armature1, RP_PLANT_damping1},
        {RP_PLANT_armature2, RP_PLANT_damping2},
    };
    const double values[] = {not_negative(input, 1e-3, 10.0), not_negative(input, 1e-3, 100.0)};
    set_reals(instance, references[joint], 2, values);
}

static void set_payload(struct fuzz_input *input, struct fuzz_instance *instance) {
    static const fmi2ValueReference references[] = {RP_PLANT_payload_mass, RP_PLANT_payload_inertia,
                                                    RP_PLANT_payload_x, RP_PLANT_payload_z};
    const double values[] = {not_negative(input, 1e-3, 10.0), not_negative(input, 1e-4, 1.0),
                             fuzz_signed(input, 1e-3, 1.0), fuzz_signed(input, 1e-3, 1.0)};
    set_reals(instance, references, 4, values);
    set_item(instance, RP_PLANT_grasp, 1 + (fmi2Integer)fuzz_below(input, 2));
}

void fuzz_plant_set(struct fuzz_input *input, struct fuzz_instance *instance, unsigned group,
                    double limits[2][2]) {
    const int joint = (int)(group % 2);
    switch (group / 2) {
    case 0:
        set_friction(input, instance, joint);
        break;
    case 1:
        set_stops(input, instance, joint, limits[joint]);
        break;
    case 2:
        set_drive(input, instance, joint);
        break;
    default:
        set_payload(input, instance);
        break;
    }
}

void fuzz_plant_set_states(struct fuzz_input *input, struct fuzz_instance *instance,
                           double limits[2][2]) {
    static const fmi2ValueReference references[] = {RP_PLANT_q1, RP_PLANT_q2, RP_PLANT_dq1,
                                                    RP_PLANT_dq2};
    double values[4];
    for (int i = 0; i < 2; i++) {
        const double lower = limits[i][0];
        const double upper = limits[i][1];
        const unsigned place = fuzz_byte(input);
        values[i] = place < 32     ? lower
                    : place >= 224 ? upper
                                   : lower + (upper - lower) * ((place - 31) / 256.0);
        values[2 + i] = fuzz_signed(input, 1e-3, 10.0);
    }
    set_reals(instance, references, 4, values);
}
