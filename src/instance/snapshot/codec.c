#include "codec.h"

#include <limits.h>
#include <stdint.h>
#include <string.h>

static const char magic[8] = {'C', 'O', 'S', 'I', 'M', 'S', 'T', 'A'};
enum { FORMAT_VERSION = 2, HASH_SIZE = 8 };

struct codec codec_counting(void) {
    return (struct codec){.mode = CODEC_COUNTING};
}

struct codec codec_writing(unsigned char *to, size_t size) {
    return (struct codec){.mode = CODEC_WRITING, .to = to, .size = size};
}

struct codec codec_reading(const unsigned char *from, size_t size) {
    return (struct codec){.mode = CODEC_READING, .from = from, .size = size};
}

/* ---- Bytes ---------------------------------------------------------------------------------- */

static void transfer_bytes(struct codec *codec, void *bytes, size_t count) {
    if (codec->mode != CODEC_COUNTING && count > codec->size - codec->at) {
        codec->is_cut_off = true;
        return;
    }
    if (codec->mode == CODEC_WRITING) {
        memcpy(codec->to + codec->at, bytes, count);
    } else if (codec->mode == CODEC_READING) {
        memcpy(bytes, codec->from + codec->at, count);
    }
    codec->at += count;
}

static void transfer_number(struct codec *codec, uint64_t *number, size_t byte_count) {
    unsigned char bytes[8] = {0};
    for (size_t i = 0; i < byte_count; i++) {
        bytes[i] = (unsigned char)(*number >> (8 * i));
    }
    transfer_bytes(codec, bytes, byte_count);
    *number = 0;
    for (size_t i = 0; i < byte_count; i++) {
        *number |= (uint64_t)bytes[i] << (8 * i);
    }
}

/* FNV-1a, 64 bit: G. Fowler, L. C. Noll, K.-P. Vo. Any change of one byte changes it. */
static uint64_t hash(const unsigned char *bytes, size_t count) {
    uint64_t value = 0xcbf29ce484222325u;
    for (size_t i = 0; i < count; i++) {
        value = (value ^ bytes[i]) * 0x100000001b3u;
    }
    return value;
}

/* ---- Around the fields ---------------------------------------------------------------------- */

void codec_begin(struct codec *codec, const char *guid) {
    unsigned char start[sizeof magic];
    memcpy(start, magic, sizeof magic);
    uint64_t version = FORMAT_VERSION;
    uint64_t length = codec->size;
    uint64_t guid_length = strlen(guid);
    transfer_bytes(codec, start, sizeof start);
    transfer_number(codec, &version, 4);
    transfer_number(codec, &length, 4);
    transfer_number(codec, &guid_length, 4);
    for (; *guid != '\0'; guid++) {
        unsigned char c = (unsigned char)*guid;
        transfer_bytes(codec, &c, 1);
    }
}

void codec_end(struct codec *codec) {
    uint64_t value = codec->mode == CODEC_WRITING ? hash(codec->to, codec->at) : 0;
    transfer_number(codec, &value, HASH_SIZE);
}

const char *codec_check(struct codec *codec, const char *guid, size_t length) {
    unsigned char start[sizeof magic] = {0};
    uint64_t version = 0;
    uint64_t stated_length = 0;
    uint64_t guid_length = 0;
    transfer_bytes(codec, start, sizeof start);
    transfer_number(codec, &version, 4);
    transfer_number(codec, &stated_length, 4);
    transfer_number(codec, &guid_length, 4);
    if (codec->is_cut_off) {
        return "it is cut off";
    }
    if (memcmp(start, magic, sizeof magic) != 0) {
        return "it is not a saved state of such a model";
    }
    if (version != FORMAT_VERSION) {
        return "it has another version of the format, 2 is expected";
    }
    const size_t guid_size = strlen(guid);
    if (guid_length != guid_size || codec->size - codec->at < guid_size ||
        memcmp(codec->from + codec->at, guid, guid_size) != 0) {
        return "its GUID belongs to another model";
    }
    if (stated_length != codec->size || codec->size != length) {
        return "it has the wrong length";
    }

    struct codec end = *codec;
    uint64_t stated_hash = 0;
    end.at = codec->size - HASH_SIZE;
    transfer_number(&end, &stated_hash, HASH_SIZE);
    if (stated_hash != hash(codec->from, codec->size - HASH_SIZE)) {
        return "it is damaged, its checksum does not fit";
    }
    codec->at += guid_size;
    return NULL;
}

/* ---- Fields --------------------------------------------------------------------------------- */

void codec_real(struct codec *codec, double *value) {
    uint64_t bits;
    memcpy(&bits, value, sizeof bits);
    transfer_number(codec, &bits, 8);
    memcpy(value, &bits, sizeof bits);
}

/* Two's complement. */
void codec_int64(struct codec *codec, int64_t *value) {
    uint64_t bits = (uint64_t)*value;
    transfer_number(codec, &bits, 8);
    memcpy(value, &bits, sizeof bits);
}

/* A value outside the bounds leaves the old one and is noted. */
static int64_t transfer_integer(struct codec *codec, const char *name, int64_t value,
                                int64_t smallest, int64_t largest) {
    int64_t read = value;
    codec_int64(codec, &read);
    if (read < smallest || read > largest) {
        codec->bad_field = codec->bad_field != NULL ? codec->bad_field : name;
        return value;
    }
    return read;
}

void codec_int(struct codec *codec, const char *name, int *value) {
    *value = (int)transfer_integer(codec, name, *value, INT_MIN, INT_MAX);
}

void codec_unsigned(struct codec *codec, const char *name, unsigned *value) {
    *value = (unsigned)transfer_integer(codec, name, *value, 0, UINT_MAX);
}

void codec_bool(struct codec *codec, const char *name, bool *value) {
    *value = transfer_integer(codec, name, *value, 0, 1) != 0;
}
