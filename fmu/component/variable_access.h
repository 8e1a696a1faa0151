/* Values of variables and their derivatives, the same in all versions of FMI. Each function takes
 * the number of the call it serves. */
#ifndef VARIABLE_ACCESS_H
#define VARIABLE_ACCESS_H

#include "component.h"

#include <stdbool.h>
#include <stdint.h>

/* ---- Values --------------------------------------------------------------------------------- */

enum component_status access_get_real(struct component *component, unsigned call,
                                      const unsigned references[], size_t count, double values[]);
enum component_status access_set_real(struct component *component, unsigned call,
                                      const unsigned references[], size_t count,
                                      const double values[]);

/* Integers and enumerations, by one function. */
enum component_status access_get_integer(struct component *component, unsigned call,
                                         const unsigned references[], size_t count, int values[]);
enum component_status access_set_integer(struct component *component, unsigned call,
                                         const unsigned references[], size_t count,
                                         const int values[]);

/* Integers only. */
enum component_status access_get_int32(struct component *component, unsigned call,
                                       const unsigned references[], size_t count, int values[]);
enum component_status access_set_int32(struct component *component, unsigned call,
                                       const unsigned references[], size_t count,
                                       const int values[]);

/* Enumerations only. */
enum component_status access_get_enumeration(struct component *component, unsigned call,
                                             const unsigned references[], size_t count,
                                             int64_t values[]);
enum component_status access_set_enumeration(struct component *component, unsigned call,
                                             const unsigned references[], size_t count,
                                             const int64_t values[]);

/* Booleans, as ints and as bools. */
enum component_status access_get_boolean(struct component *component, unsigned call,
                                         const unsigned references[], size_t count, int values[]);
enum component_status access_set_boolean(struct component *component, unsigned call,
                                         const unsigned references[], size_t count,
                                         const int values[]);
enum component_status access_get_bool(struct component *component, unsigned call,
                                      const unsigned references[], size_t count, bool values[]);
enum component_status access_set_bool(struct component *component, unsigned call,
                                      const unsigned references[], size_t count,
                                      const bool values[]);

/* Of a type that no variable has: succeeds for no values only. */
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
