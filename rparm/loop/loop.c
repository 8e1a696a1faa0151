#include "loop.h"

#ifdef _WIN32
#include <windows.h>
#else
#include <sys/time.h>
#endif

static const double rounding = 1e-9; /* of a step: two times closer than that are equal */

static const double piece = 0.02; /* s, after which the host has its turn */

static void copy(int64_t count, const double from[], double to[]) {
    for (int64_t i = 0; i < count; i++) {
        to[i] = from[i];
    }
}

/* Notes what has failed. Returns false if the status is one that stops a run. */
static bool passes(struct loop *loop, int status, enum loop_phase phase,
                   const struct loop_component *c, int64_t item, double time) {
    if (loop->stop) { /* then the status may be anything */
        status = FMU_RAISED;
        phase = LOOP_HOST;
    }
    if (status < FMU_DISCARD) {
        return true;
    }
    const int64_t component = c == NULL ? -1 : c->number;
    loop->failure = (struct loop_failure){status, (int32_t)phase, component, item, time};
    return false;
}

/* ---- Inputs --------------------------------------------------------------------------------- */

/* Returns a value of the system at a time; of a component at another time, on its line. */
static double value_at(const struct loop *loop, int64_t index, double time) {
    const double value = loop->values[index];
    const int64_t owner = loop->owners[index];
    if (!loop->extrapolates || owner < 0) {
        return value;
    }
    return value + loop->slopes[index] * (time - loop->components[owner]->time);
}

static void keep(struct loop_component *c, int64_t input, double value, double slope) {
    c->kept[input] = value;
    c->kept[c->input_count + input] = slope;
}

/* Keeps the sources of inputs as they are at a time: all, or those ahead. */
static void keep_sources(const struct loop *loop, struct loop_component *c, double time, bool all) {
    for (int64_t i = 0; i < c->input_count; i++) {
        if (all || c->ahead[i]) {
            const int64_t source = c->sources[i];
            keep(c, i, value_at(loop, source, time), loop->slopes[source]);
        }
    }
}

static int set_inputs(struct loop_component *c) {
    return fmu_set_reals(&c->fmu, c->input_count, c->inputs, c->input_values);
}

/* Sets the inputs over a step: held, or as straight lines. */
static int set_over_step(const struct loop *loop, struct loop_component *c, double length) {
    const int64_t n = c->input_count;
    const double *const slopes = c->kept + n;
    const bool takes_lines = loop->extrapolates && c->lines != NULL;
    const double middle = loop->extrapolates && !takes_lines && !c->is_sampled ? length / 2 : 0.0;
    for (int64_t i = 0; i < n; i++) {
        c->input_values[i] = middle != 0.0 ? c->kept[i] + middle * slopes[i] : c->kept[i];
    }
    const int status = set_inputs(c);
    if (!takes_lines || status >= FMU_DISCARD) {
        return status;
    }
    for (int64_t i = 0; i < 2 * n; i++) {
        c->lines[i] = c->kept[i]; /* FMI 3.0: loop_update_inputs sets them within the step */
    }
    return c->fmu.version == 2 ? fmu_set_slopes(&c->fmu, n, c->inputs, c->orders, slopes) : FMU_OK;
}

/* Sets where these lines end, for an FMU that takes no slopes and for algebraic loops. */
static int end_lines(struct loop_component *c, double length) {
    if (c->input_count == 0 || (c->lines != NULL && !c->solves)) {
        return FMU_OK;
    }
    for (int64_t i = 0; i < c->input_count; i++) {
        c->input_values[i] = c->kept[i] + length * c->kept[c->input_count + i];
    }
    return set_inputs(c);
}

/* ---- Outputs -------------------------------------------------------------------------------- */

static int read_slopes(const struct loop *loop, struct loop_component *c) {
    const int status =
        fmu_get_slopes(&c->fmu, c->slope_count, c->slope_outputs, c->slope_orders, c->slope_values);
    for (int64_t k = 0; status < FMU_DISCARD && k < c->slope_count; k++) {
        loop->slopes[c->slope_indices[k]] = c->slope_values[k];
    }
    return status;
}

/* Lets outputs that have no other slopes be lines from before the step. */
static void draw_slopes(const struct loop *loop, const struct loop_component *c, double length) {
    for (int64_t k = 0; k < c->difference_count; k++) {
        const int64_t i = c->differences[k];
        loop->slopes[c->first + i] = (loop->values[c->first + i] - c->before[i]) / length;
    }
}

static bool read_outputs(struct loop *loop, struct loop_component *c, double time) {
    double *const outputs = loop->values + c->first;
    const int status = fmu_get_reals(&c->fmu, c->output_count, c->outputs, outputs);
    bool is_good = passes(loop, status, LOOP_READ, c, 0, time);
    for (int64_t i = 0; is_good && loop->checks_finite && i < c->output_count; i++) {
        if (!__builtin_isfinite(outputs[i])) {
            is_good = passes(loop, FMU_DISCARD, LOOP_NOT_FINITE, c, i, time);
        }
    }
    return is_good;
}

int loop_follow_slopes(struct loop *loop) {
    const int64_t count = loop->component_count;
    const double now = loop->time;
    int64_t rounds = 0;
    for (int64_t i = 0; i < count; i++) {
        rounds += loop->components[i]->is_due;
    }
    for (int64_t round = 0; round <= rounds; round++) {
        for (int64_t i = 0; i < count; i++) {
            struct loop_component *const c = loop->components[i];
            if (c->is_due && !passes(loop, read_slopes(loop, c), LOOP_SLOPES, c, 0, now)) {
                return -1;
            }
        }
        for (int64_t i = 0; round < rounds && i < count; i++) {
            struct loop_component *const c = loop->components[i];
            if (c->is_due) {
                for (int64_t k = 0; k < c->input_count; k++) {
                    keep(c, k, loop->values[c->sources[k]], loop->slopes[c->sources[k]]);
                }
                if (!passes(loop, set_over_step(loop, c, 0.0), LOOP_SLOPES, c, 0, now)) {
                    return -1;
                }
            }
        }
    }
    for (int64_t i = 0; i < count; i++) {
        const struct loop_component *const c = loop->components[i];
        for (int64_t k = 0; c->is_due && k < c->difference_count; k++) {
            loop->slopes[c->first + c->differences[k]] = 0.0;
        }
    }
    return 0;
}

/* ---- Discrete variables --------------------------------------------------------------------- */

/* Finds the values that discrete inputs must have. */
static bool find_wanted(struct loop *loop, const int64_t scheduled[]) {
    for (int64_t k = 0; k < loop->switch_count; k++) {
        struct loop_switch *const s = &loop->switches[k];
        if (s->source < 0) {
            s->is_new = s->value != scheduled[s->column];
            s->value = scheduled[s->column];
            continue;
        }
        struct loop_component *const source = loop->components[s->source];
        const int status = fmu_get_discrete(&source->fmu, s->from, &s->value);
        if (!passes(loop, status, LOOP_GET_DISCRETE, source, k, loop->time)) {
            return false;
        }
    }
    return true;
}

int64_t loop_transfer(struct loop *loop, const int64_t scheduled[]) {
    if (!find_wanted(loop, scheduled)) {
        return -1;
    }
    int64_t count = 0;
    for (int64_t k = 0; k < loop->switch_count; k++) {
        struct loop_switch *const s = &loop->switches[k];
        struct loop_component *const target = loop->components[s->target];
        if (!loop->inputs_first) { /* else it has what was set last */
            s->is_new = 0;
            int64_t present = s->value;
            const int status =
                target->is_due ? fmu_get_discrete(&target->fmu, s->to, &present) : FMU_OK;
            if (!passes(loop, status, LOOP_GET_DISCRETE, target, k, loop->time)) {
                return -1;
            }
            s->is_new = present != s->value;
        }
        const int status = s->is_new ? fmu_set_discrete(&target->fmu, s->to, s->value) : FMU_OK;
        if (!passes(loop, status, LOOP_SET_DISCRETE, target, k, loop->time)) {
            return -1;
        }
        count += s->is_new;
    }
    return count;
}

/* ---- Rates of components -------------------------------------------------------------------- */

/* True if its own step ends with the system's step of this length, at `end`: the system's point
 * nearest to a multiple of `every`, the earlier of two. */
static bool is_due(const struct loop *loop, const struct loop_component *c, double end,
                   double length) {
    if (c->every == 0.0 || c->every <= length) {
        return true;
    }
    const double due = loop->start + (c->ticks + 1) * c->every - length / 2;
    return due <= end + rounding * length;
}

static void note_end(const struct loop *loop, struct loop_component *c, double end, double length) {
    c->began = c->time;
    c->time = end;
    if (c->every != 0.0) {
        const double passed = (end - loop->start + (0.5 + rounding) * length) / c->every;
        const double whole = (double)(int64_t)passed; /* which is not below 0 */
        c->ticks = whole > c->ticks ? whole : c->ticks;
    }
}

/* ---- Steps ---------------------------------------------------------------------------------- */

/* Steps one component to its end. */
static bool step_component(struct loop *loop, struct loop_component *c, double end) {
    const double begin = c->time;
    const double length = end - begin;
    struct tangent *const tangent = c->number == 0 ? loop->tangent : NULL;
    if (c->has_ahead) {
        keep_sources(loop, c, begin, false);
    }
    int status = set_over_step(loop, c, length);
    if (status < FMU_DISCARD && tangent != NULL) {
        status = tangent_begin(tangent, &c->fmu);
    }
    if (status < FMU_DISCARD) {
        status = fmu_do_step(&c->fmu, begin, length, loop->is_final);
    }
    if (status < FMU_DISCARD && loop->extrapolates) {
        status = read_slopes(loop, c);
    }
    if (status < FMU_DISCARD && loop->extrapolates) {
        status = end_lines(c, length);
    }
    if (!passes(loop, status, LOOP_STEP, c, 0, begin)) {
        return false;
    }
    loop->step_count++;
    return true;
}

/* Steps the components of a group that are due, reads them, and solves their algebraic loops. */
static bool step_group(struct loop *loop, int64_t group, double end, double length, bool reads) {
    struct loop_component *const *const all = loop->components;
    const int64_t *const first = loop->grouped + loop->group_first[group];
    const int64_t *const last = loop->grouped + loop->group_first[group + 1];
    for (const int64_t *i = first; i < last; i++) {
        struct loop_component *const c = all[*i];
        if (loop->extrapolates && c->is_due && c->output_count > 0) {
            copy(c->output_count, loop->values + c->first, c->before);
        }
    }
    for (const int64_t *i = first; i < last; i++) {
        if (all[*i]->is_due && !step_component(loop, all[*i], end)) {
            return false;
        }
    }
    for (const int64_t *i = first; i < last; i++) {
        if (all[*i]->is_due) {
            if (reads && !read_outputs(loop, all[*i], end)) {
                return false;
            }
            note_end(loop, all[*i], end, length);
        }
    }
    if (loop->solve != NULL &&
        !passes(loop, loop->solve(group) ? FMU_RAISED : FMU_OK, LOOP_HOST, NULL, 0, end)) {
        return false;
    }
    for (const int64_t *i = first; loop->extrapolates && i < last; i++) {
        if (all[*i]->is_due) {
            draw_slopes(loop, all[*i], end - all[*i]->began);
        }
    }
    return true;
}

/* Steps all components that are due to the end. */
static bool step(struct loop *loop, double end, bool reads) {
    const double length = end - loop->time;
    loop->end = end;
    for (int64_t i = 0; i < loop->component_count; i++) {
        struct loop_component *const c = loop->components[i];
        if (c->time == loop->time) {
            keep_sources(loop, c, loop->time, true);
        }
        c->is_due = !loop->has_rates || is_due(loop, c, end, length);
    }
    for (int64_t group = 0; group < loop->group_count; group++) {
        if (!step_group(loop, group, end, length, reads)) {
            return false;
        }
    }
    loop->time = end;
    return true;
}

/* Takes the values from outside at the end of a step, and passes on what has switched. */
static bool take_inputs(struct loop *loop, const double driven[], const int64_t scheduled[]) {
    for (int64_t i = 0; i < loop->driven_count; i++) {
        loop->values[loop->first_driven + i] = driven[i];
    }
    const int64_t switched = loop_transfer(loop, scheduled);
    if (switched <= 0 || loop->follow == NULL) {
        return switched >= 0;
    }
    return passes(loop, loop->follow() ? FMU_RAISED : FMU_OK, LOOP_HOST, NULL, 0, loop->time);
}

/* ---- Rows ----------------------------------------------------------------------------------- */

/* Sets the inputs of the next step, those on algebraic loops as they are solved for: their sources
 * are equal but for rounding, which the gain of a loop would amplify. */
static int follow_sources(const struct loop *loop, struct loop_component *c) {
    for (int64_t i = 0; i < c->input_count; i++) {
        if (!c->on_loop[i]) {
            c->input_values[i] = loop->values[c->sources[i]];
        }
    }
    return set_inputs(c);
}

static bool read_component(struct loop *loop, struct loop_component *c, double row[]) {
    int status = loop->sets_for_rows ? follow_sources(loop, c) : FMU_OK;
    if (status < FMU_DISCARD) {
        status = fmu_get_reals(&c->fmu, c->read_count, c->read, c->read_values);
    }
    if (!passes(loop, status, LOOP_ROW, c, 0, loop->time)) {
        return false;
    }
    for (int64_t k = 0; k < c->read_count; k++) {
        row[c->read_columns[k]] = c->read_values[k];
    }
    for (int64_t k = 0; k < c->discrete_count; k++) {
        int64_t value = 0;
        status = fmu_get_discrete(&c->fmu, c->discretes[k], &value);
        if (!passes(loop, status, LOOP_GET_DISCRETE, c, -1 - k, loop->time)) {
            return false;
        }
        row[c->discrete_columns[k]] = (double)value;
    }
    return true;
}

int loop_read_row(struct loop *loop, double row[]) {
    for (int64_t i = 0; i < loop->column_count; i++) {
        row[i] = loop->values[loop->columns[i]];
    }
    for (int64_t i = 0; i < loop->component_count; i++) {
        if (loop->components[i]->is_due && !read_component(loop, loop->components[i], row)) {
            return -1;
        }
    }
    return 0;
}

/* ---- Runs ----------------------------------------------------------------------------------- */

/* Reads a row; row[-row_width] is the one before. */
static bool read_next_row(struct loop *loop, double row[]) {
    if (loop->has_rates) { /* of components that are within a step */
        copy(loop->row_width, row - loop->row_width, row);
    }
    return loop_read_row(loop, row) == 0;
}

#ifdef _WIN32
/* The library has no C runtime: 70 of 84 kB would be that. */
BOOL WINAPI DllMainCRTStartup(HINSTANCE library, DWORD reason, LPVOID reserved);

BOOL WINAPI DllMainCRTStartup(HINSTANCE library, DWORD reason, LPVOID reserved) {
    return TRUE;
}

static double wall_time(void) {
    FILETIME now;
    GetSystemTimeAsFileTime(&now);
    return 1e-7 * (4294967296.0 * (double)now.dwHighDateTime + (double)now.dwLowDateTime);
}
#else
static double wall_time(void) {
    struct timeval now;
    gettimeofday(&now, NULL);
    return (double)now.tv_sec + 1e-6 * (double)now.tv_usec;
}
#endif

/* Makes step i of a run; row: where its row goes, NULL: none. */
static bool make_step(struct loop *loop, const struct loop_run *run, int64_t i, double *row) {
    const double *const driven = run->driven + i * loop->driven_count;
    const int64_t *const scheduled = run->scheduled + i * loop->scheduled_count;
    struct tangent *const tangent = loop->tangent;
    const double begin = loop->time;
    if (loop->inputs_first && !take_inputs(loop, driven, scheduled)) {
        return false;
    }
    if (!step(loop, run->ends[i], row != NULL || !loop->reads_for_rows)) {
        return false;
    }
    if (tangent != NULL) {
        struct loop_component *const first = loop->components[0];
        const double length = loop->time - begin;
        const int status = tangent_end(tangent, &first->fmu, length, &run->growth[i]);
        if (!passes(loop, status, LOOP_STEP, first, 0, begin)) {
            return false;
        }
    }
    if (!loop->inputs_first && !take_inputs(loop, driven, scheduled)) {
        return false;
    }
    return row == NULL || read_next_row(loop, row);
}

int64_t loop_advance(struct loop *loop, const struct loop_run *run) {
    double *row = run->rows;
    loop->failure = (struct loop_failure){0};
    const double begin = wall_time();
    for (int64_t i = 0; i < run->count; i++) {
        const bool has_row = row != NULL && (run->has_row == NULL || run->has_row[i]);
        if (!make_step(loop, run, i, has_row ? row : NULL)) {
            return i;
        }
        row += has_row ? loop->row_width : 0;
        const double elapsed = wall_time() - begin;
        if (elapsed > piece || elapsed < 0.0) { /* the clock may have been set */
            return i + 1;
        }
    }
    return run->count;
}

int loop_missing(void) {
    return FMU_ERROR;
}

int64_t loop_size(int number) {
    const size_t sizes[] = {sizeof(struct fmu_polynomials), sizeof(struct fmu),
                            sizeof(struct fmu_variable),    sizeof(struct tangent),
                            sizeof(struct loop_component),  sizeof(struct loop_switch),
                            sizeof(struct loop_failure),    sizeof(struct loop),
                            sizeof(struct loop_run)};
    const int count = sizeof sizes / sizeof sizes[0];
    return number < count ? (int64_t)sizes[number] : 0;
}
