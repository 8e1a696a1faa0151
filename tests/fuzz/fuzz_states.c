/* Deserialization of mutated states, and what an instance does that continues from one that was
 * taken. README.md says how an input is decoded. */
#include "fuzz_bytes.h"
#include "value_references.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

const char *const fuzz_target_name = FUZZ_TARGET_NAME;

enum { BASES = 12, MAX_MUTATIONS = 12, MAX_OPERATIONS = 10 };

/* An instance steps from a restored state only if its max_internal_steps is at most this. */
enum { MAX_INTERNAL_STEPS = 3000 };

/* ---- States to mutate ------------------------------------------------------------------------ */

static void step_with_efforts(struct fuzz_instance *instance, unsigned base) {
    const fmi2ValueReference inputs[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_f2};
    const double efforts[] = {1.0, 9.0};
    const fmi2Integer orders[] = {1, 3};
    fuzz_require(FUZZ_CHECKED(instance, SetReal, inputs, 2, efforts), instance, "fmi2SetReal");
    for (int i = 0; i < 5; i++) {
        fuzz_require(fuzz_step(instance, 0.0625 * (1 + i % 2)), instance, "fmi2DoStep");
    }
    if (base >= 6) {
        fuzz_require(FUZZ_CHECKED(instance, SetRealInputDerivatives, inputs, 2, orders, efforts),
                     instance, "fmi2SetRealInputDerivatives");
    }
    if (base >= 9) {
        fuzz_require(fuzz_step(instance, 0.25), instance, "fmi2DoStep");
    }
}

/* Co-Simulation with each method, between steps, with input derivatives and after them; of both
 * kinds, new, in initialization mode, terminated and in the error state. */
static void bring_to_base(struct fuzz_instance *instance, unsigned base) {
    const fmi2ValueReference method_reference = RP_MANIPULATOR_solver_method;
    const fmi2Integer method = 1 + (fmi2Integer)(base % FUZZ_METHODS);
    fuzz_require(FUZZ_CHECKED(instance, SetInteger, &method_reference, 1, &method), instance,
                 "fmi2SetInteger");
    if (base == 0) {
        return;
    }
    fuzz_require(fuzz_initialize(instance, base % 2 == 0 ? 0.0 : 1e-4, base < 8 ? 0.0 : 100.0),
                 instance, "the initialization");
    if (instance->kind == fmi2CoSimulation) {
        step_with_efforts(instance, base);
    } else if (base % 2 == 0) {
        fuzz_require(FUZZ_CHECKED_PLAIN(instance, EnterContinuousTimeMode), instance,
                     "fmi2EnterContinuousTimeMode");
    }
    if (base == 1) {
        fuzz_require(FUZZ_CHECKED_PLAIN(instance, Terminate), instance, "fmi2Terminate");
    }
    if (base == 2) {
        (void)FUZZ_CHECKED_PLAIN(instance, ExitInitializationMode); // is refused
    }
}

static const struct fuzz_bytes *base_bytes(fmi2Type kind, unsigned base) {
    static struct fuzz_bytes known[2][BASES];
    struct fuzz_bytes *bytes = &known[kind == fmi2CoSimulation][base];
    if (bytes->size == 0) {
        struct fuzz_instance *instance = fuzz_instance_create(kind, false, false);
        fuzz_limit_steps(instance, FUZZ_MAX_INTERNAL_STEPS);
        bring_to_base(instance, base);
        fuzz_serialize(instance, bytes);
        fuzz_instance_free(instance);
    }
    return bytes;
}

/* ---- Mutations ------------------------------------------------------------------------------- */

static void mutate(struct fuzz_input *input, fmi2Type kind, struct fuzz_bytes *bytes) {
    const unsigned at = fuzz_byte(input);
    const size_t field = fuzz_fields_begin() + (size_t)at * FUZZ_FIELD;
    double value;
    uint64_t bits;
    fmi2Byte *byte;
    const struct fuzz_bytes *other;
    switch (fuzz_below(input, 8)) {
    case 0: // one byte anywhere
        byte = &bytes->data[(at + (size_t)256 * fuzz_byte(input)) % bytes->size];
        *byte = (fmi2Byte)(*byte ^ (int)(1 + fuzz_below(input, 255)));
        break;
    case 1: // a field of another state
        other = base_bytes(kind, fuzz_below(input, BASES));
        if (field + FUZZ_FIELD <= other->size && other->size == bytes->size) {
            memcpy(bytes->data + field, other->data + field, FUZZ_FIELD);
        }
        break;
    case 2:
    case 3:
        fuzz_write_field(bytes, at, (uint64_t)(int64_t)fuzz_integer(input));
        break;
    case 4: // a small integer, or one at the end of the range
        bits = fuzz_byte(input);
        fuzz_write_field(bytes, at, bits < 240 ? bits : INT64_MAX - (bits - 240));
        break;
    default:
        value = fuzz_real(input);
        memcpy(&bits, &value, sizeof bits);
        fuzz_write_field(bytes, at, bits);
        break;
    }
}

/* Cut off or lengthened, with the length that is stated repaired or not. */
static void change_size(struct fuzz_input *input, struct fuzz_bytes *bytes) {
    const unsigned change = fuzz_byte(input) + 256u * fuzz_below(input, 4);
    const bool states_it = fuzz_below(input, 2) == 0;
    bytes->size = change < bytes->size ? bytes->size - change : bytes->size + change % 64;
    if (states_it && bytes->size >= FUZZ_LENGTH_AT + 4) {
        fuzz_write_number(bytes->data + FUZZ_LENGTH_AT, bytes->size, 4);
    }
}

/* ---- Going on -------------------------------------------------------------------------------- */

static void read_derivatives(struct fuzz_instance *instance) {
    const fmi2ValueReference outputs[] = {RP_MANIPULATOR_ddq1, RP_MANIPULATOR_ee_vx,
                                          RP_MANIPULATOR_total_energy};
    const fmi2Integer orders[] = {1, 2, 1};
    const fmi2ValueReference knowns[] = {RP_MANIPULATOR_q2, RP_MANIPULATOR_f2};
    const double seed[] = {1.0, -0.5};
    double values[4];
    fuzz_poison(values, 4);
    fmi2Status status =
        FUZZ_CHECKED(instance, GetDirectionalDerivative, outputs, 3, knowns, 2, seed, values);
    fuzz_assert_written(status, values, 3, "fmi2GetDirectionalDerivative");
    fuzz_poison(values, 4);
    status = instance->kind == fmi2CoSimulation
                 ? FUZZ_CHECKED(instance, GetRealOutputDerivatives, outputs, 3, orders, values)
                 : FUZZ_CHECKED(instance, GetDerivatives, values, 4);
    fuzz_assert_written(status, values, instance->kind == fmi2CoSimulation ? 3 : 4,
                        "a call for derivatives");
}

static void set_input(struct fuzz_input *input, struct fuzz_instance *instance) {
    const fmi2ValueReference reference =
        fuzz_below(input, 2) == 0 ? RP_MANIPULATOR_tau1 : RP_MANIPULATOR_f2;
    const fmi2Integer order = (fmi2Integer)fuzz_below(input, 4);
    const double value = fuzz_real(input);
    if (order == 0 || instance->kind == fmi2ModelExchange) {
        FUZZ_CHECKED(instance, SetReal, &reference, 1, &value);
    } else {
        FUZZ_CHECKED(instance, SetRealInputDerivatives, &reference, 1, &order, &value);
    }
}

static void set_states(struct fuzz_input *input, struct fuzz_instance *instance) {
    const double x[] = {fuzz_real(input), 0.5, fuzz_real(input), 1.0};
    FUZZ_CHECKED(instance, SetTime, instance->time);
    FUZZ_CHECKED(instance, SetContinuousStates, x, 4);
}

/* The same step twice, from the state and again from it. */
static void repeat_step(struct fuzz_instance *instance, fmi2FMUstate state, double length) {
    struct fuzz_values values[2];
    fmi2Status statuses[2];
    memset(values, 0, sizeof values);
    for (int i = 0; i < 2; i++) {
        fuzz_require(FUZZ_CHECKED(instance, SetFMUstate, state), instance,
                     "fmi2SetFMUstate of an accepted state");
        instance->in_error = false; // or not: the state may hold it
        if (FUZZ_CHECKED(instance, GetReal, &(fmi2ValueReference){RP_MANIPULATOR_time}, 1,
                         &instance->time) != fmi2OK) {
            return; // it was saved before initialization
        }
        statuses[i] = fuzz_step(instance, length);
        if (statuses[i] != fmi2Error) {
            fuzz_read(instance, &values[i]);
        }
    }
    if (statuses[0] != statuses[1]) {
        fuzz_fail("a step repeated from a restored state has the status %d, not %d",
                  (int)statuses[1], (int)statuses[0]);
    }
    fuzz_assert_same(&values[0], &values[1], "a step repeated from a restored state");
}

static double any_step(struct fuzz_input *input) {
    return fuzz_below(input, 8) != 0 ? fuzz_magnitude(input, 1e-6, 10.0) : fuzz_real(input);
}

static void go_on(struct fuzz_input *input, struct fuzz_instance *instance, fmi2FMUstate state) {
    const fmi2ValueReference limit_reference = RP_MANIPULATOR_max_internal_steps;
    const fmi2ValueReference time_reference = RP_MANIPULATOR_time;
    fmi2Integer limit = 0;
    double time = 0.0;
    const bool reads = FUZZ_CHECKED(instance, GetInteger, &limit_reference, 1, &limit) == fmi2OK &&
                       FUZZ_CHECKED(instance, GetReal, &time_reference, 1, &time) == fmi2OK;
    if (!reads || limit > MAX_INTERNAL_STEPS) {
        return;
    }
    instance->time = time;
    if (fuzz_below(input, 2) == 0) {
        repeat_step(instance, state, any_step(input));
    }
    struct fuzz_values values;
    for (int i = 0; i < MAX_OPERATIONS && input->left > 0 && !instance->in_error; i++) {
        const bool steps = instance->kind == fmi2CoSimulation;
        switch (fuzz_below(input, 4)) {
        case 0:
            set_input(input, instance);
            break;
        case 1:
            read_derivatives(instance);
            break;
        default:
            if (steps) {
                fuzz_step(instance, any_step(input));
            } else {
                set_states(input, instance);
            }
            break;
        }
        if (!instance->in_error) {
            fuzz_read(instance, &values);
        }
    }
}

/* A state that was taken is served like any other, and comes out as the bytes that went in. */
static void use(struct fuzz_input *input, struct fuzz_instance *instance, fmi2FMUstate state,
                const struct fuzz_bytes *bytes) {
    static struct fuzz_bytes again;
    fuzz_serialize_state(instance, state, &again);
    if (!fuzz_are_same_bytes(&again, bytes)) {
        fuzz_fail("an accepted state is serialized to other bytes");
    }
    if (FUZZ_CHECKED(instance, SetFMUstate, state) != fmi2OK) {
        fuzz_fail("fmi2SetFMUstate of an accepted state fails: %s", instance->text);
    }
    go_on(input, instance, state);
}

/* ---- The target ------------------------------------------------------------------------------ */

void fuzz_target_run(struct fuzz_input *input) {
    static struct fuzz_bytes bytes;
    const unsigned selector = fuzz_byte(input);
    const fmi2Type kind = selector & 0x80 ? fmi2ModelExchange : fmi2CoSimulation;
    const fmi2Type reader = (selector & 0x70) == 0x70 ? fmi2ModelExchange : kind;
    const struct fuzz_bytes *base = base_bytes(kind, (selector & 15) % BASES);
    const unsigned variant = fuzz_byte(input);
    const unsigned mutations = fuzz_below(input, MAX_MUTATIONS);
    const bool repairs = fuzz_below(input, 8) != 0;
    const bool resizes = fuzz_below(input, 32) == 1;
    bytes = *base;
    for (unsigned i = 0; i < mutations; i++) {
        mutate(input, kind, &bytes);
    }
    if (resizes) {
        change_size(input, &bytes);
    }
    if (repairs && bytes.size > FUZZ_FIELD) {
        fuzz_repair_checksum(&bytes);
    }

    struct fuzz_instance *instance = fuzz_instance_create(reader, true, (variant & 0x80) != 0);
    fmi2FMUstate state = NULL;
    fmi2Byte *exact = fuzz_array(bytes.size > 0 ? bytes.size : 1, 1); // nothing lies behind them
    memcpy(exact, bytes.data, bytes.size);
    const fmi2Status status =
        FUZZ_CHECKED(instance, DeSerializeFMUstate, exact, bytes.size, &state);
    free(exact);
    const bool is_changed = !fuzz_are_same_bytes(&bytes, base);
    if ((status == fmi2OK) != (state != NULL)) {
        fuzz_fail("fmi2DeSerializeFMUstate has the status %d and leaves %s", (int)status,
                  state != NULL ? "a state" : "none");
    }
    if (!is_changed && reader == kind && status != fmi2OK) {
        fuzz_fail("a state that was not changed is refused");
    }
    if (status == fmi2OK && (bytes.size != base->size || (is_changed && !repairs))) {
        fuzz_fail("a state with the wrong %s is accepted",
                  bytes.size != base->size ? "length" : "checksum");
    }
    if (status == fmi2OK) {
        use(input, instance, state, &bytes);
    }
    if (instance->had_error || variant % 4 == 0) {
        fuzz_assert_as_new(instance, variant);
    }
    fuzz_instance_free(instance);
}
