/* Taylor coefficients, in balls, of everything that a model calculates along its motion, and their
 * derivatives by the states at the origin.
 *
 * The operations of the model are a list of nodes (../proof.py writes it), each after its
 * arguments. The slope of a function is a node, too. By the chain rule it gives its coefficients:
 *     y' = s x'   so that   k y_k = sum over j = 1 .. k of j x_j s_(k - j) */
#pragma once

#include "functions.h"

#include <stddef.h>

enum { LAST_ORDER = 31, ORDERS = LAST_ORDER + 1, MOST_STATES = 64, NO_NODE = -1 };

enum operation { NUMBER, STATE, INPUT, TIME, SUM, DIFFERENCE, PRODUCT, QUOTIENT, NEGATIVE, CALL };

struct node {
    enum operation operation;
    int first, second;  /* arguments; of a state or input its number */
    int slope;          /* of a function; NO_NODE: its value is enough */
    struct ball number; /* of a NUMBER */
    ball_function function;
    bool moves; /* it may have coefficients above order 0 */
};

/* The states come first, then what rates follow from, then guards and slopes; of all else only
 * values are needed. */
struct model {
    struct node *nodes;
    int count, of_rates, of_series;
    int states, inputs, outputs, guards;
    int rate[MOST_STATES]; /* nodes: of each state, */
    int *output;           /* of each output, */
    int *guard;            /* and of what must not become 0: where it does, an event comes, */
    bool *positive;        /* so that each is above or below 0 */
    struct ball *input;    /* over a communication step */
};

/* Coefficients of t^k, times (the step)^k: [direction][node][order], where direction 0 is the value
 * and 1 + d the derivative by state d at the origin. */
struct series {
    const struct model *model;
    struct ball *rows;
    struct ball *paces;       /* [node][order]: j x_j of arguments of functions */
    struct ball *reciprocals; /* [node]: of divisors, order 0 */
    int directions;
};

static struct ball *series_row(const struct series *s, int direction, int node) {
    return s->rows + ((size_t)direction * (size_t)s->model->count + (size_t)node) * ORDERS;
}

/* True if a ball bounds its numbers. */
static bool is_bounded(struct ball x) {
    return ball_largest(x) <= DBL_MAX;
}

/* ---- Order 0 --------------------------------------------------------------------------------- */

/* The value of a node from those of its arguments. */
static struct ball node_value(const struct series *s, const struct node *node,
                              const struct ball states[], struct ball time) {
    const struct ball x = node->operation >= SUM ? *series_row(s, 0, node->first) : ONE;
    const struct ball y = node->second >= 0 ? *series_row(s, 0, node->second) : ONE;
    switch (node->operation) {
    case NUMBER:
        return node->number;
    case STATE:
        return states[node->first];
    case INPUT:
        return s->model->input[node->first];
    case TIME:
        return time;
    case SUM:
        return ball_sum(x, y);
    case DIFFERENCE:
        return ball_difference(x, y);
    case PRODUCT:
        return ball_product(x, y);
    case QUOTIENT:
        return ball_quotient(x, y);
    case NEGATIVE:
        return ball_negative(x);
    case CALL:
        return node->function(x);
    }
    return x;
}

/* Values of the first `count` nodes. Returns the first one that is not bounded, else NO_NODE. */
static int series_values(struct series *s, const struct ball states[], struct ball time,
                         int count) {
    int unbounded = NO_NODE;
    for (int i = 0; i < count; i++) {
        const struct node *node = s->model->nodes + i;
        const struct ball value = node_value(s, node, states, time);
        *series_row(s, 0, i) = value;
        if (node->operation == QUOTIENT && node->moves) {
            s->reciprocals[i] = ball_quotient(ONE, *series_row(s, 0, node->second));
        }
        if (unbounded == NO_NODE && !is_bounded(value)) {
            unbounded = i;
        }
    }
    return unbounded;
}

/* ---- The orders from 1 on -------------------------------------------------------------------- */

/* The sum of x_i y_(k - i) over i = 0 .. k; a y that rests has y_0 only. */
static struct ball product_of(const struct ball *x, const struct ball *y, int k, bool y_moves) {
    return y_moves ? ball_convolution(x, y, k) : ball_product(x[k], y[0]);
}

/* Coefficient k of a node along a motion, from 1 on, of what is no state. */
static struct ball node_coefficient(const struct series *s, int i, int k, struct ball step,
                                    const struct ball per_order[ORDERS]) {
    const struct node *nodes = s->model->nodes, *node = nodes + i;
    const bool has_second = node->second >= 0;
    const struct ball *x = series_row(s, 0, node->operation >= SUM ? node->first : i);
    const struct ball *y = has_second ? series_row(s, 0, node->second) : x;
    struct ball sum = ball_exact(0.0);
    switch (node->operation) {
    case TIME:
        return k == 1 ? step : sum;
    case SUM:
        return ball_sum(x[k], y[k]);
    case DIFFERENCE:
        return ball_difference(x[k], y[k]);
    case NEGATIVE:
        return ball_negative(x[k]);
    case PRODUCT:
        return nodes[node->first].moves ? product_of(x, y, k, nodes[node->second].moves)
                                        : ball_product(x[0], y[k]);
    case QUOTIENT: // x = y q
        sum = nodes[node->second].moves ? ball_convolution(y + 1, series_row(s, 0, i), k - 1) : sum;
        return ball_product(ball_difference(x[k], sum), s->reciprocals[i]);
    default: { // CALL
        struct ball *pace = s->paces + (size_t)i * ORDERS;
        const struct ball *slope = series_row(s, 0, node->slope);
        pace[k - 1] = ball_product(ball_exact(k), x[k]);
        sum = product_of(pace, slope, k - 1, nodes[node->slope].moves);
        return ball_product(sum, per_order[k]);
    }
    }
}

/* The derivative of coefficient k, from 0 on, of what is no state, by state d. */
static struct ball node_derivative(const struct series *s, int i, int k, int d) {
    const struct model *model = s->model;
    const struct node *nodes = model->nodes, *node = nodes + i;
    const int first = node->first, second = node->second >= 0 ? node->second : first;
    const struct ball *x = series_row(s, 0, first), *dx = series_row(s, 1 + d, first);
    const struct ball *y = series_row(s, 0, second), *dy = series_row(s, 1 + d, second);
    const bool by_x = nodes[first].moves, by_y = nodes[second].moves;
    struct ball sum = ball_exact(0.0);
    switch (node->operation) {
    case SUM:
        return ball_sum(dx[k], dy[k]);
    case DIFFERENCE:
        return ball_difference(dx[k], dy[k]);
    case NEGATIVE:
        return ball_negative(dx[k]);
    case PRODUCT:
        sum = by_x ? product_of(dx, y, k, by_y) : sum;
        return by_y ? ball_sum(sum, product_of(dy, x, k, by_x)) : sum;
    case QUOTIENT: // dx = q dy + y dq
        sum = by_x ? dx[k] : sum;
        if (by_y) {
            const struct ball *q = series_row(s, 0, i);
            sum = ball_difference(sum, product_of(dy, q, k, true));
        }
        if (by_y && k > 0) {
            const struct ball *dq = series_row(s, 1 + d, i);
            sum = ball_difference(sum, ball_convolution(y + 1, dq, k - 1));
        }
        return ball_product(sum, s->reciprocals[i]);
    default: { // CALL
        const struct ball *slope = series_row(s, 0, node->slope);
        return product_of(dx, slope, k, nodes[node->slope].moves);
    }
    }
}

/* Coefficient k of all nodes of the series, and of its derivatives. */
static void series_extend(struct series *s, struct ball step, int k,
                          const struct ball per_order[ORDERS]) {
    const struct model *model = s->model;
    const struct ball share = k > 0 ? ball_product(step, per_order[k]) : ONE;
    for (int i = 0; i < model->of_series && k > 0; i++) {
        const struct node *node = model->nodes + i;
        if (node->operation == STATE) {
            const struct ball *rate = series_row(s, 0, model->rate[node->first]);
            series_row(s, 0, i)[k] = ball_product(share, rate[k - 1]);
        } else if (node->moves) {
            series_row(s, 0, i)[k] = node_coefficient(s, i, k, step, per_order);
        }
    }
    for (int d = 0; d < s->directions; d++) {
        for (int i = 0; i < model->of_rates; i++) {
            const struct node *node = model->nodes + i;
            struct ball *row = series_row(s, 1 + d, i);
            if (node->operation == STATE && k == 0) {
                row[0] = ball_exact(node->first == d ? 1.0 : 0.0);
            } else if (node->operation == STATE) {
                const struct ball *rate = series_row(s, 1 + d, model->rate[node->first]);
                row[k] = ball_product(share, rate[k - 1]);
            } else if (node->moves && node->operation != TIME) {
                row[k] = node_derivative(s, i, k, d);
            }
        }
    }
}

/* Order 0 of a series from these states. Returns as series_values. */
static int series_begin(struct series *s, const struct ball states[], struct ball time,
                        int directions) {
    s->directions = directions;
    const int unbounded = series_values(s, states, time, s->model->of_series);
    series_extend(s, ONE, 0, NULL);
    return unbounded;
}

/* The value of a polynomial at the end of the step. */
static struct ball series_end(const struct ball coefficients[ORDERS], int order) {
    struct ball sum = coefficients[order];
    for (int k = order - 1; k >= 0; k--) {
        sum = ball_sum(sum, coefficients[k]);
    }
    return sum;
}
