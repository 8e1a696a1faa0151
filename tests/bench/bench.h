/* The measurements of the benchmark; bench.c chooses among them. */
#ifndef BENCH_H
#define BENCH_H

#include "fmu3_library.h"
#include "fmu_library.h"
#include "report.h"

struct bench {
    struct fmu_functions fmu;
    struct fmu3_functions fmu3;
    struct fmu_functions idle;  /* the FMU with idle_integrator.c */
    struct fmu_functions plant; /* RPPlant */
    struct report report;
    int repeats;
    bool quick; /* little of everything: shows that it works, the figures mean nothing */
};

/* steps.c: communication steps against the plain loop and MuJoCo; free motion at equal errors */
void measure_steps(struct bench *bench);
void measure_free_motion(struct bench *bench);

/* sweeps.c: error and time over the tolerance, time over the communication step size */
void measure_precision(struct bench *bench);
void measure_step_sizes(struct bench *bench);

/* plant.c: friction and stops, against the arm without them */
void measure_plant(struct bench *bench);

/* instances.c: many instances stepped in turn, two threads with an instance each */
void measure_instances(struct bench *bench);
void measure_threads(struct bench *bench);

/* energy.c: how the energy of a motion without losses drifts */
void measure_energy(struct bench *bench);

/* instance_alone.c: a step without the time of its integrator */
void measure_instance(struct bench *bench);

/* calls.c: each call by itself, and from fmi2Instantiate to fmi2FreeInstance */
void measure_calls(struct bench *bench);
void measure_life(struct bench *bench);

#endif
