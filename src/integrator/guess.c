#include "guess.h"

double guess_next_event(const struct problem *problem, double row[][SERIES_LENGTH],
                        double nearest) {
    const struct location *location = &problem->location;
    const struct series *rows = problem->ode.rows;
    double soonest = INFINITY;
    for (size_t k = 0; k < location->used_count; k++) {
        const size_t i = location->used[k];
        const struct indicator *indicator = &location->indicators[i];
        const bool is_of_state = indicator->kind == INDICATOR_OF_STATE;
        if (!is_of_state && (rows == NULL || rows->row_of_indicator == NULL)) {
            continue;
        }
        const double factor = is_of_state ? indicator->factor : 1.0;
        const double *c = row[is_of_state ? indicator->state : rows->row_of_indicator[i]];
        if (location->is_armed[i] || factor * c[1] > 0.0) {
            const double s = roots_guess(is_of_state ? indicator->offset : 0.0, factor, c);
            soonest = s > nearest && s < soonest ? s : soonest;
        }
    }
    return soonest;
}
