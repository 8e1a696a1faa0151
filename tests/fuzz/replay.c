/* Stands in for libFuzzer where the compiler has none: runs each file of a folder once. */
#include "fuzz.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool replay_file(const char *path) {
    uint8_t content[4096];
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        perror(path);
        return false;
    }
    const size_t size = fread(content, 1, sizeof content, file);
    fclose(file);
    // an exact copy, so that a sanitizer sees what is read past its end
    uint8_t *input = malloc(size > 0 ? size : 1);
    if (input != NULL) {
        memcpy(input, content, size);
        fprintf(stderr, "%s\n", path);
        LLVMFuzzerTestOneInput(input, size);
    }
    free(input);
    return input != NULL && size > 0;
}

static int is_visible(const struct dirent *entry) {
    return entry->d_name[0] != '.';
}

int main(int argc, char **argv) {
    struct dirent **entries = NULL;
    bool done = LLVMFuzzerInitialize(&argc, &argv) == 0;
    const int count = argc == 2 ? scandir(argv[1], &entries, is_visible, alphasort) : 0;
    if (count <= 0) {
        fprintf(stderr, "usage: %s FOLDER; no input was found\n", argv[0]);
        return EXIT_FAILURE;
    }
    for (int i = 0; i < count; i++) {
        char path[4096];
        snprintf(path, sizeof path, "%s/%s", argv[1], entries[i]->d_name);
        done = replay_file(path) && done;
        free(entries[i]);
    }
    free(entries);
    return done ? EXIT_SUCCESS : EXIT_FAILURE;
}
