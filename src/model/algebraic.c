#include "algebraic.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum {
    MOST_ITERATIONS = 200, /* to an edge they halve the distance at best */
    MOST_NEAR = 10,        /* iterations to a solution that is near */
    MOST_HALVINGS = 30,    /* of a step */
    MOST_PARTS = 64,       /* of a path to a solution, found or not */
    MOST_SHOWN = 120,      /* characters of names or equations in a message */
};

static const double noise = 4.0 * DBL_EPSILON; // of a residual, over the sizes of its terms
static const double most_noise = 1e-11;        // of a step, over the unknowns themselves
static const double least_noise = 1e-15;       // over the sizes of the unknowns
static const double large_noise = 1e-6;        // likewise, of ill-conditioned equations
static const double large_step = 1e-2;         // likewise
/* Of a step, beyond which quadratic convergence is not believed: far from the solution equations
 * may be straighter than at it. */
static const double best_shrinking = 1e-4;
/* Of the first step, within which there is one solution: Deuflhard, theorem 2.1. */
static const double contraction = 0.25;
static const double shortest_part = 0x1p-16; // of a path
static const double off_edge = 0x1p-10;      // over the size of an unknown
static const double straight = 1e-6; // change of a step by that of the slopes, over the step
static const double jump = 1e-6; // of a residual whose sign changes, over its values at the bounds

/* ---- Linear equations ----------------------------------------------------------------------- */

static void swap_rows(int count, double matrix[], int a, int b) {
    for (int j = 0; a != b && j < count; j++) {
        const double kept = matrix[a * count + j];
        matrix[a * count + j] = matrix[b * count + j];
        matrix[b * count + j] = kept;
    }
}

/* Writes 1 over the largest element of each row; INFINITY if it is 0. */
static void write_scales(int count, const double matrix[], double scale[]) {
    for (int i = 0; i < count; i++) {
        double largest = 0.0;
        for (int j = 0; j < count; j++) {
            largest = fmax(largest, fabs(matrix[i * count + j]));
        }
        scale[i] = 1.0 / largest;
    }
}

/* Returns the row from k on that has the largest element in column k, over its scale. */
static int pivot_row(int count, const double matrix[], const double scale[], int k) {
    int found = k;
    double largest = fabs(matrix[k * count + k]) * scale[k];
    for (int i = k + 1; i < count; i++) {
        const double size = fabs(matrix[i * count + k]) * scale[i];
        if (size > largest) {
            largest = size;
            found = i;
        }
    }
    return found;
}

/* Columns that are eliminated together, so that the rows below are read once for all of them. */
enum { PANEL = 4 };

/* Subtracts from a row, from the element `first` on, the rows of a panel times the row's factors.
 */
static void eliminate(int count, const double matrix[], int panel, int end, int first,
                      double own[]) {
    const double *f = own + panel;
    const double *const u = matrix + (ptrdiff_t)panel * count;
    if (end - panel == PANEL && f[0] != 0.0 && f[1] != 0.0 && f[2] != 0.0 && f[3] != 0.0) {
        const double f0 = f[0];
        const double f1 = f[1];
        const double f2 = f[2];
        const double f3 = f[3];
        for (int j = first; j < count; j++) {
            own[j] = own[j] - f0 * u[j] - f1 * u[j + count] - f2 * u[j + 2 * count] -
                     f3 * u[j + 3 * count];
        }
        return;
    }
    for (int k = 0; k < end - panel; k++) {
        const double factor = f[k];
        for (int j = first; factor != 0.0 && j < count; j++) {
            own[j] -= factor * u[j + k * count];
        }
    }
}

/* Factorizes the columns from `panel` to `end`, of which these columns are written, and the rest of
 * the rows with pivots. Returns false if a pivot is none. */
static bool factorize_panel(int count, double matrix[], double scale[], int panel, int end,
                            int pivot[]) {
    for (int k = panel; k < end; k++) {
        const int row = pivot_row(count, matrix, scale, k);
        pivot[k] = row;
        swap_rows(count, matrix, k, row);
        scale[row] = scale[k];
        double *upper = matrix + (ptrdiff_t)k * count;
        if (upper[k] == 0.0 || !isfinite(upper[k])) {
            return false;
        }
        eliminate(count, matrix, panel, k, end, upper);
        for (int i = k + 1; i < count; i++) {
            double *own = matrix + (ptrdiff_t)i * count;
            if (own[k] == 0.0) {
                continue;
            }
            const double factor = own[k] / upper[k];
            own[k] = factor;
            for (int j = k + 1; j < end; j++) {
                own[j] -= factor * upper[j];
            }
        }
    }
    return true;
}

static bool factorize(int count, double matrix[], int pivot[]) {
    if (count == 1) {
        pivot[0] = 0;
        return matrix[0] != 0.0 && isfinite(matrix[0]);
    }
    double *scale = matrix + (ptrdiff_t)count * count;
    write_scales(count, matrix, scale);
    for (int panel = 0; panel < count; panel += PANEL) {
        const int end = panel + PANEL < count ? panel + PANEL : count;
        if (!factorize_panel(count, matrix, scale, panel, end, pivot)) {
            return false;
        }
        for (int i = end; i < count; i++) {
            eliminate(count, matrix, panel, end, end, matrix + (ptrdiff_t)i * count);
        }
    }
    return true;
}

void algebraic_factorize(int count, double matrix[], int pivot[]) {
    if (!factorize(count, matrix, pivot)) {
        for (int k = 0; k < count; k++) {
            pivot[k] = k;
            matrix[k * count + k] = (double)NAN;
        }
    }
}

void algebraic_substitute(int count, const double matrix[], const int pivot[], const double b[],
                          double x[]) {
    if (count == 1) {
        x[0] = b[0] / matrix[0];
        return;
    }
    memcpy(x, b, (size_t)count * sizeof *x);
    for (int k = 0; k < count; k++) {
        const double kept = x[pivot[k]];
        x[pivot[k]] = x[k];
        x[k] = kept;
    }
    for (int i = 1; i < count; i++) {
        for (int j = 0; j < i; j++) {
            x[i] -= matrix[i * count + j] * x[j];
        }
    }
    for (int i = count - 1; i >= 0; i--) {
        for (int j = i + 1; j < count; j++) {
            x[i] -= matrix[i * count + j] * x[j];
        }
        x[i] /= matrix[i * count + i];
    }
}

void algebraic_bounds(int count, const double matrix[], const int pivot[], const double e[],
                      double room[], double bound[]) {
    double *unit = room;
    double *column = room + count;
    memset(bound, 0, (size_t)count * sizeof *bound);
    for (int j = 0; j < count; j++) {
        memset(unit, 0, (size_t)count * sizeof *unit);
        unit[j] = 1.0;
        algebraic_substitute(count, matrix, pivot, unit, column);
        for (int i = 0; i < count; i++) {
            bound[i] += fabs(column[i]) * e[j];
        }
    }
}

/* ---- Newton's method ------------------------------------------------------------------------ */

/* What one solution needs; the vectors are of the unknowns or residuals. */
struct newton {
    const struct algebraic *system;
    const double *given;
    bool is_free;
    double *matrix, *next; /* slopes at the last iterate, factorized, and at the next one */
    double *residual, *step, *ahead, *trial, *size, *before;
    double *rounding; /* of the residuals at the last iterate */
    double *room;     /* three vectors */
    double *first; /* residuals at the guess, and how much of them is left on the path from there */
    double left;
    int *pivot;
};

static bool are_finite(int count, const double x[]) {
    bool found = true;
    for (int i = 0; i < count; i++) {
        found &= isfinite(x[i]) != 0;
    }
    return found;
}

static void copy(int count, const double from[], double to[]) {
    for (int i = 0; i < count; i++) {
        to[i] = from[i];
    }
}

/* Writes the residuals and their slopes to newton->residual and newton->next. Returns false if the
 * residuals are not finite or, where one is not 0, if the slopes are not. */
static bool evaluate(const struct newton *newton, const double unknown[]) {
    const int count = newton->system->count;
    double size = 0.0;
    double sum = 0.0;
    for (int i = 0; i < count * count; i++) {
        newton->next[i] = 0.0;
    }
    newton->system->evaluate(newton->given, newton->is_free, unknown, newton->residual,
                             newton->next);
    for (int i = 0; i < count; i++) {
        newton->residual[i] -= newton->left > 0.0 ? newton->left * newton->first[i] : 0.0;
        size += fabs(newton->residual[i]);
    }
    for (int i = 0; size > 0.0 && i < count * count; i++) {
        sum += 0.0 * newton->next[i];
    }
    return isfinite(size) && sum == 0.0;
}

/* True if each residual is as small as the rounding of its terms, which it writes. */
static bool is_rounding(const struct newton *newton, const double unknown[]) {
    const int count = newton->system->count;
    bool found = true;
    for (int i = 0; i < count; i++) {
        double size = 0.0;
        for (int j = 0; j < count; j++) {
            size += fabs(newton->next[i * count + j] * unknown[j]);
        }
        newton->rounding[i] = noise * size;
        found &= newton->residual[i] == 0.0 || fabs(newton->residual[i]) <= noise * size;
    }
    return found;
}

/* Returns the largest change of an unknown, over its size. */
static double length(const struct newton *newton, const double step[]) {
    double found = 0.0;
    for (int i = 0; i < newton->system->count; i++) {
        found = fmax(found, fabs(step[i]) / newton->size[i]);
    }
    return found;
}

/* Writes the correction that makes up for the residuals, by the last factorized matrix. */
static void correct(const struct newton *newton, double step[]) {
    const int count = newton->system->count;
    algebraic_substitute(count, newton->matrix, newton->pivot, newton->residual, step);
    for (int i = 0; i < count; i++) {
        step[i] = -step[i];
    }
}

/* True if the step changes no unknown by more than a part of it. */
static bool is_within(const struct newton *newton, const double unknown[], double part) {
    bool found = true;
    for (int i = 0; i < newton->system->count; i++) {
        found &= fabs(newton->step[i]) <= part * fabs(unknown[i]);
    }
    return found;
}

/* True if the rounding of residuals moves the solution by as much as the step. */
static bool is_noise(const struct newton *newton) {
    const int count = newton->system->count;
    double *bound = newton->room + (ptrdiff_t)2 * count;
    bool found = true;
    algebraic_bounds(count, newton->matrix, newton->pivot, newton->rounding, newton->room, bound);
    for (int i = 0; i < count; i++) {
        found &= fabs(newton->step[i]) <= bound[i];
    }
    return found;
}

/* True if rounding may hide whether a step leads nearer to the solution. */
static bool is_small(const struct newton *newton, const double unknown[], double of_step) {
    return is_within(newton, unknown, most_noise) || of_step <= least_noise ||
           (of_step <= large_noise && is_noise(newton));
}

/* True if the slopes have not changed over the last step: what is left is rounding, or a long way,
 * and no edge where slopes have no limit. */
static bool goes_straight(const struct newton *newton) {
    double change = 0.0;
    for (int i = 0; i < newton->system->count; i++) {
        change = fmax(change, fabs(newton->step[i] - newton->ahead[i]) / newton->size[i]);
    }
    return change <= straight * length(newton, newton->step);
}

/* Moves by a part of the step to `trial`, within the bounds. Returns how much of the step is left
 * there, by the matrix at its begin: 1 - part of linear equations. */
static double left_after(const struct newton *newton, const double unknown[], double part,
                         double of_step) {
    const struct algebraic *system = newton->system;
    for (int i = 0; i < system->count; i++) {
        const double moved = unknown[i] + part * newton->step[i];
        newton->trial[i] = moved < system->low[i]    ? system->low[i]
                           : moved > system->high[i] ? system->high[i]
                                                     : moved;
    }
    if (!evaluate(newton, newton->trial)) {
        return INFINITY;
    }
    correct(newton, newton->ahead);
    return length(newton, newton->ahead) / of_step;
}

/* Moves to a trial by the whole step. Returns false unless it leads to the one solution that is
 * near. */
static bool advance_near(const struct newton *newton, const double unknown[], double of_step) {
    if (!(of_step <= 1.0)) {
        return false;
    }
    if (of_step > large_step) { // chance may lead to a solution that is far away
        const double half = left_after(newton, unknown, 0.5, of_step);
        if (!(fabs(half - 0.5) <= contraction)) {
            return false;
        }
    }
    const double left = left_after(newton, unknown, 1.0, of_step);
    return left <= contraction || (left < INFINITY && is_small(newton, unknown, of_step));
}

/* Moves to a trial by as much of the step as leads nearer to a solution, and writes whether that is
 * all of it. Returns false if no part does. */
static bool advance_far(const struct newton *newton, const double unknown[], double of_step,
                        bool *is_whole) {
    double part = 1.0;
    for (int count = 0; count <= MOST_HALVINGS; count++) {
        if (left_after(newton, unknown, part, of_step) <= 1.0 - 0.25 * part) {
            *is_whole = count == 0;
            return true;
        }
        part *= 0.5;
    }
    *is_whole = true;
    return is_small(newton, unknown, of_step) &&
           left_after(newton, unknown, 1.0, of_step) < INFINITY;
}

/* Solves a single equation between its bounds, at which the residual has opposite signs. Returns
 * false if it has not. */
static bool bisect(const struct newton *newton, double unknown[]) {
    const struct algebraic *system = newton->system;
    double low = system->low[0];
    double high = system->high[0];
    if (system->count != 1 || !isfinite(low) || !isfinite(high)) {
        return false;
    }
    double at_low;
    double at_high;
    system->evaluate(newton->given, newton->is_free, &low, &at_low, NULL);
    system->evaluate(newton->given, newton->is_free, &high, &at_high, NULL);
    const double at_bounds = fmax(fabs(at_low), fabs(at_high));
    if (!((at_low <= 0.0 && at_high >= 0.0) || (at_low >= 0.0 && at_high <= 0.0))) {
        return false;
    }
    double middle = 0.5 * low + 0.5 * high;
    while (middle > low && middle < high) {
        double value;
        system->evaluate(newton->given, newton->is_free, &middle, &value, NULL);
        if (isnan(value)) {
            return false;
        }
        const bool is_below = (value < 0.0) == (at_low < 0.0) && value != 0.0;
        *(is_below ? &low : &high) = middle;
        middle = 0.5 * low + 0.5 * high;
    }
    double of_low;
    system->evaluate(newton->given, newton->is_free, &low, &of_low, NULL);
    system->evaluate(newton->given, newton->is_free, &high, &at_high, NULL);
    const double least = fmin(fabs(of_low), fabs(at_high));
    if (!(least <= jump * at_bounds)) { // signs also change at a pole, or where values jump
        return false;
    }
    unknown[0] = fabs(of_low) < fabs(at_high) ? low : high;
    newton->residual[0] = least;
    return true;
}

/* Factorizes the matrix at the last iterate and writes the step from there, and the sizes of the
 * unknowns. Returns false if it is singular. */
static bool begin_step(struct newton *newton, const double unknown[]) {
    double *factorized = newton->next;
    newton->next = newton->matrix;
    newton->matrix = factorized;
    if (!factorize(newton->system->count, factorized, newton->pivot)) {
        return false;
    }
    correct(newton, newton->step);
    for (int i = 0; i < newton->system->count; i++) {
        newton->size[i] = fmax(fabs(unknown[i]), newton->system->nominal[i]);
    }
    return true;
}

/* Moves a guess away from where the equations or their slopes are not finite, as at the edge of a
 * root, by a small part of the sizes. Returns false if that does not help. */
static bool leave_edge(const struct newton *newton, double unknown[]) {
    const struct algebraic *system = newton->system;
    copy(system->count, unknown, newton->trial);
    for (int sign = 1; sign >= -1; sign -= 2) {
        for (int i = 0; i < system->count; i++) {
            unknown[i] = newton->trial[i] + sign * off_edge * system->nominal[i];
        }
        if (evaluate(newton, unknown)) {
            return true;
        }
    }
    copy(system->count, newton->trial, unknown);
    return false;
}

static enum algebraic_outcome iterate(struct newton *newton, bool is_near, double unknown[],
                                      int *iterations) {
    const int count = newton->system->count;
    double last = INFINITY; // length of the step to this iterate
    bool is_whole = true;   // that step; where parts lead ever nearer to an edge is no solution
    if (!evaluate(newton, unknown) && (is_near || !leave_edge(newton, unknown))) {
        return ALGEBRAIC_NOT_FINITE;
    }
    for (*iterations = 0;; ++*iterations) {
        if (is_rounding(newton, unknown)) {
            return ALGEBRAIC_SOLVED;
        }
        if (!begin_step(newton, unknown)) {
            return ALGEBRAIC_SINGULAR;
        }
        const double of_step = length(newton, newton->step);
        const bool is_straight = *iterations > 0 && is_whole && goes_straight(newton);
        if (is_within(newton, unknown, DBL_EPSILON) ||
            (*iterations == MOST_ITERATIONS && is_straight && of_step <= least_noise)) {
            return ALGEBRAIC_SOLVED;
        }
        const double shrinks = *iterations > 0 ? fmax(of_step / last, best_shrinking) : INFINITY;
        if (is_within(newton, unknown, DBL_EPSILON / (shrinks * shrinks))) { // quadratically
            for (int i = 0; i < count; i++) {
                unknown[i] += newton->step[i];
            }
            return ALGEBRAIC_SOLVED;
        }
        if (is_straight && of_step > 0.5 * last && is_small(newton, unknown, of_step)) {
            copy(count, newton->before, unknown); // from here on there is only noise
            return ALGEBRAIC_SOLVED;
        }
        copy(count, unknown, newton->before);
        last = of_step;
        if (*iterations == (is_near ? MOST_NEAR : MOST_ITERATIONS) ||
            !(is_near ? advance_near(newton, unknown, of_step)
                      : advance_far(newton, unknown, of_step, &is_whole))) {
            return ALGEBRAIC_FAR;
        }
        copy(count, newton->trial, unknown);
    }
}

/* Follows the solutions of residuals that go from those at the guess to 0: Newton's homotopy, in
 * parts so short that each leads to the one solution near the last. Returns false if it ends, as
 * where equations are singular. end: room for unknowns. */
static bool follow(struct newton *newton, double unknown[], double end[], int *iterations) {
    const int count = newton->system->count;
    double part = 0.5;
    double left = 1.0;
    if (!evaluate(newton, unknown)) {
        return false;
    }
    copy(count, newton->residual, newton->first);
    for (int parts = 0; left > 0.0 && part >= shortest_part && parts < MOST_PARTS; parts++) {
        int more = 0;
        newton->left = left > part ? left - part : 0.0;
        copy(count, unknown, end);
        if (iterate(newton, true, end, &more) == ALGEBRAIC_SOLVED) {
            copy(count, end, unknown);
            left = newton->left;
            part *= 2.0;
        } else {
            part *= 0.5;
        }
        *iterations += more;
    }
    newton->left = 0.0;
    return left == 0.0;
}

struct algebraic_report algebraic_solve(const struct algebraic *system, struct algebraic_room room,
                                        const double given[], bool is_near, bool is_free,
                                        double unknown[]) {
    const int count = system->count;
    struct newton newton = {
        .system = system,
        .given = given,
        .is_free = is_free && system->has_modes,
        .matrix = room.matrix,
        .next = room.matrix + (ptrdiff_t)count * (count + 1),
        .residual = room.vector,
        .step = room.vector + count,
        .ahead = room.vector + (ptrdiff_t)2 * count,
        .trial = room.vector + (ptrdiff_t)3 * count,
        .size = room.vector + (ptrdiff_t)4 * count,
        .before = room.vector + (ptrdiff_t)5 * count,
        .rounding = room.vector + (ptrdiff_t)6 * count,
        .room = room.vector + (ptrdiff_t)7 * count,
        .first = room.vector + (ptrdiff_t)10 * count,
        .pivot = room.pivot,
    };
    double *guess = room.vector + (ptrdiff_t)11 * count;
    struct algebraic_report report = {.iterations = 0};
    copy(count, unknown, guess);
    report.outcome = iterate(&newton, is_near, unknown, &report.iterations);
    if (report.outcome == ALGEBRAIC_FAR && is_near &&
        follow(&newton, guess, unknown, &report.iterations)) {
        report.outcome = ALGEBRAIC_SOLVED;
    }
    if (report.outcome == ALGEBRAIC_NOT_FINITE && system->has_modes && !is_free) {
        newton.is_free = true;
        report.outcome = iterate(&newton, false, unknown, &report.iterations);
        newton.is_free = false;
        if (report.outcome == ALGEBRAIC_SOLVED) {
            report.outcome = iterate(&newton, is_near, unknown, &report.iterations);
        }
    }
    if (report.outcome != ALGEBRAIC_SOLVED && bisect(&newton, unknown)) {
        report.outcome = ALGEBRAIC_SOLVED;
    }
    if (report.outcome != ALGEBRAIC_SOLVED) {
        (void)evaluate(&newton, unknown);
    }
    for (int i = 0; i < count; i++) {
        report.residual = fmax(report.residual, fabs(newton.residual[i]));
        unknown[i] = report.outcome == ALGEBRAIC_SOLVED ? unknown[i] : (double)NAN;
    }
    return report;
}

void algebraic_spread(const struct algebraic *system, struct algebraic_room room,
                      const double given[], const double unknown[], double error[]) {
    const int count = system->count;
    double *e = room.vector;
    system->evaluate(given, false, unknown, e, room.matrix); // the room is 0 for a start
    for (int i = 0; i < count; i++) {
        e[i] = error[i];
        for (int j = 0; j < count; j++) {
            e[i] += noise * fabs(room.matrix[i * count + j] * unknown[j]);
        }
    }
    algebraic_factorize(count, room.matrix, room.pivot);
    algebraic_bounds(count, room.matrix, room.pivot, e, room.vector + count, error);
}

/* ---- Messages ------------------------------------------------------------------------------- */

bool algebraic_fails(const struct algebraic *system, struct algebraic_room room,
                     const double given[], double t, double unknown[], char *text, size_t size) {
    const struct algebraic_report report =
        algebraic_solve(system, room, given, false, false, unknown);
    const char *more = strlen(system->names) > MOST_SHOWN ? "..." : "";
    switch (report.outcome) {
    case ALGEBRAIC_SOLVED:
        return false;
    case ALGEBRAIC_NOT_FINITE:
        (void)snprintf(text, size,
                       "%.*s%s: no solution at t = %.17g, their equations are not finite after %d "
                       "iterations: %.*s",
                       MOST_SHOWN, system->names, more, t, report.iterations, MOST_SHOWN,
                       system->equations);
        return true;
    case ALGEBRAIC_SINGULAR:
        (void)snprintf(text, size,
                       "%.*s%s: no solution at t = %.17g, the equations are singular%s with "
                       "largest residual %.3g after %d iterations: %.*s",
                       MOST_SHOWN, system->names, more, t,
                       report.iterations == 0 ? " at the guess (give another start)" : "",
                       report.residual, report.iterations, MOST_SHOWN, system->equations);
        return true;
    case ALGEBRAIC_FAR:
        (void)snprintf(
            text, size,
            "%.*s%s: no solution at t = %.17g, largest residual %.3g after %d iterations: "
            "%.*s",
            MOST_SHOWN, system->names, more, t, report.residual, report.iterations, MOST_SHOWN,
            system->equations);
        return true;
    }
    return true;
}

bool algebraic_lacks(int count, const double x[], const char *names, const char *equations,
                     double t, char *text, size_t size) {
    if (are_finite(count, x)) {
        return false;
    }
    (void)snprintf(text, size,
                   "%.*s%s: no solution at t = %.17g: these linear equations are singular, or what "
                   "they read is not finite: %.*s",
                   MOST_SHOWN, names, strlen(names) > MOST_SHOWN ? "..." : "", t, MOST_SHOWN,
                   equations);
    return true;
}
