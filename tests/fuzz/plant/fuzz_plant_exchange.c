/* RPPlant in Model Exchange. */
#include "fuzz_exchange.h"
#include "fuzz_plant_settings.h"

#include <math.h>
#include <string.h>

enum { STATES = 4, MAX_STEPS = 40 };

static void read(struct fuzz_exchange *run) {
    if (!fuzz_exchange_read(run)) {
        fuzz_fail("states or event indicators cannot be computed: %s", run->instance->text);
    }
}

/* Inputs change in event mode; one update is enough, and says truly whether states have jumped. */
static void handle_event(struct fuzz_input *input, struct fuzz_exchange *run) {
    static const fmi2ValueReference efforts[] = {RP_PLANT_tau1, RP_PLANT_f2};
    const fmi2ValueReference payload = RP_PLANT_payload_attached;
    double before[STATES];
    fmi2EventInfo info;
    fuzz_require(FUZZ_CHECKED_PLAIN(run->instance, EnterEventMode), run->instance,
                 "fmi2EnterEventMode");
    if (fuzz_below(input, 3) == 0) {
        const double values[] = {fuzz_signed(input, 1e-2, 100.0), fuzz_signed(input, 1e-2, 100.0)};
        fuzz_require(FUZZ_CHECKED(run->instance, SetReal, efforts, 2, values), run->instance,
                     "inputs");
    }
    if (fuzz_below(input, 4) == 0) {
        const fmi2Boolean is_attached = fuzz_below(input, 2) == 0 ? fmi2True : fmi2False;
        fuzz_require(FUZZ_CHECKED(run->instance, SetBoolean, &payload, 1, &is_attached),
                     run->instance, "fmi2SetBoolean");
    }
    if (fuzz_below(input, 8) == 0) {
        double limits[2][2];
        fuzz_plant_set(input, run->instance, fuzz_below(input, FUZZ_PLANT_GROUPS), limits);
    }
    read(run);
    memcpy(before, run->x, sizeof before);
    fuzz_require(FUZZ_CHECKED(run->instance, NewDiscreteStates, &info), run->instance,
                 "fmi2NewDiscreteStates");
    read(run);
    if (info.newDiscreteStatesNeeded || info.terminateSimulation || info.nextEventTimeDefined) {
        fuzz_fail("fmi2NewDiscreteStates wants more than a plant needs");
    }
    if (info.valuesOfContinuousStatesChanged != (memcmp(before, run->x, sizeof before) != 0)) {
        fuzz_fail("fmi2NewDiscreteStates says %d about jumps of states",
                  info.valuesOfContinuousStatesChanged);
    }
    fuzz_require(FUZZ_CHECKED_PLAIN(run->instance, EnterContinuousTimeMode), run->instance,
                 "fmi2EnterContinuousTimeMode");
}

void fuzz_plant_exchange(struct fuzz_input *input, struct fuzz_instance *instance) {
    struct fuzz_exchange run = {.instance = instance, .next_time = INFINITY};
    const double length = fuzz_magnitude(input, 1e-5, 0.05);
    fmi2EventInfo info;
    fuzz_require(FUZZ_CHECKED(instance, NewDiscreteStates, &info), instance,
                 "fmi2NewDiscreteStates");
    fuzz_require(FUZZ_CHECKED_PLAIN(instance, EnterContinuousTimeMode), instance,
                 "fmi2EnterContinuousTimeMode");
    read(&run);
    for (int i = 0; i < MAX_STEPS && input->left > 0; i++) {
        const unsigned selector = fuzz_below(input, 16);
        if (selector == 0) {
            fuzz_exchange_repeat(&run, length);
        }
        const enum fuzz_outcome outcome = fuzz_exchange_step(&run, length);
        if (outcome == FUZZ_MEETS_EVENT || (outcome == FUZZ_RESUMES && selector == 1)) {
            handle_event(input, &run);
        }
        for (int k = 0; k < STATES; k++) {
            if (!(fabs(run.x[k]) < 1e6)) {
                return; // Euler's method has become unstable
            }
        }
        if (outcome == FUZZ_IS_OVER) {
            fuzz_fail("derivatives or indicators cannot be computed: %s", instance->text);
        }
    }
}
