/* For headers of equations in prefix form (*_lifted.h), which derivatives are calculated from until
 * the build derives them from the plain ones. Include an arithmetic before:
 *
 *   arithmetic_taylor.h    first and second derivatives along a curve
 *   arithmetic_gradient.h  derivatives by each of some variables */
#ifndef EQUATION_H
#define EQUATION_H

#ifndef ARITHMETIC_H
#error "include the arithmetic before the equations"
#endif

#include "platform.h"

/* Begins each equation. Inlined wherever it is used: only then do compilers leave out what a result
 * does not need, such as second derivatives, and keep the rest in registers. */
#define EQUATION ALWAYS_INLINE

#endif
