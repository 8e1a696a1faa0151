/* Equations that are written once and calculated in several arithmetics.
 *
 * A header of equations uses the names real, plus, times, sine ... and READ, WRITE, which an
 * arithmetic such as arithmetic_double.h defines. Include one arithmetic before it:
 *
 *   arithmetic_double.h    values
 *   arithmetic_taylor.h    first and second derivatives along a curve
 *   arithmetic_gradient.h  derivatives by each of some variables
 *
 * All have the same order of operations, and so the same values bit for bit. */
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
