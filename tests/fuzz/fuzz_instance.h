/* An instance under fuzzing, with what holds for every call of every target. Its functions are
 * those of FMI 2.0, or stand for those of FMI 3.0: fmu_version.h. */
#ifndef FUZZ_INSTANCE_H
#define FUZZ_INSTANCE_H

#include "fmu_version.h"
#include "fuzz.h"
#include "model_description.h"

extern struct fmu_functions fuzz_fmu;

/* What instances for Co-Simulation may have besides in FMI 3.0. */
enum fuzz_variety {
    FUZZ_EVENT_MODE = 1 << 0, /* then saved states are of another kind */
    FUZZ_EARLY_RETURN = 1 << 1,
    FUZZ_UPDATES = 1 << 2, /* intermediate ones */
    FUZZ_VARIETIES = 1 << 3
};

/* Called before an instance is made, and with 0 after it. NULL: there are no varieties. */
extern void (*fuzz_choose_variety)(unsigned variety);

struct fuzz_instance {
    fmi2Component component;
    fmi2Type kind;
    unsigned variety; /* bits of enum fuzz_variety */
    bool has_logger;
    bool tells_refusals; /* errors and discards must come with a text */
    bool in_error;       /* since an fmi2Error (section 4.2.4) */
    double time;         /* s: where it is, by the calls so far */
    double slope;        /* of all inputs in steps of FMI 3.0 with updates; 0: they are held */
    unsigned told[fmi2Pending + 1]; /* texts by status since the last fuzz_check */
    char text[256];                 /* the last one */
};

/* NULL and false where has_logger is false: logging_on then means nothing. Freed by
 * fuzz_instance_free. */
struct fuzz_instance *fuzz_instance_create(fmi2Type kind, unsigned variety, bool has_logger,
                                           bool logging_on);
void fuzz_instance_free(struct fuzz_instance *instance);

/* What holds for the status of every call: OK, Discard or Error; a text with the latter two; in
 * the error state Error from all but what the standard allows there. Returns the status. */
fmi2Status fuzz_check(struct fuzz_instance *instance, enum fmu_function function,
                      fmi2Status status);

/* The same for any function, by its name. */
fmi2Status fuzz_check_call(struct fuzz_instance *instance, const char *name, bool works_in_error,
                           fmi2Status status);

#define FUZZ_CHECKED(instance, name, ...)                                                          \
    fuzz_check(instance, FMU_##name, FUZZ_CALL(fuzz_fmu.name((instance)->component, __VA_ARGS__)))
#define FUZZ_CHECKED_PLAIN(instance, name)                                                         \
    fuzz_check(instance, FMU_##name, FUZZ_CALL(fuzz_fmu.name((instance)->component)))

/* Fails unless the status is fmi2OK. */
void fuzz_require(fmi2Status status, const struct fuzz_instance *instance, const char *what);

/* A state of the instance, which goes back to it, also after an error; it is of this time (s). */
fmi2FMUstate fuzz_save(struct fuzz_instance *instance);
void fuzz_restore(struct fuzz_instance *instance, fmi2FMUstate state, double time);
void fuzz_forget(struct fuzz_instance *instance, fmi2FMUstate *state);

/* fmi2Reset. */
void fuzz_reset(struct fuzz_instance *instance);

/* Limits max_internal_steps, if the model has it, of an instance that was just made or reset. */
void fuzz_limit_steps(struct fuzz_instance *instance, fmi2Integer limit);

/* ---- Saved states as bytes, and forged ones ---------------------------------------------------
 */

struct fuzz_bytes {
    size_t size;
    fmi2Byte data[8192]; /* twice as many as any state has */
};

/* A state of the instance, or the instance as it is now. */
void fuzz_serialize_state(struct fuzz_instance *instance, fmi2FMUstate state,
                          struct fuzz_bytes *bytes);
void fuzz_serialize(struct fuzz_instance *instance, struct fuzz_bytes *bytes);

bool fuzz_are_same_bytes(const struct fuzz_bytes *one, const struct fuzz_bytes *other);

/* Changes one to three fields, and repairs the checksum. */
void fuzz_forge(struct fuzz_input *input, struct fuzz_bytes *bytes);

/* ---- Values ---------------------------------------------------------------------------------- */

enum { FUZZ_VARIABLE_CAPACITY = 160, FUZZ_STATE_CAPACITY = 8 };

/* NULL where the model has no variable of this name. */
const struct variable *fuzz_find(const char *name);

/* Continuous states of the model. */
size_t fuzz_state_count(void);

/* All variables, in the order of the table; what is not of the type, or cannot be computed,
 * is 0. */
struct fuzz_values {
    double reals[FUZZ_VARIABLE_CAPACITY];
    fmi2Integer integers[FUZZ_VARIABLE_CAPACITY];
    fmi2Status status; /* OK or Discard */
};

/* Reads all variables; a value that is not finite is a finding. */
void fuzz_read(struct fuzz_instance *instance, struct fuzz_values *values);

/* The value of a Real variable. */
double fuzz_value(const struct fuzz_values *values, fmi2ValueReference reference);

/* Same bits, or a finding that names the variable. */
void fuzz_assert_same(const struct fuzz_values *expected, const struct fuzz_values *actual,
                      const char *what);

/* Finite values, if the status is OK; nothing written otherwise (values were poisoned). */
void fuzz_assert_written(fmi2Status status, const double values[], size_t count, const char *what);

#endif
