/* The loop of a co-simulation: steps connected FMUs, in Jacobi or Gauss-Seidel order.
 *
 * The host, rparm/fmi/loop.py, fills these structures and owns all memory in them; nothing is
 * allocated here. The host is called back for algebraic loops, and for what follows when a Boolean
 * or Integer has changed.
 *
 * All times are in s. `values` are those of the whole system: outputs by component, then inputs
 * from outside. Each Real input has a source among them. */
#pragma once

#include "fmu_calls.h"
#include "tangent.h"

struct loop_component {
    struct fmu fmu;
    int64_t number; /* among the components */

    /* Real inputs */
    int64_t input_count;
    const uint32_t *inputs; /* value references */
    const int64_t *sources; /* indices of values */
    const uint8_t *ahead;   /* 1: the source's component steps before this one */
    const uint8_t *on_loop; /* 1: on an algebraic loop that the host solves */
    const int32_t *orders;  /* all 1 */
    double *input_values;   /* as set last */
    double *kept;           /* [2][input_count] sources and their slopes as the step began */
    double *lines;          /* the same, for an FMU that takes slopes; NULL: it takes none */
    int32_t has_ahead;      /* some inputs are ahead */
    int32_t solves;         /* some are on an algebraic loop */
    int32_t is_sampled; /* without slopes: it takes its inputs from the beginning of the step, not
                           its middle */
    int32_t is_due;     /* the last step of the loop has brought it to its end */

    /* Real outputs that are read after each step */
    int64_t output_count;
    const uint32_t *outputs; /* value references */
    int64_t first;           /* of them among the values */
    double *before;          /* [output_count] at the beginning of the step */

    /* slopes of outputs: of the FMU, or differences of the last two values */
    int64_t slope_count;
    const uint32_t *slope_outputs;
    const int32_t *slope_orders;  /* all 1 */
    const int64_t *slope_indices; /* among the slopes of the system */
    double *slope_values;
    int64_t difference_count;
    const int64_t *differences; /* among its outputs */

    /* variables that are read for a row only */
    int64_t read_count;
    const uint32_t *read;
    const int64_t *read_columns;
    double *read_values;
    int64_t discrete_count;
    const struct fmu_variable *discretes;
    const int64_t *discrete_columns;

    double every; /* s, its own step; 0: it steps with the system */
    double time;  /* of its last communication point */
    double began; /* of the one before */
    double ticks; /* multiples of `every` that have passed */
};

/* A discrete input, which follows an output or a schedule. */
struct loop_switch {
    int32_t source; /* component; -1: the schedule */
    int32_t target; /* component */
    struct fmu_variable from;
    struct fmu_variable to;
    int64_t column; /* of the schedule */
    int64_t value;  /* wanted, or set last */
    int64_t is_new; /* 1: set by the last transfer */
};

enum loop_phase {
    LOOP_STEP,   /* inputs and the step from `time` */
    LOOP_READ,   /* at `time` */
    LOOP_ROW,    /* variables for a row at `time` */
    LOOP_SLOPES, /* of inputs and outputs at `time` */
    LOOP_GET_DISCRETE,
    LOOP_SET_DISCRETE,
    LOOP_NOT_FINITE, /* output `item` of the component at `time` */
    LOOP_HOST,       /* a function of the host */
};

struct loop_failure {
    int32_t status; /* of the FMU, from FMU_DISCARD on; 0: none */
    int32_t phase;  /* enum loop_phase */
    int64_t component;
    int64_t item; /* output, discrete variable of a row, or switch */
    double time;
};

struct loop {
    int64_t component_count;
    struct loop_component *const *components;
    int64_t group_count;
    const int64_t *grouped;     /* components, by groups that step together */
    const int64_t *group_first; /* [group_count + 1] */

    double *values;
    double *slopes;
    const int64_t *owners; /* component of each value, -1 for one from outside */
    int64_t first_driven;  /* of the values from outside */
    int64_t driven_count;
    int64_t switch_count;
    struct loop_switch *switches;
    int64_t scheduled_count;

    /* columns of a row */
    int64_t row_width;
    int64_t column_count;   /* the first are values */
    const int64_t *columns; /* indices of values */

    /* functions of the host; they return 0, or not 0 to end the run */
    int (*solve)(int64_t group); /* solves algebraic loops; NULL: there are none */
    int (*follow)(void);         /* computes what follows from switches; NULL: nothing does */

    struct tangent *tangent; /* of the first component's states; NULL: none */

    int32_t extrapolates;   /* inputs are straight lines over a step, not held */
    int32_t has_rates;      /* components have their own steps */
    int32_t is_final;       /* no step is ever undone */
    int32_t checks_finite;  /* outputs */
    int32_t sets_for_rows;  /* inputs of the next step are set before a row is read */
    int32_t reads_for_rows; /* outputs are read for rows only */
    int32_t inputs_first;   /* inputs from outside are taken before a step, and hold over it */

    double start;
    double time;
    double end;         /* of the present step */
    int64_t step_count; /* of components, so far */
    int32_t stop;       /* not 0: the host ends the run, from within a call */
    struct loop_failure failure;
};

struct loop_run {
    int64_t count;            /* steps */
    const double *ends;       /* [count] s */
    const double *driven;     /* [count][driven_count] at the ends; inputs_first: the beginnings */
    const int64_t *scheduled; /* [count][scheduled_count] the same */
    const uint8_t *has_row;   /* [count] NULL: each step has a row */
    double *rows;             /* [rows][row_width]; NULL: none. The row before is there, too */
    double *growth;           /* [count] of the tangent */
};

/* Makes steps for 20 ms, or all; returns how many were made. If one failed, `failure` explains it.
 */
LOOP_API int64_t loop_advance(struct loop *loop, const struct loop_run *run);

/* Sets the discrete inputs whose sources have another value; returns how many, -1 after a failure.
 * scheduled: [scheduled_count]. */
LOOP_API int64_t loop_transfer(struct loop *loop, const int64_t scheduled[]);

/* Reads all variables of a row, [row_width]; returns 0, -1 after a failure. */
LOOP_API int loop_read_row(struct loop *loop, double row[]);

/* Reads slopes at the present time until they follow from each other: once per component that is
 * due, since slopes of inputs show in those of outputs. Slopes that are differences are 0. Returns
 * 0, -1 after a failure. */
LOOP_API int loop_follow_slopes(struct loop *loop);

/* In place of a function that an FMU lacks: returns FMI's status of an error. */
LOOP_API int loop_missing(void);

/* Returns the size of a structure, in the order of the table there, for the host to compare. */
LOOP_API int64_t loop_size(int number);
