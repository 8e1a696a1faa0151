#include "fuzz.h"

#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- Findings and figures -------------------------------------------------------------------- */

unsigned long fuzz_call_count;
unsigned long fuzz_instance_count;
static const char *target_name;
static unsigned long execution_count;

static void print_figures(int findings) {
    printf("figures: %s; executions %lu; calls %lu; instances %lu; findings %d\n", target_name,
           execution_count, fuzz_call_count, fuzz_instance_count, findings);
    fflush(stdout);
}

static void print_final_figures(void) {
    print_figures(0);
}

void fuzz_fail(const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    fprintf(stderr, "%s: finding: ", target_name);
    vfprintf(stderr, format, arguments);
    fprintf(stderr, "\n");
    va_end(arguments);
    print_figures(1);
    abort();
}

int LLVMFuzzerInitialize(int *argc, char ***argv) {
    target_name = (*argv)[0];
    return atexit(print_final_figures);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct fuzz_input input = {.at = data, .left = size};
    execution_count++;
    fuzz_target_run(&input);
    return 0;
}

/* ---- Reading an input ------------------------------------------------------------------------ */

uint8_t fuzz_byte(struct fuzz_input *input) {
    if (input->left == 0) {
        return 0;
    }
    input->left--;
    return *input->at++;
}

unsigned fuzz_below(struct fuzz_input *input, unsigned count) {
    return fuzz_byte(input) % count;
}

uint64_t fuzz_word(struct fuzz_input *input) {
    uint64_t word = 0;
    for (int i = 0; i < 8; i++) {
        word |= (uint64_t)fuzz_byte(input) << (8 * i);
    }
    return word;
}

double fuzz_real(struct fuzz_input *input) {
    static const double special[] = {
        0.0,     1.0,         0.5,    1e-3,        1e-2,     0.1,     10.0, 1e3,  1e6,    1e9,
        1e12,    1e15,        1e100,  1e155,       1e200,    DBL_MAX, 1e-6, 1e-9, 1e-12,  1e-16,
        DBL_MIN, DBL_MIN / 2, 5e-324, DBL_EPSILON, INFINITY, NAN,     2.0,  3.0,  1e-100, 1e300,
    };
    const unsigned selector = fuzz_byte(input);
    if (selector < 2 * FUZZ_COUNT(special)) {
        return selector % 2 == 0 ? special[selector / 2] : -special[selector / 2];
    }
    if (selector < 192) {
        return ((int)selector - 128) / 16.0;
    }
    const uint64_t bits = fuzz_word(input);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

double fuzz_likely_real(struct fuzz_input *input) {
    const unsigned selector = fuzz_byte(input);
    return selector < 208 ? ((int)selector - 104) / 16.0 : fuzz_real(input);
}

int fuzz_integer(struct fuzz_input *input) {
    static const int special[] = {INT_MAX, INT_MIN, INT_MAX - 1, 1000, 100000, 65536, -1000};
    const unsigned selector = fuzz_byte(input);
    if (selector < FUZZ_COUNT(special)) {
        return special[selector];
    }
    return selector < 250 ? (int)selector - 32 : (int)(fuzz_word(input) & INT_MAX);
}

double fuzz_magnitude(struct fuzz_input *input, double low, double high) {
    const unsigned fraction = fuzz_byte(input) | (unsigned)fuzz_byte(input) << 8;
    return low * pow(high / low, fraction / 65535.0);
}

/* ---- Memory ---------------------------------------------------------------------------------- */

void *fuzz_array(size_t count, size_t size) {
    if (count == 0) {
        return NULL;
    }
    void *array = calloc(count, size);
    if (array == NULL) {
        fuzz_fail("no memory for %zu elements of %zu bytes", count, size);
    }
    return array;
}

static const uint64_t poison = 0x7ff8dead0badf00d; // a NaN that no arithmetic makes

void fuzz_poison(double values[], size_t count) {
    for (size_t i = 0; i < count; i++) {
        memcpy(&values[i], &poison, sizeof poison);
    }
}

bool fuzz_is_poisoned(const double values[], size_t count) {
    for (size_t i = 0; i < count; i++) {
        if (memcmp(&values[i], &poison, sizeof poison) != 0) {
            return false;
        }
    }
    return true;
}
