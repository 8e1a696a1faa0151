#include "fmu_calls.h"

#include "fmi2FunctionTypes.h"
#include "fmi3FunctionTypes.h"

/* The function of a type that FMI declares; notes which is called. */
#define FUNCTION(fmu, name, type) ((type *)(fmu)->functions[(fmu)->called = (name)])

/* True if variables are in memory; some that are only read need not be. */
static bool are_in_memory(const struct fmu *fmu, int64_t count, const uint32_t references[]) {
    bool are_in = fmu->memory != NULL;
    for (int64_t i = 0; are_in && i < count; i++) {
        are_in = references[i] < fmu->memory_count;
    }
    return are_in;
}

int fmu_set_reals(struct fmu *fmu, int64_t count, const uint32_t references[],
                  const double values[]) {
    const size_t n = (size_t)count;
    if (are_in_memory(fmu, count, references)) {
        for (int64_t i = 0; i < count; i++) {
            fmu->memory[references[i]] = values[i];
        }
        return FMU_OK;
    }
    if (n == 0) {
        return FMU_OK;
    }
    if (fmu->version == 2) {
        fmi2SetRealTYPE *const set = FUNCTION(fmu, FMU_SET_REAL, fmi2SetRealTYPE);
        return (int)set(fmu->instance, references, n, values);
    }
    fmi3SetFloat64TYPE *const set = FUNCTION(fmu, FMU_SET_REAL, fmi3SetFloat64TYPE);
    return (int)set(fmu->instance, references, n, values, n);
}

int fmu_get_reals(struct fmu *fmu, int64_t count, const uint32_t references[], double values[]) {
    const size_t n = (size_t)count;
    if (are_in_memory(fmu, count, references)) {
        for (int64_t i = 0; i < count; i++) {
            values[i] = fmu->memory[references[i]];
        }
        return FMU_OK;
    }
    if (n == 0) {
        return FMU_OK;
    }
    if (fmu->version == 2) {
        fmi2GetRealTYPE *const get = FUNCTION(fmu, FMU_GET_REAL, fmi2GetRealTYPE);
        return (int)get(fmu->instance, references, n, values);
    }
    fmi3GetFloat64TYPE *const get = FUNCTION(fmu, FMU_GET_REAL, fmi3GetFloat64TYPE);
    return (int)get(fmu->instance, references, n, values, n);
}

/* ---- Discrete variables --------------------------------------------------------------------- */

/* FMI 2.0: Booleans and Integers are int, and their functions have the same type. */

static int set_discrete_2(struct fmu *fmu, struct fmu_variable variable, int64_t value) {
    const bool is_boolean = variable.type == FMU_BOOLEAN;
    const int given = is_boolean ? value != 0 : (int)value;
    fmi2SetIntegerTYPE *const set =
        FUNCTION(fmu, is_boolean ? FMU_SET_BOOLEAN : FMU_SET_INTEGER, fmi2SetIntegerTYPE);
    return (int)set(fmu->instance, &variable.reference, 1, &given);
}

static int set_discrete_3(struct fmu *fmu, struct fmu_variable variable, int64_t value) {
    if (variable.type == FMU_BOOLEAN) {
        const fmi3Boolean given = value != 0;
        fmi3SetBooleanTYPE *const set = FUNCTION(fmu, FMU_SET_BOOLEAN, fmi3SetBooleanTYPE);
        return (int)set(fmu->instance, &variable.reference, 1, &given, 1);
    }
    if (variable.type == FMU_INTEGER) {
        const fmi3Int32 given = (fmi3Int32)value;
        fmi3SetInt32TYPE *const set = FUNCTION(fmu, FMU_SET_INTEGER, fmi3SetInt32TYPE);
        return (int)set(fmu->instance, &variable.reference, 1, &given, 1);
    }
    fmi3SetInt64TYPE *const set = FUNCTION(fmu, FMU_SET_ENUMERATION, fmi3SetInt64TYPE);
    return (int)set(fmu->instance, &variable.reference, 1, &value, 1);
}

int fmu_set_discrete(struct fmu *fmu, struct fmu_variable variable, int64_t value) {
    const bool is_2 = fmu->version == 2;
    return is_2 ? set_discrete_2(fmu, variable, value) : set_discrete_3(fmu, variable, value);
}

static int get_discrete_2(struct fmu *fmu, struct fmu_variable variable, int64_t *value) {
    const bool is_boolean = variable.type == FMU_BOOLEAN;
    int found = 0;
    fmi2GetIntegerTYPE *const get =
        FUNCTION(fmu, is_boolean ? FMU_GET_BOOLEAN : FMU_GET_INTEGER, fmi2GetIntegerTYPE);
    const int status = (int)get(fmu->instance, &variable.reference, 1, &found);
    *value = found;
    return status;
}

static int get_discrete_3(struct fmu *fmu, struct fmu_variable variable, int64_t *value) {
    int status;
    if (variable.type == FMU_BOOLEAN) {
        fmi3Boolean found = false;
        fmi3GetBooleanTYPE *const get = FUNCTION(fmu, FMU_GET_BOOLEAN, fmi3GetBooleanTYPE);
        status = (int)get(fmu->instance, &variable.reference, 1, &found, 1);
        *value = found;
    } else if (variable.type == FMU_INTEGER) {
        fmi3Int32 found = 0;
        fmi3GetInt32TYPE *const get = FUNCTION(fmu, FMU_GET_INTEGER, fmi3GetInt32TYPE);
        status = (int)get(fmu->instance, &variable.reference, 1, &found, 1);
        *value = found;
    } else {
        fmi3GetInt64TYPE *const get = FUNCTION(fmu, FMU_GET_ENUMERATION, fmi3GetInt64TYPE);
        status = (int)get(fmu->instance, &variable.reference, 1, value, 1);
    }
    return status;
}

int fmu_get_discrete(struct fmu *fmu, struct fmu_variable variable, int64_t *value) {
    const bool is_2 = fmu->version == 2;
    return is_2 ? get_discrete_2(fmu, variable, value) : get_discrete_3(fmu, variable, value);
}

/* ---- Derivatives ---------------------------------------------------------------------------- */

int fmu_set_slopes(struct fmu *fmu, int64_t count, const uint32_t references[],
                   const int32_t orders[], const double slopes[]) {
    if (count == 0) {
        return FMU_OK;
    }
    fmi2SetRealInputDerivativesTYPE *const set =
        FUNCTION(fmu, FMU_SET_INPUT_DERIVATIVES, fmi2SetRealInputDerivativesTYPE);
    return (int)set(fmu->instance, references, (size_t)count, orders, slopes);
}

int fmu_get_slopes(struct fmu *fmu, int64_t count, const uint32_t references[],
                   const int32_t orders[], double slopes[]) {
    const size_t n = (size_t)count;
    if (n == 0) {
        return FMU_OK;
    }
    if (fmu->version == 2) {
        fmi2GetRealOutputDerivativesTYPE *const get =
            FUNCTION(fmu, FMU_GET_OUTPUT_DERIVATIVES, fmi2GetRealOutputDerivativesTYPE);
        return (int)get(fmu->instance, references, n, orders, slopes);
    }
    fmi3GetOutputDerivativesTYPE *const get =
        FUNCTION(fmu, FMU_GET_OUTPUT_DERIVATIVES, fmi3GetOutputDerivativesTYPE);
    return (int)get(fmu->instance, references, n, orders, slopes, n);
}

int fmu_get_derivative(struct fmu *fmu, int64_t count, const uint32_t unknowns[],
                       const uint32_t knowns[], const double direction[], double result[]) {
    const size_t n = (size_t)count;
    if (fmu->version == 2) {
        fmi2GetDirectionalDerivativeTYPE *const get =
            FUNCTION(fmu, FMU_GET_DIRECTIONAL_DERIVATIVE, fmi2GetDirectionalDerivativeTYPE);
        return (int)get(fmu->instance, unknowns, n, knowns, n, direction, result);
    }
    fmi3GetDirectionalDerivativeTYPE *const get =
        FUNCTION(fmu, FMU_GET_DIRECTIONAL_DERIVATIVE, fmi3GetDirectionalDerivativeTYPE);
    return (int)get(fmu->instance, unknowns, n, knowns, n, direction, n, result, n);
}

/* ---- Steps ---------------------------------------------------------------------------------- */

void loop_update_inputs(void *environment, double time, bool sets, bool gets, bool finished,
                        bool may_return, bool *returns, double *return_time) {
    struct fmu_polynomials *const p = environment;
    if (!sets || p == NULL || p->status != FMU_OK) {
        return;
    }
    if (p->order < 0) {
        p->status = p->host != NULL && p->host(time) ? FMU_RAISED : FMU_OK;
        return;
    }
    const double elapsed = time - p->start;
    for (int64_t i = 0; i < p->count; i++) {
        double power = 1.0; /* over the factorial */
        p->values[i] = p->coefficients[i];
        for (int64_t k = 1; k <= p->order; k++) {
            power *= elapsed / (double)k;
            p->values[i] += power * p->coefficients[k * p->count + i];
        }
    }
    fmi3SetFloat64TYPE *const set = (fmi3SetFloat64TYPE *)p->set;
    const size_t n = (size_t)p->count;
    const int status = (int)set(p->instance, p->references, n, p->values, n);
    p->status = status < FMU_DISCARD ? FMU_OK : status;
}

/* Returns the status of a step, or of the inputs that were set within it. */
static int with_inputs(struct fmu *fmu, int status) {
    struct fmu_polynomials *const p = fmu->polynomials;
    if (p == NULL || p->status == FMU_OK) {
        return status;
    }
    const int found = p->status;
    if (found != FMU_RAISED) { /* the host clears that */
        p->status = FMU_OK;
        fmu->called = FMU_SET_REAL;
    }
    return found;
}

int fmu_do_step(struct fmu *fmu, double time, double length, bool is_final) {
    if (fmu->polynomials != NULL) {
        fmu->polynomials->start = time;
    }
    if (fmu->version == 2) {
        fmi2DoStepTYPE *const step = FUNCTION(fmu, FMU_DO_STEP, fmi2DoStepTYPE);
        return (int)step(fmu->instance, time, length, is_final);
    }
    fmi3Boolean has_event = false;
    fmi3Boolean terminates = false;
    fmi3Boolean is_early = false;
    fmi3DoStepTYPE *const step = FUNCTION(fmu, FMU_DO_STEP, fmi3DoStepTYPE);
    int status = (int)step(fmu->instance, time, length, is_final, &has_event, &terminates,
                           &is_early, &fmu->reached);
    status = with_inputs(fmu, status);
    return status < FMU_DISCARD && terminates ? FMU_ENDED : status;
}
