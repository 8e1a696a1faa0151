#include "relations_modes.h"

#include <math.h>
#include <string.h>

static const double rest_time = 1e-3; // s: a relation at rest stays within its noise so long

struct call modes_call(const struct relations *model, struct relations_room room, void *values,
                       double t, const double du[], const double largest_inputs[]) {
    int *modes = (int *)(void *)((char *)values + model->modes.offset);
    int *holds = modes + 1;
    int *active = holds + model->relation_count;
    const bool are_read = *modes == 0 || model->are_read == NULL || model->are_read(values);
    return (struct call){
        .model = model,
        .room = room,
        .values = values,
        .is_begun = modes,
        .holds = holds,
        .active = active,
        .segments = active + model->event_count + 1,
        .relation_count = are_read ? model->relation_count : 0,
        .t = t,
        .passed = t,
        .du = du,
        .largest_inputs = largest_inputs,
    };
}

static struct given given_in(const struct call *call, bool is_free, const double state_errors[]) {
    const bool inputs_move = call->largest_inputs != NULL; // those that do not are exact
    const double *largest = inputs_move ? call->largest_inputs : call->room.zeros;
    const double inputs = inputs_move ? MODES_TIME_ERROR : 0.0;
    return (struct given){state_errors, call->error, inputs, largest, call->du, is_free};
}

static void compare_in(const struct call *call, bool is_free, const double state_errors[],
                       struct compared compared[]) {
    const struct given given = given_in(call, is_free, state_errors);
    call->model->compare(call->values, call->t, &given, compared);
}

void modes_compare(const struct call *call, const double state_errors[],
                   struct compared compared[]) {
    compare_in(call, false, state_errors, compared);
}

void modes_compare_limits(const struct call *call, struct compared compared[]) {
    const struct given given = given_in(call, false, call->room.tolerance);
    call->model->contacts->compare(call->values, call->t, &given, compared);
}

/* True if the distance follows from a solution that is not known: it tells nothing. */
static bool is_unsolved(const struct call *call, int k) {
    const bool *is_circular = call->model->is_circular;
    return is_circular != NULL && is_circular[k] && isnan(call->room.compared[k].distance);
}

/* Moves a segment whose value has left it: by one, or to where the value is if that is farther.
 * Returns true if it has moved. */
static bool update_segment(const struct call *call, int i, bool is_exact) {
    const struct segment *segment = &call->model->segment[i];
    int *number = &call->segments[i];
    const bool is_above = call->holds[segment->high] != 0;
    const bool is_below = call->holds[segment->low] == 0;
    if (!is_above && !is_below) {
        return false;
    }
    const int before = *number;
    int found = call->room.segment[i];
    if (!is_exact && is_above && found <= before) {
        found = before + 1;
    } else if (!is_exact && !is_above && found >= before) {
        found = before - 1;
    }
    *number = found < segment->first  ? segment->first
              : found < segment->last ? found
                                      : segment->last;
    call->holds[segment->low] = 1;
    call->holds[segment->high] = 0;
    return *number != before;
}

/* Writes to call->room.segment where the values of all segments are. */
static void locate_segments(const struct call *call) {
    if (call->model->segment_count > 0) {
        call->model->locate(call->values, call->t, call->room.segment);
    }
}

static bool update_segments(const struct call *call, bool is_exact) {
    const struct relations *model = call->model;
    bool changes = false;
    locate_segments(call);
    for (int i = 0; i < model->segment_count; i++) {
        changes |= update_segment(call, i, is_exact);
    }
    return changes;
}

/* Updates the modes of relations by their distances. A relation at its limit keeps its mode, as
 * does a turned one. Returns true if some have changed. is_exact: distances are exact to the last
 * bit. */
static bool update_modes(const struct call *call, bool is_exact) {
    const struct relation *relation = call->model->relation;
    struct compared *compared = call->room.compared;
    bool changes = false;
    modes_compare(call, call->room.tolerance, compared);
    for (int k = 0; k < call->relation_count; k++) {
        const int holds = modes_hold_at(&relation[k], compared[k].distance);
        const bool follows =
            is_exact || (modes_sure(&compared[k]) && !(call->room.turned[k] & TURNED));
        if (follows && !relation[k].is_timed && call->holds[k] != holds && !is_unsolved(call, k)) {
            call->holds[k] = holds;
            changes = true;
        }
    }
    const bool moves = update_segments(call, is_exact);
    return changes || moves;
}

/* Updates the mode of the first relation whose distance contradicts it. Returns false if there is
 * none. */
static bool update_first_mode(const struct call *call, bool is_exact) {
    const struct compared *compared = call->room.compared;
    modes_compare(call, call->room.tolerance, call->room.compared);
    for (int k = 0; k < call->relation_count; k++) {
        const int holds = modes_hold_at(&call->model->relation[k], compared[k].distance);
        const bool follows =
            is_exact || (modes_sure(&compared[k]) && !(call->room.turned[k] & TURNED));
        if (follows && !call->model->relation[k].is_timed && call->holds[k] != holds &&
            !is_unsolved(call, k)) {
            call->holds[k] = holds;
            return true;
        }
    }
    return false;
}

/* Gives relations in circles the modes that follow from solutions, which may not exist in present
 * modes. A relation near its limit does not take the mode that it is about to leave. */
static void follow_solutions(const struct call *call) {
    const struct relations *model = call->model;
    bool changes = model->is_circular != NULL;
    for (int count = 0; changes && count < call->relation_count; count++) {
        changes = false;
        compare_in(call, true, call->room.zeros, call->room.compared);
        for (int k = 0; k < call->relation_count; k++) {
            const int holds = modes_hold_at(&model->relation[k], call->room.compared[k].distance);
            const bool turns =
                model->is_circular[k] && !is_unsolved(call, k) && call->holds[k] != holds;
            call->holds[k] ^= turns;
            call->room.turned[k] |= turns ? FOLLOWS : 0;
            changes |= turns;
        }
        modes_compare(call, call->room.tolerance, call->room.compared);
        for (int k = 0; k < call->relation_count; k++) {
            const struct compared *compared = &call->room.compared[k];
            const bool turns = (call->room.turned[k] & FOLLOWS) != 0;
            call->holds[k] ^=
                turns && modes_near(compared) && !(modes_slope(compared, call->holds[k]) > 0.0);
            call->room.turned[k] &= ~FOLLOWS;
        }
    }
}

/* True if a value that is needed follows from a solution that is not known. */
static bool lacks_solution(const struct call *call) {
    bool found = false;
    for (int k = 0; call->model->is_circular != NULL && k < call->relation_count; k++) {
        found |= is_unsolved(call, k) && call->room.compared[k].used;
    }
    return found;
}

/* Rounds for relations in circles, for each of which there may be several. Without circles each
 * round decides at least one relation more for good. In circles, where all modes at once find no
 * end, the first wrong one changes alone: Murty's rule for linear complementarity. */
enum { ROUNDS_IN_CIRCLES = 20 };

bool modes_update(const struct call *call, bool is_exact) {
    const int relations = call->relation_count;
    bool changes = true;
    bool is_any = false;
    for (int count = 0; changes && count < relations; count++) {
        changes = update_modes(call, is_exact);
        is_any |= changes;
        if (!changes && count == 0 && lacks_solution(call)) {
            follow_solutions(call);
            changes = is_any = true;
        }
    }
    const int rounds =
        call->model->is_circular != NULL && changes ? ROUNDS_IN_CIRCLES * relations : 0;
    for (int count = 0; changes && count < rounds; count++) {
        changes = update_first_mode(call, is_exact);
        is_any |= changes;
    }
    return is_any;
}

/* True if the distance of a relation contradicts its mode or, at the limit, will at once. */
static bool is_contradicted(const struct call *call, int k) {
    const struct compared *compared = &call->room.compared[k];
    modes_compare(call, call->room.tolerance, call->room.compared);
    const double slope = modes_slope(compared, call->holds[k]);
    const int holds = modes_hold_at(&call->model->relation[k], compared->distance);
    return modes_near(compared) ? slope < 0.0 : modes_sure(compared) && holds != call->holds[k];
}

int modes_contradiction(const struct call *call) {
    const bool *is_circular = call->model->is_circular;
    for (int k = 0; is_circular != NULL && k < call->relation_count; k++) {
        if (!is_circular[k] || !is_contradicted(call, k)) {
            continue;
        }
        call->holds[k] = !call->holds[k];
        const bool is_wrong = is_contradicted(call, k);
        call->holds[k] = !call->holds[k];
        if (is_wrong && call->room.compared[k].used) {
            return k;
        }
    }
    return -1;
}

/* Puts relations that the time takes over their limits on their later sides. Returns true if some
 * have changed. */
static bool pass_by_time(const struct call *call) {
    const struct relation *relation = call->model->relation;
    const struct compared *compared = call->room.compared;
    bool changes = false;
    bool is_any = false;
    for (int k = 0; k < call->relation_count; k++) {
        is_any |= relation[k].is_of_time && !relation[k].is_timed;
    }
    if (!is_any) {
        return false;
    }
    modes_compare(call, call->room.zeros, call->room.compared);
    for (int k = 0; k < call->relation_count; k++) {
        const bool passes = relation[k].is_of_time && !relation[k].is_timed &&
                            modes_near(&compared[k]) && compared[k].slope != 0.0;
        const int holds = compared[k].slope > 0.0;
        changes |= passes && call->holds[k] != holds;
        call->holds[k] = passes ? holds : call->holds[k];
    }
    return changes;
}

bool modes_settle(const struct call *call) {
    bool changes = modes_update(call, false);
    for (int count = 0; count < call->relation_count && pass_by_time(call); count++) {
        (void)modes_update(call, false);
        changes = true;
    }
    return changes;
}

/* Writes the modes that follow from the values, whatever they were before. Returns true if some
 * have changed. */
static bool set_modes_from_values(const struct call *call, bool only_of_inputs) {
    const struct relations *model = call->model;
    const struct compared *compared = call->room.compared;
    bool changes = false;
    locate_segments(call);
    for (int i = 0; i < model->segment_count; i++) {
        if (model->segment[i].is_of_inputs || !only_of_inputs) {
            changes |= call->segments[i] != call->room.segment[i];
            call->segments[i] = call->room.segment[i];
        }
    }
    modes_compare(call, call->room.zeros, call->room.compared);
    for (int k = 0; k < call->relation_count; k++) {
        if (model->relation[k].is_of_inputs || !only_of_inputs) {
            const int holds = modes_hold_at(&model->relation[k], compared[k].distance);
            changes |= call->holds[k] != holds;
            call->holds[k] = holds;
        }
    }
    return changes;
}

void modes_follow_inputs(const struct call *call) {
    for (int count = 0; set_modes_from_values(call, true) && count < call->relation_count;
         count++) {
    }
}

void modes_begin(const struct call *call) {
    set_modes_from_values(call, false);
    follow_solutions(call);
    (void)modes_update(call, true);
}

void modes_switch_fallen(const struct call *call) {
    const struct relations *model = call->model;
    const struct compared *before = call->room.before;
    struct compared *after = call->room.compared;
    modes_compare(call, call->room.tolerance, after);
    for (int k = 0; k < call->relation_count; k++) {
        const double slope = modes_slope(&after[k], call->holds[k]);
        const bool falls = slope < 0.0 && slope < modes_slope(&before[k], call->holds[k]);
        const bool may_turn = !model->relation[k].is_timed && modes_near(&after[k]);
        call->room.turned[k] = may_turn && falls ? TURNED : 0;
        call->holds[k] ^= may_turn && falls;
    }
    modes_compare(call, call->room.zeros, after);
    for (int k = 0; k < call->relation_count; k++) {
        const bool is_new = !before[k].used || modes_slope(&before[k], call->holds[k]) > 0.0;
        const bool rests = is_new && fabs(after[k].slope) * rest_time <= after[k].noise;
        if (!model->relation[k].is_timed && modes_near(&after[k]) && rests) {
            call->room.turned[k] = TURNED;
            call->holds[k] = model->relation[k].includes_zero;
        }
    }
}

void modes_clear_turned(const struct call *call) {
    memset(call->room.turned, 0, (size_t)call->relation_count * sizeof *call->room.turned);
}
