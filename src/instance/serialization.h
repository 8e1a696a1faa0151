/* Snapshots as bytes, which restore in any instance of the same model, also in another process and
 * on another platform. All numbers are little-endian, reals as IEEE 754 double:
 *
 *     8 bytes      "COSIMSTA"
 *     u32          version of the format, 2
 *     u32          length of the whole in bytes
 *     u32, bytes   length of the GUID, GUID
 *     8 bytes each fields, in the order of transfer_state() in serialization.c
 *     u64          FNV-1a hash of all bytes before it */
#pragma once

#include "snapshot.h"

/* Returns the number of bytes that instance_serialize writes. */
NONNULL size_t instance_serialized_size(const struct instance *instance);

/* Writes the snapshot to bytes; size must be at least instance_serialized_size. */
MUST_CHECK NONNULL enum status instance_serialize(struct instance *instance,
                                                  struct instance_snapshot *snapshot,
                                                  unsigned char bytes[], size_t size);

/* Makes a new snapshot from bytes that instance_serialize of any instance of the same model wrote.
 * Bytes that are damaged, foreign or impossible are refused with STATUS_INVALID_ARGUMENT and a
 * message. */
MUST_CHECK NONNULL enum status instance_deserialize(struct instance *instance,
                                                    const unsigned char bytes[], size_t size,
                                                    struct instance_snapshot **snapshot);
