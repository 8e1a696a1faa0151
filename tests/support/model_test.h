/* The functions of any struct model, for its tests. */
#ifndef MODEL_TEST_H
#define MODEL_TEST_H

#include "model.h"

/* The parameters are accepted, without a text, or refused with this one. */
void model_test_accepted(const struct model *model, const void *values);
void model_test_refused(const struct model *model, const void *values, const char *expected);

#endif
