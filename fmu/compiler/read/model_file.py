"""The graph of a file with equations."""

import math
from collections import ChainMap
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

from ..expressions.expression import RELATIONS, Node, derivative_of, written
from ..expressions.hints import meant
from ..expressions.kinds import CONDITION
from ..graph import algebraic, contacts
from ..graph.algebraic import UNKNOWN
from ..graph.graph import MOVING, Graph, Value
from ..names import Fields, StructFields
from ..plain_c.memory import is_real
from ..plain_c.text import CTextError
from . import file as file_reader
from . import gradients
from .code import Calls
from .components import all_parts
from .content import (
    ALGEBRAIC,
    CALCULATED,
    COUNTS,
    FOLLOWS,
    FORCES,
    OPTIONS,
    PLACEHOLDER,
    SWITCHES,
    Block,
    Expression,
    ModelFile,
    ModelFileError,
    placed,
)
from .header import RATES

__all__ = ["ModelFile", "ModelFileError", "read"]
LEAVES = {
    "parameters": "parameter",
    "inputs": "input",
    "states": "state",
    "discrete": "discrete",
    OPTIONS: "integer",  # conditions are modes
    SWITCHES: "integer",
    COUNTS: "integer",
    FORCES: UNKNOWN,
}


def read(path: Path, by: list[str] | None = None) -> ModelFile:
    """Read and check a file for values of its expressions; ModelFileError if something is wrong.

    by: what there are gradients by, in place of what the file says.
    """
    file = file_reader.read(path, by=by)
    # without states nothing is integrated: outputs follow at once
    has_switches = file.hook is None and bool(file.of("states") or file.events)
    is_exact = file.hook is None  # C by hand keeps its models where they have values
    graph = Graph(tables=file.tables, has_switches=has_switches, is_guarded=is_exact)
    file.graph, calls = graph, Calls(file.code.program, graph, is_exact) if file.code else None
    known = leaves(file, graph)
    known |= {mode: graph.value("mode", name=mode) for mode in file.modes}
    known["pi"] = graph.number(math.pi)
    if calls:
        graph.functions = calls.of(file.code.functions) | _written(file, calls, dict(known))
    in_c = calls.relation_texts if calls else {}
    for prefix, part in all_parts(file):
        if part.code:
            of_part = Calls(part.code.program, graph)
            own = {name.removeprefix(prefix): x for name, x in known.items()
                   if name.startswith(prefix)}  # fmt: skip
            functions = of_part.of(part.code.functions)
            functions |= _written(part, of_part, own | {"time": known["time"]})
            graph.functions |= {f"{prefix}{name}": x for name, x in functions.items()}
            in_c = ChainMap(of_part.relation_texts, in_c)
    counted, checked = {v.name for v in file.calculated if not v.is_real}, {*file.checked}
    sources: list[Expression] = []  # of each relation
    solved: set[Block] = set()
    # right sides last: their conditions are switches of others
    for expression in sorted(file.order, key=lambda expression: expression.event == "then"):
        tree, block = expression.tree, file.blocks.get(expression)
        if block is not None:
            if block not in solved:
                solved.add(block)
                with file_reader.located(path, file.text):
                    Blocks(file, known, sources).solve(block)
            continue
        with file_reader.located(path, file.text), placed(*expression.place):
            if expression.event == "when" and tree.op in RELATIONS:
                sides = [graph.of_tree(side, known) for side in tree.arguments]
                expression.value = graph.switch(tree.op, *sides)
                graph.nodes += [tree] * (len(graph.relations) - len(graph.nodes))
            else:
                is_instant = expression.event == "then"
                graph.has_times = expression.target in counted
                value = graph.of_tree(tree, known, is_instant)
                expression.value = graph.passed(value) if is_instant else value
                if expression in checked:
                    _check_constant(file, value)
        sources += [expression] * (len(graph.relations) - len(sources))
        if expression.is_rate:
            known[derivative_of(expression.target)] = expression.value
        elif expression.target:
            known.setdefault(expression.target, expression.value)
    if file.contacts:
        with file_reader.located(path, file.text):
            _solve_contacts(file)
    for variable in file.of(*CALCULATED):
        if variable.variability and variable.value.moves:
            moving = sorted(name or op for op, name in variable.value.leaves if op in MOVING)
            with file_reader.located(path, file.text), placed(variable.place, variable.name):
                what = f"is for what only events change, but {moving[0]} moves"
                raise ModelFileError(f'variability: "{variable.variability}" {what}')
    for event in file.events:
        for name in PLACEHOLDER.findall(event.terminate):
            with file_reader.located(path, file.text), placed(f"[events.{event.name}]"):
                if name not in file.variables:
                    way_out = meant(name, file.variables)
                    raise ModelFileError(f"terminate: {{{name}}}: no such variable{way_out}")
    places = [source.place for source in sources]
    file.relation_texts = [
        in_c[name]
        if name in in_c
        else f"{place[0].strip('[]').replace('events.', 'event ')} ({_shown(node)})"
        if place[-1] == "when"
        else f"{_shown(node)} of {' '.join(place[:2])}"
        for name, node, place in zip(graph.relations, graph.nodes, places, strict=True)
    ]
    if file.gradients:
        with file_reader.located(path, file.text):
            gradients.add(file)
    file.fields = _fields(file)
    own = {state.value: f"der_{state.name}" for state in reversed(file.of("states"))}
    own |= {variable.value: variable.name for variable in reversed(file.calculated)}
    graph.names |= {value: name for value, name in own.items() if value.arguments}
    return file


def _fields(file: ModelFile) -> Fields | StructFields:
    """Return where the struct of values has the variables."""
    if file.hook:
        states = [v.name for v in file.of("states")]
        return StructFields(file.header.places, RATES, states)
    sections = ("parameters", "inputs", "states", "discrete", OPTIONS, SWITCHES)
    names = [[v.name for v in file.of(section)] for section in sections]
    calculated = [v.name for v in file.calculated]
    return Fields([*names, calculated, [*file.modes, *(v.name for v in file.of(COUNTS))]])


class Blocks:
    """Puts solutions into `known`, in the place of unknowns; sources: of each relation."""

    def __init__(self, file: ModelFile, known: dict[str, Value], sources: list[Expression]) -> None:
        self.file, self.graph, self.known, self.sources = file, file.graph, known, sources
        self.entries = {variable.name: variable for variable in file.calculated}
        self.entries |= {derivative_of(state.name): state for state in file.of("states")}

    def solve(self, block: Block) -> None:
        """Give the entries of a block their values."""
        graph, first = self.graph, len(self.graph.relations)
        unknowns = [graph.value(UNKNOWN, name=name) for name in block.unknowns]
        inside = self.known | dict(zip(block.unknowns, unknowns, strict=True))
        zero = graph.number(0.0)
        for name, (entry, factor) in block.explicit.items():
            inside[name] = self._value(entry, inside | {name: zero} if factor else inside)
            if abs(factor) == 1.0:
                inside[name] = graph.negative(inside[name]) if factor > 0 else inside[name]
            elif factor:
                inside[name] = graph.value("/", inside[name], graph.number(-factor))
        residuals = []
        for name in block.equations:
            value = self._value(name, inside)
            if self.entries[name].section != ALGEBRAIC:
                value = graph.value("-", value, inside[name])
            residuals.append(value)
        with self._placed(block):
            found, block.is_linear = algebraic.solved(
                graph,
                block.unknowns,
                [self._text(name) for name in block.equations],
                unknowns,
                residuals,
                lambda: [self._guess(name) for name in block.unknowns],
                self._ranges(block.unknowns),
                [*graph.relations.values()][first:],
            )
        by = dict(zip(unknowns, found, strict=True))
        algebraic.put(graph, by, first)
        for name in block.explicit:
            (self.entries[name].expression.value,) = algebraic.replaced(graph, [inside[name]], by)
        for name, value in zip(block.unknowns, found, strict=True):
            self.entries[name].expression.value = value
        self.known |= {name: self.entries[name].expression.value for name in block.names}

    def _value(self, name: str, inside: Mapping[str, Value]) -> Value:
        """What the expression of an entry calculates from the unknowns."""
        expression = self.entries[name].expression
        with placed(*expression.place):
            value = self.graph.of_tree(expression.tree, inside)
        self.sources += [expression] * (len(self.graph.relations) - len(self.sources))
        return value

    def _guess(self, name: str) -> Value:
        """Where the search begins: the start of the unknown, or its value at the last restart."""
        guess = self.entries[name].guess
        if guess is None:
            self.file.anchors[name] = self.entries[name]
            return self.graph.value("anchor", name=name)
        return guess.value

    @contextmanager
    def _placed(self, block: Block) -> Iterator[None]:
        """Name the entries of a block, with the file and the line of the first one."""
        first, all_of = self.entries[block.names[0]], ", ".join(block.names)
        names = [first.name, *([all_of] if len(block.names) > 1 else [])]
        section, *_ = first.expression.place
        owners = [(p, part) for p, part in all_parts(self.file) if first.name.startswith(p)]
        if not owners or section == "[connections]":
            with placed(section, *names):
                yield
            return
        prefix, part = owners[-1]
        text = part.path.read_text(encoding="utf-8")
        names[0] = first.name.removeprefix(prefix)
        with (
            placed("[components]", prefix[:-1]),
            file_reader.located(part.path, text),
            placed(first.place, *names),
        ):
            yield

    def _text(self, name: str) -> str:
        expression = self.entries[name].expression
        return f"{'0' if self.entries[name].section == ALGEBRAIC else name} = {expression.text}"

    def _ranges(self, names: list[str]) -> tuple[list[float], list[float], list[float]]:
        """Nominal values, lower and upper bounds of unknowns."""
        found = [self.entries[name] for name in names]
        return (
            [v.nominal or 1.0 for v in found],
            [-math.inf if v.min is None else v.min for v in found],
            [math.inf if v.max is None else v.max for v in found],
        )


def _solve_contacts(file: ModelFile) -> None:
    """Put the forces of friction and stops in the place of their names."""
    graph, states = file.graph, file.of("states")
    found = [
        contacts.Contact(
            contact.name,
            contact.is_friction,
            graph.value(UNKNOWN, name=contact.force),
            file.variables[contact.variable("mode")].leaf,
            {key: expression.value for key, expression in contact.given.items()},
        )
        for contact in file.contacts
    ]
    for contact in found:
        if "breakaway" in contact.given:
            contact.given.setdefault("stribeck", graph.number(0.0))
    before = {state.leaf: state.value for state in states}
    try:
        graph.contacts, shown, rates = contacts.Builder(graph, found, before).build()
    except contacts.ContactError as error:
        with placed(f"[{error.contact.name}]", error.key):
            raise ModelFileError(str(error)) from None
    by = shown | {old: rates[x] for x, old in before.items() if old.op != "state"}
    expressions = [e for e in [*file.order, *file.initial] if hasattr(e, "value")]
    values = algebraic.replaced(graph, [e.value for e in expressions], by)
    for expression, value in zip(expressions, values, strict=True):
        expression.value = value
    for state in states:
        state.expression.value = rates[state.leaf]
    algebraic.put(graph, by, 0)
    for system in graph.systems.values():
        (system.solution,) = algebraic.replaced(graph, [system.solution], by)
    vectors = algebraic.replaced(graph, [linear.vector for linear in graph.linear], by)
    pairs = zip(graph.linear, vectors, strict=True)
    graph.linear = [replace(linear, vector=vector) for linear, vector in pairs]
    for contact in file.contacts:
        force = file.variables[contact.force]
        force.expression = file.variables[contact.variable("force")].expression
        force.leaf = None


def leaves(file: ModelFile, graph: Graph) -> dict[str, Value]:
    """Make the values that nothing calculates, of variables and time; return them by name."""
    for variable in file.of(*LEAVES):
        op = "mode" if variable.kind == CONDITION else LEAVES[variable.section]
        variable.leaf = graph.value(op, name=variable.name)
    return {v.name: v.leaf for v in file.of(*LEAVES)} | {"time": graph.value("time")}


def _check_constant(file: ModelFile, value: Value) -> None:
    """Check that a condition follows from parameters only."""
    known = {v.name for v in file.of("parameters", FOLLOWS, OPTIONS)}
    todo = [*value.leaves]
    for _, name in todo:
        if name in file.graph.relations:
            todo += file.graph.relations[name].distance.leaves
    others = {name or op for op, name in todo} - known - file.graph.relations.keys()
    if others:
        raise ModelFileError(f"follows from {min(others)}, which is no parameter")


def _written(
    file: ModelFile, calls: Calls, known: dict[str, Value]
) -> dict[str, Callable[[list[Value], bool], Value]]:
    """Return the variables that a function of C writes, as functions.

    Of a component they have its inputs as arguments; others have none.
    """
    places, inputs = file.header.places, [v.name for v in file.of("inputs", SWITCHES)]

    def leaf(place: tuple[str | int, ...], kind: object) -> object:
        name = places.get(place[1:], "")
        if name not in known:
            field = "".join(f"[{x}]" if isinstance(x, int) else f".{x}" for x in place[1:])
            raise CTextError(f"{file.calculate} reads {field[1:]} before it writes it")
        if is_real(kind):
            return known[name]
        if known[name].op == "mode":
            return calls.conditions.choice(known[name], 1, 0)
        return calls.conditions.leaf(name, file.variables[name].numbers)

    @cache
    def values(given: tuple[Value, ...]) -> dict[str, Value]:
        known.update(zip(inputs, given, strict=False))
        found = calls.written(file.calculate, leaf)
        named = {places[place]: value for place, value in found.items() if place in places}
        flat = calls.flat[file.calculate]
        file.code.flat.update({f"{file.calculate}: {name}": flat for name in named})
        return named

    def value(name: str, given: list[Value], _is_instant: bool) -> Value:
        found = values(tuple(given))
        if name not in found:
            raise CTextError(f"has no value, and {file.calculate} writes none")
        return found[name]

    written = [
        v for v in file.calculated if v.expression.tree.name == f"{file.calculate}: {v.name}"
    ]
    return {v.expression.tree.name: partial(value, v.name) for v in written}


def _shown(switch: Node) -> str:
    """Return the text of a relation, or of the function that rounds."""
    if switch.op != "floor" or switch.function == "floor":
        return written(switch)
    count = 1 if switch.function == "round" else 2  # round(x) adds 0.5
    given = switch.arguments[0].arguments[:count]
    return f"{switch.function}({', '.join(map(written, given))})"
