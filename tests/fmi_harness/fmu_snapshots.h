/* FMU states (section 2.1.8), by functions that fail the test where the FMU does. */
#ifndef FMU_SNAPSHOTS_H
#define FMU_SNAPSHOTS_H

#include "fmu_harness.h"

/* A new handle with the state of the component. */
fmi2FMUstate fmu_save(fmi2Component component);
void fmu_restore(fmi2Component component, fmi2FMUstate state);
void fmu_forget(fmi2Component component, fmi2FMUstate *state);

/* A serialized state; fmu_bytes_free frees it. */
struct fmu_bytes {
    fmi2Byte *data;
    size_t size;
};
struct fmu_bytes fmu_serialize(fmi2Component component, fmi2FMUstate state);
fmi2FMUstate fmu_deserialize(fmi2Component component, const struct fmu_bytes *bytes);
void fmu_bytes_free(struct fmu_bytes *bytes);

/* The first size bytes, zeros after their end, in memory of exactly this size: a sanitizer sees
 * what is read beyond. */
struct fmu_bytes fmu_bytes_copy(const struct fmu_bytes *bytes, size_t size);

void fmu_assert_same_bytes(const struct fmu_bytes *expected, const struct fmu_bytes *actual,
                           const char *message);

/* The present state of the component, serialized. */
struct fmu_bytes fmu_save_bytes(fmi2Component component);
void fmu_restore_bytes(fmi2Component component, const struct fmu_bytes *bytes);

/* ---- An instance to save -------------------------------------------------------------------- */

/* Between steps, everything set that can be. */
fmi2Component fmu_used(fmi2Integer method, struct fmu_log *log);

/* One step from there; values are those after it. */
void fmu_used_step(fmi2Component component, struct fmu_values *values);

#endif
