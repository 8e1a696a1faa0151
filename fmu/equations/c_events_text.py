"""What the events of all models have in common, in C."""

BANDS = """\
/* A relation near its limit keeps its mode: where it was located, rounding says nothing. */
static bool settle(struct equations_values *values, double t, const double tolerance[]) {
    struct compared compared;
    bool changes = false;
    compare(values, t, tolerance, &compared);
    for (int k = 0; k < RELATIONS; k++) {
        const int holds = holds_at(k, compared.distance[k]);
        const bool is_sure = !compared.used[k] || fabs(compared.distance[k]) >= compared.noise[k];
        if (is_sure && !is_timed[k] && values->relations[k] != holds) {
            values->relations[k] = holds;
            changes = true;
        }
    }
    return changes;
}

/* Modes may depend on each other, in a circle even: then the last ones stay. */
static void settle_all(struct equations_values *values, double t, const double tolerance[]) {
    for (int count = 0; count <= RELATIONS && settle(values, t, tolerance); count++) {
    }
}

/* Relations with the same limit switch at one event: those on it that are about to pass it. */
static void find_joining(const struct equations_values *values, double t, const double tolerance[],
                         bool joins[]) {
    struct compared compared;
    compare(values, t, tolerance, &compared);
    for (int k = 0; k < RELATIONS; k++) {
        const double slope = values->relations[k] ? compared.slope[k] : -compared.slope[k];
        const bool is_near = fabs(compared.distance[k]) < compared.noise[k];
        joins[k] = compared.used[k] && is_near && slope < 0.0;
    }
}

/* The modes that follow from the values, whatever they were. */
static void begin(struct equations_values *values, double t) {
    static const double exact[STATES + 1] = {0.0};
    struct compared compared;
    compare(values, t, exact, &compared);
    for (int k = 0; k < RELATIONS; k++) {
        values->relations[k] = holds_at(k, compared.distance[k]);
    }
    settle_all(values, t, exact);
}

/* The values whose modes have followed inputs and parameters that were set since the last event. */
static const struct equations_values *followed(const struct equations_values *values, double t,
                                               struct equations_values *copy) {
    static const double exact[STATES + 1] = {0.0};
    if (values->is_begun && !HAS_INPUTS) {
        return values;
    }
    *copy = *values;
    if (!values->is_begun) {
        begin(copy, t);
        return copy;
    }
    struct compared compared;
    compare(values, t, exact, &compared);
    for (int k = 0; k < RELATIONS; k++) {
        copy->relations[k] = of_inputs[k] ? holds_at(k, compared.distance[k]) : copy->relations[k];
    }
    return copy;
}
"""
FIRE = """\
/* Runs the events that have become due, in their order; false: there was none. */
static bool fire(struct equations_values *values, double t, double tolerance[]) {
    int due[EVENTS];
    bool fires = false;
    for (int i = 0; i < EVENTS; i++) {
        find_due(values, t, due);
        if (due[i] && !values->active[i]) {
            change(values, t, i, tolerance);
            settle_all(values, t, tolerance);
            values->active[i] = 1;
            fires = true;
        }
        find_due(values, t, due);
        for (int k = 0; k < EVENTS; k++) {
            values->active[k] = values->active[k] && due[k];
        }
    }
    return fires;
}
"""
UPDATE = """\
static enum status update(void *values_pointer, const struct event *event) {
    struct equations_values *values = values_pointer;
    double tolerance[STATES + 1] = {0.0};
    for (int i = 0; i < STATES; i++) {
        const double size = nominal[i] + fabs(STATE_I);
        tolerance[i] = fmax(event->tolerance[i], location_error * size);
    }
    if (!values->is_begun) {
        begin(values, event->t);
        values->is_begun = 1;
    } else {
        const double passed = event->is_timed ? next_time(values) : -INFINITY;
        double times[RELATIONS];
        bool joins[RELATIONS];
        write_times(values, times);
        find_joining(values, event->t, tolerance, joins);
        for (int k = 0; k < RELATIONS; k++) {
            if (is_timed[k]) {
                const bool is_past = event->t >= times[k] || times[k] <= passed;
                values->relations[k] = is_past == rises[k];
            } else if (event->triggered != NULL) {
                values->relations[k] ^= event->triggered[indicator_of[k]] || joins[k];
            }
        }
        settle_all(values, event->t, tolerance);
    }
    for (int count = 0; count < MOST_FIRINGS; count++) {
        if (!fire(values, event->t, tolerance)) {
            return STATUS_OK;
        }
    }
    if (event->reason != NULL) {
        (void)snprintf(event->reason, event->reason_size, "events follow each other without end");
    }
    return STATUS_INTERNAL;
}
"""
