/* Calls about FMU states: snapshots of the instance, which carry the kind and the FMI state of its
 * component. Each function takes the number of the call it serves. */
#pragma once

#include "component.h"

/* Saves to a new snapshot if *handle is NULL, otherwise over that one. */
enum component_status fmi_snapshot_save(struct component *component, unsigned call, void **handle);

/* Restores the component, also its FMI state. The saved state stays valid. */
enum component_status fmi_snapshot_restore(struct component *component, unsigned call,
                                           void *handle);

/* Frees *handle and sets it to NULL; NULL and a pointer to NULL are allowed. */
enum component_status fmi_snapshot_free(struct component *component, unsigned call, void **handle);

enum component_status fmi_snapshot_size(struct component *component, unsigned call, void *handle,
                                        size_t *size);

enum component_status fmi_snapshot_serialize(struct component *component, unsigned call,
                                             void *handle, unsigned char bytes[], size_t size);

/* Makes a new snapshot from bytes. */
enum component_status fmi_snapshot_deserialize(struct component *component, unsigned call,
                                               const unsigned char bytes[], size_t size,
                                               void **handle);
