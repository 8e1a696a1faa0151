/* Any model, by its description: what the files of the target fuzz_model share. README.md says how
 * an input is decoded. */
#ifndef FUZZ_MODEL_H
#define FUZZ_MODEL_H

#include "fuzz_instance.h"

struct subject {
    struct fuzz_input *input;
    struct fuzz_instance *instance;
    enum phase phase;
    bool is_usual;        /* all values set so far have usual magnitudes */
    bool is_inconsistent; /* parameters have been set since they were last accepted */
    fmi2FMUstate saved;   /* NULL: none */
    double saved_time;    /* s */
    bool saved_usual;     /* is_usual then */
    bool saved_inconsistent;
};

/* ---- Values (fuzz_model_values.c) ------------------------------------------------------------ */

/* Sets a variable that can be set in this phase, mostly to a value that it may have. */
void fuzz_model_set_any(struct subject *subject);

/* Sets all continuous inputs in one call. */
void fuzz_model_set_inputs(struct subject *subject);

/* Continuous inputs, or continuous outputs; the result is their number. */
size_t fuzz_model_references(enum causality causality, fmi2ValueReference references[]);

/* Directional derivatives of outputs by inputs, and derivatives of outputs by the time. */
void fuzz_model_derive(struct subject *subject);

/* All variables; where only usual values have been set, each of them has a value. */
void fuzz_model_read(struct subject *subject, struct fuzz_values *values);

/* ---- Steps (fuzz_model_fmi2.c, fuzz_model_fmi3.c) -------------------------------------------- */

/* Before an instance for Co-Simulation is made. */
unsigned fuzz_model_variety(struct fuzz_input *input);

/* Chooses how inputs move over the next step. */
void fuzz_model_move_inputs(struct subject *subject);

/* From where the instance is; keeps its time. The same state and arguments give the same step.
 * choices: what the importer does inside the step. */
fmi2Status fuzz_model_step(struct fuzz_instance *instance, double length, unsigned choices);

/* A value that could not be computed has failed the last step from inside. */
bool fuzz_model_failed_inside(void);

/* ---- Model Exchange (fuzz_model_exchange.c) -------------------------------------------------- */

/* From the end of the initialization. */
void fuzz_model_exchange(struct subject *subject);

/* ---- Hostile calls (fuzz_hostile.c) ---------------------------------------------------------- */

/* Some calls of any function, with any arguments. The instance is then where it was. */
void fuzz_model_call_anything(struct subject *subject);

#endif
