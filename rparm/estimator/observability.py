"""Which states and parameters measurements do not show: the rank of Lie derivatives.

The slopes of y, L_f y, L_f^2 y, ... by all that is estimated, at a point near the start with inputs
that move: what lies in their null space changes no measurement (Hermann and Krener, 1977). Inputs
are constant here. There is no answer where an operation has no value in this file, such as tables.
"""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress

import numpy as np

from rparm.estimator.request import Request
from rparm.fmu_tools.compiler.expressions.expression import OPERATIONS, in_order
from rparm.fmu_tools.compiler.graph.graph import Value

MOST_OPERATIONS = 20_000
POINTS = 3  # at each the rank may be lower by chance
RELATIVE = 1e-9  # singular values that count as 0
MOVED = 0.3  # by how much inputs and states are away from the start
OF_DOUBLES = OPERATIONS | {
    "if": lambda condition, a, b: a if condition else b, "pow": math.pow, "isnan": math.isnan,
    "isfinite": math.isfinite, "value_of": lambda x: x, "moving_as": lambda x, _: x,
    "slopes_scaled": lambda slope, d: slope * d if d else 0.0, "slopes_bounded": lambda slope: slope,
    "slopes_product": lambda a, b, _: a * b if b else 0.0,
}  # fmt: skip


def unobservable(request: Request) -> list[str]:
    """Return names of what no measurement shows; none if that is not known."""
    plant = request.plant
    estimated = [plant.variables[name] for name in (*(v.name for v in plant.of("states")),)]
    estimated += [plant.variables[name] for name in request.unknown]
    measured = [plant.variables[name] for name in request.measure]
    rates = {v.leaf: v.value for v in plant.of("states")}
    scales = np.array([abs(v.start or 0.0) or v.nominal or 1.0 for v in estimated])
    rows: list[Value] = [v.leaf or v.value for v in measured]
    slopes: list[list[Value]] = []
    missing: list[str] = []
    random = np.random.default_rng(0)
    points = [_point(request, random) for _ in range(POINTS)]
    for _ in estimated:
        found = plant.graph.gradients(rows, [v.leaf for v in estimated])
        zero = plant.graph.number(0.0)
        slopes += [[row.get(v.leaf, zero) for v in estimated] for row in found]
        if len(in_order([value for row in slopes for value in row])) > MOST_OPERATIONS:
            return []
        matrices = [_numbers(slopes, point, request) for point in points]
        known = [m * scales for m in matrices if m is not None]
        if not known:
            return []
        missing = min((_null(m, [v.name for v in estimated]) for m in known), key=len)
        if not missing:
            return []
        rows = plant.graph.derivatives(rows, rates)
    return missing


def _null(matrix: np.ndarray, names: Sequence[str]) -> list[str]:
    """Return what has a part in the null space of a matrix (rows, names)."""
    lengths = np.linalg.norm(matrix, axis=1, keepdims=True)
    _, sizes, right = np.linalg.svd(matrix / np.where(lengths > 0, lengths, 1.0))
    rank = int(np.sum(sizes > RELATIVE * max(sizes[0], 1e-300)))
    return [x for x, part in zip(names, right[rank:].T, strict=True) if np.abs(part).max(initial=0) > 1e-6]


def _point(request: Request, random: np.random.Generator) -> dict[tuple[str, str], float]:
    """Return values of the leaves, by operation and name."""
    plant, found = request.plant, {("time", ""): 0.0}
    for v in plant.variables.values():
        if v.leaf is not None:
            start = float(v.start or 0.0)
            moves = v.section in ("inputs", "states") or v.name in request.unknown
            size = abs(start) or v.nominal or 1.0
            found[v.leaf.op, v.name] = start + moves * MOVED * size * random.uniform(0.5, 1.0)
    return found | {("mode", name): float(start) for name, start in plant.modes.items()}


def _numbers(
    slopes: Sequence[Sequence[Value]], point: Mapping[tuple[str, str], float], request: Request
) -> np.ndarray | None:
    """Evaluate slopes; None where an operation is not known or not defined."""
    relations, found = request.plant.graph.relations, {}
    roots = [value for row in slopes for value in row]
    distances = [r.distance for r in relations.values()]
    with suppress(KeyError, ArithmeticError, ValueError):
        for value in in_order([*distances, *roots]):
            if value.op == "number":
                found[value] = value.number
            elif not value.arguments:
                relation = relations.get(value.name) if value.op == "mode" else None
                known = None if relation is None else found[relation.distance] > 0
                found[value] = point[value.op, value.name] if known is None else known
            else:
                found[value] = OF_DOUBLES[value.op](*(found[a] for a in value.arguments))
        matrix = np.array([[found[value] for value in row] for row in slopes])
        return matrix if np.isfinite(matrix).all() else None
    return None
