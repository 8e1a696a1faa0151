/* What friction and stops cost: a step of RPPlant against one of RPManipulator with the same
 * inputs, and a step with a bounce against one in which an input changes. */
#include "bench.h"

#include "value_references.h"

#include <math.h>

enum { STEPS = 1000 };
static const double step = 1e-3; // s

/* Friction and stops, the start, and the efforts of each step. */
struct motion {
    double coulomb[2];   /* N.m, N */
    double breakaway[2]; /* N.m, N */
    double stribeck[2];  /* rad/s, m/s */
    bool bounces;        /* the slide falls on a stop that gives all of its speed back */
    double start[4];     /* q1, q2, dq1, dq2 */
    double inputs[STEPS][2];
};

static void set_real(const struct fmu_functions *fmu, fmi2Component c, fmi2ValueReference reference,
                     double value) {
    require(fmu->SetReal(c, &reference, 1, &value) == fmi2OK, "a parameter is refused");
}

static void set_parameters(const struct fmu_functions *fmu, fmi2Component c,
                           const struct motion *motion) {
    static const fmi2ValueReference stops = RP_PLANT_stops2;
    static const fmi2Integer rigid = 2;
    set_real(fmu, c, RP_PLANT_coulomb_friction1, motion->coulomb[0]);
    set_real(fmu, c, RP_PLANT_coulomb_friction2, motion->coulomb[1]);
    set_real(fmu, c, RP_PLANT_breakaway_friction1, motion->breakaway[0]);
    set_real(fmu, c, RP_PLANT_breakaway_friction2, motion->breakaway[1]);
    set_real(fmu, c, RP_PLANT_stribeck_velocity1, motion->stribeck[0]);
    set_real(fmu, c, RP_PLANT_stribeck_velocity2, motion->stribeck[1]);
    if (motion->bounces) {
        set_real(fmu, c, RP_PLANT_a, 0.0); // else impacts move joint 1, too
        set_real(fmu, c, RP_PLANT_lower2, 0.0);
        set_real(fmu, c, RP_PLANT_upper2, 5.0);
        set_real(fmu, c, RP_PLANT_restitution2, 1.0);
        require(fmu->SetInteger(c, &stops, 1, &rigid) == fmi2OK, "the stops are refused");
    }
}

/* Processor time of a step, s, and the number of events in all. is_plant: of RPPlant, else the same
 * motion of RPManipulator, which has neither friction nor stops. */
static double run(const struct fmu_functions *fmu, bool is_plant, const struct motion *motion,
                  enum method method, int *events) {
    static const fmi2ValueReference states_of[] = {RP_PLANT_q1, RP_PLANT_q2, RP_PLANT_dq1,
                                                   RP_PLANT_dq2};
    static const fmi2ValueReference inputs_of[] = {RP_PLANT_tau1, RP_PLANT_f2};
    static const fmi2ValueReference solver_method = RP_PLANT_solver_method;
    static const fmi2ValueReference event_count = RP_PLANT_event_count;
    const int chosen = (int)method;
    double x[4];
    fmi2Component c = fmu_instantiate(fmu, is_plant ? RP_PLANT_GUID : fmu_guid_of_arm);
    require(fmu->SetReal(c, states_of, 4, motion->start) == fmi2OK &&
                fmu->SetInteger(c, &solver_method, 1, &chosen) == fmi2OK,
            "a start value is refused");
    if (is_plant) {
        set_parameters(fmu, c, motion);
    }
    require(fmu->SetupExperiment(c, 1, 1e-8, 0.0, 0, 0.0) == fmi2OK &&
                fmu->EnterInitializationMode(c) == fmi2OK &&
                fmu->ExitInitializationMode(c) == fmi2OK,
            "not initialized");
    const double begin = processor_time();
    for (int i = 0; i < STEPS; i++) {
        const bool done = fmu->SetReal(c, inputs_of, 2, motion->inputs[i]) == fmi2OK &&
                          fmu->DoStep(c, i * step, step, 1) == fmi2OK &&
                          fmu->GetReal(c, states_of, 4, x) == fmi2OK;
        require(done, "a step failed");
    }
    const double seconds = processor_time() - begin - clock_cost();
    *events = 0;
    if (is_plant) {
        require(fmu->GetInteger(c, &event_count, 1, events) == fmi2OK, "no count of events");
    }
    fmu->FreeInstance(c);
    return seconds / STEPS;
}

/* ---- The motions ----------------------------------------------------------------------------- */

/* As those of the other measurements: sampled from sines. */
static void change_efforts(struct motion *motion) {
    for (int i = 0; i < STEPS; i++) {
        const double t = i * step;
        motion->inputs[i][0] = 12.0 + 3.0 * sin(5.0 * t);
        motion->inputs[i][1] = 4.0 + 2.0 * cos(7.0 * t);
    }
}

static struct motion coulomb_friction(void) {
    struct motion motion = {.coulomb = {0.4, 0.3}, .start = {0.3, 0.2, 3.0, 2.0}};
    change_efforts(&motion);
    return motion;
}

static struct motion stribeck_friction(void) {
    struct motion motion = coulomb_friction();
    motion.breakaway[0] = 0.6;
    motion.breakaway[1] = 0.5;
    motion.stribeck[0] = 0.1;
    motion.stribeck[1] = 0.1;
    return motion;
}

static struct motion no_friction(void) {
    struct motion motion = {.start = {0.3, 0.2, 3.0, 2.0}};
    change_efforts(&motion);
    return motion;
}

static struct motion held(void) {
    struct motion motion = {
        .coulomb = {100.0, 100.0}, .breakaway = {100.0, 100.0}, .start = {0.3, 0.2, 0.0, 0.0}};
    change_efforts(&motion);
    return motion;
}

/* Joint 1 is held, the slide points upwards. From the vertex of a flight that takes one step, it
 * bounces in the middle of each. */
static struct motion bouncing(void) {
    const double g = 9.81; // the start value
    const double speed = g * step / 2.0;
    return (struct motion){.coulomb = {100.0, 0.0},
                           .bounces = true,
                           .start = {acos(-1.0) / 2.0, speed * speed / (2.0 * g), 0.0, 0.0}};
}

/* The same above the stop, with an effort that changes in each step. */
static struct motion above_the_stop(void) {
    struct motion motion = bouncing();
    motion.start[1] = 0.3;
    for (int i = 0; i < STEPS; i++) {
        motion.inputs[i][1] = 0.1 * sin(40.0 * i);
    }
    return motion;
}

/* ---- Rows ------------------------------------------------------------------------------------ */

static const struct work {
    const char *name;
    struct motion (*motion)(void);
    struct motion (*peer)(void); /* NULL: RPManipulator with the same inputs */
    double most[METHODS];        /* the largest ratio to the peer; 0: no target */
} works[] = {
    {"without friction and stops", no_friction, NULL, {0.0}},
    {"Coulomb friction",
     coulomb_friction,
     NULL,
     {[CVODE_ADAMS] = 1.6, [CVODE_BDF] = 1.7, [ERK] = 1.7, [TAYLOR] = 1.7}},
    {"Stribeck friction",
     stribeck_friction,
     NULL,
     {[CVODE_ADAMS] = 1.6, [CVODE_BDF] = 1.7, [ERK] = 1.6, [TAYLOR] = 1.6}},
    {"held by friction",
     held,
     NULL,
     {[CVODE_ADAMS] = 0.55, [CVODE_BDF] = 0.55, [ERK] = 0.55, [TAYLOR] = 0.45}},
    {"a bounce in each step",
     bouncing,
     above_the_stop,
     {[CVODE_ADAMS] = 1.5, [CVODE_BDF] = 1.5, [ERK] = 2.0, [TAYLOR] = 2.0}},
};

static void measure_work(struct bench *bench, const struct work *work, enum method method) {
    const struct motion motion = work->motion();
    const struct motion peer = work->peer == NULL ? motion : work->peer();
    const struct fmu_functions *other = work->peer == NULL ? &bench->fmu : &bench->plant;
    double seconds[MOST_REPEATS];
    double ratios[MOST_REPEATS];
    int events = 0;
    for (int i = 0; i < bench->repeats; i++) {
        int none;
        seconds[i] = run(&bench->plant, true, &motion, method, &events);
        ratios[i] = seconds[i] / run(other, work->peer != NULL, &peer, method, &none);
    }
    report_row("plant", work->name, method_names[method]);
    report_number("us", 1e6 * median(seconds, bench->repeats));
    report_number("events", events);
    report_judged("ratio", median(ratios, bench->repeats), work->most[method]);
    report_row_end();
}

void measure_plant(struct bench *bench) {
    for (size_t i = 0; i < sizeof works / sizeof works[0]; i++) {
        for (enum method method = FIRST_METHOD; method < METHODS; method++) {
            measure_work(bench, &works[i], method);
        }
    }
}
