/* How an input is read, how a finding ends the program, and the
 * figures of a run. README.md says what each target checks. */
#ifndef FUZZ_H
#define FUZZ_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The entry points that libFuzzer, or replay.c in its place, calls. */
int LLVMFuzzerInitialize(int *argc, char ***argv);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* One execution. */
struct fuzz_input;
void fuzz_target_run(struct fuzz_input *input);

/* ---- Findings and figures -------------------------------------------------------------------- */

/* Says what was violated, prints the figures and aborts: a finding. */
__attribute__((format(printf, 1, 2), noreturn)) void fuzz_fail(const char *format, ...);

extern unsigned long fuzz_call_count;
extern unsigned long fuzz_instance_count;

/* Evaluates a call of an FMI function and counts it. */
#define FUZZ_CALL(call) (fuzz_call_count++, (call))

#define FUZZ_COUNT(array) (sizeof(array) / sizeof(array)[0])

/* ---- Reading an input ------------------------------------------------------------------------ */

/* Every sequence of bytes is an input; past its end zeros are read. */
struct fuzz_input {
    const uint8_t *at;
    size_t left;
};

uint8_t fuzz_byte(struct fuzz_input *input);

/* One byte, modulo count <= 256. */
unsigned fuzz_below(struct fuzz_input *input, unsigned count);

/* Eight bytes, or as many as are left. */
uint64_t fuzz_word(struct fuzz_input *input);

/* Any double: small and special ones by one byte, any bits by nine. */
double fuzz_real(struct fuzz_input *input);

/* Mostly of the size of 1, else any double. */
double fuzz_likely_real(struct fuzz_input *input);

/* Any int, in the same way as a double. */
int fuzz_integer(struct fuzz_input *input);

/* low > 0 to high, evenly distributed over the logarithm: two bytes. */
double fuzz_magnitude(struct fuzz_input *input, double low, double high);

/* ---- Memory ---------------------------------------------------------------------------------- */

/* An array with nothing behind it that may be touched; NULL for none. Freed with free(). */
void *fuzz_array(size_t count, size_t size);

/* Fills memory with a value that no call writes, and checks that all of it is still there. */
void fuzz_poison(double values[], size_t count);
bool fuzz_is_poisoned(const double values[], size_t count);

#endif
