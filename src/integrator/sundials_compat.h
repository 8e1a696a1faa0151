/* What differs between SUNDIALS 6.4 and 7: the one place that knows. Private to the integrator. */
#ifndef SUNDIALS_COMPAT_H
#define SUNDIALS_COMPAT_H

#include <arkode/arkode_erkstep.h>
#include <cvode/cvode.h>
#include <sundials/sundials_config.h>
#include <sundials/sundials_context.h>

/* Receives each text of SUNDIALS; error_code as in cvode.h, context as given. */
typedef void sundials_text_handler(int error_code, const char *text, void *context);

struct sundials_texts {
    sundials_text_handler *handle;
    void *context;
};

/* Functions of ERKStep that all of ARKODE's methods share since 7.1. */
#if SUNDIALS_VERSION_MAJOR > 7 || (SUNDIALS_VERSION_MAJOR == 7 && SUNDIALS_VERSION_MINOR >= 1)
#define ERK(name) ARKode##name
#else
#define ERK(name) ERKStep##name
#endif

#if SUNDIALS_VERSION_MAJOR >= 7

static inline void sundials_forward(int line, const char *function, const char *file,
                                    const char *text, SUNErrCode error_code, void *texts_pointer,
                                    SUNContext context) {
    (void)line;
    (void)function;
    (void)file;
    (void)context;
    const struct sundials_texts *texts = texts_pointer;
    texts->handle(error_code, text, texts->context);
}

static inline int sundials_context_create(SUNContext *context) {
    return SUNContext_Create(SUN_COMM_NULL, context);
}

/* texts must outlive the context. */
static inline int sundials_redirect_cvode(SUNContext context, void *cvode,
                                          struct sundials_texts *texts) {
    (void)cvode;
    SUNContext_ClearErrHandlers(context);
    return SUNContext_PushErrHandler(context, sundials_forward, texts);
}

static inline int sundials_redirect_erk(SUNContext context, void *erk,
                                        struct sundials_texts *texts) {
    return sundials_redirect_cvode(context, erk, texts);
}

#else

static inline void sundials_forward(int error_code, const char *module, const char *function,
                                    char *text, void *texts_pointer) {
    (void)module;
    (void)function;
    const struct sundials_texts *texts = texts_pointer;
    texts->handle(error_code, text, texts->context);
}

static inline int sundials_context_create(SUNContext *context) {
    return SUNContext_Create(NULL, context);
}

/* texts must outlive the context. */
static inline int sundials_redirect_cvode(SUNContext context, void *cvode,
                                          struct sundials_texts *texts) {
    (void)context;
    return CVodeSetErrHandlerFn(cvode, sundials_forward, texts);
}

static inline int sundials_redirect_erk(SUNContext context, void *erk,
                                        struct sundials_texts *texts) {
    (void)context;
    return ERKStepSetErrHandlerFn(erk, sundials_forward, texts);
}

#endif

#endif
