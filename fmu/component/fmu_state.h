/* FMU states as all versions of FMI have them: a snapshot of the instance, which carries the kind
 * and the FMI state of its component. Each function takes the number of the call it serves. */
#ifndef FMU_STATE_H
#define FMU_STATE_H

#include "component.h"

/* *fmu_state NULL: a new one; otherwise that one is overwritten. */
enum component_status fmu_state_save(struct component *component, unsigned call, void **fmu_state);

/* The saved state stays valid. The component is then in the FMI state that was saved. */
enum component_status fmu_state_restore(struct component *component, unsigned call,
                                        void *fmu_state);

/* NULL and a pointer to NULL are allowed; *fmu_state becomes NULL. */
enum component_status fmu_state_free(struct component *component, unsigned call, void **fmu_state);

enum component_status fmu_state_size(struct component *component, unsigned call, void *fmu_state,
                                     size_t *size);

enum component_status fmu_state_serialize(struct component *component, unsigned call,
                                          void *fmu_state, unsigned char bytes[], size_t size);

/* *fmu_state becomes a new one. */
enum component_status fmu_state_deserialize(struct component *component, unsigned call,
                                            const unsigned char bytes[], size_t size,
                                            void **fmu_state);

#endif
