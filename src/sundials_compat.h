/* What differs between SUNDIALS 6.4 and 7: the one place that knows. Included by integrator.c. */
#ifndef SUNDIALS_COMPAT_H
#define SUNDIALS_COMPAT_H

#include <cvode/cvode.h>
#include <sundials/sundials_config.h>
#include <sundials/sundials_context.h>

/* Receives each text of SUNDIALS; error_code as in cvode.h, context as given. */
typedef void sundials_text_handler(int error_code, const char *text, void *context);

struct sundials_texts {
    sundials_text_handler *handle;
    void *context;
};

#if SUNDIALS_VERSION_MAJOR >= 7

static void sundials_forward(int line, const char *function, const char *file, const char *text,
                             SUNErrCode error_code, void *texts_pointer, SUNContext context) {
    (void)line;
    (void)function;
    (void)file;
    (void)context;
    const struct sundials_texts *texts = texts_pointer;
    texts->handle(error_code, text, texts->context);
}

static int sundials_context_create(SUNContext *context) {
    return SUNContext_Create(SUN_COMM_NULL, context);
}

/* texts must outlive the context. */
static int sundials_redirect_texts(SUNContext context, void *cvode, struct sundials_texts *texts) {
    (void)cvode;
    SUNContext_ClearErrHandlers(context);
    return SUNContext_PushErrHandler(context, sundials_forward, texts);
}

#else

static void sundials_forward(int error_code, const char *module, const char *function, char *text,
                             void *texts_pointer) {
    (void)module;
    (void)function;
    const struct sundials_texts *texts = texts_pointer;
    texts->handle(error_code, text, texts->context);
}

static int sundials_context_create(SUNContext *context) {
    return SUNContext_Create(NULL, context);
}

/* texts must outlive the context. */
static int sundials_redirect_texts(SUNContext context, void *cvode, struct sundials_texts *texts) {
    (void)context;
    return CVodeSetErrHandlerFn(cvode, sundials_forward, texts);
}

#endif

#endif
