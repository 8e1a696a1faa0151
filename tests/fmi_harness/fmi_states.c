#include "fmi_states.h"

#include <stdlib.h>
#include <string.h>
#include <unity.h>

static const fmi2ValueReference q1 = RP_MANIPULATOR_q1;
static const fmi2ValueReference ddq1 = RP_MANIPULATOR_ddq1;
static const fmi2ValueReference tau1 = RP_MANIPULATOR_tau1;
static const fmi2ValueReference steps = RP_MANIPULATOR_solver_steps;
static const fmi2Integer order = 1;
static const double one = 1.0;
static const double zeros[4];

// where results go
static fmi2Boolean flags[2];
static double reals[4];
static fmi2Integer integer;
static fmi2String text;
static fmi2Status pending;
static fmi2EventInfo info;

/* ---- With these arguments ------------------------------------------------------------------- */

#define CALL_PLAIN(name)                                                                           \
    static fmi2Status call_##name(fmi2Component c, double now, double step) {                      \
        return fmu.name(c);                                                                        \
    }
#define CALL(name, ...)                                                                            \
    static fmi2Status call_##name(fmi2Component c, double now, double step) {                      \
        return fmu.name(c, __VA_ARGS__);                                                           \
    }
CALL(SetDebugLogging, fmi2True, 0, NULL)
CALL(SetupExperiment, fmi2True, 1e-6, 0.0, fmi2True, 100.0)
CALL_PLAIN(EnterInitializationMode)
CALL_PLAIN(ExitInitializationMode)
CALL_PLAIN(Terminate)
CALL_PLAIN(Reset)
CALL(GetReal, &q1, 1, reals)
CALL(GetInteger, &steps, 1, &integer)
CALL(GetBoolean, NULL, 0, NULL) // there is none of this type, nor of String
CALL(GetString, NULL, 0, NULL)
CALL(SetReal, &tau1, 1, &one)
CALL(SetInteger, NULL, 0, NULL) // none that may be set in all states of the row
CALL(SetBoolean, NULL, 0, NULL)
CALL(SetString, NULL, 0, NULL)
CALL(FreeFMUstate, &(fmi2FMUstate){NULL})
CALL(GetDirectionalDerivative, &ddq1, 1, &tau1, 1, &one, reals)

// Co-Simulation
CALL(SetRealInputDerivatives, &tau1, 1, &order, &one)
CALL(GetRealOutputDerivatives, &q1, 1, &order, reals)
CALL(DoStep, now, step, fmi2True)
CALL_PLAIN(CancelStep)
CALL(GetStatus, fmi2DoStepStatus, &pending)
CALL(GetRealStatus, fmi2LastSuccessfulTime, reals)
CALL(GetIntegerStatus, fmi2DoStepStatus, &integer)
CALL(GetBooleanStatus, fmi2Terminated, flags)
CALL(GetStringStatus, fmi2PendingStatus, &text)

// Model Exchange
CALL_PLAIN(EnterEventMode)
CALL(NewDiscreteStates, &info)
CALL_PLAIN(EnterContinuousTimeMode)
CALL(CompletedIntegratorStep, fmi2True, &flags[0], &flags[1])
CALL(SetTime, now)
CALL(SetContinuousStates, zeros, 4)
CALL(GetDerivatives, reals, 4)
CALL(GetEventIndicators, reals, 0)
CALL(GetContinuousStates, reals, 4)
CALL(GetNominalsOfContinuousStates, reals, 4)

/* ---- With more than arguments --------------------------------------------------------------- */

static fmi2Status ok_if(bool condition) {
    return condition ? fmi2OK : fmi2Error;
}

static fmi2Status call_GetTypesPlatform(fmi2Component c, double now, double step) {
    return ok_if(strcmp(fmu.GetTypesPlatform(), fmi2TypesPlatform) == 0);
}

static fmi2Status call_GetVersion(fmi2Component c, double now, double step) {
    return ok_if(strcmp(fmu.GetVersion(), "2.0") == 0);
}

static fmi2Status call_Instantiate(fmi2Component c, double now, double step) {
    static const fmi2Type types[] = {fmi2CoSimulation, fmi2ModelExchange};
    const fmi2CallbackFunctions callbacks = {0};
    bool instantiated = true;
    for (size_t i = 0; i < FMU_COUNT(types); i++) {
        const fmi2Component other = fmu.Instantiate("other", types[i], RP_MANIPULATOR_GUID, "",
                                                    &callbacks, fmi2False, fmi2False);
        instantiated = instantiated && other != NULL;
        fmu.FreeInstance(other);
    }
    return ok_if(instantiated);
}

static fmi2Status call_FreeInstance(fmi2Component c, double now, double step) {
    fmu_free(c);
    return fmi2OK;
}

/* The status of the last call, made with a state that the instance has given out. */
static fmi2Status call_with_state(enum fmu_function function, fmi2Component c) {
    fmi2FMUstate state = NULL;
    fmi2FMUstate copy = NULL;
    size_t size = 0;
    fmi2Byte *bytes = NULL;

    fmi2Status status = fmu.GetFMUstate(c, &state);
    if (function == FMU_SetFMUstate) {
        status = fmu.SetFMUstate(c, state);
    } else if (function != FMU_GetFMUstate) {
        status = fmu.SerializedFMUstateSize(c, state, &size);
        bytes = calloc(size + 1, 1);
    }
    if (function == FMU_SerializeFMUstate || function == FMU_DeSerializeFMUstate) {
        status = fmu.SerializeFMUstate(c, state, bytes, size);
    }
    if (function == FMU_DeSerializeFMUstate) {
        status = fmu.DeSerializeFMUstate(c, bytes, size, &copy);
    }
    free(bytes);
    if (state != NULL) {
        fmu.FreeFMUstate(c, &state);
    }
    if (copy != NULL) {
        fmu.FreeFMUstate(c, &copy);
    }
    return status;
}

#define CALL_WITH_STATE(name)                                                                      \
    static fmi2Status call_##name(fmi2Component c, double now, double step) {                      \
        return call_with_state(FMU_##name, c);                                                     \
    }
CALL_WITH_STATE(GetFMUstate)
CALL_WITH_STATE(SetFMUstate)
CALL_WITH_STATE(SerializedFMUstateSize)
CALL_WITH_STATE(SerializeFMUstate)
CALL_WITH_STATE(DeSerializeFMUstate)

fmi2Status fmu_call(enum fmu_function function, fmi2Component c, double now, double step) {
#define CALL_OF(name, kinds, states) call_##name,
    static fmi2Status (*const calls[])(fmi2Component c, double now,
                                       double step) = {FMI2_FUNCTION_LIST(CALL_OF)};
#undef CALL_OF
    return calls[function](c, now, step);
}

/* ---- States --------------------------------------------------------------------------------- */

const struct fmi_states *fmi_states_of(fmi2Type type) {
    return type == fmi2CoSimulation ? &fmu_co_simulation_states : &fmu_model_exchange_states;
}

const struct fmi_state *fmi_state_of(fmi2Type type, char letter) {
    const struct fmi_state *state = fmi_states_of(type)->states;
    while (state->letter != letter) {
        state++;
    }
    return state;
}

/* The instance takes the one internal step that it may, and gives up. */
static void fail_step(fmi2Component c) {
    ASSERT_DISCARD(fmu.DoStep(c, 0.0, 10.0, fmi2True));
}

fmi2Component fmu_reach(fmi2Type type, const struct fmi_state *state, struct fmu_log *log) {
    const fmi2Component c = fmu_instantiate_as(type, log, false);
    if (state->letter == 'F') {
        fmu_set_integer(c, RP_MANIPULATOR_max_internal_steps, 1);
    }
    ASSERT_OK(fmu.SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0));
    if (state->letter != 'I') {
        ASSERT_OK(fmu.EnterInitializationMode(c));
    }
    if (strchr("CFVNTE", state->letter) != NULL) {
        ASSERT_OK(fmu.ExitInitializationMode(c));
    }
    if (state->letter == 'F') {
        fail_step(c);
    } else if (state->letter == 'N') {
        ASSERT_OK(fmu.EnterContinuousTimeMode(c));
    } else if (state->letter == 'T') {
        ASSERT_OK(fmu.Terminate(c));
    } else if (state->letter == 'E') {
        ASSERT_ERROR(fmu.ExitInitializationMode(c));
    }
    fmu_log_clear(log);
    return c;
}

void fmu_assert_in_state(fmi2Component component, const struct fmi_state *state, double now,
                         struct fmu_log *log, const char *message) {
    if (state->proof != FMU_FUNCTION_COUNT) {
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu_call(state->proof, component, now, 0.01),
                                      message);
        return;
    }
    // the same functions work in the other states: only a refusal's message distinguishes them
    fmu_log_clear(log);
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2Error, fmu_try_set(component, RP_MANIPULATOR_tau1, 1.0),
                                  message);
    fmu_assert_logged(log, state->name);
    fmu_assert_in_error(component);
}
