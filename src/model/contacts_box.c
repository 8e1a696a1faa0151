#include "algebraic.h"
#include "contacts.h"

#include <float.h>
#include <math.h>
#include <string.h>

enum { MOST = CONTACTS_MOST_COUPLED };

/* What is beyond its bound by rounding, over its size, stays: its limit is looked at apart. */
static const double rounding = 64.0 * DBL_EPSILON;

/* Writes T and a where `leaves` says which stay, by the linear equations of those. */
static void solve_pattern(const struct box *box, struct box_solution *to) {
    double matrix[MOST * (MOST + 1)];
    double right[MOST], held[MOST];
    int member[MOST], pivot[MOST];
    int count = 0;
    for (int i = 0; i < box->count; i++) {
        to->T[i] = to->leaves[i] > 0 ? box->low[i] : to->leaves[i] < 0 ? box->high[i] : 0.0;
        if (to->leaves[i] == 0) {
            member[count++] = i;
        }
    }
    for (int i = 0; i < box->count; i++) {
        to->a[i] = box->a0[i];
        for (int j = 0; j < box->count; j++) {
            to->a[i] += box->W[i][j] * to->T[j];
        }
    }
    for (int r = 0; r < count; r++) {
        right[r] = -to->a[member[r]];
        for (int c = 0; c < count; c++) {
            matrix[r * count + c] = box->W[member[r]][member[c]];
        }
    }
    if (count == 1) {
        held[0] = right[0] / matrix[0];
    } else if (count > 1) {
        algebraic_factorize(count, matrix, pivot);
        algebraic_substitute(count, matrix, pivot, right, held);
    }
    for (int r = 0; r < count; r++) {
        to->T[member[r]] = held[r];
    }
    for (int i = 0; i < box->count; i++) {
        for (int r = 0; r < count && to->leaves[i] != 0; r++) {
            to->a[i] += box->W[i][member[r]] * held[r];
        }
        to->a[i] = to->leaves[i] == 0 ? 0.0 : to->a[i];
    }
}

/* By how much an unknown violates its condition, over the size of its terms. */
static double violation(const struct box *box, const struct box_solution *at, int i) {
    double terms = fabs(box->a0[i]);
    for (int j = 0; j < box->count; j++) {
        terms += j == i && at->leaves[i] == 0 ? 0.0 : fabs(box->W[i][j] * at->T[j]);
    }
    if (at->leaves[i] == 0) {
        const double high = at->T[i] - box->high[i];
        const double low = box->low[i] - at->T[i];
        const double over = high > low ? high : low;
        const double bound = high > low ? box->high[i] : box->low[i];
        const double own = fabs(at->T[i]) + (isfinite(bound) ? fabs(bound) : 0.0);
        const double scale = own + terms / fabs(box->W[i][i]);
        const double relative = scale > 0.0 ? over / scale : over;
        return isnan(at->T[i]) ? INFINITY : relative > 0.0 && relative <= rounding ? 0.0 : relative;
    }
    if (!isfinite(at->T[i]) || at->a[i] == 0.0) {
        return INFINITY; // what leaves without an acceleration stays
    }
    return -at->leaves[i] * at->a[i] / terms;
}

/* Writes the misfit, and returns the worst unknown. */
static int judge(const struct box *box, struct box_solution *at) {
    int worst = 0;
    at->misfit = -INFINITY;
    for (int i = 0; i < box->count; i++) {
        const double own = violation(box, at, i);
        if (!(own <= at->misfit)) {
            at->misfit = own;
            worst = i;
        }
    }
    return worst;
}

static void look_at_all(const struct box *box, struct box_solution *solution) {
    static const int order[] = {0, 1, -1};
    int patterns = 1;
    for (int i = 0; i < box->count; i++) {
        patterns *= 3;
    }
    solution->misfit = INFINITY;
    for (int k = 0; k < patterns && !(k > 0 && solution->misfit <= 0.0); k++) {
        struct box_solution tried;
        for (int i = box->count - 1, rest = k; i >= 0; i--, rest /= 3) {
            tried.leaves[i] = order[rest % 3];
        }
        solve_pattern(box, &tried);
        judge(box, &tried);
        if (k == 0 || tried.misfit < solution->misfit) {
            *solution = tried;
        }
    }
}

/* The same of one unknown, which stays in most cases. */
static void solve_one(const struct box *box, struct box_solution *to) {
    to->leaves[0] = 0;
    to->T[0] = -box->a0[0] / box->W[0][0];
    to->a[0] = 0.0;
    to->misfit = violation(box, to, 0);
    if (!(to->misfit <= 0.0)) {
        look_at_all(box, to);
    }
}

/* Lets one unknown do what its violation asks for. */
static void turn(const struct box *box, struct box_solution *at, int i) {
    at->leaves[i] = at->leaves[i] != 0 ? 0 : at->T[i] > box->high[i] ? -1 : 1;
}

static void pivot(const struct box *box, struct box_solution *solution) {
    enum { MOST_WORST = 3 * MOST, MOST_PIVOTS = 200 };
    memset(solution->leaves, 0, sizeof solution->leaves);
    struct box_solution best = {.misfit = INFINITY};
    for (int count = 0; count < MOST_PIVOTS; count++) {
        solve_pattern(box, solution);
        int next = judge(box, solution);
        if (solution->misfit < best.misfit || count == 0) {
            best = *solution;
        }
        if (solution->misfit <= 0.0) {
            break;
        }
        for (int i = 0; count >= MOST_WORST && i < box->count; i++) {
            if (violation(box, solution, i) > 0.0) {
                next = i;
                break;
            }
        }
        turn(box, solution, next);
    }
    *solution = best;
}

void box_solve(const struct box *box, struct box_solution *solution) {
    enum { MOST_LOOKED_AT = 3 };
    if (box->count == 1) {
        solve_one(box, solution);
    } else if (box->count <= MOST_LOOKED_AT) {
        look_at_all(box, solution);
    } else {
        pivot(box, solution);
    }
}
