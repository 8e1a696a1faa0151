/* In front of every file of musl (ElementaryFunctions.cmake): what its own headers of the same
 * names as the system's would define, and no fused operations on the processors that have them. */
#ifndef MUSL_H
#define MUSL_H

#include <math.h>

#define hidden
#define weak_alias(old, new)

/* glibc declares other functions of these names */
#define __sin  musl_sin
#define __cos  musl_cos
#define __tan  musl_tan
#define __sinl musl_sinl
#define __cosl musl_cosl
#define __tanl musl_tanl

#undef __FP_FAST_FMA

#endif
