/* Equations that need each other: systems r(z) = 0 that a model solves for its unknowns z wherever
 * it is evaluated, and systems of linear equations for what follows from them.
 *
 * Newton's method with damping by the natural monotonicity test: Deuflhard, Newton Methods for
 * Nonlinear Problems, section 3.3. The result is a pure function of the arguments. A guess that
 * solves the equations within rounding is the result, bit by bit. */
#pragma once

#include <stdbool.h>
#include <stddef.h>

struct algebraic {
    const char *names;     /* of the unknowns, with commas */
    const char *equations; /* texts of the equations, with semicolons */
    int count;
    bool has_modes;           /* true if modes may follow from the unknowns */
    const double *nominal;    /* of each unknown, above 0, in its unit */
    const double *low, *high; /* bounds of each unknown */

    /* Writes the residuals and, unless slope is NULL, their derivatives by the unknowns, row after
     * row; those that are always 0 are 0 already. given: what the equations read. is_free: true
     * if modes follow from the unknowns, else they are given. */
    void (*evaluate)(const double given[], bool is_free, const double unknown[], double residual[],
                     double slope[]);
};

/* Memory for one system of `count` unknowns. */
struct algebraic_room {
    double *matrix; /* 2 count (count + 1) */
    double *vector; /* 6 count */
    int *pivot;     /* count */
};

#define ALGEBRAIC_ROOM(count)                                                                      \
    (struct algebraic_room) {                                                                      \
        (double[2 * (count) * ((count) + 1)]){0}, (double[12 * (count)]){0}, (int[count]) {        \
            0                                                                                      \
        }                                                                                          \
    }

enum algebraic_outcome {
    ALGEBRAIC_SOLVED,
    ALGEBRAIC_NOT_FINITE, /* residuals at the guess are not finite */
    ALGEBRAIC_SINGULAR,
    ALGEBRAIC_FAR, /* no convergence */
};

struct algebraic_report {
    enum algebraic_outcome outcome;
    int iterations;
    double residual; /* largest one, at the last iterate */
};

/* Solves the system from the guess in `unknown`, which gets the solution, or NAN if there is none.
 * is_near: only the solution counts to which a path leads while the guess's residuals go to 0.
 * is_free: as of evaluate. In given modes a guess may be where the equations are not finite; then
 * the search begins at the solution in free modes. */
struct algebraic_report algebraic_solve(const struct algebraic *system, struct algebraic_room room,
                                        const double given[], bool is_near, bool is_free,
                                        double unknown[]);

/* Writes one line that says why there is no solution, to text (size bytes); unknown: the guess.
 * Returns false if there is one, which `unknown` gets. */
bool algebraic_fails(const struct algebraic *system, struct algebraic_room room,
                     const double given[], double t, double unknown[], char *text, size_t size);

/* Likewise of linear equations, whose solution x is not finite; false if it is. */
bool algebraic_lacks(int count, const double x[], const char *names, const char *equations,
                     double t, char *text, size_t size);

/* Factorizes a matrix of count rows, which stand one after the other, by Gaussian elimination with
 * scaled partial pivoting; count further elements are memory. Writes the order of the rows to
 * pivot. Of a singular matrix all solutions are NAN. */
void algebraic_factorize(int count, double matrix[], int pivot[]);

/* Writes the solution x of the factorized linear equations with right sides b. */
void algebraic_substitute(int count, const double matrix[], const int pivot[], const double b[],
                          double x[]);

/* Replaces errors >= 0 of a system's equations by bounds of the errors of its solution `unknown`,
 * with the rounding of their terms. */
void algebraic_spread(const struct algebraic *system, struct algebraic_room room,
                      const double given[], const double unknown[], double error[]);

/* Writes bounds of the solution's errors, where right sides may be wrong by e >= 0. */
void algebraic_bounds(int count, const double matrix[], const int pivot[], const double e[],
                      double room[], double bound[]);
