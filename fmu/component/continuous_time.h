/* Time and continuous states of a component that is integrated from outside, the same in all
 * versions of FMI. Each function takes the number of the call it serves. */
#ifndef CONTINUOUS_TIME_H
#define CONTINUOUS_TIME_H

#include "component.h"

enum component_status continuous_set_time(struct component *component, unsigned call, double time);

enum component_status continuous_set_states(struct component *component, unsigned call,
                                            const double x[], size_t count);
enum component_status continuous_get_states(struct component *component, unsigned call, double x[],
                                            size_t count);
enum component_status continuous_get_derivatives(struct component *component, unsigned call,
                                                 double dx[], size_t count);
enum component_status continuous_get_nominals(struct component *component, unsigned call,
                                              double nominals[], size_t count);

/* The variables that are the event indicators. */
enum component_status continuous_get_indicators(struct component *component, unsigned call,
                                                double indicators[], size_t count);

/* Ends a step of the integrator; enters, terminates: where the caller's answers go. Writes whether
 * event mode is needed. */
enum component_status continuous_complete_step(struct component *component, unsigned call,
                                               const void *enters, const void *terminates,
                                               bool *is_event);

#endif
