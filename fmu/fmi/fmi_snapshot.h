/* Calls about FMU states: snapshots of the instance, which carry the kind and the FMI state of its
 * fmi. Each function takes the number of the call it serves. */
#pragma once

#include "fmi_instance.h"

/* Saves to a new snapshot if *handle is NULL, otherwise over that one. */
enum fmi_status fmi_snapshot_save(struct fmi_instance *fmi, unsigned call, void **handle);

/* Restores the FMI instance, also its FMI state. The saved state stays valid. */
enum fmi_status fmi_snapshot_restore(struct fmi_instance *fmi, unsigned call, void *handle);

/* Frees *handle and sets it to NULL; NULL and a pointer to NULL are allowed. */
enum fmi_status fmi_snapshot_free(struct fmi_instance *fmi, unsigned call, void **handle);

enum fmi_status fmi_snapshot_size(struct fmi_instance *fmi, unsigned call, void *handle,
                                  size_t *size);

enum fmi_status fmi_snapshot_serialize(struct fmi_instance *fmi, unsigned call, void *handle,
                                       unsigned char bytes[], size_t size);

/* Makes a new snapshot from bytes. */
enum fmi_status fmi_snapshot_deserialize(struct fmi_instance *fmi, unsigned call,
                                         const unsigned char bytes[], size_t size, void **handle);
