/* What all functions of an instance take. */
#ifndef INSTANCE_TYPES_H
#define INSTANCE_TYPES_H

#include "integrator.h"
#include "platform.h"
#include "variables.h"

struct instance;

/* Values of the variables with owner = "instance" (time_variable.toml, solver_variables.toml).
 */
struct instance_values {
    double time;                         /* s */
    int solver_steps;                    /* internal steps since initialization */
    int solver_rhs_evaluations;          /* the integrator's, since initialization */
    double relative_tolerance;           /* 0: that of the experiment */
    int max_internal_steps;              /* per communication step */
    double effective_relative_tolerance; /* what the integrator runs at */
    int solver_restarts;                 /* since initialization */
    double solver_last_step;             /* s: length of the last internal step */
    int solver_last_order;
    int solver_failed_steps; /* refused attempts since initialization */
    int solver_method;       /* an enum integrator_method */
    double max_step;         /* s: of internal steps; 0: no limit */
    int event_count;         /* since initialization */
    double last_event_time;  /* s; that of the start, before there has been one */
    int max_events;          /* per communication step */
};

struct instance_experiment {
    double start_time; /* s */
    bool stop_time_defined;
    double stop_time; /* s; steps past it are refused */
    bool tolerance_defined;
    double tolerance; /* relative, > 0 */
};

#endif
