/* One instance of a model: its values by reference, its time, and steps from one communication
 * point to the next. Knows no particular model and no FMI.
 *
 * Every function that can fail reports the status it returns, with one line of text that says what
 * was wrong and what was expected, to the sink given at creation. Functions that set or get values
 * are all or nothing. One instance serves one thread at a time; instances share nothing. */
#ifndef INSTANCE_H
#define INSTANCE_H

#include "integrator.h"
#include "platform.h"
#include "variables.h"

struct instance;

/* Values of the variables with owner = "instance" (src/time_variable.toml, solver_variables.toml).
 */
struct instance_values {
    double time;                         /* s */
    int solver_steps;                    /* internal steps since initialization */
    int solver_rhs_evaluations;          /* the integrator's, since initialization */
    double relative_tolerance;           /* asked for; 0: that of the experiment */
    int max_internal_steps;              /* per communication step */
    double effective_relative_tolerance; /* what the integrator runs at */
    int solver_restarts;                 /* since initialization */
    double solver_last_step;             /* s: length of the last internal step */
    int solver_last_order;
    int solver_failed_steps; /* refused attempts since initialization */
    int solver_method;       /* an enum integrator_method */
    double max_step;         /* s: of internal steps; 0: no limit */
};

struct instance_experiment {
    double start_time; /* s */
    bool stop_time_defined;
    double stop_time; /* s; steps past it are refused */
    bool tolerance_defined;
    double tolerance; /* relative, > 0 */
};

/* Allocates all that the instance needs; steps allocate nothing. description must outlive the
 * instance, sink is copied. On failure *instance is NULL. */
MUST_CHECK NONNULL enum status instance_create(const struct model_description *description,
                                               const struct message_sink *sink,
                                               struct instance **instance);

/* NULL is allowed. */
void instance_destroy(struct instance *instance);

/* Back to the state right after instance_create: start values, no experiment. */
NONNULL void instance_reset(struct instance *instance);

/* Before initialization; may be repeated. */
MUST_CHECK NONNULL enum status
instance_setup_experiment(struct instance *instance, const struct instance_experiment *experiment);

MUST_CHECK NONNULL enum status instance_enter_initialization(struct instance *instance);

/* Ends initialization: the parameters must go together. */
MUST_CHECK NONNULL enum status instance_exit_initialization(struct instance *instance);

/* count values by reference; the arrays may be NULL where count is 0. Real functions take Real
 * variables only, Integer functions Integer ones. A set value shows at once in what is calculated
 * from it. */
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_set_real(struct instance *instance, const unsigned references[], size_t count,
                      const double values[]);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_set_integer(struct instance *instance, const unsigned references[], size_t count,
                         const int values[]);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_real(struct instance *instance, const unsigned references[], size_t count,
                      double values[]);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_integer(struct instance *instance, const unsigned references[], size_t count,
                         int values[]);

/* Derivatives of inputs with respect to time, of orders 1 to 3, at the beginning of the next step:
 * over it the inputs are Taylor polynomials. They apply to that step alone. All or nothing. */
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_set_input_derivatives(struct instance *instance, const unsigned references[],
                                   size_t count, const int orders[], const double values[]);

/* Derivatives of Real outputs with respect to time, of orders 1 and 2, at the current time, inputs
 * being the polynomials that apply there. All or nothing. */
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_output_derivatives(struct instance *instance, const unsigned references[],
                                    size_t count, const int orders[], double values[]);

/* Writes J v: J the derivatives of unknowns (Real variables of the model that are not parameters or
 * inputs) with respect to knowns (inputs, states; before the first step parameters too). */
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_directional_derivative(struct instance *instance, const unsigned unknowns[],
                                        size_t unknown_count, const unsigned knowns[],
                                        size_t known_count, const double v[], double result[]);

/* Steps from communication_point to communication_point + step (s) with the inputs held, or as
 * polynomials where derivatives were set.
 * STATUS_INVALID_TIME: step not > 0, communication_point not where the instance is (clock_slack),
 * or the end past the stop time. Where the integration ends early (severity discard), instance_time
 * tells how far the instance got, and its states are those of that time. */
MUST_CHECK NONNULL enum status instance_do_step(struct instance *instance,
                                                double communication_point, double step);

/* Time that the instance has reached, s. */
NONNULL double instance_time(const struct instance *instance);

/* ---- Integration from outside (Model Exchange) ---------------------------------------------- */

/* While the time is continuous only continuous inputs may be set. */
MUST_CHECK NONNULL enum status instance_enter_continuous_time(struct instance *instance);
NONNULL void instance_enter_event_mode(struct instance *instance);

MUST_CHECK NONNULL enum status instance_set_time(struct instance *instance, double time);

/* count must be instance_state_count; the arrays may be NULL where it is 0. All or nothing. */
NONNULL size_t instance_state_count(const struct instance *instance);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_set_states(struct instance *instance, const double x[], size_t count);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_states(struct instance *instance, double x[], size_t count);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_derivatives(struct instance *instance, double dx[], size_t count);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_nominals(struct instance *instance, double nominals[], size_t count);

#endif
