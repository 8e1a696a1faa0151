/* Values of variables and their derivatives, the same in all versions of FMI. Each function takes
 * the number of the call it serves. */
#ifndef VARIABLE_ACCESS_H
#define VARIABLE_ACCESS_H

#include "component.h"
#include "value_types.h"

/* ---- Values --------------------------------------------------------------------------------- */

/* For each type of value: access_get_real, access_set_real and so on. */
#define ACCESS(name, constant, element)                                                            \
    enum component_status access_get_##name(struct component *component, unsigned call,            \
                                            const unsigned references[], size_t count,             \
                                            element values[]);                                     \
    enum component_status access_set_##name(struct component *component, unsigned call,            \
                                            const unsigned references[], size_t count,             \
                                            const element values[]);
VALUE_TYPE_LIST(ACCESS)
#undef ACCESS

/* For a type that no variable has: succeeds only if no value is asked for. */
enum component_status access_none(struct component *component, unsigned call, const char *type,
                                  const unsigned references[], size_t count, const void *values);

/* ---- Derivatives ---------------------------------------------------------------------------- */

enum component_status access_set_input_derivatives(struct component *component, unsigned call,
                                                   const unsigned references[], size_t count,
                                                   const int orders[], const double values[]);
enum component_status access_get_output_derivatives(struct component *component, unsigned call,
                                                    const unsigned references[], size_t count,
                                                    const int orders[], double values[]);

/* Derivatives J of unknowns with respect to knowns: J seed, one value per unknown. */
enum component_status access_get_directional_derivative(struct component *component, unsigned call,
                                                        const unsigned unknowns[],
                                                        size_t unknown_count,
                                                        const unsigned knowns[], size_t known_count,
                                                        const double seed[], double result[]);

/* seed^T J, one value per known. */
enum component_status access_get_adjoint_derivative(struct component *component, unsigned call,
                                                    const unsigned unknowns[], size_t unknown_count,
                                                    const unsigned knowns[], size_t known_count,
                                                    const double seed[], double result[]);

#endif
