/* Snapshots of an instance: all that later results depend on.
 *
 * A restored instance gives the same bits as the saved one would have given. A snapshot is constant
 * in size and does not contain the integrator's own history, which follows from the last restart
 * and is replayed at the next step, if that step continues from it.
 *
 * A snapshot belongs to its instance, which frees it at its own end at the latest. Functions refuse
 * a snapshot of another instance with STATUS_INVALID_ARGUMENT and a message. */
#pragma once

#include "variables.h"

struct instance_snapshot;

/* Saves the instance into *snapshot: a new one if it is NULL, otherwise over that one. tag: a
 * number for the caller. */
MUST_CHECK NONNULL enum status instance_save(struct instance *instance, unsigned tag,
                                             struct instance_snapshot **snapshot);

/* Restores the instance. The snapshot stays valid. */
MUST_CHECK NONNULL enum status instance_restore(struct instance *instance,
                                                const struct instance_snapshot *snapshot);

/* Frees *snapshot and sets it to NULL. */
NONNULL enum status instance_forget(struct instance *instance, struct instance_snapshot **snapshot);

/* Reads the tag that the snapshot was saved with, and the phase of the instance then. */
MUST_CHECK NONNULL enum status instance_snapshot_tag(const struct instance *instance,
                                                     const struct instance_snapshot *snapshot,
                                                     unsigned *tag, enum phase *phase);

/* ---- Within the library --------------------------------------------------------------------- */

/* Returns STATUS_OK if the snapshot belongs to the instance; otherwise a message says so. */
MUST_CHECK NONNULL enum status instance_check_own(const struct instance *instance,
                                                  const struct instance_snapshot *snapshot);

/* Saves all that one step can change, for instance_undo. Cheaper than instance_save: every step may
 * call it. */
NONNULL void instance_keep(struct instance *instance, struct instance_snapshot *snapshot);

/* Restores the instance as it was when instance_keep was called, at most one step ago. */
MUST_CHECK NONNULL enum status instance_undo(struct instance *instance,
                                             const struct instance_snapshot *snapshot);
