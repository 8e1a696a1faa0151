/* Stands in for libFuzzer where the compiler has none: runs each file named, and each file of each
 * archive (.tar) named, once. */
#include "fuzz.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// A tar archive: for each file a block with its name, size and kind, then its bytes in whole
// blocks.
enum { BLOCK = 512, SIZE_AT = 124, SIZE_DIGITS = 11, KIND_AT = 156 };
static const char file_kind = '0';

static unsigned long file_count;

static void replay_input(const char *name, const uint8_t *bytes, size_t size) {
    // an exact copy, so that a sanitizer sees what is read past its end
    uint8_t *input = malloc(size > 0 ? size : 1);
    if (input != NULL) {
        memcpy(input, bytes, size);
        fprintf(stderr, "%s\n", name);
        LLVMFuzzerTestOneInput(input, size);
        file_count++;
    }
    free(input);
}

static bool replay_archive(const char *path, const uint8_t *bytes, size_t size) {
    for (size_t at = 0; size - at >= BLOCK;) {
        const char *header = (const char *)&bytes[at];
        if (header[0] == '\0') {
            return true; // an empty block is its end
        }
        char digits[SIZE_DIGITS + 1] = {0};
        memcpy(digits, header + SIZE_AT, SIZE_DIGITS);
        const size_t length = strtoul(digits, NULL, 8);
        const size_t blocks = BLOCK + (length + BLOCK - 1) / BLOCK * BLOCK;
        if (blocks > size - at) {
            break;
        }
        if (header[KIND_AT] == file_kind) {
            replay_input(header, &bytes[at + BLOCK], length);
        }
        at += blocks;
    }
    fprintf(stderr, "%s: is cut off, or no archive\n", path);
    return false;
}

/* Content of a file, to be freed; NULL if it cannot be read. */
static uint8_t *read_file(const char *path, size_t *size) {
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        return NULL;
    }
    uint8_t *bytes = NULL;
    if (fseek(file, 0, SEEK_END) == 0) {
        const long end = ftell(file);
        bytes = end < 0 ? NULL : malloc((size_t)end + 1);
        rewind(file);
        *size = bytes == NULL ? 0 : fread(bytes, 1, (size_t)end, file);
    }
    fclose(file);
    return bytes;
}

static bool replay(const char *path) {
    size_t size = 0;
    uint8_t *bytes = read_file(path, &size);
    if (bytes == NULL) {
        perror(path);
        return false;
    }
    const char *ending = strrchr(path, '.');
    bool done = true;
    if (ending != NULL && strcmp(ending, ".tar") == 0) {
        done = replay_archive(path, bytes, size);
    } else {
        replay_input(path, bytes, size);
    }
    free(bytes);
    return done;
}

int main(int argc, char **argv) {
    bool done = LLVMFuzzerInitialize(&argc, &argv) == 0;
    for (int i = 1; i < argc; i++) {
        done = replay(argv[i]) && done;
    }
    if (file_count == 0) {
        fprintf(stderr, "usage: %s FILE_OR_ARCHIVE...; no input was found\n", argv[0]);
        return EXIT_FAILURE;
    }
    return done ? EXIT_SUCCESS : EXIT_FAILURE;
}
