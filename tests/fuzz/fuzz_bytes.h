/* Saved states as bytes, and forged ones. */
#ifndef FUZZ_BYTES_H
#define FUZZ_BYTES_H

#include "fuzz_instance.h"

struct fuzz_bytes {
    size_t size;
    fmi2Byte data[8192]; /* twice as many as any state has */
};

/* A state of the instance, or the instance as it is now. */
void fuzz_serialize_state(struct fuzz_instance *instance, fmi2FMUstate state,
                          struct fuzz_bytes *bytes);
void fuzz_serialize(struct fuzz_instance *instance, struct fuzz_bytes *bytes);

bool fuzz_are_same_bytes(const struct fuzz_bytes *one, const struct fuzz_bytes *other);

/* Changes one to three fields, and repairs the checksum. */
void fuzz_forge(struct fuzz_input *input, struct fuzz_bytes *bytes);

#endif
