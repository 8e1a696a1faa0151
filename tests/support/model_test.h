/* The functions of any struct model, for its tests. */
#ifndef MODEL_TEST_H
#define MODEL_TEST_H

#include "model.h"

/* The parameters are accepted, without a text, or refused with this one. */
void model_test_accepted(const struct model *model, const void *values);
void model_test_refused(const struct model *model, const void *values, const char *expected);

/* propagate writes all calculated fields, from this offset on, and reads none of them; the first
 * derivatives do not depend on whether there are second ones. */
void model_test_calculated_fields(const struct model *model, const void *values, const void *first,
                                  const void *second, size_t calculated);

#endif
