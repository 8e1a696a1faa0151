"""Equations that need each other in C (src/model/algebraic.h): their systems and messages."""

import math
from collections.abc import Mapping

from ..graph.algebraic import FREE, System, components
from ..graph.graph import CONDITIONS
from ..read.content import ModelFile
from . import c_hook
from .c_code import Code, Leaves, in_row, of_both
from .c_events import arrays, leaves
from .c_text import indented, text
from .statements import Operand, Place, Statement, store

ANCHORS = "anchors"


def fields(file: ModelFile) -> list[str]:
    """Return the fields of the value structure for unknowns without a start."""
    if not file.anchors:
        return []
    return ["/* where solutions are searched */", f"double {ANCHORS}[{2 * len(file.anchors)}];"]


def parts(file: ModelFile, followed: list[str]) -> dict[str, list[str]]:
    """Return lines of equations.c.in; nothing where no equations need each other.

    followed: statements that let `values` have the modes in effect.
    """
    systems, linear = file.graph.systems, file.graph.linear
    if not (systems or linear):
        return dict.fromkeys(("algebraic_header", "systems", "solutions", "solving"), [])
    head = f"    const {c_hook.structure(file)} *values = values_pointer;"
    solving = [".explain = explain,"]
    solutions = [
        "static bool explain(const void *values_pointer, double time, char *text, size_t size) {",
        head,
        *indented(followed),
        "    (void)values;",
        *indented(_failures(file)),
        "    return false;",
        "}",
        "",
    ]
    if file.anchors:
        solving += anchors(file)
        solutions += [
            "static void anchor(const void *values_pointer, double time, const double state[],",
            "                   const double input[], enum model_search search,",
            "                   double anchors[]) {",
            head,
            "    (void)values;",
            *indented(_anchored(file)),
            "}",
            "",
        ]
    return {
        "algebraic_header": ['#include "algebraic.h"'],
        "systems": [line for system in systems.values() for line in _system(file, system)],
        "solutions": solutions,
        "solving": solving,
    }


def anchors(file: ModelFile) -> list[str]:
    """Return the members of a struct for anchors, if there are any."""
    if not file.anchors:
        return []
    size = f"sizeof(double) * {2 * len(file.anchors)}"
    place = f"offsetof({c_hook.structure(file)}, {ANCHORS})"
    return [f".anchors = {{{place}, {size}}},", ".anchor = anchor,"]


def _system(file: ModelFile, system: System) -> list[str]:
    """Return the struct algebraic of a system, and the function that solves it."""
    count, number = len(system.unknowns), system.name
    given: Mapping[tuple[str, str], Operand] = {
        (leaf.op, leaf.name): _given(file, system, i) for i, leaf in enumerate(system.given)
    }
    own = {
        (leaf.op, leaf.name): Place("unknown[", i, "]", leaf.name, is_opaque=True)
        for i, leaf in enumerate(system.unknowns)
    }
    found = leaves(file)
    places = {**given, **own, ("mode", FREE): "is_free"}
    code = Code(Leaves(places, found.names, found.arrays, found.conditions))
    of_residuals, of_slopes = system.free or (system.residuals, system.slopes.values())
    residuals = {Place("residual[", i, "]"): of for i, of in enumerate(of_residuals)}
    slopes = {
        Place("slope[", i * count + j, "]"): of
        for (i, j), of in zip(system.slopes, of_slopes, strict=True)
    }
    first, second = of_both(code, residuals, slopes, "slope", "return;")
    rows = {
        f"nominal_{number}": system.nominal,
        f"low_{number}": system.low,
        f"high_{number}": system.high,
    }
    return [
        f"static void evaluate_{number}(const double given[], bool is_free,",
        "                               const double unknown[], double residual[],",
        "                               double slope[]) {",
        "    (void)given;",
        *indented([*first, *second]),
        "}",
        "",
        *(_array(name, row) for name, row in rows.items()),
        "",
        f"static const struct algebraic system_{number} = {{",
        f"    {text(', '.join(system.names))},",
        f"    {text('; '.join(system.texts))},",
        f"    {count}, {str(system.free is not None).lower()}, nominal_{number}, low_{number}, "
        f"high_{number}, evaluate_{number},",
        "};",
        "",
        f"MAYBE_UNUSED static void factorize_{number}(const double given[],",
        "                                      const double unknown[], double matrix[],",
        "                                      int pivot[]) {",
        f"    double residual[{count}];",
        f"    evaluate_{number}(given, false, unknown, residual, matrix);",
        f"    algebraic_factorize({count}, matrix, pivot);",
        "}",
        "",
        f"MAYBE_UNUSED static void spread_{number}(const double given[], const double unknown[],",
        "                                   double error[]) {",
        f"    algebraic_spread(&system_{number}, ALGEBRAIC_ROOM({count}), given, unknown, error);",
        "}",
        "",
        f"static bool solve_{number}(const double given[], bool is_near, bool is_free,",
        "                            double unknown[]) {",
        f"    return algebraic_solve(&system_{number}, ALGEBRAIC_ROOM({count}), given, is_near,",
        "                           is_free, unknown)",
        "               .outcome == ALGEBRAIC_SOLVED;",
        "}",
        "",
    ]


def _given(file: ModelFile, system: System, number: int) -> Operand:
    """Return where equations read a value from outside."""
    value = system.solution.arguments[number]
    name = value.name if not value.arguments else file.graph.names.get(value, "")
    name = "" if name in file.graph.relations or name in file.graph.segments else name
    place = Place("given[", number, "]", name, is_opaque=bool(name))
    return ("!=", place, 0.0) if value.op in CONDITIONS else place


def _array(name: str, row: list[float]) -> str:
    numbers = (repr(x) if math.isfinite(x) else f"{'-' * (x < 0)}INFINITY" for x in row)
    return f"static const double {name}[] = {{{', '.join(numbers)}}};"


def _failures(file: ModelFile) -> list[str]:
    """Return with the reason, if a system has no solution."""
    code, graph = Code(leaves(file)), file.graph
    for system in graph.systems.values():
        count = len(system.unknowns)
        given = [code.of(value) for value in system.solution.arguments]
        call = (
            f"if (algebraic_fails(&system_{system.name}, ALGEBRAIC_ROOM({count}), ",
            *in_row(given[:-count]),
            ", time, ",
            *in_row(given[-count:], "(double[])"),
            ", text, size)) {\n    return true;\n}",
        )
        code.statements.append(Statement(call))
    for linear in graph.linear:
        count = len(linear.vector.arguments) - 1
        found = [code.of(value) for value in components(graph, linear.vector, count)]
        names, texts = text(", ".join(linear.names)), text("; ".join(linear.texts))
        call = (
            f"if (algebraic_lacks({count}, ",
            *in_row(found),
            f", {names}, {texts}, time, text, size)) {{\n    return true;\n}}",
        )
        code.statements.append(Statement(call))
    return code.lines()


def _anchored(file: ModelFile) -> list[str]:
    """Write the solutions, or the old anchors."""
    places = arrays(file).but({}, is_near="search == SEARCH_NEAR", is_free="search == SEARCH_FREE")
    code, stores = Code(places), []
    for i, name in enumerate(file.anchors):
        value, before = code.of(file.anchors[name].value), code.leaves["anchor", name]
        kept = "if", ("isfinite", value), value, before
        stores.append(store(Place("anchors[", i, "]"), kept))
    code.statements += stores
    return code.lines()
