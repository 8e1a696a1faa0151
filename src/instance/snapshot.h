/* Snapshots of an instance: all that later results depend on, in memory and as bytes.
 *
 * A restored instance gives the same bits as the one saved would have given. The integrator's own
 * history is not in a snapshot: it follows from the last restart and is replayed at the first step,
 * and only where that step goes on from it.
 *
 * Bytes, all numbers little-endian, reals as IEEE 754 double:
 *
 *     8 bytes      "COSIMSTA"
 *     u32          version of the format, 1
 *     u32          length of the whole in bytes
 *     u32, bytes   length of the GUID, GUID
 *     8 bytes each fields, in the order of transfer_state() in snapshot.c
 *     u64          FNV-1a hash of all bytes before it
 *
 * Functions return STATUS_INVALID_ARGUMENT with a text where a snapshot is not the instance's own
 * or bytes are not what is expected; the instance is then as it was. */
#ifndef SNAPSHOT_H
#define SNAPSHOT_H

#include "instance.h"

struct instance_snapshot;

/* Saves the instance into *snapshot: a new one where that is NULL, otherwise over that one. tag: a
 * number that the caller wants back. A snapshot is owned by its instance: instance_destroy frees
 * it.
 */
MUST_CHECK NONNULL enum status instance_save(struct instance *instance, unsigned tag,
                                             struct instance_snapshot **snapshot);

/* The snapshot stays valid. */
MUST_CHECK NONNULL enum status instance_restore(struct instance *instance,
                                                struct instance_snapshot *snapshot);

/* Frees *snapshot and sets it to NULL. */
NONNULL enum status instance_forget(struct instance *instance, struct instance_snapshot **snapshot);

/* The tag that the snapshot was saved with, and the phase the instance was in. */
MUST_CHECK NONNULL enum status instance_snapshot_tag(struct instance *instance,
                                                     struct instance_snapshot *snapshot,
                                                     unsigned *tag, enum phase *phase);

/* Bytes that instance_serialize writes. */
NONNULL size_t instance_serialized_size(const struct instance *instance);

/* bytes: size bytes, size at least instance_serialized_size. */
MUST_CHECK NONNULL enum status instance_serialize(struct instance *instance,
                                                  struct instance_snapshot *snapshot,
                                                  unsigned char bytes[], size_t size);

/* A new snapshot from what instance_serialize of any instance of the same model wrote. */
MUST_CHECK NONNULL enum status instance_deserialize(struct instance *instance,
                                                    const unsigned char bytes[], size_t size,
                                                    struct instance_snapshot **snapshot);

#endif
