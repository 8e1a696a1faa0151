/* The types of values that are set and read by value reference, once for every function that exists
 * for each of them. */
#ifndef INSTANCE_VALUE_TYPES_H
#define INSTANCE_VALUE_TYPES_H

#include <stdbool.h>
#include <stdint.h>

/* X(name in functions, name in constants, element of an array): those that are kept as int.
 *   integer       variables of type int32 and enumerations
 *   int32         variables of type int32
 *   enumeration   enumerations
 *   boolean       Booleans, as 0 or 1
 *   bool          Booleans */
#define INTEGER_TYPE_LIST(X)                                                                       \
    X(integer, INTEGER, int)                                                                       \
    X(int32, INT32, int)                                                                           \
    X(enumeration, ENUMERATION, int64_t)                                                           \
    X(boolean, BOOLEAN, int)                                                                       \
    X(bool, BOOL, bool)

/* The same, and real: variables of type float64. */
#define VALUE_TYPE_LIST(X) X(real, REAL, double) INTEGER_TYPE_LIST(X)

#endif
