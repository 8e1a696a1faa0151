/* Shared by the tests of the built FMU. They load it as an importer does, as a shared object with
 * the functions of the standard header, and link none of its code. FMI 2.0 is cited by section. */
#ifndef FMU_HARNESS_H
#define FMU_HARNESS_H

#include "fmu_version.h"
#include "value_references.h"

#define FMU_COUNT(array) (sizeof(array) / sizeof(array)[0])

/* ---- The loaded FMU ------------------------------------------------------------------------- */

extern struct fmu_functions fmu;

/* Text of modelDescription.xml. */
extern char *fmu_description;

struct fmu_variable {
    fmi2ValueReference reference;
    bool is_real; /* otherwise Integer */
};

/* All variables, in the order of modelDescription.xml. */
enum { FMU_VARIABLE_CAPACITY = 96 };
extern struct fmu_variable fmu_variables[FMU_VARIABLE_CAPACITY];
extern size_t fmu_variable_count;

/* Loads the FMU of this build; says what is missing and ends the program where it cannot be used.
 */
void fmu_load(void);

/* ---- Messages ------------------------------------------------------------------------------- */

/* Receives what the FMU logs; passed to it as the component environment. */
struct fmu_log {
    unsigned count[fmi2Pending + 1]; /* messages by status */
    struct {
        char name[32];
        unsigned count;
    } categories[16];
    char text[1024];        /* the last message */
    char texts[16384];      /* all messages, one a line, as far as they fit */
    char instance_name[64]; /* of the last message */
    unsigned malformed;     /* NULL or empty strings, a '%', a '#' that is not doubled */
};

/* Of the running test. */
extern struct fmu_log messages;

fmi2CallbackFunctions fmu_callbacks(struct fmu_log *log);
void fmu_log_clear(struct fmu_log *log);
unsigned fmu_log_count(const struct fmu_log *log, const char *category);
unsigned fmu_log_total(const struct fmu_log *log);

/* The status of a call; the messages are shown where it is another one. */
#define ASSERT_OK(call)      TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, call, messages.text)
#define ASSERT_DISCARD(call) TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2Discard, call, messages.text)
#define ASSERT_ERROR(call)   TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2Error, call, messages.text)

/* Fails the test unless one message contains text. */
void fmu_assert_logged(const struct fmu_log *log, const char *text);

/* ---- Instances ------------------------------------------------------------------------------ */

/* An instance named "manipulator"; fmu_tear_down frees it where the test did not. Tests that say
 * nothing about the kind are about Co-Simulation. */
fmi2Component fmu_instantiate_as(fmi2Type type, struct fmu_log *log, bool logging_on);
fmi2Component fmu_instantiate(struct fmu_log *log, bool logging_on);
void fmu_free(fmi2Component component);

/* Frees what is open and fails the test if a message was malformed. */
void fmu_tear_down(const struct fmu_log *log);

/* SetupExperiment, from start on (s), and EnterInitializationMode. */
void fmu_enter_initialization(fmi2Component component, double start);

/* SetupExperiment to ExitInitializationMode; tolerance 0: not defined. No stop time. */
void fmu_initialize(fmi2Component component, double start, double tolerance);

/* An instance between steps, at time start; with the default method or this one. */
fmi2Component fmu_initialized(struct fmu_log *log, double start);
fmi2Component fmu_initialized_with(fmi2Integer method, struct fmu_log *log, double start);

/* One Real; the test fails unless the status is fmi2OK. */
void fmu_set(fmi2Component component, fmi2ValueReference reference, double value);
double fmu_get(fmi2Component component, fmi2ValueReference reference);

fmi2Status fmu_try_set(fmi2Component component, fmi2ValueReference reference, double value);

/* One Integer or Enumeration, likewise. */
void fmu_set_integer(fmi2Component component, fmi2ValueReference reference, fmi2Integer value);
fmi2Integer fmu_get_integer(fmi2Component component, fmi2ValueReference reference);

/* The states. */
enum { FMU_STATES = 4 };
extern const fmi2ValueReference fmu_state_references[FMU_STATES]; /* q1, q2, dq1, dq2 */
void fmu_get_states(fmi2Component component, double x[FMU_STATES]);

/* Fails the test unless D ddq + C dq + g = (tau1, f2), and the power is theirs, by what is read. */
void fmu_assert_motion(fmi2Component component, double tau1, double f2, double tolerance);

/* Values of solver_method. */
enum { FMU_CVODE_ADAMS = 1, FMU_CVODE_BDF = 2, FMU_ERK = 3, FMU_TAYLOR = 4, FMU_METHODS };

/* All variables, each in the place of its row in fmu_variables. */
struct fmu_values {
    double reals[FMU_VARIABLE_CAPACITY];
    int integers[FMU_VARIABLE_CAPACITY];
};

/* The worst status of all variables; what cannot be read, or is of the other type, is 0. */
fmi2Status fmu_get_all(fmi2Component component, struct fmu_values *values);

/* Fails the test at the first variable whose bits differ, and names it. */
void fmu_assert_same_values(const struct fmu_values *expected, const struct fmu_values *actual,
                            const char *message);

/* Ignores the running test where the FMU is one of another version. */
void fmu_only_in(unsigned version, const char *reason);

/* The next calls are refused as after an fmi2Error (section 4.2.4), and the message says so. */
void fmu_assert_in_error(fmi2Component component);

/* ---- Model Exchange -------------------------------------------------------------------------- */

/* SetupExperiment to EnterContinuousTimeMode, with the event iteration between them; no tolerance
 * and no stop time. */
fmi2Status fmu_me_enter_continuous_time(fmi2Component component, double start);

/* An instance in continuous-time mode at time start. */
fmi2Component fmu_me_initialized(struct fmu_log *log, double start);

/* One step of the classical Runge-Kutta method from t to t + h (s), with the inputs as set, and
 * CompletedIntegratorStep. */
fmi2Status fmu_me_step(fmi2Component component, double t, double h);

/* ---- FMU states ------------------------------------------------------------------------------ */

/* Section 2.1.8; these fail the test where the FMU does. */

/* A new handle with the state of the component. */
fmi2FMUstate fmu_save(fmi2Component component);
void fmu_restore(fmi2Component component, fmi2FMUstate state);
void fmu_forget(fmi2Component component, fmi2FMUstate *state);

/* A serialized state; fmu_bytes_free frees it. */
struct fmu_bytes {
    fmi2Byte *data;
    size_t size;
};
struct fmu_bytes fmu_serialize(fmi2Component component, fmi2FMUstate state);
fmi2FMUstate fmu_deserialize(fmi2Component component, const struct fmu_bytes *bytes);
void fmu_bytes_free(struct fmu_bytes *bytes);

/* The first size bytes, zeros after their end, in memory of exactly this size: a sanitizer sees
 * what is read beyond. */
struct fmu_bytes fmu_bytes_copy(const struct fmu_bytes *bytes, size_t size);

void fmu_assert_same_bytes(const struct fmu_bytes *expected, const struct fmu_bytes *actual,
                           const char *message);

/* The present state of the component, serialized. */
struct fmu_bytes fmu_save_bytes(fmi2Component component);
void fmu_restore_bytes(fmi2Component component, const struct fmu_bytes *bytes);

/* ---- An instance to save -------------------------------------------------------------------- */

/* Between steps, everything set that can be. */
fmi2Component fmu_used(fmi2Integer method, struct fmu_log *log);

/* One step from there; values are those after it. */
void fmu_used_step(fmi2Component component, struct fmu_values *values);

/* ---- A run to compare bit for bit ----------------------------------------------------------- */

enum { FMU_RUN_STEPS = 20 };

struct fmu_run {
    struct fmu_values after[FMU_RUN_STEPS];
};

/* From an instance that was just made or reset, as a master for its kind does. The variant decides
 * the start values. Nothing is asserted, so that threads may call these: they return the worst
 * status of all calls. */
fmi2Status fmu_run_start(fmi2Type type, fmi2Component component, unsigned variant);
fmi2Status fmu_run_step(fmi2Type type, fmi2Component component, unsigned step, struct fmu_run *run);
fmi2Status fmu_run_as(fmi2Type type, fmi2Component component, unsigned variant,
                      struct fmu_run *run);
fmi2Status fmu_run(fmi2Component component, unsigned variant, struct fmu_run *run);

/* Resets the instance; its run then has the bits of a fresh instance's. */
void fmu_assert_reset_is_fresh_as(fmi2Type type, fmi2Component component, const char *message);
void fmu_assert_reset_is_fresh(fmi2Component component, const char *message);

#endif
