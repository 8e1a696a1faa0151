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

/* src/instance/serialization.h: magic, version, length and length of the GUID, the GUID,
 * fields of 8 bytes, FNV-1a of all that. */
enum { FUZZ_LENGTH_AT = 12, FUZZ_FIELD = 8 };
size_t fuzz_fields_begin(void);
void fuzz_write_number(fmi2Byte *to, uint64_t number, size_t size);
void fuzz_write_field(struct fuzz_bytes *bytes, size_t field,
                      uint64_t bits); /* modulo their number */
void fuzz_repair_checksum(struct fuzz_bytes *bytes);

/* Changes one to three fields, and repairs the checksum. */
void fuzz_forge(struct fuzz_input *input, struct fuzz_bytes *bytes);

#endif
