"""Writes what C needs of a declaration: value_references.h and the table in variables.c."""

from ..interface import Declaration, Variable

# C sets and reads calculated parameters like locals
CAUSALITIES = {"calculatedParameter": "LOCAL"}
C_TYPES = {"float64": "double", "int32": "int", "enumeration": "int", "boolean": "int"}


def value_references(declaration: Declaration) -> str:
    name = declaration.name
    prefix = macro_prefix(name)
    lines = [
        "/* Generated from the declaration of the model. */",
        "#pragma once",
        "",
        f'#define {prefix}_NAME "{name}"',
        f'#define {prefix}_GUID "{declaration.guid}"',
        f'#define {prefix}_TOKEN_FMI3 "{declaration.token("fmi3")}"',
        "",
        "enum {",
        *(f"    {prefix}_{n} = {v.reference}," for n, v in declaration.variables.items()),
        "};",
    ]
    return "\n".join(lines) + "\n"


def macro_prefix(name: str) -> str:
    """Prefix of the model's macros, for example RP_MANIPULATOR for RPManipulator."""
    words = [
        ("_" if i and c.isupper() and not name[i + 1 : i + 2].isupper() else "") + c.upper()
        for i, c in enumerate(name)
    ]
    return "".join(words)


def variable_table(declaration: Declaration) -> str:
    """Text of variables.c: the rows, and the check that each field has the declared type."""
    variables = declaration.variables
    structures = {"model": declaration.values, "instance": "struct instance_values"}
    checks, rows = [], []
    for name, variable in variables.items():
        structure = structures[variable.owner]
        checks += type_checks(name, variable, structure)
        rows.append(table_row(name, variable, structure))
    row_of = {v.reference: row for row, v in enumerate(variables.values())}
    entries = [str(row_of.get(reference, -1)) for reference in range(max(row_of, default=-1) + 1)]
    lines = [
        "/* Generated from the declaration of the model. */",
        '#include "instance.h"',
        f'#include "{declaration.header}"',
        '#include "model_description.h"',
        "",
        "#include <math.h>",
        "",
        *checks,
        "",
        "static const struct variable variables[] = {",
        *rows,
        "};",
        "",
        "static const short row_of_reference[] = {",
        *("    " + ", ".join(entries[i : i + 20]) + "," for i in range(0, len(entries), 20)),
        "};",
        "",
        *indicator_list(declaration),
        "const struct model_description model_description = {",
        f'    .name = "{declaration.name}",',
        f'    .guid = "{declaration.guid}",',
        f"    .default_tolerance = {declaration.experiment['tolerance']!r},",
        f"    .model = &{declaration.symbol},",
        "    .variables = variables,",
        "    .variable_count = sizeof variables / sizeof variables[0],",
        "    .row_of_reference = row_of_reference,",
        "    .reference_count = sizeof row_of_reference / sizeof row_of_reference[0],",
        *(INDICATORS if declaration.indicators else []),
        *(["    .has_time_events = true,"] if declaration.has_time_events else []),
        "};",
        "",
        f'const char model_token_fmi3[] = "{declaration.token("fmi3")}";',
    ]
    return "\n".join(lines) + "\n"


INDICATORS = [
    "    .indicators = indicators,",
    "    .indicator_count = sizeof indicators / sizeof indicators[0],",
]


def indicator_list(declaration: Declaration) -> list[str]:
    """The value references of the event indicators; empty without any."""
    names = declaration.indicators
    references = ", ".join(str(declaration.variables[name].reference) for name in names)
    return [f"static const unsigned indicators[] = {{{references}}};", ""] if names else []


def type_checks(name: str, variable: Variable, structure: str) -> list[str]:
    """Checks by the compiler: the type of the field, and the constants of an enumeration."""
    c_type, field = C_TYPES[variable.type], variable.field
    checks = [
        f"_Static_assert(_Generic((({structure} *)0)->{field}, {c_type}: 1, "
        f'default: 0), "{name}: {field} must be of type {c_type}");'
    ]
    checks += [
        f'_Static_assert({constant} == {value}, "{name}: {constant} must be {value}");'
        for value, constant in enumerate(variable.constants, start=1)
    ]
    return checks


def table_row(name: str, variable: Variable, structure: str) -> str:
    """A row of the table: struct variable of src/instance/variables.h."""
    return (
        f'    {{{variable.reference}, "{name}", VARIABLE_{variable.type.upper()}, '
        f"VARIABLE_OF_{variable.owner.upper()}, offsetof({structure}, {variable.field}),\n"
        f"     CAUSALITY_{CAUSALITIES.get(variable.causality, variable.causality.upper())}, "
        f"VARIABILITY_{variable.variability.upper()}, "
        f"INITIAL_{(variable.initial or 'none').upper()},\n"
        f"     {c_number(variable.start, '0.0')}, {c_number(variable.min, '-INFINITY')}, "
        f"{c_number(variable.max, 'INFINITY')}, {c_number(variable.nominal, '1.0')}}},"
    )


def c_number(value: float | None, otherwise: str) -> str:
    """Return the text of a double that reads back as the same value."""
    return otherwise if value is None else repr(float(value))
