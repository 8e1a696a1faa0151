#include "small_vector.h"

#include "platform.h"
#include "workspace.h"

#include <math.h>
#include <stddef.h>

_Static_assert(sizeof(sunrealtype) == sizeof(double), "SUNDIALS must be built for doubles");

struct small_vector {
    struct _generic_N_Vector base; /* first: the N_Vector */
    sunindextype length;
    // cppcheck-suppress unusedStructMember // it does not see through the casts below
    struct small_vector_terms *terms; /* NULL if terms are not noted */
    double data[];
};

static sunindextype length_of(N_Vector x) {
    return ((const struct small_vector *)(const void *)x)->length;
}

/* ---- Life ----------------------------------------------------------------------------------- */

static N_Vector create_like(const struct _generic_N_Vector *base, sunindextype length) {
    struct small_vector *created =
        workspace_calloc(1, sizeof *created + (size_t)length * sizeof(double));
    if (created == NULL) {
        return NULL;
    }
    created->base = *base;
    created->base.content = created->data;
    created->length = length;
    return (N_Vector)created;
}

static N_Vector clone(N_Vector x) {
    return create_like(x, length_of(x));
}

static void destroy(N_Vector x) {
    workspace_free(x);
}

static void space(N_Vector x, sunindextype *reals, sunindextype *integers) {
    *reals = length_of(x);
    *integers = 1;
}

static N_Vector_ID id(N_Vector x) {
    return SUNDIALS_NVEC_CUSTOM;
}

/* ---- Operations, n elements each ------------------------------------------------------------ */

// clang-format off
/* Defines an operation that writes each z[i]. Arguments may be the same vector, but never overlap
 * otherwise. */
#define ELEMENTWISE(name, result, ...)                                                             \
    ALWAYS_INLINE void name(sunindextype n, __VA_ARGS__, double *z) {                              \
        INDEPENDENT_ITERATIONS                                                                     \
        for (sunindextype i = 0; i < n; i++) {                                                     \
            z[i] = (result);                                                                       \
        }                                                                                          \
    }
ELEMENTWISE(linear_sum, a * x[i] + b * y[i], double a, const double *x, double b, const double *y)
ELEMENTWISE(product, x[i] * y[i], const double *x, const double *y)
ELEMENTWISE(quotient, x[i] / y[i], const double *x, const double *y)
ELEMENTWISE(scale, c * x[i], double c, const double *x)
ELEMENTWISE(absolute, fabs(x[i]), const double *x)
ELEMENTWISE(inverse, 1.0 / x[i], const double *x)
ELEMENTWISE(add_constant, x[i] + b, const double *x, double b)
// clang-format on

ALWAYS_INLINE void constant(sunindextype n, double c, double *z) {
    for (sunindextype i = 0; i < n; i++) {
        z[i] = c;
    }
}

ALWAYS_INLINE double dot_product(sunindextype n, const double *x, const double *y) {
    double sum = 0.0;
    for (sunindextype i = 0; i < n; i++) {
        sum += x[i] * y[i];
    }
    return sum;
}

ALWAYS_INLINE double max_norm(sunindextype n, const double *x) {
    double largest = 0.0;
    for (sunindextype i = 0; i < n; i++) {
        largest = fabs(x[i]) > largest ? fabs(x[i]) : largest;
    }
    return largest;
}

ALWAYS_INLINE double minimum(sunindextype n, const double *x) {
    double smallest = x[0];
    for (sunindextype i = 1; i < n; i++) {
        smallest = x[i] < smallest ? x[i] : smallest;
    }
    return smallest;
}

/* Returns sqrt(sum (x w)^2 / n). */
ALWAYS_INLINE double weighted_norm(sunindextype n, const double *x, const double *w) {
    double sum = 0.0;
    for (sunindextype i = 0; i < n; i++) {
        sum += x[i] * w[i] * (x[i] * w[i]);
    }
    return sqrt(sum / (double)n);
}

/* Writes the n <= 8 elements from begin on of linear_combination. */
ALWAYS_INLINE void combine_few(sunindextype n, int count, const double *c, N_Vector *X,
                               sunindextype begin, double *z) {
    double sum[8];
    scale(n, c[0], small_vector_data(X[0]) + begin, sum);
    for (int k = 1; k < count; k++) {
        linear_sum(n, 1.0, sum, c[k], small_vector_data(X[k]) + begin, sum);
    }
    scale(n, 1.0, sum, z + begin);
}

/* Writes z = sum c[k] X[k]; z may be one of X. Proceeds by few elements or one, so that sums stay
 * in registers. */
ALWAYS_INLINE void linear_combination(sunindextype n, int count, const double *c, N_Vector *X,
                                      double *z) {
    if (n <= 4) {
        combine_few(n, count, c, X, 0, z);
        return;
    }
    sunindextype begin = 0;
    for (; begin + 8 <= n; begin += 8) {
        combine_few(8, count, c, X, begin, z);
    }
    for (sunindextype i = begin; i < n; i++) {
        double sum = c[0] * small_vector_data(X[0])[i];
        for (int k = 1; k < count; k++) {
            sum += c[k] * small_vector_data(X[k])[i];
        }
        z[i] = sum;
    }
}

static void note(struct small_vector_terms *terms, int count, N_Vector *X) {
    terms->count = count <= SMALL_VECTOR_MOST_TERMS ? count : 0;
    for (int k = 0; k < terms->count; k++) {
        terms->data[k] = small_vector_data(X[k]);
    }
}

void small_vector_note_terms(N_Vector x, struct small_vector_terms *terms) {
    ((struct small_vector *)(void *)x)->terms = terms;
}

static struct small_vector_terms *terms_of(N_Vector x) {
    return ((const struct small_vector *)(const void *)x)->terms;
}

ALWAYS_INLINE void polynomial(sunindextype n, const struct small_vector_terms *terms, double s,
                              double *x) {
    scale(n, 1.0, terms->data[0], x);
    for (int k = 1; k < terms->count; k++) {
        linear_sum(n, s, x, 1.0, terms->data[k], x);
    }
}

void small_vector_polynomial(const struct small_vector_terms *terms, double s, size_t length,
                             double x[]) {
    switch (length) {
    case 2:
        polynomial(2, terms, s, x);
        break;
    case 4:
        polynomial(4, terms, s, x);
        break;
    default:
        polynomial((sunindextype)length, terms, s, x);
    }
}

/* Writes Z[k] = a[k] x + Y[k]. */
ALWAYS_INLINE void scale_add_multi(sunindextype n, int count, const double *a, const double *x,
                                   N_Vector *Y, N_Vector *Z) {
    for (int k = 0; k < count; k++) {
        linear_sum(n, a[k], x, 1.0, small_vector_data(Y[k]), small_vector_data(Z[k]));
    }
}

/* Writes Z[k] = c[k] X[k]. */
ALWAYS_INLINE void scale_vectors(sunindextype n, int count, const double *c, N_Vector *X,
                                 N_Vector *Z) {
    for (int k = 0; k < count; k++) {
        scale(n, c[k], small_vector_data(X[k]), small_vector_data(Z[k]));
    }
}

/* Writes Z[k] = a X[k] + b Y[k]. */
ALWAYS_INLINE void sum_vectors(sunindextype n, int count, double a, N_Vector *X, double b,
                               N_Vector *Y, N_Vector *Z) {
    for (int k = 0; k < count; k++) {
        linear_sum(n, a, small_vector_data(X[k]), b, small_vector_data(Y[k]),
                   small_vector_data(Z[k]));
    }
}

/* ---- Tables of operations ------------------------------------------------------------------- */

/* Return constant lengths, for which the compiler unrolls the loops. */
ALWAYS_INLINE sunindextype two(N_Vector x) {
    return 2;
}

ALWAYS_INLINE sunindextype four(N_Vector x) {
    return 4;
}

/* Defines the operations above as SUNDIALS calls them, for vectors x of length(x): two, four or
 * length_of. */
// clang-format off
#define DEFINE_TABLE(name, length)                                                                 \
    static void name##_linear_sum(sunrealtype a, N_Vector x, sunrealtype b, N_Vector y,            \
                                  N_Vector z) {                                                    \
        linear_sum(length(x), a, small_vector_data(x), b, small_vector_data(y),                    \
                   small_vector_data(z));                                                          \
    }                                                                                              \
    static void name##_constant(sunrealtype c, N_Vector x) {                                       \
        constant(length(x), c, small_vector_data(x));                                              \
    }                                                                                              \
    static void name##_product(N_Vector x, N_Vector y, N_Vector z) {                               \
        product(length(x), small_vector_data(x), small_vector_data(y), small_vector_data(z));      \
    }                                                                                              \
    static void name##_quotient(N_Vector x, N_Vector y, N_Vector z) {                              \
        quotient(length(x), small_vector_data(x), small_vector_data(y), small_vector_data(z));     \
    }                                                                                              \
    static void name##_scale(sunrealtype c, N_Vector x, N_Vector z) {                              \
        scale(length(x), c, small_vector_data(x), small_vector_data(z));                           \
    }                                                                                              \
    static void name##_absolute(N_Vector x, N_Vector z) {                                          \
        absolute(length(x), small_vector_data(x), small_vector_data(z));                           \
    }                                                                                              \
    static void name##_inverse(N_Vector x, N_Vector z) {                                           \
        inverse(length(x), small_vector_data(x), small_vector_data(z));                            \
    }                                                                                              \
    static void name##_add_constant(N_Vector x, sunrealtype b, N_Vector z) {                       \
        add_constant(length(x), small_vector_data(x), b, small_vector_data(z));                    \
    }                                                                                              \
    static sunrealtype name##_dot_product(N_Vector x, N_Vector y) {                                \
        return dot_product(length(x), small_vector_data(x), small_vector_data(y));                 \
    }                                                                                              \
    static sunrealtype name##_max_norm(N_Vector x) {                                               \
        return max_norm(length(x), small_vector_data(x));                                          \
    }                                                                                              \
    static sunrealtype name##_minimum(N_Vector x) {                                                \
        return minimum(length(x), small_vector_data(x));                                           \
    }                                                                                              \
    static sunrealtype name##_weighted_norm(N_Vector x, N_Vector w) {                              \
        return weighted_norm(length(x), small_vector_data(x), small_vector_data(w));               \
    }                                                                                              \
    static int name##_linear_combination(int count, sunrealtype *c, N_Vector *X, N_Vector x) {     \
        struct small_vector_terms *terms = terms_of(x);                                            \
        if (terms == NULL || !terms->replace_sum) {                                                \
            linear_combination(length(x), count, c, X, small_vector_data(x));                      \
        }                                                                                          \
        if (terms != NULL) {                                                                       \
            note(terms, count, X);                                                                 \
        }                                                                                          \
        return 0;                                                                                  \
    }                                                                                              \
    static int name##_scale_add_multi(int count, sunrealtype *a, N_Vector x, N_Vector *Y,          \
                                      N_Vector *Z) {                                               \
        scale_add_multi(length(x), count, a, small_vector_data(x), Y, Z);                          \
        return 0;                                                                                  \
    }                                                                                              \
    static int name##_scale_vectors(int count, sunrealtype *c, N_Vector *X, N_Vector *Z) {         \
        scale_vectors(length(X[0]), count, c, X, Z);                                               \
        return 0;                                                                                  \
    }                                                                                              \
    static int name##_sum_vectors(int count, sunrealtype a, N_Vector *X, sunrealtype b,            \
                                  N_Vector *Y, N_Vector *Z) {                                      \
        sum_vectors(length(X[0]), count, a, X, b, Y, Z);                                           \
        return 0;                                                                                  \
    }                                                                                              \
    static const struct _generic_N_Vector_Ops name = {                                             \
        .nvgetvectorid = id,                                                                       \
        .nvclone = clone,                                                                          \
        .nvdestroy = destroy,                                                                      \
        .nvspace = space,                                                                          \
        .nvgetarraypointer = small_vector_data,                                                    \
        .nvgetlength = length_of,                                                                  \
        .nvlinearsum = name##_linear_sum,                                                          \
        .nvconst = name##_constant,                                                                \
        .nvprod = name##_product,                                                                  \
        .nvdiv = name##_quotient,                                                                  \
        .nvscale = name##_scale,                                                                   \
        .nvabs = name##_absolute,                                                                  \
        .nvinv = name##_inverse,                                                                   \
        .nvaddconst = name##_add_constant,                                                         \
        .nvdotprod = name##_dot_product,                                                           \
        .nvmaxnorm = name##_max_norm,                                                              \
        .nvmin = name##_minimum,                                                                   \
        .nvwrmsnorm = name##_weighted_norm,                                                        \
        .nvlinearcombination = name##_linear_combination,                                          \
        .nvscaleaddmulti = name##_scale_add_multi,                                                 \
        .nvscalevectorarray = name##_scale_vectors,                                                \
        .nvlinearsumvectorarray = name##_sum_vectors,                                              \
    };
// clang-format on

DEFINE_TABLE(of_2, two)
DEFINE_TABLE(of_4, four)
DEFINE_TABLE(of_any, length_of)

N_Vector small_vector_create(sunindextype length, SUNContext context) {
    const struct _generic_N_Vector_Ops *const tables[] = {[2] = &of_2, [4] = &of_4};
    const struct _generic_N_Vector_Ops *table = &of_any;
    if (length < (sunindextype)(sizeof tables / sizeof tables[0]) && tables[length] != NULL) {
        table = tables[length];
    }
    // SUNDIALS never writes to a table of operations, though the type of its pointer would let it
    return create_like(
        &(const struct _generic_N_Vector){.ops = (N_Vector_Ops)table, .sunctx = context}, length);
}
