/* setUp and tearDown of every test of the built FMU: link fmu_fixture. */
#include "fmu_harness.h"

#include <unity.h>

void suiteSetUp(void) {
    fmu_load();
}

void setUp(void) {
    fmu_log_clear(&messages);
}

void tearDown(void) {
    fmu_tear_down(&messages);
}
