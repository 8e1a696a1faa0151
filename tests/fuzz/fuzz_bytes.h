/* Serialized states, and forged ones. */
#ifndef FUZZ_BYTES_H
#define FUZZ_BYTES_H

#include "fuzz_instance.h"

struct fuzz_bytes {
    size_t size;
    fmi2Byte data[4096];
};

/* The instance as it is now. */
void fuzz_serialize(struct fuzz_instance *instance, struct fuzz_bytes *bytes);

/* Changes one to three fields, and repairs the checksum. */
void fuzz_forge(struct fuzz_input *input, struct fuzz_bytes *bytes);

#endif
