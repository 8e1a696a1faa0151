"""What a filter cannot find, and what is allowed, but may not be meant.

Which states and parameters measurements show follows from the slopes of y, L_f y, L_f^2 y, ... by
all that is estimated, at points near the start, with inputs that rest: what lies in their null
space changes no measurement (Hermann and Krener, 1977). There is no answer where an operation has
no value here, such as a table.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress

import numpy as np

from rparm.errors import UserError
from rparm.estimator.request import Request
from rparm.estimator.terms import Terms
from rparm.fmu_tools.compiler.expressions.expression import OPERATIONS, in_order, names
from rparm.fmu_tools.compiler.graph.graph import SWITCHING, Relation, Value
from rparm.fmu_tools.compiler.read.content import COUNTS, SWITCHES

MOST_OPERATIONS = 20_000
POINTS = 3  # at each the rank may be lower by chance
RELATIVE, PART = 1e-9, 1e-6  # singular values, and parts of vectors, that count as 0
STEPS = 20  # of Newton's method
MOVED = (0.15, 0.3)  # how far inputs and states are from the start, of their size
BRANCHES = ("if", "mode", "element", *SWITCHING)  # also those of abs, min and max
OF_DOUBLES = OPERATIONS | {
    "if": lambda condition, a, b: a if condition else b, "pow": math.pow, "isnan": math.isnan,
    "isfinite": math.isfinite, "value_of": lambda x: x, "moving_as": lambda x, _: x,
    "slopes_scaled": lambda slope, d: slope * d if d else 0.0, "slopes_bounded": lambda x: x,
    "slopes_product": lambda a, b, _: a * b if b else 0.0,
}  # fmt: skip


def check(terms: Terms) -> list[str]:
    """Return warnings; UserError for what a filter cannot find."""
    request, plant = terms.request, terms.plant
    for name in request.measure:
        if not terms.h[name]:
            raise UserError(f"{request.path}: measure: {name}: no state of the plant moves it")
        if not any(terms.p(x, y) for x in terms.h[name] for y in terms.estimated):
            what = "nothing that moves it has a spread: give start, unknown or noise"
            raise UserError(f"{request.path}: measure: {name}: {what}")
    unseen, is_smooth = _unseen(request), _is_smooth(request)
    shows = f"{', '.join(request.measure)} {'does' if len(request.measure) == 1 else 'do'} not show"
    found = [*_of_period(terms), *_of_changes(terms), *_of_switches(terms)]
    if unknown := [x for x in unseen if x in request.unknown]:
        what = f"unknown: {shows} {', '.join(unknown)}"
        if is_smooth:
            raise UserError(f"{request.path}: {what}: other values fit as well")
        found.append(f"{what} near the start: only events, samplers or other branches may")
    if states := [x for x in unseen if x not in request.unknown]:
        where = "" if is_smooth else " near the start"
        found.append(f"measure: {shows} {', '.join(states)}{where}: sigma may grow")
    for name in request.measure:
        variable = plant.variables[name]
        direct = terms.slopes(variable.leaf or variable.value, terms.noisy)
        if both := [u for u in direct if any(u in by for by in terms.b.values())]:
            what = "moves it directly, its noise there counts as independent of that of the states"
            found.append(f"measure: {name}: {', '.join(both)} {what}")
    if plant.modes:
        what = "not measured, the filter takes it from its estimate"
        found.append(f"{plant.path.name}: mode {', '.join(plant.modes)}: {what}")
    return found


def _of_period(terms: Terms) -> Iterator[str]:
    """Yield warnings of a period that is long, or that never ends."""
    request, plant = terms.request, terms.plant
    every, stop = request.every, plant.experiment["stop"]
    for key, time in (("every", every), ("offset", request.offset)):
        if time > stop:
            yield f"{key}: {time:g} s is above the stop time of {plant.path.name}, {stop:g} s"
    states = plant.of("states")
    rows = plant.graph.gradients([v.value for v in states], [v.leaf for v in states])
    zero = plant.graph.number(0.0)
    slopes = [[row.get(v.leaf, zero) for v in states] for row in rows]
    if not any(terms.b.values()) or len(in_order(sum(slopes, []))) > MOST_OPERATIONS:
        return  # what is not noisy is exact for any period
    a = _numbers(slopes, _point(request), request)
    fastest = 0.0 if a is None else float(np.abs(np.linalg.eigvals(a)).max())
    if every * fastest > 1:
        what = f"the fastest time constant of {plant.path.name} at the start, {1 / fastest:.2g} s"
        yield f"every: {every:g} s is above {what}: it takes noise as white, sigma may be wrong"


def _of_changes(terms: Terms) -> Iterator[str]:
    """Yield warnings of events that may happen again, and of held values taken as exact."""
    file = terms.plant.path.name
    for event in terms.plant.events:
        moving = terms.relations(*(e.tree for e in event.conditions))
        if len(moving) == 1 and event.reinit:
            what = "an update may pass its limit from the other side, and it happens again"
            yield f'{file}: [events.{event.name}]: {what}: write while with a direction, as "v < 0"'
    for change in terms.plant.changes:
        for name, new in change.set.items():
            variable = terms.plant.variables.get(name)
            if variable and variable.is_real and terms.moving(names(new.tree)):
                what = "follows from states, the filter takes it as exact"
                yield f"{file}: [discrete]: {name}: {what}"


def _of_switches(terms: Terms) -> Iterator[str]:
    """Yield warnings of rates that jump where a state passes a limit, without a mode."""
    plant, graph = terms.plant, terms.plant.graph
    leaves = set().union(*(v.value.leaves for v in plant.of("states")))
    whole = {
        segment.low.name
        for name, segment in graph.segments.items()
        if ("integer", name) in leaves and not segment.bounds
    }
    random, found = np.random.default_rng(0), {}
    for (name, relation), text in zip(graph.relations.items(), plant.relation_texts, strict=False):
        by = terms.slopes(relation.distance, terms.leaves)
        if by and (name in whole or ("mode", name) in leaves and _jump(terms, name, by, random)):
            limit, _, place = text.rpartition(" of ")
            found.setdefault(place, []).append(limit)
    what = "rates jump there, the covariance does not see it: write a mode that an event sets"
    for place, limits in found.items():
        where = f"{place}: {', '.join(limits)}" if limits[0] else place
        yield f"{plant.path.name}: {where}: {what}"


def _jump(terms: Terms, mode: str, by: Sequence[str], random: np.random.Generator) -> bool:
    """Return whether rates differ by a mode where its distance is 0; False if that is not known."""
    request, graph = terms.request, terms.plant.graph
    distance, rates = graph.relations[mode].distance, [v.value for v in terms.plant.of("states")]
    moved = [terms.plant.variables[name].leaf for name in by]
    (slopes,) = graph.gradients([distance], moved)
    rows = [[distance, *(slopes.get(leaf, graph.number(0.0)) for leaf in moved)]]
    for _ in range(POINTS):
        point = _point(request, random)
        first = _numbers([rates], point, request)
        for _ in range(STEPS):
            found = _numbers(rows, point, request)
            if found is None or not found[0, 1:].any():
                break
            fastest = int(np.argmax(np.abs(found[0, 1:])))
            place = moved[fastest].op, by[fastest]
            point[place] -= found[0, 0] / found[0, 1 + fastest]
        sides = [_numbers([rates], point, request, {mode: holds}) for holds in (False, True)]
        if found is None or abs(found[0, 0]) > RELATIVE or any(m is None for m in (first, *sides)):
            continue
        if np.any(np.abs(sides[1] - sides[0]) > PART * sum(map(np.abs, (first, *sides)))):
            return True
    return False


def _is_smooth(request: Request) -> bool:
    """Return whether slopes near the start describe the plant elsewhere, too."""
    plant = request.plant
    if plant.changes or plant.modes or plant.of("discrete", COUNTS, SWITCHES):
        return False
    values = [v.value for v in plant.of("states")]
    values += [v.value for v in map(plant.variables.get, request.measure) if v.leaf is None]
    return not any(v.op in BRANCHES for v in in_order(values))


def _unseen(request: Request) -> list[str]:
    """Return names of what no measurement shows; none if that is not known."""
    graph, plant = request.plant.graph, request.plant
    estimated = [*plant.of("states"), *(plant.variables[name] for name in request.unknown)]
    rates = {v.leaf: v.value for v in plant.of("states")}
    scales = np.array([abs(v.start or 0.0) or v.nominal or 1.0 for v in estimated])
    measured = [plant.variables[name] for name in request.measure]
    rows = [v.leaf or v.value for v in measured]
    random, zero = np.random.default_rng(0), graph.number(0.0)
    points = [_point(request, random) for _ in range(POINTS)]
    slopes: list[list[Value]] = []
    missing: list[str] = []
    for _ in estimated:
        found = graph.gradients(rows, [v.leaf for v in estimated])
        slopes += [[row.get(v.leaf, zero) for v in estimated] for row in found]
        if len(in_order([value for row in slopes for value in row])) > MOST_OPERATIONS:
            return []
        known = [m for m in (_numbers(slopes, point, request) for point in points) if m is not None]
        null = [_null(matrix * scales, [v.name for v in estimated]) for matrix in known]
        missing = min(null, key=len, default=[])
        if not missing:
            return []
        rows = graph.derivatives(rows, rates)
    return missing


def _null(matrix: np.ndarray, columns: Sequence[str]) -> list[str]:
    """Return which columns have a part in the null space of a matrix (rows, columns)."""
    lengths = np.linalg.norm(matrix, axis=1, keepdims=True)
    _, sizes, right = np.linalg.svd(matrix / np.where(lengths > 0, lengths, 1.0))
    rank = int(np.sum(sizes > RELATIVE))
    parts = np.abs(right[rank:]).max(axis=0, initial=0.0)
    return [name for name, part in zip(columns, parts, strict=True) if part > PART]


def _point(
    request: Request, random: np.random.Generator | None = None
) -> dict[tuple[str, str], float]:
    """Return values of leaves, by operation and name: at the start, or at random near it."""
    found = {("time", ""): 0.0}
    for v in request.plant.variables.values():
        if v.leaf is not None:
            start = float(v.start or 0.0)
            moves = v.section in ("inputs", "states") or v.name in request.unknown
            part = random.uniform(*MOVED) if random else 0.0
            size = (abs(start) or v.nominal or 1.0) * part
            found[v.leaf.op, v.name] = start + moves * size
    return found | {("mode", name): float(start) for name, start in request.plant.modes.items()}


def _numbers(
    slopes: Sequence[Sequence[Value]],
    point: Mapping[tuple[str, str], float],
    request: Request,
    modes: Mapping[str, bool] | None = None,
) -> np.ndarray | None:
    """Evaluate slopes, with given modes; None where an operation is not known or not defined."""
    relations, found, modes = request.plant.graph.relations, {}, modes or {}
    roots = [value for row in slopes for value in row]
    with suppress(KeyError, ArithmeticError, ValueError):
        for value in in_order([*_distances(roots, relations), *roots]):
            if value.op == "number":
                found[value] = value.number
            elif value.arguments:
                found[value] = OF_DOUBLES[value.op](*(found[a] for a in value.arguments))
            elif value.op == "mode" and value.name in modes:
                found[value] = modes[value.name]
            elif value.op == "mode" and value.name in relations:
                found[value] = found[relations[value.name].distance] > 0
            else:
                found[value] = point[value.op, value.name]
        matrix = np.array([[found[value] for value in row] for row in slopes])
        return matrix if np.isfinite(matrix).all() else None
    return None


def _distances(roots: Sequence[Value], relations: Mapping[str, Relation]) -> list[Value]:
    """Return distances of relations that decide values, those of others first."""
    needed, todo = set(), [*roots]
    for value in todo:
        more = {name for op, name in value.leaves if op == "mode" and name in relations} - needed
        needed |= more
        todo += [relations[name].distance for name in more]
    return [r.distance for name, r in relations.items() if name in needed]
