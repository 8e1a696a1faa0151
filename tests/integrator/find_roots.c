/* find_roots < POLYNOMIALS > ROOTS: what the search finds, for test_random_roots.py. A polynomial
 * is 34 doubles: degree, noise, 32 coefficients. Its roots are 66: their count, roots_first, 32
 * times s and the kind. */
#include "roots.h"

#include <stdio.h>

int main(void) {
    double given[2 + ROOTS_LENGTH];
    while (fread(given, sizeof given, 1, stdin) == 1) {
        const struct roots_polynomial p = {given + 2, (int)given[0], given[1]};
        struct root roots[ROOTS_LENGTH];
        double found[2 + 2 * ROOTS_LENGTH] = {0.0};
        const int count = roots_find(&p, roots);
        found[0] = count;
        found[1] = roots_first(&p);
        for (int i = 0; i < count; i++) {
            found[2 + 2 * i] = roots[i].s;
            found[3 + 2 * i] = roots[i].kind;
        }
        if (fwrite(found, sizeof found, 1, stdout) != 1) {
            return 1;
        }
    }
    return 0;
}
