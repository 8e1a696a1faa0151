/* Names that compilers and platforms spell differently: the only header that asks which one it is.
 * Attributes stand in front of the return type. */
#pragma once

#if defined(__FAST_MATH__)
#error "Without -ffast-math: the code relies on the order of its sums"
#endif

#if defined(__GNUC__)

/* The caller must look at the returned status. */
#define MUST_CHECK __attribute__((warn_unused_result))

/* No pointer argument may be NULL; NONNULL_ARGUMENTS: these arguments, counted from 1, may not be
 * NULL. */
#define NONNULL                __attribute__((nonnull))
#define NONNULL_ARGUMENTS(...) __attribute__((nonnull(__VA_ARGS__)))

/* Arguments from number `first` on belong to the printf format in argument number `format`. */
#if defined(__MINGW32__)
#define PRINTF_FORMAT(format_, first) __attribute__((format(gnu_printf, format_, first)))
#else
#define PRINTF_FORMAT(format_, first) __attribute__((format(printf, format_, first)))
#endif

#define ALWAYS_INLINE static inline __attribute__((always_inline))
#define NOINLINE      __attribute__((noinline))
#define MAYBE_UNUSED  __attribute__((unused))
/* Stands in front of a function whose code is to be small rather than fast. */
#if defined(__clang__)
#define SELDOM_CALLED __attribute__((cold, minsize))
#else
#define SELDOM_CALLED __attribute__((cold))
#endif

/* Stands in front of a loop in which no iteration depends on another. */
#if defined(__clang__)
#define INDEPENDENT_ITERATIONS _Pragma("clang loop vectorize(assume_safety)")
#else
#define INDEPENDENT_ITERATIONS _Pragma("GCC ivdep")
#endif

/* Compiles a function for AVX2, vectors of four doubles, without operations that fuse: the same
 * bits in less time. To be called only where processor_has_avx2 is true. */
#if defined(__x86_64__)
#include <cpuid.h>
#define BY_AVX2 __attribute__((target("avx2")))

/* True if processor and system have AVX2. Compilers would ask libraries that zig leaves out. */
static inline _Bool processor_has_avx2(void) {
    enum { XMM_AND_YMM = 6 };
    unsigned a, b, c, d, saved;
    if (!__get_cpuid(1, &a, &b, &c, &d) || (c & bit_OSXSAVE) == 0) {
        return 0;
    }
    __asm__("xgetbv" : "=a"(saved), "=d"(d) : "c"(0));
    return (saved & XMM_AND_YMM) == XMM_AND_YMM && __get_cpuid_count(7, 0, &a, &b, &c, &d) &&
           (b & bit_AVX2) != 0;
}
#endif

/* Two numbers, with which one statement calculates at once: EACH a.of LANE += b.of LANE; */
struct pair {
    double of __attribute__((vector_size(16)));
};
#define EACH
#define LANE

/* Hides all symbols below from the shared object's users, unless one says so itself. */
#define HIDE_SYMBOLS _Pragma("GCC visibility push(hidden)")

/* Rounds products below before they are added. gcc 12 fuses them nevertheless if it vectorizes sums
 * beside differences. */
#if defined(__clang__)
#define NO_FUSED_OPERATIONS _Pragma("STDC FP_CONTRACT OFF")
#else
#define NO_FUSED_OPERATIONS _Pragma("GCC optimize(\"fp-contract=off\", \"no-tree-vectorize\")")
#endif

#else

#define MUST_CHECK
#define NONNULL
#define NONNULL_ARGUMENTS(...)
#define PRINTF_FORMAT(format_, first)
#define ALWAYS_INLINE static inline
#define NOINLINE
#define MAYBE_UNUSED
#define SELDOM_CALLED
#define INDEPENDENT_ITERATIONS
#define HIDE_SYMBOLS
struct pair {
    double of[2];
};
#define EACH for (int lane = 0; lane < 2; lane++)
#define LANE [lane]
#if defined(_MSC_VER)
#define NO_FUSED_OPERATIONS __pragma(fp_contract(off))
#else
#define NO_FUSED_OPERATIONS _Pragma("STDC FP_CONTRACT OFF")
#endif

#endif

#if !defined(BY_AVX2)
#define BY_AVX2
#define processor_has_avx2() 0
#endif

/* Lets another thread run. */
#if defined(_WIN32)
__declspec(dllimport) int __stdcall SwitchToThread(void);
#define YIELD_THREAD() ((void)SwitchToThread())
#else
#include <sched.h>
#define YIELD_THREAD() ((void)sched_yield())
#endif
