/* What a snapshot is made of, for the files that save and serialize it. */
#ifndef INSTANCE_SNAPSHOT_CONTENTS_H
#define INSTANCE_SNAPSHOT_CONTENTS_H

#include "internals.h"
#include "snapshot.h"

#include <stddef.h>

struct instance_snapshot {
    struct instance_snapshot *newer;
    struct instance_snapshot *older;
    unsigned tag;
    bool history_is_lost; /* of instance_keep, as the next one */
    bool inputs_are_held;
    struct instance_state state;
    max_align_t memory[]; /* copy of instance_memory.block */
};

/* STATUS_OK if the snapshot belongs to the instance; otherwise a message says so. */
MUST_CHECK NONNULL enum status instance_check_own(const struct instance *instance,
                                                  const struct instance_snapshot *snapshot);

/* Keeps the instance in a snapshot of it, which is then for instance_undo only. As instance_save,
 * but quick enough to be done in each step: what costs more is left to instance_undo. */
NONNULL void instance_keep(struct instance *instance, struct instance_snapshot *snapshot);

/* Back to where instance_keep was called; since then at most one step was done. */
MUST_CHECK NONNULL enum status instance_undo(struct instance *instance,
                                             const struct instance_snapshot *snapshot);

#endif
