/* Random valid parameters and states of RPPlant, and runs in Model Exchange. */
#ifndef FUZZ_PLANT_SETTINGS_H
#define FUZZ_PLANT_SETTINGS_H

#include "fuzz_instance.h"
#include "value_references.h"

/* 0, or of either sign. */
double fuzz_signed(struct fuzz_input *input, double low, double high);

/* Masses, inertias and lengths of the arm. */
void fuzz_plant_set_arm(struct fuzz_input *input, struct fuzz_instance *instance);

/* Parameters that have to fit each other are one group: friction of a joint, its stops, its drive,
 * the payload. Valid at any time. limits[joint]: where its lower and upper stop are from now on. */
enum { FUZZ_PLANT_GROUPS = 7 };
void fuzz_plant_set(struct fuzz_input *input, struct fuzz_instance *instance, unsigned group,
                    double limits[2][2]);

/* Within the stops, or on them. */
void fuzz_plant_set_states(struct fuzz_input *input, struct fuzz_instance *instance,
                           double limits[2][2]);

/* Euler steps with event indicators, event mode and saved states; from the end of initialization.
 */
void fuzz_plant_exchange(struct fuzz_input *input, struct fuzz_instance *instance);

#endif
