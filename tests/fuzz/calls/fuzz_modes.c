/* Calls that lead from one state of FMI to another, and those of time in Model Exchange. */
#include "fuzz_arguments.h"
#include "fuzz_session.h"
#include "model_description.h"

#include <math.h>
#include <string.h>

/* ---- Life and logging ------------------------------------------------------------------------ */

void fuzz_call_GetVersion(struct fuzz_session *session, struct fuzz_instance *instance) {
    if (strcmp(FUZZ_CALL(fuzz_fmu.GetVersion()), "2.0") != 0) {
        fuzz_fail("fmi2GetVersion returns another version");
    }
}

void fuzz_call_FreeInstance(struct fuzz_session *session, struct fuzz_instance *instance) {
    fuzz_session_free_instance(session, instance);
}

void fuzz_call_SetDebugLogging(struct fuzz_session *session, struct fuzz_instance *instance) {
    static const char *const categories[] = {"logEvents",
                                             "logStatusWarning",
                                             "logStatusDiscard",
                                             "logStatusError",
                                             "logStatusFatal",
                                             "logAll",
                                             "",
                                             "%s%n"};
    struct fuzz_input *input = session->input;
    const size_t count = fuzz_byte(input) % 4;
    fmi2String *chosen = fuzz_argument(count, sizeof *chosen);
    for (size_t i = 0; i < count; i++) {
        chosen[i] = categories[fuzz_below(input, FUZZ_COUNT(categories))];
    }
    if (FUZZ_CHECKED(instance, SetDebugLogging, fuzz_byte(input) % 3, count, chosen) == fmi2OK) {
        instance->tells_refusals = false; // it may not have to
    }
}

#define PLAIN_CALL(name)                                                                           \
    void fuzz_call_##name(struct fuzz_session *session, struct fuzz_instance *instance) {          \
        FUZZ_CHECKED_PLAIN(instance, name);                                                        \
    }
PLAIN_CALL(EnterInitializationMode)
PLAIN_CALL(ExitInitializationMode)
PLAIN_CALL(Terminate)
PLAIN_CALL(EnterEventMode)
PLAIN_CALL(EnterContinuousTimeMode)

void fuzz_call_Reset(struct fuzz_session *session, struct fuzz_instance *instance) {
    fuzz_reset(instance);
}

/* ---- Model Exchange -------------------------------------------------------------------------- */

void fuzz_call_NewDiscreteStates(struct fuzz_session *session, struct fuzz_instance *instance) {
    fmi2EventInfo info = {.nextEventTime = NAN};
    if (FUZZ_CHECKED(instance, NewDiscreteStates, &info) == fmi2OK &&
        (info.nextEventTimeDefined || info.newDiscreteStatesNeeded || info.terminateSimulation)) {
        fuzz_fail("fmi2NewDiscreteStates reports an event");
    }
}

void fuzz_call_CompletedIntegratorStep(struct fuzz_session *session,
                                       struct fuzz_instance *instance) {
    fmi2Boolean enter = fmi2True;
    fmi2Boolean terminate = fmi2True;
    if (FUZZ_CHECKED(instance, CompletedIntegratorStep, fuzz_integer(session->input), &enter,
                     &terminate) == fmi2OK &&
        (terminate || (enter && model_description.indicator_count == 0))) {
        fuzz_fail("fmi2CompletedIntegratorStep asks for %d %d", enter, terminate);
    }
}

void fuzz_call_SetTime(struct fuzz_session *session, struct fuzz_instance *instance) {
    const double time = fuzz_real(session->input);
    if (FUZZ_CHECKED(instance, SetTime, time) == fmi2OK) {
        instance->time = time;
    }
}
