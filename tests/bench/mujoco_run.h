/* MuJoCo on the arm of tests/rp_manipulator/rp_manipulator.xml, through its C library. */
#ifndef BENCH_MUJOCO_RUN_H
#define BENCH_MUJOCO_RUN_H

#include "problem.h"

#include <stdbool.h>

enum mujoco_integrator { MUJOCO_RK4, MUJOCO_IMPLICITFAST };

/* False where the benchmark was built without MuJoCo; then nothing else may be called. */
bool mujoco_available(void);
const char *mujoco_version(void);

/* Processor time of all communication steps, s, each of the given number of steps of mj_step: sets
 * qfrc_applied, steps, reads qpos and qvel. */
double mujoco_run(const struct problem *problem, enum mujoco_integrator integrator, int substeps,
                  double states[][4]);

#endif
