#include "bench.h"

#include "race.h"

/* A step with an integrator that returns at once, and one with the Taylor method, in turns. */
static void measure_inputs(struct bench *bench, const char *work, enum problem_inputs inputs) {
    static const struct run taylor = {
        .name = "taylor", .solver = FMU, .method = TAYLOR, .tolerance = 1e-8};
    struct run idle = taylor;
    idle.name = "instance";
    idle.fmu = &bench->idle;
    struct problem *problem = problem_create(1e-3, 2000, inputs, 0.0);
    struct race race = {0};
    race_add(&race, idle);
    race_add(&race, taylor);
    race_run(&race, &bench->fmu, problem, bench->repeats);

    const double us = race_us(&race, 0);
    const double share = race_ratio(&race, 0, 1);
    report_row(&bench->report, "instance", work, idle.name);
    report_number(&bench->report, "us", us);
    report_number(&bench->report, "ratio", share);
    report_number(&bench->report, "internal_steps", race.counts[0].internal_steps);
    report_row_end(&bench->report);
    printf("  %s %6.3f us, %5.3f of a step with taylor\n", work, us, share);
    problem_destroy(problem);
}

void measure_instance(struct bench *bench) {
    printf("\nthe instance with an integrator that returns at once\n");
    measure_inputs(bench, "1 ms steps, inputs changing", INPUTS_CHANGING);
    measure_inputs(bench, "1 ms steps, inputs constant", INPUTS_CONSTANT);
}
