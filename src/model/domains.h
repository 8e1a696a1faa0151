/* Values beyond an event, for models that are made from their equations (fmu/compiler).
 *
 * Within a step modes stay the same, and the right-hand side is smooth: a trial state, or the end
 * of a step in which an event will be located, may be beyond the event. Values that are not finite
 * there are evaluated in the modes that follow from the states: sqrt(h) if h > 0 else 0 is 0 for h
 * < 0. */
#pragma once

#include "model.h"
#include "relations.h"

/* A model without this treatment of values that are not finite, and the places of its values. */
struct domains {
    size_t values_size;
    struct range states;
    struct range inputs;
    struct range calculated; /* double[]: all calculated fields except the indicators */
    struct range indicators; /* double[] */
    struct range counts;     /* int[]: all calculated ints, if one may have no value */
    size_t modes;            /* offset of int[]: the mode of each relation */
    int relation_count;
    const struct relation *relation;
    const size_t *row_of_indicator;
    struct range anchors;
    void (*anchor)(const void *values, double t, const double x[], const double u[],
                   enum model_search search, double anchors[]); /* as in struct model */
    const size_t *solution; /* rows of the series with solutions of equations */
    size_t solution_count;
    size_t own_row; /* row of the series that is 1 in order 0 if it is not in the modes of its
                       values */
    void (*write_distances)(const void *values, double t, double distance[]);

    /* as in struct model, struct model_events and struct series */
    enum status (*right_hand_side)(const void *values, double t, const double x[], const double u[],
                                   double dx[]);
    enum status (*jacobian)(const void *values, double t, const double x[], const double u[],
                            double J[]);
    enum status (*write_indicators)(const void *values, double t, const double x[],
                                    const double u[], double z[]);
    enum status (*outputs)(void *values, double t);
    enum status (*derivatives)(const void *values, double t, double dt, void *first, void *second);
    enum status (*extend)(const struct series_origin *origin, int first, int last,
                          double row[][SERIES_LENGTH]);
};

/* Memory for one call: value structures, and doubles. */
struct domains_room {
    void *values, *first, *second;
    double *distance; /* one per relation */
    double *result;   /* one per state or indicator */
};

/* True if all calculated fields are finite. */
static inline bool domains_are_calculated(const struct domains *model, const void *values) {
    const char *begin = values;
    const int *counts = (const int *)(const void *)(begin + model->counts.offset);
    for (size_t i = 0; i < model->counts.size / sizeof *counts; i++) {
        if (counts[i] == MODEL_NO_INT) {
            return false;
        }
    }
    return relations_are_finite((const double *)(const void *)(begin + model->calculated.offset),
                                model->calculated.size / sizeof(double)) &&
           relations_are_finite((const double *)(const void *)(begin + model->indicators.offset),
                                model->indicators.size / sizeof(double));
}

/* True if the states' coefficients of order 1 and all solutions are finite, in a series from order
 * 0 to last. */
static inline bool domains_has_begun(const struct domains *model, int last,
                                     double row[][SERIES_LENGTH]) {
    double sum = 0.0;
    for (size_t i = 0; last > 0 && i < model->states.size / sizeof(double); i++) {
        sum += 0.0 * row[i][1];
    }
    for (size_t i = 0; i < model->solution_count; i++) {
        sum += 0.0 * row[model->solution[i]][0];
    }
    return sum == 0.0;
}

/* Each of these completes the results of the function of its name, if some are not finite. */
enum status domains_right_hand_side(const struct domains *model, struct domains_room room,
                                    const void *values, double t, const double x[],
                                    const double u[], double dx[]);
enum status domains_jacobian(const struct domains *model, struct domains_room room,
                             const void *values, double t, const double x[], const double u[],
                             double J[]);
enum status domains_indicators(const struct domains *model, struct domains_room room,
                               const void *values, double t, const double x[], const double u[],
                               double z[]);
enum status domains_outputs(const struct domains *model, struct domains_room room, void *values,
                            double t);
enum status domains_derivatives(const struct domains *model, struct domains_room room,
                                const void *values, double t, double dt, void *first, void *second);

/* Copies the values to room.values with the modes that follow from the states and inputs. Returns
 * false if these are the same. */
bool domains_follow(const struct domains *model, struct domains_room room, const void *values,
                    double t);

/* Extends a series from order 0 on, if domains_has_begun is false. */
enum status domains_extend(const struct domains *model, struct domains_room room,
                           const struct series_origin *origin, int first, int last,
                           double row[][SERIES_LENGTH]);
