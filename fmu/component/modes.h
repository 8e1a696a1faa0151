/* How a component goes from one FMI state to the next, the same in all versions of FMI. Each
 * function takes the number of the call it serves. */
#ifndef MODES_H
#define MODES_H

#include "component.h"
#include "continuous_states.h"

enum component_status mode_setup_experiment(struct component *component, unsigned call,
                                            const struct instance_experiment *experiment);

/* experiment: NULL where it was set up before. */
enum component_status mode_enter_initialization(struct component *component, unsigned call,
                                                const struct instance_experiment *experiment);

/* Into event mode; into step mode if the importer does not handle events. */
enum component_status mode_exit_initialization(struct component *component, unsigned call);

enum component_status mode_enter_event(struct component *component, unsigned call);
enum component_status mode_enter_continuous_time(struct component *component, unsigned call);
enum component_status mode_update_discrete_states(struct component *component,
                                                  struct discrete_update *update);
enum component_status mode_enter_step(struct component *component, unsigned call);
enum component_status mode_terminate(struct component *component, unsigned call);

/* As after instantiation. */
enum component_status mode_reset(struct component *component, unsigned call);

#endif
