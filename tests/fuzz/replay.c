/* Stands in for libFuzzer where the compiler has none: runs each file named, and each file of each
 * folder named, once. */
#include "fuzz.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum { LARGEST_INPUT = 1 << 16 };

static unsigned long file_count;

static bool replay_file(const char *path) {
    FILE *file = fopen(path, "rb");
    uint8_t *bytes = malloc(LARGEST_INPUT);
    if (file == NULL || bytes == NULL) {
        perror(path);
        if (file != NULL) {
            fclose(file);
        }
        free(bytes);
        return false;
    }
    const size_t size = fread(bytes, 1, LARGEST_INPUT, file);
    fclose(file);
    // an exact copy, so that a sanitizer sees what is read past its end
    uint8_t *input = malloc(size > 0 ? size : 1);
    if (input != NULL) {
        memcpy(input, bytes, size);
        fprintf(stderr, "%s\n", path);
        LLVMFuzzerTestOneInput(input, size);
        file_count++;
    }
    free(input);
    free(bytes);
    return true;
}

static int by_name(const struct dirent **first, const struct dirent **second) {
    return strcmp((*first)->d_name, (*second)->d_name);
}

static int is_visible(const struct dirent *entry) {
    return entry->d_name[0] != '.';
}

static bool replay_folder(const char *path) {
    struct dirent **entries;
    const int count = scandir(path, &entries, is_visible, by_name);
    if (count < 0) {
        perror(path);
        return false;
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
        struct stat status;
        const bool is_folder = stat(argv[i], &status) == 0 && S_ISDIR(status.st_mode);
        done = (is_folder ? replay_folder(argv[i]) : replay_file(argv[i])) && done;
    }
    if (file_count == 0) {
        fprintf(stderr, "usage: %s FILE_OR_FOLDER...; no input was found\n", argv[0]);
        return EXIT_FAILURE;
    }
    return done ? EXIT_SUCCESS : EXIT_FAILURE;
}
