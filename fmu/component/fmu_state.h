/* Calls about FMU states: snapshots of the instance, which carry the kind and the FMI state of its
 * component. Each function takes the number of the call it serves. */
#pragma once

#include "component.h"

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
