#include "failures.h"

#include "state.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

enum {
    MOST_VALUES = 6,       /* shown */
    LONGEST_TEXT = 100,    /* of an expression, characters shown */
    DEEPEST_CAUSE = 10000, /* entries that follow from each other */
};

/* Place of what is explained. */
struct place {
    const struct instance *instance;
    const char *values; /* value structure, with calculated fields */
    double t;           /* s */
};

PRINTF_FORMAT(2, 3)
static void add(struct explanation *to, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    const int count =
        vsnprintf(to->text + to->length, sizeof to->text - to->length, format, arguments);
    va_end(arguments);
    const size_t left = sizeof to->text - 1 - to->length;
    to->length += count < 0 ? 0 : (size_t)count < left ? (size_t)count : left;
}

/* Adds an expression, or its begin. */
static void add_expression(struct explanation *to, const char *text) {
    const bool is_long = strlen(text) > LONGEST_TEXT;
    add(to, "%.*s%s", LONGEST_TEXT, text, is_long ? "..." : "");
}

/* ---- Names ---------------------------------------------------------------------------------- */

/* Returns the variable at this offset or, unless it is NULL, with this name; NULL if there is none.
 */
static const struct variable *find(const struct instance *instance, size_t offset, const char *name,
                                   size_t length) {
    const struct model_description *description = instance->description;
    for (size_t i = 0; i < description->variable_count; i++) {
        const struct variable *variable = &description->variables[i];
        const bool fits = name == NULL ? variable->offset == offset
                                       : strlen(variable->name) == length &&
                                             strncmp(variable->name, name, length) == 0;
        if (fits && variable->owner == VARIABLE_OF_MODEL) {
            return variable;
        }
    }
    return NULL;
}

static const struct variable *variable_at(const struct instance *instance, size_t offset) {
    return find(instance, offset, NULL, 0);
}

static bool is_in_name(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '.' || (unsigned char)c >= 0x80;
}

/* Returns the derivative of a state. */
static const struct variable *rate_of(const struct instance *instance,
                                      const struct variable *state) {
    const struct model *model = instance->model;
    return instance_is_state(instance, state)
               ? variable_at(instance, model->dx.offset + state->offset - model->states.offset)
               : NULL;
}

/* Returns the variable of the next name in *text that has one, and moves *text behind it; NULL at
 * the end. Indexes belong to names, x[1]; der(x) is the derivative of x. */
static const struct variable *next_variable(const struct instance *instance, const char **text) {
    const struct variable *found = NULL;
    bool is_rate = false;
    while (**text != '\0' && found == NULL) {
        size_t length = 0;
        while (is_in_name((*text)[length])) {
            length++;
        }
        const size_t base = length;
        if (length > 0 && (*text)[length] == '[') {
            length += strcspn(*text + length, "]");
            length += (*text)[length] == ']';
        }
        if (length > 0) {
            found = find(instance, 0, *text, length);
            length = found != NULL ? length : base; // indexes may be variables
            found = is_rate && found != NULL ? rate_of(instance, found) : found;
            is_rate = strncmp(*text, "der(", strlen("der(")) == 0;
        }
        *text += length > 0 ? length : 1;
    }
    return found;
}

/* Returns the value of a variable; NAN of a calculated int that has none. */
static double value_of(const struct place *place, const struct variable *variable) {
    const void *field = place->values + variable->offset;
    if (variable->type == VARIABLE_FLOAT64) {
        return *(const double *)field;
    }
    const int value = *(const int *)field;
    const bool is_calculated = variable->initial == INITIAL_CALCULATED;
    return is_calculated && value == MODEL_NO_INT ? (double)NAN : value;
}

static const struct expression *expression_at(const struct place *place, size_t offset) {
    const struct model *model = place->instance->model;
    for (size_t i = 0; i < model->expression_count; i++) {
        if (model->expressions[i].text != NULL && model->expressions[i].offset == offset) {
            return &model->expressions[i];
        }
    }
    return NULL;
}

/* Returns an expression that the text names and that is not finite; NULL if there is none. */
static const struct expression *cause_in(const struct place *place, const char *text) {
    const struct variable *variable;
    while ((variable = next_variable(place->instance, &text)) != NULL) {
        const struct expression *found = expression_at(place, variable->offset);
        if (found != NULL && !isfinite(value_of(place, variable))) {
            return found;
        }
    }
    return NULL;
}

/* Adds the values of the variables that the text names, each once. */
static void add_values(const struct place *place, const char *text, struct explanation *to) {
    const struct variable *shown[MOST_VALUES];
    size_t count = 0;
    const struct variable *variable;
    while (count < MOST_VALUES && (variable = next_variable(place->instance, &text)) != NULL) {
        bool is_new = true;
        for (size_t i = 0; i < count; i++) {
            is_new = is_new && shown[i] != variable;
        }
        if (is_new) {
            shown[count] = variable;
            add(to, "%s %s = %.17g", count == 0 ? " with" : ",", variable->name,
                value_of(place, variable));
            count++;
        }
    }
}

/* Adds the expression from which it comes that the text is not finite, unless this is the text
 * itself; and the values of its names. */
static void add_cause(const struct place *place, const char *text, struct explanation *to) {
    const struct expression *cause = NULL;
    const struct expression *next = cause_in(place, text);
    for (int count = 0; next != NULL && count < DEEPEST_CAUSE; count++) {
        cause = next;
        next = cause_in(place, cause->text);
    }
    if (cause != NULL) {
        const struct variable *variable = variable_at(place->instance, cause->offset);
        add(to, ", since %s = ", variable != NULL ? variable->name : "a part");
        add_expression(to, cause->text);
        add(to, " is not");
    }
    add_values(place, cause != NULL ? cause->text : text, to);
}

/* Adds which equations have no solution. Returns false if all have one. */
static bool add_unsolved(const struct place *place, struct explanation *to) {
    const struct model *model = place->instance->model;
    char text[400];
    if (model->explain == NULL || !model->explain(place->values, place->t, text, sizeof text)) {
        return false;
    }
    add(to, "%s", text);
    return true;
}

/* ---- Explanations --------------------------------------------------------------------------- */

/* Adds "derivative of " and the name of the state, or the name of the variable. */
static void add_name(const struct instance *instance, size_t offset, struct explanation *to) {
    const struct model *model = instance->model;
    const size_t from_derivatives = offset - model->dx.offset;
    const bool is_rate = model->expression_count > 0 && from_derivatives < model->dx.size &&
                         offset - model->states.offset >= model->states.size;
    const struct variable *variable =
        variable_at(instance, is_rate ? model->states.offset + from_derivatives : offset);
    add(to, "%s%s", is_rate ? "derivative of " : "", variable != NULL ? variable->name : "a value");
}

/* Adds why the value at this offset of the place's values, or its slope, is not finite. */
static void explain_field(const struct place *place, size_t offset, bool is_slope,
                          struct explanation *to) {
    const struct expression *expression = expression_at(place, offset);
    const struct variable *variable = variable_at(place->instance, offset);
    const bool is_int = variable != NULL && variable->type != VARIABLE_FLOAT64;
    const bool has_no_value = is_int && variable->type != VARIABLE_INT32;
    add_name(place->instance, offset, to);
    if (expression != NULL) {
        add(to, ": ");
        add_expression(to, expression->text);
    }
    add(to, " %s at t = %.17g",
        is_slope       ? "has no finite slope"
        : has_no_value ? "has no value"
        : is_int       ? "is no number of 32 bits"
                       : "is not finite",
        place->t);
    if (expression != NULL) {
        add_cause(place, expression->text, to);
    }
}

void instance_explain_text(struct instance *instance, const char *text,
                           struct explanation *explanation) {
    char *values = instance->first_derivatives;
    const struct place place = {instance, values, instance->state.time.s};
    memcpy(values, instance->memory.values, instance->model->values_size);
    if (instance->model->explain != NULL) {
        add(explanation, "; ");
        explanation->length *= add_unsolved(&place, explanation);
        explanation->text[explanation->length] = '\0';
    }
    if (explanation->length == 0 && instance->model->outputs(values, place.t) == STATUS_OK) {
        add_cause(&place, text, explanation);
    }
}

/* Returns the first derivative that is not finite; NULL if there is none. */
static const double *first_not_finite(const double derivatives[], size_t count) {
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(derivatives[i])) {
            return &derivatives[i];
        }
    }
    return NULL;
}

/* Explains why the equations, or their derivatives, are not finite where the integrator has met
 * that; of a step that has failed otherwise, only why there is no solution. */
static void explain_evaluation(struct instance *instance, bool is_failure, struct explanation *to) {
    const struct model *model = instance->model;
    const size_t count = count_of(model->dx);
    double t;
    const double *x = integrator_failure(instance->integrator, &t);
    char *values = instance->first_derivatives;
    char *slopes = instance->second_derivatives;
    const struct place place = {instance, values, instance->state.restart_time.s + t};
    if (x == NULL) {
        return;
    }
    memcpy(values, instance->memory.restart_values, model->values_size);
    memcpy(doubles_of(values, model->states), x, model->states.size);
    for (size_t i = 0; i < count_of(model->inputs); i++) {
        doubles_of(values, model->inputs)[i] =
            polynomial_value(&instance->memory.active_inputs[i], t);
    }
    if (add_unsolved(&place, to) || !is_failure || model->outputs(values, place.t) != STATUS_OK) {
        return;
    }
    const double *dx = doubles_of(values, model->dx);
    const double *refused = first_not_finite(dx, count);
    if (refused != NULL) {
        explain_field(&place, model->dx.offset + (size_t)(refused - dx) * sizeof *dx, false, to);
        return;
    }
    memset(slopes, 0, model->values_size);
    memcpy(doubles_of(slopes, model->states), dx, model->states.size);
    const double *ddx = doubles_of(slopes, model->dx);
    if (model->derivatives(values, place.t, 1.0, slopes, NULL) == STATUS_OK &&
        (refused = first_not_finite(ddx, count)) != NULL) {
        explain_field(&place, model->dx.offset + (size_t)(refused - ddx) * sizeof *ddx, true, to);
    }
}

/* Parts of the time since the restart after which a motion that has failed is looked at. */
static const double ahead[] = {1e-12, 1e-9, 1e-6};

/* Adds which equations have no solution shortly ahead of the present state. */
static void explain_ahead(struct instance *instance, struct explanation *to) {
    const struct model *model = instance->model;
    const struct instance_state *state = &instance->state;
    char *values = instance->first_derivatives;
    const double *x = doubles_of(instance->memory.values, model->states);
    memcpy(values, instance->memory.values, model->values_size);
    if (model->explain == NULL || model->outputs(values, state->time.s) != STATUS_OK) {
        return;
    }
    for (size_t k = 0; to->length == 0 && k < sizeof ahead / sizeof ahead[0]; k++) {
        const double h = ahead[k] * (state->latest_time + fabs(state->statistics.last_step));
        const struct place place = {instance, values, state->time.s + h};
        for (size_t i = 0; i < count_of(model->states); i++) {
            doubles_of(values, model->states)[i] = x[i] + h * doubles_of(values, model->dx)[i];
        }
        (void)add_unsolved(&place, to);
    }
}

void instance_explain_step(struct instance *instance, enum status status,
                           struct explanation *explanation) {
    if (instance->integrator == NULL) {
        return;
    }
    explain_evaluation(instance, status == STATUS_NOT_FINITE, explanation);
    if (explanation->length == 0) {
        explain_ahead(instance, explanation);
    }
    if (explanation->length == 0 && status == STATUS_TOO_MANY_STEPS &&
        instance->configured.method != INTEGRATOR_CVODE_BDF &&
        integrator_seems_stiff(instance->integrator)) {
        add(explanation,
            "%s: the equations seem to be stiff, for which solver_method = cvode_bdf is made",
            status_text(status));
    }
}

enum status instance_field_not_finite(struct instance *instance, size_t offset) {
    const struct place place = {instance, instance_shown_values(instance), instance->state.time.s};
    struct explanation why = {.length = 0};
    if (add_unsolved(&place, &why)) {
        message_write(&instance->sink, STATUS_NOT_FINITE, "%s", why.text);
        return STATUS_NOT_FINITE;
    }
    if (expression_at(&place, offset) == NULL) {
        add_name(instance, offset, &why);
        return instance_not_finite(instance, why.text);
    }
    explain_field(&place, offset, false, &why);
    message_write(&instance->sink, STATUS_NOT_FINITE, "%s", why.text);
    return STATUS_NOT_FINITE;
}
