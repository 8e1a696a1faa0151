/* Calls that all versions of FMI share: modes, values, derivatives, continuous time and FMU states.
 * Each function takes the number of the call it serves. */
#pragma once

#include "component.h"
#include "continuous_states.h"
#include "values.h"

/* ---- Modes ---------------------------------------------------------------------------------- */

/* How a component changes from one FMI state to the next. */

enum component_status mode_setup_experiment(struct component *component, unsigned call,
                                            const struct instance_experiment *experiment);

/* Enters initialization mode. experiment: NULL if it was set up before. */
enum component_status mode_enter_initialization(struct component *component, unsigned call,
                                                const struct instance_experiment *experiment);

/* Exits into event mode, or into step mode if the importer does not handle events. */
enum component_status mode_exit_initialization(struct component *component, unsigned call);

enum component_status mode_enter_event(struct component *component, unsigned call);
enum component_status mode_enter_continuous_time(struct component *component, unsigned call);
enum component_status mode_update_discrete_states(struct component *component,
                                                  struct discrete_update *update);
enum component_status mode_enter_step(struct component *component, unsigned call);
enum component_status mode_terminate(struct component *component, unsigned call);

/* Resets the component to its state after instantiation. */
enum component_status mode_reset(struct component *component, unsigned call);

/* ---- Values --------------------------------------------------------------------------------- */

/* For each type of value: access_get_real, access_set_real and so on. */
#define ACCESS(name, constant, element)                                                            \
    enum component_status access_get_##name(struct component *component, unsigned call,            \
                                            const unsigned references[], size_t count,             \
                                            element values[]);                                     \
    enum component_status access_set_##name(struct component *component, unsigned call,            \
                                            const unsigned references[], size_t count,             \
                                            const element values[]);
VALUE_TYPE_LIST(ACCESS)
#undef ACCESS

/* Accesses a type that no variable has: succeeds only if no value is asked for. */
enum component_status access_none(struct component *component, unsigned call, const char *type,
                                  const unsigned references[], size_t count, const void *values);

/* ---- Derivatives ---------------------------------------------------------------------------- */

enum component_status access_set_input_derivatives(struct component *component, unsigned call,
                                                   const unsigned references[], size_t count,
                                                   const int orders[], const double values[]);
enum component_status access_get_output_derivatives(struct component *component, unsigned call,
                                                    const unsigned references[], size_t count,
                                                    const int orders[], double values[]);

/* Writes J seed, one value per unknown. J: derivatives of unknowns with respect to knowns. */
enum component_status access_get_directional_derivative(struct component *component, unsigned call,
                                                        const unsigned unknowns[],
                                                        size_t unknown_count,
                                                        const unsigned knowns[], size_t known_count,
                                                        const double seed[], double result[]);

/* Writes seed^T J, one value per known. */
enum component_status access_get_adjoint_derivative(struct component *component, unsigned call,
                                                    const unsigned unknowns[], size_t unknown_count,
                                                    const unsigned knowns[], size_t known_count,
                                                    const double seed[], double result[]);

/* ---- Time and continuous states ------------------------------------------------------------- */

enum component_status continuous_set_time(struct component *component, unsigned call, double time);

enum component_status continuous_set_states(struct component *component, unsigned call,
                                            const double x[], size_t count);
enum component_status continuous_get_states(struct component *component, unsigned call, double x[],
                                            size_t count);
enum component_status continuous_get_derivatives(struct component *component, unsigned call,
                                                 double dx[], size_t count);
enum component_status continuous_get_nominals(struct component *component, unsigned call,
                                              double nominals[], size_t count);

/* Reads the variables that are the event indicators. */
enum component_status continuous_get_indicators(struct component *component, unsigned call,
                                                double indicators[], size_t count);

/* Ends a step of the integrator and writes whether event mode is needed. enters, terminates: the
 * caller's pointers for its answers. */
enum component_status continuous_complete_step(struct component *component, unsigned call,
                                               const void *enters, const void *terminates,
                                               bool *is_event);

/* ---- FMU state ------------------------------------------------------------------------------
 * A snapshot of the instance, which carries the kind and the FMI state of its component. */

/* Saves to a new FMU state if *fmu_state is NULL, otherwise over that one. */
enum component_status fmu_state_save(struct component *component, unsigned call, void **fmu_state);

/* Restores the component, also its FMI state. The saved state stays valid. */
enum component_status fmu_state_restore(struct component *component, unsigned call,
                                        void *fmu_state);

/* Frees *fmu_state and sets it to NULL; NULL and a pointer to NULL are allowed. */
enum component_status fmu_state_free(struct component *component, unsigned call, void **fmu_state);

enum component_status fmu_state_size(struct component *component, unsigned call, void *fmu_state,
                                     size_t *size);

enum component_status fmu_state_serialize(struct component *component, unsigned call,
                                          void *fmu_state, unsigned char bytes[], size_t size);

/* Makes a new FMU state from bytes. */
enum component_status fmu_state_deserialize(struct component *component, unsigned call,
                                            const unsigned char bytes[], size_t size,
                                            void **fmu_state);
