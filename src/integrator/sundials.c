#include "sundials.h"

#include "workspace.h"

#include <arkode/arkode.h>
#include <cvode/cvode.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Memory of cvode_bdf with pointers of 64 bits, measured, and 0.2 kB: 6.4 kB for 4 states, 187 kB
 * for 100. The number is the same with every compiler and system, and less with shorter pointers;
 * the other methods take at most five sixths of it. With gradients there is a solver more, and
 * cvode_adams, which has more vectors, may take more than cvode_bdf with its small matrices. */
size_t sundials_memory_size(const struct ode *ode) {
    const size_t of_gradients =
        ode->gradient_count > 0 ? 256 + sizeof(double) * 4 * ode->state_count : 0;
    return 5376 + of_gradients +
           sizeof(double) * (25 * ode->state_count + 2 * ode_jacobian_size(ode));
}

#define SAME_NUMBER(flag) _Static_assert((int)CV_##flag == (int)ARK_##flag, "the same number")
SAME_NUMBER(SUCCESS);
SAME_NUMBER(TSTOP_RETURN);
SAME_NUMBER(RHSFUNC_FAIL);
SAME_NUMBER(FIRST_RHSFUNC_ERR);
SAME_NUMBER(REPTD_RHSFUNC_ERR);
SAME_NUMBER(UNREC_RHSFUNC_ERR);
SAME_NUMBER(TOO_MUCH_WORK);
SAME_NUMBER(TOO_MUCH_ACC);
SAME_NUMBER(ERR_FAILURE);
SAME_NUMBER(CONV_FAILURE);
SAME_NUMBER(LSETUP_FAIL);
SAME_NUMBER(LSOLVE_FAIL);
SAME_NUMBER(BAD_T);
SAME_NUMBER(TOO_CLOSE);
SAME_NUMBER(ILL_INPUT);
SAME_NUMBER(MEM_FAIL);

enum status sundials_status(const struct problem *problem, int flag) {
    const bool stuck = problem_is_stuck(problem);
    switch (flag) {
    case CV_SUCCESS:
    case CV_TSTOP_RETURN:
        return STATUS_OK;
    case CV_RHSFUNC_FAIL:
    case CV_FIRST_RHSFUNC_ERR:
    case CV_REPTD_RHSFUNC_ERR:
    case CV_UNREC_RHSFUNC_ERR:
        return STATUS_NOT_FINITE;
    case CV_TOO_MUCH_WORK:
        return stuck ? STATUS_NOT_FINITE : STATUS_TOO_MANY_STEPS;
    case CV_TOO_MUCH_ACC:
    case CV_ERR_FAILURE:
    case CV_CONV_FAILURE:
    // of the Newton iteration
    case CV_LSETUP_FAIL:
    case CV_LSOLVE_FAIL:
    // values so extreme that steps, weights or times underflow or overflow
    case CV_BAD_T:
    case CV_TOO_CLOSE:
    case CV_ILL_INPUT:
        return stuck ? STATUS_NOT_FINITE : STATUS_NO_CONVERGENCE;
    case CV_MEM_FAIL:
        return STATUS_OUT_OF_MEMORY;
    default:
        return STATUS_INTERNAL;
    }
}

/* Explains a text. SUNDIALS gives the length of the step at which it fails: 0, or not a number, if
 * the norm of the derivatives has overflowed. */
static const char *explained(const char *text) {
    static const char *const overflows[] = {"h = nan", "h = -nan", "hu = 0 and"};
    for (size_t i = 0; i < sizeof overflows / sizeof overflows[0]; i++) {
        if (strstr(text, overflows[i]) != NULL) {
            return "the derivatives of the states are too large for a first step";
        }
    }
    return text;
}

/* Returns the length of the name of a time in front of text, up to its value; 0 if there is none.
 */
static size_t time_name_length(const char *text) {
    static const char *const names[] = {"t = ", "tcur = ", "tout = ", "tstop = "};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        const size_t length = strlen(names[i]);
        if (strncmp(text, names[i], length) == 0) {
            return length;
        }
    }
    return 0;
}

/* Writes text with times of the simulation: SUNDIALS counts them from the last restart. */
static void write_times(const char *text, double origin, char *to, size_t size) {
    size_t length = 0;
    char last = ' ';
    while (*text != '\0' && length + 1 < size) {
        const size_t name_length = last == ' ' ? time_name_length(text) : 0;
        char *end = NULL;
        const double t = name_length > 0 ? strtod(text + name_length, &end) : 0.0;
        if (name_length > 0 && end != text + name_length) {
            const int written = snprintf(to + length, size - length, "%.*s%.12g", (int)name_length,
                                         text, origin + t);
            length += (size_t)written < size - length ? (size_t)written : size - length - 1;
            text = end;
        } else {
            to[length++] = *text++;
        }
        last = to[length - 1];
    }
    to[length] = '\0';
}

void sundials_text(int error_code, const char *module, const char *function, char *text,
                   void *sundials_pointer) {
    const struct sundials *sundials = sundials_pointer;
    const struct problem *problem = sundials->problem;
    const char *explanation = explained(text);
    const enum status status = sundials_status(problem, error_code);
    const bool is_named = status == STATUS_NOT_FINITE && problem->failed_at > -INFINITY;
    if (explanation == text && (error_code == CV_BAD_T || is_named)) {
        return; // it follows from a failure before, or the step's message names what is not finite
    }
    char with_times[400]; // SUNDIALS writes 255 characters at most
    write_times(explanation, problem->origin, with_times, sizeof with_times);
    message_write(&problem->sink, status, "%s: %s", sundials->method->name, with_times);
}

void *sundials_create(size_t size, struct problem *problem, const struct method *method) {
    const sunindextype n = (sunindextype)problem->ode.state_count;
    struct sundials *created = workspace_calloc(1, size);
    if (created == NULL) {
        return NULL;
    }
    created->problem = problem;
    created->method = method;
    if (SUNContext_Create(NULL, &created->context) == 0 &&
        (created->x = small_vector_create(n, created->context)) != NULL &&
        (created->absolute_tolerances = small_vector_create(n, created->context)) != NULL &&
        (created->work = small_vector_create(n, created->context)) != NULL) {
        return created;
    }
    sundials_destroy(created);
    return NULL;
}

void sundials_destroy(void *memory) {
    struct sundials *sundials = memory;
    N_Vector const vectors[] = {sundials->x, sundials->absolute_tolerances, sundials->work};
    for (size_t i = 0; i < sizeof vectors / sizeof vectors[0]; i++) {
        if (vectors[i] != NULL) {
            N_VDestroy(vectors[i]);
        }
    }
    if (sundials->context != NULL) {
        SUNContext_Free(&sundials->context);
    }
    workspace_free(sundials);
}

int sundials_callback_flag(enum status status) {
    return status == STATUS_OK ? 0 : 1;
}

void sundials_keep_message(void *kept, enum status status, const char *text) {
    struct sundials_message *message = kept;
    if (message->text[0] == '\0') {
        message->status = status;
        (void)snprintf(message->text, sizeof message->text, "%s", text);
    }
}

long sundials_steps(int64_t count) {
    return count < LONG_MAX ? (long)count : LONG_MAX;
}

int sundials_rhs(sunrealtype t, N_Vector x, N_Vector dx, void *user_data) {
    const struct sundials *sundials = user_data;
    return sundials_callback_flag(
        problem_rhs(sundials->problem, t, small_vector_data(x), small_vector_data(dx)));
}

void sundials_set_state(struct sundials *sundials, const double x[]) {
    memmove(small_vector_data(sundials->x), x, sundials->problem->ode.state_count * sizeof(double));
}

void sundials_get_state(const struct sundials *sundials, double x[]) {
    memmove(x, small_vector_data(sundials->x), sundials->problem->ode.state_count * sizeof(double));
}

static enum status rest_rhs(double t, const double x[], double dx[], void *state_count) {
    memset(dx, 0, *(const size_t *)state_count * sizeof(double));
    return STATUS_OK;
}

static enum status rest_jacobian(double t, const double x[], double J[], void *state_count) {
    return STATUS_OK; // J is 0
}

/* Uses its own settings: the user's could need more steps than are spent here. */
enum status sundials_warm_up(void *memory) {
    struct sundials *sundials = memory;
    const struct method *method = sundials->method;
    struct problem *problem = sundials->problem;
    const struct problem wanted = *problem;
    size_t state_count = wanted.ode.state_count;
    double *x = small_vector_data(sundials->x);
    double stopped_at = 0.0;
    struct method_work work = {0};

    N_VConst(1.0, sundials->work);
    *problem = (struct problem){
        .ode = {.state_count = state_count,
                .rhs = rest_rhs,
                .jacobian = rest_jacobian,
                .band = wanted.ode.band,
                .gradient_count = wanted.ode.gradient_count,
                .context = &state_count},
        .sink = wanted.sink,
        .settings = {.relative_tolerance = 1e-3,
                     .absolute_tolerances = small_vector_data(sundials->work)},
        .horizon = INFINITY,
        .failed_at = -INFINITY,
        .failed_x = wanted.failed_x,
    };
    enum status status = method->configure(memory);
    if (status == STATUS_OK) {
        status = method->restart(memory, x);
    }
    if (status == STATUS_OK) {
        status = method->advance(memory, 1.0, 100, x, &stopped_at, x, &work);
    }
    *problem = wanted;
    return status;
}
