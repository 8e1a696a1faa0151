/* Tests that run with several methods of integration. The word goes in front of the test:
 *
 *     EACH_METHOD static void test_steps_allocate_nothing(void) {
 */
#ifndef EACH_METHOD_H
#define EACH_METHOD_H

#define EACH_METHOD
#define EACH_CVODE_METHOD /* those that keep a history of internal steps */

/* The method of the running test: an enum integrator_method, solver_method of an FMU. */
extern int method;

#endif
