/* setUp and tearDown of every test that calls the functions of FMI 3.0: link fmu3_fixture. */
#include "fmu3_harness.h"

#include <unity.h>

void suiteSetUp(void) {
    fmu3_load();
}

void setUp(void) {
    importer = (struct fmu3_importer){0};
}

void tearDown(void) {
    fmu3_tear_down();
}
