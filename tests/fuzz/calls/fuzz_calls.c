/* Random sequences of all functions of FMI 2.0 with hostile and mixed-up arguments, on several
 * instances of both kinds at once. README.md says how an input is decoded. */
#include "fuzz_arguments.h"
#include "fuzz_session.h"

#include <math.h>
#include <string.h>

const char *const fuzz_target_name = FUZZ_TARGET_NAME;

/* ---- Life and logging ------------------------------------------------------------------------ */

void fuzz_call_GetTypesPlatform(struct fuzz_session *session, struct fuzz_instance *instance) {
    if (strcmp(FUZZ_CALL(fuzz_fmu.GetTypesPlatform()), fmi2TypesPlatform) != 0) {
        fuzz_fail("fmi2GetTypesPlatform returns another platform");
    }
}

/* New instances, which are freed at once. */
void fuzz_call_Instantiate(struct fuzz_session *session, struct fuzz_instance *instance) {
    static const char *const names[] = {"", "one", "100 %s %n #r1#\n", "Ä"};
    static const char *const guids[] = {RP_MANIPULATOR_GUID, "", "{0}", "%s%s%s%n"};
    struct fuzz_input *input = session->input;
    const fmi2CallbackFunctions callbacks = fuzz_callbacks(instance, fuzz_below(input, 2) == 0);
    const unsigned name = fuzz_below(input, FUZZ_COUNT(names));
    const unsigned guid = fuzz_below(input, FUZZ_COUNT(guids));
    const int kind = fuzz_below(input, 4) != 0 ? fuzz_byte(input) % 2 : fuzz_integer(input);
    const fmi2Component made = FUZZ_CALL(fuzz_fmu.Instantiate(
        names[name], (fmi2Type)kind, guids[guid], fuzz_below(input, 2) == 0 ? NULL : names[name],
        &callbacks, fuzz_integer(input), fuzz_integer(input)));
    const bool is_valid =
        name != 0 && guid == 0 && (kind == fmi2CoSimulation || kind == fmi2ModelExchange);
    if ((made != NULL) != is_valid) {
        fuzz_fail("fmi2Instantiate with the name '%s', the GUID '%s' and the kind %d %s",
                  names[name], guids[guid], kind, made != NULL ? "succeeds" : "fails");
    }
    fuzz_instance_count += made != NULL;
    fuzz_call_count++;
    fuzz_fmu.FreeInstance(made);
}

void fuzz_call_SetupExperiment(struct fuzz_session *session, struct fuzz_instance *instance) {
    struct fuzz_input *input = session->input;
    const int tolerance_defined = fuzz_byte(input) % 3;
    const double tolerance = fuzz_real(input);
    const double start = fuzz_real(input);
    const int stop_defined = fuzz_byte(input) % 3;
    const double stop = fuzz_real(input);
    if (FUZZ_CHECKED(instance, SetupExperiment, tolerance_defined, tolerance, start, stop_defined,
                     stop) == fmi2OK) {
        if (!isfinite(start) || (stop_defined && !(stop >= start))) {
            fuzz_fail("an experiment from %g to %g is accepted", start, stop);
        }
        instance->time = start;
    }
}

void fuzz_call_CancelStep(struct fuzz_session *session, struct fuzz_instance *instance) {
    FUZZ_CHECKED_PLAIN(instance, CancelStep);
}

/* ---- Co-Simulation --------------------------------------------------------------------------- */

void fuzz_call_DoStep(struct fuzz_session *session, struct fuzz_instance *instance) {
    struct fuzz_input *input = session->input;
    const double point = fuzz_below(input, 8) != 7 ? instance->time : fuzz_real(input);
    const double length = fuzz_any_step(input);
    if (FUZZ_CHECKED(instance, DoStep, point, length, fuzz_integer(input)) == fmi2OK) {
        if (!(length > 0.0) || !isfinite(point + length)) {
            fuzz_fail("a step of %g s from %g s succeeds", length, point);
        }
        instance->time = point + length;
    }
}

static fmi2StatusKind any_status_kind(struct fuzz_input *input) {
    return (fmi2StatusKind)(fuzz_below(input, 8) != 0 ? (int)fuzz_below(input, 4)
                                                      : fuzz_integer(input));
}

void fuzz_call_GetRealStatus(struct fuzz_session *session, struct fuzz_instance *instance) {
    double value = NAN;
    fuzz_poison(&value, 1);
    const fmi2Status status =
        FUZZ_CHECKED(instance, GetRealStatus, any_status_kind(session->input), &value);
    fuzz_assert_written(status, &value, 1, "fmi2GetRealStatus");
}

#define STATUS_CALL(name, type)                                                                    \
    void fuzz_call_##name(struct fuzz_session *session, struct fuzz_instance *instance) {          \
        type value = (type)0;                                                                      \
        FUZZ_CHECKED(instance, name, any_status_kind(session->input), &value);                     \
    }
STATUS_CALL(GetStatus, fmi2Status)
STATUS_CALL(GetIntegerStatus, fmi2Integer)
STATUS_CALL(GetBooleanStatus, fmi2Boolean)
STATUS_CALL(GetStringStatus, fmi2String)

/* ---- The target ------------------------------------------------------------------------------ */

/* A function of the standard that is missing here does not compile. */
#define CALL_OF(name, kinds, states) [FMU_##name] = fuzz_call_##name,
static fuzz_operation *const calls[] = {FMI2_FUNCTION_LIST(CALL_OF)};

void fuzz_target_run(struct fuzz_input *input) {
    fuzz_session_run(input, calls, FUZZ_COUNT(calls));
}
