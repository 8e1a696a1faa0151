/* Stands in for libFuzzer where the compiler has none: runs each file named, and each file of each
 * folder named, once. */
#include "fuzz.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

static bool replay_file(const char *path) {
    size_t size = 0;
    uint8_t *bytes = read_file(path, &size);
    if (bytes == NULL) {
        perror(path);
        return false;
    }
    replay_input(path, bytes, size);
    free(bytes);
    return true;
}

static int is_visible(const struct dirent *entry) {
    return entry->d_name[0] != '.';
}

static bool replay(const char *path) {
    struct dirent **entries;
    const int count = scandir(path, &entries, is_visible, alphasort);
    if (count < 0) {
        return replay_file(path);
    }
    bool done = true;
    for (int i = 0; i < count; i++) {
        char file[4096];
        snprintf(file, sizeof file, "%s/%s", path, entries[i]->d_name);
        done = replay_file(file) && done;
        free(entries[i]);
    }
    free(entries);
    return done;
}

int main(int argc, char **argv) {
    bool done = LLVMFuzzerInitialize(&argc, &argv) == 0;
    for (int i = 1; i < argc; i++) {
        done = replay(argv[i]) && done;
    }
    if (file_count == 0) {
        fprintf(stderr, "usage: %s FILE_OR_FOLDER...; no input was found\n", argv[0]);
        return EXIT_FAILURE;
    }
    return done ? EXIT_SUCCESS : EXIT_FAILURE;
}
