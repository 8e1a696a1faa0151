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
    FMU_ENDED = 1000000, /* the FMU asks to end the simulation; reached says when */
    FMU_RAISED,          /* a function of the host has failed within the call */
};

/* Types of discrete variables. */
enum fmu_type { FMU_BOOLEAN, FMU_INTEGER, FMU_ENUMERATION };

/* Inputs that an FMU of FMI 3.0 asks for within its steps: polynomials of the time since the step
 * began, or functions of the host. It is the environment of the instance. */
struct fmu_polynomials {
    void *instance;
    void (*set)(void); /* fmi3SetFloat64 */
    int64_t count;
    const uint32_t *references;
    int64_t order;              /* -1: no polynomials, the host sets inputs */
    const double *coefficients; /* [order + 1][count] values at the beginning, then derivatives */
    double *values;             /* [count] */
    int (*host)(double time);   /* sets inputs at a time, s; returns not 0 if that fails; or NULL */
    double start;               /* s, of the present step */
    int32_t status;             /* of a call that has failed, or FMU_RAISED; else 0 */
};

/* What runs like an FMU may keep its Real variables in memory, by their value references: then they
 * are set and read there. */
struct fmu {
    void *instance;
    void (*functions[FMU_FUNCTION_COUNT])(void); /* loop_missing if not there */
    struct fmu_polynomials *polynomials;         /* NULL: the FMU asks for no inputs */
    double reached;                              /* s, when FMU_ENDED */
    double *memory;                              /* [memory_count]; NULL: of an FMU */
    int64_t memory_count;
    int32_t version; /* of FMI: 2 or 3 */
    int32_t called;  /* enum fmu_function, the last one */
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

#ifdef _WIN32
#define LOOP_API __declspec(dllexport)
#else
#define LOOP_API __attribute__((visibility("default")))
#endif

/* The intermediate update of FMI 3.0 (section 2.3.1), for an environment struct fmu_polynomials. */
LOOP_API void loop_update_inputs(void *environment, double time, bool sets, bool gets,
                                 bool finished, bool may_return, bool *returns,
                                 double *return_time);

/* Steps from `time` over `length` (s); is_final: no step is ever undone. */
int fmu_do_step(struct fmu *fmu, double time, double length, bool is_final);
