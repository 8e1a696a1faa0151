/* RPPlant in Model Exchange. */
#include "fuzz_plant_settings.h"

#include <math.h>
#include <string.h>

enum { STATES = 4, MAX_STEPS = 40 };

/* What an importer keeps of a run. */
struct exchange {
    struct fuzz_input *input;
    struct fuzz_instance *instance;
    double x[STATES];
    double z[FUZZ_PLANT_INDICATORS];
};

static void require(fmi2Status status, const struct exchange *run, const char *what) {
    if (status != fmi2OK) {
        fuzz_fail("%s has the status %d: %s", what, (int)status, run->instance->text);
    }
}

static void read(struct exchange *run, double x[STATES], double z[FUZZ_PLANT_INDICATORS]) {
    fuzz_poison(x, STATES);
    fuzz_poison(z, FUZZ_PLANT_INDICATORS);
    require(FUZZ_CHECKED(run->instance, GetContinuousStates, x, STATES), run, "the states");
    require(FUZZ_CHECKED(run->instance, GetEventIndicators, z, FUZZ_PLANT_INDICATORS), run,
            "the event indicators");
    fuzz_assert_written(fmi2OK, x, STATES, "fmi2GetContinuousStates");
    fuzz_assert_written(fmi2OK, z, FUZZ_PLANT_INDICATORS, "fmi2GetEventIndicators");
}

/* Inputs change in event mode; one update is enough, and says truly whether states have jumped. */
static void handle_event(struct exchange *run) {
    static const fmi2ValueReference efforts[] = {RP_PLANT_tau1, RP_PLANT_f2};
    const fmi2ValueReference payload = RP_PLANT_payload_attached;
    double before[STATES];
    double z[FUZZ_PLANT_INDICATORS];
    fmi2EventInfo info;
    require(FUZZ_CHECKED_PLAIN(run->instance, EnterEventMode), run, "fmi2EnterEventMode");
    if (fuzz_below(run->input, 3) == 0) {
        const double values[] = {fuzz_signed(run->input, 1e-2, 100.0),
                                 fuzz_signed(run->input, 1e-2, 100.0)};
        require(FUZZ_CHECKED(run->instance, SetReal, efforts, 2, values), run, "inputs");
    }
    if (fuzz_below(run->input, 4) == 0) {
        const fmi2Boolean is_attached = fuzz_below(run->input, 2) == 0 ? fmi2True : fmi2False;
        require(FUZZ_CHECKED(run->instance, SetBoolean, &payload, 1, &is_attached), run,
                "fmi2SetBoolean");
    }
    if (fuzz_below(run->input, 8) == 0) {
        double limits[2][2];
        fuzz_plant_set(run->input, run->instance, fuzz_below(run->input, FUZZ_PLANT_GROUPS),
                       limits);
    }
    read(run, before, z);
    require(FUZZ_CHECKED(run->instance, NewDiscreteStates, &info), run, "fmi2NewDiscreteStates");
    read(run, run->x, z);
    if (info.newDiscreteStatesNeeded || info.terminateSimulation || info.nextEventTimeDefined) {
        fuzz_fail("fmi2NewDiscreteStates wants more than a plant needs");
    }
    if (info.valuesOfContinuousStatesChanged != (memcmp(before, run->x, sizeof before) != 0)) {
        fuzz_fail("fmi2NewDiscreteStates says %d about jumps of states",
                  info.valuesOfContinuousStatesChanged);
    }
    require(FUZZ_CHECKED_PLAIN(run->instance, EnterContinuousTimeMode), run,
            "fmi2EnterContinuousTimeMode");
}

/* Forward Euler; true: an indicator has changed its sign. */
static bool step(struct exchange *run, double length) {
    fmi2Boolean enter_event_mode = fmi2True;
    fmi2Boolean terminate = fmi2True;
    double dx[STATES];
    double z[FUZZ_PLANT_INDICATORS];
    bool crosses = false;
    fuzz_poison(dx, STATES);
    require(FUZZ_CHECKED(run->instance, GetDerivatives, dx, STATES), run, "fmi2GetDerivatives");
    fuzz_assert_written(fmi2OK, dx, STATES, "fmi2GetDerivatives");
    for (int i = 0; i < STATES; i++) {
        run->x[i] += length * dx[i];
        if (!(fabs(run->x[i]) < 1e6)) {
            return false; // Euler's method has become unstable
        }
    }
    run->instance->time += length;
    require(FUZZ_CHECKED(run->instance, SetTime, run->instance->time), run, "fmi2SetTime");
    require(FUZZ_CHECKED(run->instance, SetContinuousStates, run->x, STATES), run,
            "fmi2SetContinuousStates");
    require(FUZZ_CHECKED(run->instance, CompletedIntegratorStep, fmi2True, &enter_event_mode,
                         &terminate),
            run, "fmi2CompletedIntegratorStep");
    if (enter_event_mode || terminate) {
        fuzz_fail("fmi2CompletedIntegratorStep asks for %d %d", enter_event_mode, terminate);
    }
    read(run, run->x, z);
    for (int i = 0; i < FUZZ_PLANT_INDICATORS; i++) {
        crosses |= (z[i] > 0.0) != (run->z[i] > 0.0);
    }
    memcpy(run->z, z, sizeof z);
    return crosses;
}

/* From a saved state the same step has the same bits. */
static void repeat(struct exchange *run, double length) {
    struct exchange first = *run;
    struct exchange second = *run;
    struct fuzz_values values[2];
    const double begin = run->instance->time;
    fmi2FMUstate state = NULL;
    require(FUZZ_CHECKED(run->instance, GetFMUstate, &state), run, "fmi2GetFMUstate");
    (void)step(&first, length);
    fuzz_read(run->instance, &values[0]);
    require(FUZZ_CHECKED(run->instance, SetFMUstate, state), run, "fmi2SetFMUstate");
    run->instance->time = begin;
    (void)step(&second, length);
    fuzz_read(run->instance, &values[1]);
    fuzz_assert_same(&values[0], &values[1], "a repeated step of Model Exchange");
    require(FUZZ_CHECKED(run->instance, SetFMUstate, state), run, "fmi2SetFMUstate");
    run->instance->time = begin;
    require(FUZZ_CHECKED(run->instance, FreeFMUstate, &state), run, "fmi2FreeFMUstate");
}

void fuzz_plant_exchange(struct fuzz_input *input, struct fuzz_instance *instance) {
    struct exchange run = {.input = input, .instance = instance};
    const double length = fuzz_magnitude(input, 1e-5, 0.05);
    fmi2EventInfo info;
    require(FUZZ_CHECKED(instance, NewDiscreteStates, &info), &run, "fmi2NewDiscreteStates");
    require(FUZZ_CHECKED_PLAIN(instance, EnterContinuousTimeMode), &run,
            "fmi2EnterContinuousTimeMode");
    read(&run, run.x, run.z);
    for (int i = 0; i < MAX_STEPS && input->left > 0; i++) {
        const unsigned selector = fuzz_below(input, 16);
        if (selector == 0) {
            repeat(&run, length);
        }
        if (step(&run, length) || selector == 1) {
            handle_event(&run);
            read(&run, run.x, run.z);
        }
        if (!(fabs(run.x[0]) < 1e6 && fabs(run.x[1]) < 1e6 && fabs(run.x[2]) < 1e6 &&
              fabs(run.x[3]) < 1e6)) {
            return;
        }
    }
}
