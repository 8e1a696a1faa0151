/* Reads, writes or counts the fields of a serialized state, by one sequence of calls for all three.
 * serialization.h has the format. */
#ifndef CODEC_H
#define CODEC_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct codec {
    enum { CODEC_COUNTING, CODEC_WRITING, CODEC_READING } mode;
    unsigned char *to;         /* CODEC_WRITING */
    const unsigned char *from; /* CODEC_READING */
    size_t size;               /* bytes available */
    size_t at;                 /* bytes done */
    bool is_cut_off;           /* there were too few bytes */
    const char *bad_field; /* first one read with a value that its type does not have; or NULL */
};

struct codec codec_counting(void);
struct codec codec_writing(unsigned char *to, size_t size);
struct codec codec_reading(const unsigned char *from, size_t size);

/* Counting and writing: what stands before the fields, and after them. */
void codec_begin(struct codec *codec, const char *guid);
void codec_end(struct codec *codec);

/* Reading: checks all but the fields and goes to the first of them. Returns NULL, or what is wrong.
 * length: bytes expected in all. */
const char *codec_check(struct codec *codec, const char *guid, size_t length);

/* Read, write or count one field, 8 bytes. If the value read is none of the type, *value stays and
 * the field is the bad one, unless there is one already. name: static text. */
void codec_real(struct codec *codec, double *value);
void codec_int64(struct codec *codec, int64_t *value);
void codec_int(struct codec *codec, const char *name, int *value);
void codec_unsigned(struct codec *codec, const char *name, unsigned *value);
void codec_bool(struct codec *codec, const char *name, bool *value);

#endif
