/* plant_rows model|rest|series: reads rows of doubles from standard input, in the order of the
 * structures below, and writes a row of doubles for each to standard output. */
#include "rp_plant_model.h"
#include "rp_plant_rest.h"

#include <stddef.h>
#include <stdio.h>
#include <string.h>

/* Parameters up to stop_damping, inputs, states, and as doubles: payload_attached, modes, stops. */
struct model_row {
    double parameters[32];
    double inputs[5];
    double q[2];
    double dq[2];
    double attached;
    double joint[2];
    double contact[2];
    double stops[2];
};

struct model_results {
    double ddq[2];
    double ee_acceleration[2];
    double energies[2]; /* kinetic, potential */
    double D[3];        /* D11, D12, D22 */
    double coriolis[2];
    double gravity[2];
    double loads[6]; /* f1_x, f1_z, tau1_y, f2_x, f2_z, tau2_y */
    double friction[2];
    double stop_force[2];
};

_Static_assert(offsetof(struct rp_plant_parameters, stops) == sizeof(double[32]),
               "32 parameters are doubles and come first");

static struct rp_plant_values values_of(const struct model_row *row) {
    struct rp_plant_values v = {.payload_attached = row->attached != 0.0};
    memcpy(&v.parameters, row->parameters, sizeof row->parameters);
    memcpy(&v.inputs, row->inputs, sizeof row->inputs);
    memcpy(v.q, row->q, sizeof v.q);
    memcpy(v.dq, row->dq, sizeof v.dq);
    v.modes.payload = row->attached != 0.0 ? RP_PLANT_ATTACHED : RP_PLANT_RELEASED;
    for (int i = 0; i < 2; i++) {
        v.modes.joint[i] = (int)row->joint[i];
        v.modes.contact[i] = (int)row->contact[i];
        v.parameters.stops[i] = (int)row->stops[i];
    }
    return v;
}

static void evaluate_model(const void *row, void *results_pointer) {
    struct model_results *results = results_pointer;
    struct rp_plant_values v = values_of(row);
    (void)rp_plant_model.outputs(&v, 0.0);

    const struct rp_joint_loads *loads = &v.loads;
    *results = (struct model_results){
        .ddq = {v.ddq[0], v.ddq[1]},
        .ee_acceleration = {v.ee_acceleration[0], v.ee_acceleration[1]},
        .energies = {v.kinetic_energy, v.potential_energy},
        .D = {v.D[0][0], v.D[0][1], v.D[1][1]},
        .coriolis = {v.coriolis[0], v.coriolis[1]},
        .gravity = {v.gravity[0], v.gravity[1]},
        .loads = {loads->f1[0], loads->f1[2], loads->tau1[1], loads->f2[0], loads->f2[2],
                  loads->tau2[1]},
        .friction = {v.friction[0], v.friction[1]},
        .stop_force = {v.stop_force[0], v.stop_force[1]},
    };
}

struct rest_row {
    double D[3]; /* D11, D12, D22 */
    double forces[2];
    double breakaway[2];
    double at_rest[2];
    double closed[2];
};

struct rest_results {
    double pattern[2];
    double ddq[2];
    double reaction[2];
};

static void evaluate_rest(const void *row_pointer, void *results_pointer) {
    const struct rest_row *row = row_pointer;
    struct rest_results *results = results_pointer;
    const double *D = row->D;
    const struct rp_plant_rest rest = {
        .inertia = {.D = {{D[0], D[1]}, {D[1], D[2]}}, .determinant = D[0] * D[2] - D[1] * D[1]},
        .forces = {row->forces[0], row->forces[1]},
        .breakaway = {row->breakaway[0], row->breakaway[1]},
        .at_rest = {row->at_rest[0] != 0.0, row->at_rest[1] != 0.0},
        .closed = {(int)row->closed[0], (int)row->closed[1]},
    };
    struct rp_plant_outcome outcome;
    rp_plant_rest_decide(&rest, &outcome);
    *results = (struct rest_results){
        .pattern = {outcome.pattern[0], outcome.pattern[1]},
        .ddq = {outcome.ddq[0], outcome.ddq[1]},
        .reaction = {outcome.reaction[0], outcome.reaction[1]},
    };
}

enum { ORDERS = 13 };

struct series_row {
    struct model_row model;
    double unit;
    double inputs[5][SERIES_INPUT_LENGTH];
};

struct series_results {
    double states[4][ORDERS];
    double indicators[RP_PLANT_INDICATORS][ORDERS];
};

static void evaluate_series(const void *row_pointer, void *results_pointer) {
    static double rows[64][SERIES_LENGTH];
    const struct series_row *row = row_pointer;
    struct series_results *results = results_pointer;
    const struct rp_plant_values v = values_of(&row->model);
    const struct series *series = rp_plant_model.series;
    const struct series_origin origin = {
        .values = &v, .time_scale = row->unit, .inputs = row->inputs};
    for (int i = 0; i < 2; i++) {
        rows[i][0] = v.q[i];
        rows[2 + i][0] = v.dq[i];
    }
    (void)series->extend(&origin, 0, ORDERS - 1, rows);
    for (int i = 0; i < 4; i++) {
        memcpy(results->states[i], rows[i], sizeof results->states[i]);
    }
    for (int i = 0; i < RP_PLANT_INDICATORS; i++) {
        memcpy(results->indicators[i], rows[series->row_of_indicator[i]],
               sizeof results->indicators[i]);
    }
}

static const struct {
    const char *name;
    size_t row_size;
    size_t result_size;
    void (*evaluate)(const void *row, void *results);
} commands[] = {
    {"model", sizeof(struct model_row), sizeof(struct model_results), evaluate_model},
    {"rest", sizeof(struct rest_row), sizeof(struct rest_results), evaluate_rest},
    {"series", sizeof(struct series_row), sizeof(struct series_results), evaluate_series},
};

enum { MOST_BYTES = 1 << 16 }; // of a row, and of results

_Static_assert(sizeof(struct model_row) <= MOST_BYTES && sizeof(struct rest_row) <= MOST_BYTES &&
                   sizeof(struct series_row) <= MOST_BYTES &&
                   sizeof(struct model_results) <= MOST_BYTES &&
                   sizeof(struct rest_results) <= MOST_BYTES &&
                   sizeof(struct series_results) <= MOST_BYTES,
               "every row fits");

int main(int argc, char **argv) {
    static _Alignas(max_align_t) char row[MOST_BYTES];
    static _Alignas(max_align_t) char results[MOST_BYTES];
    for (size_t i = 0; argc == 2 && i < sizeof commands / sizeof commands[0]; i++) {
        if (strcmp(argv[1], commands[i].name) != 0) {
            continue;
        }
        size_t written = 1;
        while (written == 1 && fread(row, commands[i].row_size, 1, stdin) == 1) {
            commands[i].evaluate(row, results);
            written = fwrite(results, commands[i].result_size, 1, stdout);
        }
        return written == 1 && fflush(stdout) == 0 ? 0 : 1;
    }
    (void)fprintf(stderr, "usage: plant_rows model|rest|series\n");
    return 2;
}
