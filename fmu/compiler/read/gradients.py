"""Gradients of a run: states, discrete variables and outputs by parameters and by starts of states.

Each state x gets a state x_by_p, whose rate is the derivative of the rate of x along the change of
p; discrete variables and outputs likewise. At an event the time of the event changes with p, too:
the leaves `shift` are the derivatives of that time, which src/model/gradients.h finds.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from ..expressions.expression import RELATIONS, Node, in_order
from ..expressions.hints import meant
from ..expressions.kinds import CONDITION
from ..graph.contacts import deciding
from ..graph.dominators import Slopes
from ..graph.graph import Graph, Value
from ..units import Exponents
from . import keys
from .content import (
    CALCULATED,
    COUNTS,
    FOLLOWS,
    OPTIONS,
    Change,
    Expression,
    ModelFile,
    ModelFileError,
    Variable,
    placed,
    shown,
)

ARE_EXACT = "gradients_are_exact"
START = re.compile(r"start\(\s*(.+?)\s*\)")
OF_IMPACTS = ("impulse", "impulses", "loss")  # of stops
STEPS = {"floor", "ceil", "round", "sign"}
CONTINUOUS = ("abs", "min", "max")  # switch where both branches are equal
CHANGING = ("state", "discrete", "mode", "integer")
SHIFT = "shift"  # leaf: derivative of the time of an event


@dataclass(frozen=True)
class By:
    """A parameter, or the start of a state, by which there are gradients."""

    shown: str  # as the file has it
    variable: Variable
    is_start: bool

    @property
    def name(self) -> str:
        """How names of gradients end."""
        return f"start_{self.variable.name}" if self.is_start else self.variable.name

    @property
    def size(self) -> float:
        """By what a change of it is large or small, in its unit."""
        return abs(self.variable.start or 0.0) or self.variable.nominal or 1.0


@dataclass
class Gradients:
    """The gradients of a file."""

    by: list[By]
    of: list[str] | None  # variables; None: all states and outputs
    # derivatives of variables, in the order of `by`
    states: dict[Value, list[Value]] = field(default_factory=dict)  # by their leaves
    discrete: dict[Value, list[Value]] = field(default_factory=dict)
    # relations of slopes with 0, and the relations whose distances have these slopes
    watched: dict[str, str] = field(default_factory=dict)
    relations: int = 0  # of the file; those of slopes follow
    parts: dict[tuple[str, str], int] = field(default_factory=dict)  # by leaves
    kinks: set[str] = field(default_factory=set)  # relations where both branches are equal

    @property
    def part_count(self) -> int:
        """The number of parts."""
        return 1 + max(self.parts.values(), default=0)

    def seeds(
        self, graph: Graph, i: int, at_event: Iterable[Value] | None = None, part: int = 0
    ) -> dict[Value, Value]:
        """Return derivatives of all leaves by one of `by`.

        at_event: inputs, which move there; part: in which the event is.
        """
        given = self.by[i]
        found = {leaf: slopes[i] for leaf, slopes in (self.states | self.discrete).items()}
        if not given.is_start:
            found[given.variable.leaf] = graph.number(1.0)
        if at_event is None:
            return found
        shift = graph.value(SHIFT, name=f"{part} {given.name}")
        found |= {graph.value(op): shift for op in ("time", "later")}
        return found | {
            u: graph.value("*", graph.value("first", name=u.name), shift) for u in at_event
        }


def read(file: ModelFile, given: dict[str, Any], by: list[str] | None) -> None:
    """Read [gradients]; by: in place of what the file says."""
    with placed("[gradients]"):
        entries = keys.entries(given | ({"by": by} if by else {}), keys.GRADIENTS, "by")
        if file.hook or file.is_by_hand:
            raise ModelFileError("expected a model whose events are no C by hand")
        found: dict[str, By] = {}
        for text in entries["by"]:
            with placed("by", shown(text)):
                of = _by(file, text)
                if of.name in found:
                    raise ModelFileError("is there already")
                found[of.name] = of
        of = entries.get("of")
        for i, name in enumerate(of or ()):
            with placed("of", shown(name)):
                _check_of(file, name)
                if name in of[:i]:
                    raise ModelFileError("is there already")
        if not found or of == []:
            raise ModelFileError(f"{'of' if found else 'by'}: expected names, got an empty list")
    file.gradients = Gradients([*found.values()], of)


def _by(file: ModelFile, text: str) -> By:
    start = START.fullmatch(text)
    variable = file.variables.get(start[1] if start else text)
    if variable is None:
        known = [v.name for v in file.of("states" if start else "parameters")]
        array = [name for name in known if name.startswith(f"{start[1] if start else text}[")]
        if array:
            raise ModelFileError(f"is an array, expected its elements, {array[0]} ...")
        raise ModelFileError("no such variable" + meant(start[1] if start else text, known))
    if start and variable.section != "states":
        raise ModelFileError(f"{variable.name} is in {variable.place}, expected a state")
    if start and variable.initial is not None:
        raise ModelFileError(f"the start of {variable.name} follows from others: name those")
    if variable.section == "states" and not start:
        raise ModelFileError(f"is a state, expected a parameter or start({variable.name})")
    if variable.section == OPTIONS:
        raise ModelFileError("expected a real parameter")
    if not start and variable.section == FOLLOWS:
        raise ModelFileError("follows from others: name those")
    if not start and variable.section != "parameters":
        raise ModelFileError(f"is in {variable.place}, expected a parameter")
    return By(text, variable, bool(start))


def _check_of(file: ModelFile, name: str) -> None:
    variable = file.variables.get(name)
    if variable is None:
        raise ModelFileError("no such variable" + meant(name, file.variables))
    if not variable.is_real or variable.section not in ("states", "discrete", *CALCULATED):
        raise ModelFileError("expected a real state, discrete variable or entry that follows")


def warnings(file: ModelFile) -> Iterator[str]:
    """Yield what has a gradient of 0 between its steps."""
    for variable in file.calculated_reals:
        functions = {node.function for node in in_order([variable.expression.tree])} & STEPS
        if functions and f"{variable.name}_by_{file.gradients.by[0].name}" in file.variables:
            yield (
                f"[gradients]: {variable.name}: {min(functions)} rests between its steps, and so "
                "its gradients miss how it changes with what they are by"
            )


def add(file: ModelFile) -> None:
    """Add the variables to a file whose expressions have their values."""
    gradients, slopes = file.gradients, Slopes(file.graph)
    of_stops = {c.variable(key) for c in file.contacts for key in OF_IMPACTS}
    moved = [v for v in file.of("states", "discrete") if v.name not in of_stops]
    outputs = [v for v in file.of(*CALCULATED) if v.is_real and _is_wanted(gradients, v)]
    _declare(file, moved)
    gradients.parts = _parts(file)
    for i in range(len(gradients.by)):
        _derive(file, moved, outputs, slopes, i)
        _derive_changes(file, moved, i)
    _add_flag(file)
    _watch(file)


def _declare(file: ModelFile, moved: list[Variable]) -> None:
    """Declare the gradients of states and discrete variables; those of one parameter together."""
    places = {"states": file.gradients.states, "discrete": file.gradients.discrete}
    for by in file.gradients.by:
        for variable in moved:
            made = _variable(file, variable, by, variable.section)
            made.leaf = file.graph.value(variable.leaf.op, name=made.name)
            made.start = 1.0 if by.is_start and by.variable is variable else 0.0
            places[variable.section].setdefault(variable.leaf, []).append(made.leaf)


def _derive(
    file: ModelFile, moved: list[Variable], outputs: list[Variable], slopes: Slopes, i: int
) -> None:
    """Derive rates, outputs and starts by one of the parameters."""
    graph, by, seeds = file.graph, file.gradients.by[i], file.gradients.seeds(file.graph, i)
    states = [v for v in moved if v.section == "states"]
    for x, rate in zip(states, slopes.along([x.value for x in states], seeds), strict=True):
        made = file.variables[_name(x, by)]
        made.expression = _expression(made, rate, f"derivative of d{x.name}/dt by {by.shown}")
    values = graph.derivatives([v.value for v in outputs], seeds)
    for variable, value in zip(outputs, values, strict=True):
        made = _variable(file, variable, by, "outputs")
        made.expression = _expression(made, value, f"derivative of {variable.name} by {by.shown}")
    for variable in moved:
        if variable.initial is not None:
            made = file.variables[_name(variable, by)]
            (value,) = graph.derivatives([variable.initial.value], seeds)
            made.initial = _expression(made, value, f"derivative of the start by {by.shown}")


def _derive_changes(file: ModelFile, moved: list[Variable], i: int) -> None:
    """Derive the new values of events and samplers by one of the parameters."""
    graph, by = file.graph, file.gradients.by[i]
    inputs = [u.leaf for u in file.of("inputs")]
    for change in file.changes:
        seeds = file.gradients.seeds(graph, i, inputs, part_of_change(file, change))
        targets = [name for name in change.given if file.variables.get(name) in moved]
        new = graph.derivatives([change.given[name].value for name in targets], seeds)
        for name, value in zip(targets, new, strict=True):
            made = file.variables[_name(file.variables[name], by)]
            text = f"derivative of {name} by {by.shown}"
            change.gradients[made.name] = _expression(made, value, text)


def _parts(file: ModelFile) -> dict[tuple[str, str], int]:
    """Return numbers of parts that do not read each other, by what changes in them."""
    graph, above = file.graph, {}

    def top(leaf: tuple[str, str]) -> tuple[str, str]:
        while above.setdefault(leaf, leaf) != leaf:
            leaf = above[leaf]
        return leaf

    def join(leaves: Iterable[tuple[str, str]]) -> None:
        found = [leaf for leaf in leaves if leaf[0] in CHANGING]
        for leaf in found:
            above[top(leaf)] = top(found[0])

    for x in [x for x in file.of("states") if x.leaf in file.gradients.states]:
        join([(x.leaf.op, x.name), *x.value.leaves])
    for relation in graph.relations.values():
        join([(relation.mode.op, relation.name), *relation.distance.leaves])
    for segment in graph.segments.values():
        modes = ((of.mode.op, of.name) for of in (segment.low, segment.high))
        join([(segment.leaf.op, segment.leaf.name), *segment.argument.leaves, *modes])
    for change in file.changes:
        values = [e.value for e in (*change.conditions, *change.given.values())]
        join([*_targets(file, change), *(leaf for value in values for leaf in value.leaves)])
    modes = [contact.mode for contact in graph.contacts.contacts] if graph.contacts else []
    join(leaf for value in [*deciding(graph), *modes] for leaf in value.leaves)  # one part
    numbers: dict[tuple[str, str], int] = {}
    return {leaf: numbers.setdefault(top(leaf), len(numbers)) for leaf in [*above]}


def _targets(file: ModelFile, change: Change) -> list[tuple[str, str]]:
    """Return the leaves that an event or a sampler changes."""
    variables = file.variables  # modes have no leaf there
    return [(variables[x].leaf.op if x in variables else "mode", x) for x in change.given]


def part_of_change(file: ModelFile, change: Change) -> int:
    """Return the part in which an event or a sampler is."""
    return part_of(file, _targets(file, change)[:1])


def part_of(file: ModelFile, leaves: Iterable[tuple[str, str]]) -> int:
    """Return the part in which one of these leaves is; 0 if there is none."""
    parts = file.gradients.parts
    return next((parts[leaf] for leaf in sorted(leaves) if leaf in parts), 0)


def _watch(file: ModelFile) -> None:
    """Compare slopes of distances with 0, where these turn before a relation switches.

    abs, min and max need none: both branches are equal where they switch.
    """
    graph, texts = file.graph, file.relation_texts
    motion = {x.leaf: x.value for x in file.of("states") if x.leaf in file.gradients.states}
    motion |= {graph.value("time"): graph.number(1.0)}
    pairs = [*zip(graph.relations.values(), graph.nodes, texts, strict=True)]
    file.gradients.relations = len(pairs)
    for relation, node, text in pairs:
        if node.op in CONTINUOUS:
            file.gradients.kinks.add(relation.name)
        if node.op not in RELATIONS or relation.time is not None:
            continue
        (slope,) = graph.derivatives([relation.distance], motion)
        if slope.moves:
            mode = graph.switch(">", slope, graph.number(0.0))
            file.gradients.watched.setdefault(mode.name, relation.name)
        if len(texts) < len(graph.relations):
            graph.nodes.append(node)
            texts.append(f"slope of {text}")


def _is_wanted(gradients: Gradients, variable: Variable) -> bool:
    if gradients.of is not None:
        return variable.name in gradients.of
    return variable.section in ("states", "discrete", "outputs")


def _name(variable: Variable, by: By) -> str:
    return f"{variable.name}_by_{by.name}"


def _variable(file: ModelFile, variable: Variable, by: By, section: str) -> Variable:
    """Add the gradient of a variable."""
    name = _name(variable, by)
    with placed("[gradients]", name):
        if name in file.variables or name in file.modes or name in file.reserved:
            raise ModelFileError("this name is there already")
    made = Variable(name, section)
    made.exponents = _over(variable.exponents, by.variable.exponents)
    made.nominal = (variable.nominal or 1.0) / by.size if section == "states" else None
    made.description = f"Derivative of {variable.name} by {by.shown}"
    if section != "outputs" and not _is_wanted(file.gradients, variable):
        made.causality = "local"
    file.variables[name] = made
    return made


def _over(unit: Exponents, by: Exponents) -> Exponents:
    bases = dict.fromkeys([*unit, *by])
    found = {base: unit.get(base, 0) - by.get(base, 0) for base in bases}
    return {base: exponent for base, exponent in found.items() if exponent}


def _expression(variable: Variable, value: Value, text: str) -> Expression:
    tree = Node("number", 1, value=0.0)
    made = Expression(("[gradients]", variable.name), text, tree, target=variable.name)
    made.value = value
    return made


def _add_flag(file: ModelFile) -> None:
    """Add whether the gradients are exact: events decide it, if there are some."""
    with placed("[gradients]", ARE_EXACT):
        if ARE_EXACT in file.variables or ARE_EXACT in file.modes:
            raise ModelFileError("this name is there already")
    flag = Variable(ARE_EXACT, COUNTS, start=True, kind=CONDITION)
    flag.description = "False after an event about which gradients say nothing"
    file.variables[ARE_EXACT] = flag
    if file.graph.relations or file.changes or file.contacts:
        flag.leaf = file.graph.value("mode", name=ARE_EXACT)
        return
    flag.section, flag.start = "outputs", None
    zero, one = map(file.graph.number, (0.0, 1.0))
    flag.expression = _expression(flag, file.graph.value("<", zero, one), "true")
    flag.expression.kind = CONDITION
