/* Calls of an FMU: one interface to FMI 2.0 and 3.0, by functions that the host has looked up. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Functions of an FMU, by their names in FMI 2.0; in FMI 3.0 those that do the same. */
enum fmu_function {
    FMU_SET_REAL,
    FMU_GET_REAL,
    FMU_SET_BOOLEAN,
    FMU_GET_BOOLEAN,
    FMU_SET_INTEGER,
    FMU_GET_INTEGER,
    FMU_SET_ENUMERATION,
    FMU_GET_ENUMERATION,
    FMU_SET_INPUT_DERIVATIVES, /* none in FMI 3.0 */
    FMU_GET_OUTPUT_DERIVATIVES,
    FMU_GET_DIRECTIONAL_DERIVATIVE,
    FMU_DO_STEP,
    FMU_FUNCTION_COUNT,
};

/* Results of calls: a status of FMI, or one of these. A run stops from FMU_DISCARD on. */
enum {
    FMU_OK = 0,
    FMU_DISCARD = 2,
    FMU_ERROR = 3,
    FMU_ENDED = 100,  /* the FMU asks to end the simulation; reached says when */
    FMU_RAISED = 101, /* a function of the host has failed within the call */
};

/* Types of discrete variables. */
enum fmu_type { FMU_BOOLEAN, FMU_INTEGER, FMU_ENUMERATION };

/* What runs like an FMU may keep its Real variables in memory, by their value references: then they
 * are set and read there. */
struct fmu {
    void *instance;
    void (*functions[FMU_FUNCTION_COUNT])(void); /* loop_missing if not there */
    double *step_start;                          /* s, of the present step; NULL: nobody asks */
    const int32_t *raised;                       /* not 0: FMU_RAISED; NULL: never */
    double reached;                              /* s, when FMU_ENDED */
    double *memory;                              /* [memory_count]; NULL: of an FMU */
    int64_t memory_count;
    int32_t version; /* of FMI: 2 or 3 */
    int32_t called;  /* enum fmu_function, last */
};

struct fmu_variable {
    uint32_t reference;
    int32_t type; /* enum fmu_type */
};

/* Sets or gets Real variables; no call for none. */
int fmu_set_reals(struct fmu *fmu, int64_t count, const uint32_t references[],
                  const double values[]);
int fmu_get_reals(struct fmu *fmu, int64_t count, const uint32_t references[], double values[]);

int fmu_set_discrete(struct fmu *fmu, struct fmu_variable variable, int64_t value);
int fmu_get_discrete(struct fmu *fmu, struct fmu_variable variable, int64_t *value);

/* Sets first derivatives of Real inputs over the next step, of an FMU of FMI 2.0. */
int fmu_set_slopes(struct fmu *fmu, int64_t count, const uint32_t references[],
                   const int32_t orders[], const double slopes[]);

/* Gets derivatives of Real outputs with respect to time. */
int fmu_get_slopes(struct fmu *fmu, int64_t count, const uint32_t references[],
                   const int32_t orders[], double slopes[]);

/* Gets the change of `count` unknowns for a change of as many knowns. */
int fmu_get_derivative(struct fmu *fmu, int64_t count, const uint32_t unknowns[],
                       const uint32_t knowns[], const double direction[], double result[]);

/* Steps from `time` over `length` (s); is_final: no step is ever undone. */
int fmu_do_step(struct fmu *fmu, double time, double length, bool is_final);
