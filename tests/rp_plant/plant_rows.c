/* Reads rows of doubles from standard input, in the order of struct row, and writes a row of
 * doubles for each to standard output, in the order of struct results. */
#include "rp_plant_model.h"

#include <stddef.h>
#include <stdio.h>
#include <string.h>

/* Parameters up to stop_damping, inputs, states, and as doubles: payload_attached, modes, stops. */
struct row {
    double parameters[32];
    double inputs[5];
    double q[2];
    double dq[2];
    double attached;
    double joint[2];
    double contact[2];
    double stops[2];
};

struct results {
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

static struct results evaluate(const struct row *row) {
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
    (void)rp_plant_model.outputs(&v, 0.0);

    const struct rp_joint_loads *loads = &v.loads;
    return (struct results){
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

int main(void) {
    struct row row;
    size_t written = 1;
    while (written == 1 && fread(&row, sizeof row, 1, stdin) == 1) {
        const struct results results = evaluate(&row);
        written = fwrite(&results, sizeof results, 1, stdout);
    }
    return written == 1 && fflush(stdout) == 0 ? 0 : 1;
}
