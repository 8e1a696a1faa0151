"""The content of a file with equations: variables, events, samplers and expressions."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from declaration.load import shown
from equations_tables import Table

from rparm.expressions.expression import NUMBER, Function, Lookup, Node, parse
from rparm.expressions.units import exponents

FOLLOWS = "calculated"  # section of parameters that follow from others
OPTIONS, SWITCHES = "options", "switches"  # of parameters and inputs that are Booleans
WRITTEN = {
    FOLLOWS: "parameters",
    OPTIONS: "parameters",
    SWITCHES: "inputs",
}  # where files have them
BOOLEAN = "Boolean"
# what other languages have, by what it looks like, and what to do instead
INSTEAD = {
    r"\[": "arrays are not supported: give each element a name and write sums out",
    r"==|^(?:equations?|algebraic|residuals?|dae)$": (
        "equations in implicit form are not supported: solve them for the derivative of each state"
    ),
    r"\b(?:sample[rds]?|pre|previous|hold|clock|interval)\s*(?:\(|$)": (
        "samplers are written as [sampled.NAME] with every and set, which see the values before"
    ),
    r"\b(?:noise|random|rand|randn|gauss|normal|uniform)\s*(?:\(|$)": (
        "noise is not supported: make it outside and give it to an input"
    ),
}


class ModelFileError(Exception):
    """What is wrong with the file, in one line."""


@dataclass(eq=False)
class Expression:
    """An expression of the file."""

    place: tuple[str, ...]
    text: str
    kind: str = NUMBER
    target: str = ""  # the variable or mode that it is assigned to; of a period: time
    is_rate: bool = False  # of the target
    event: str = ""  # "when" one happens, or "then"
    functions: Mapping[str, Function] = field(default_factory=dict)  # of the file
    tree: Node = field(init=False)
    value: Any = field(init=False)  # what a generator makes of it

    def __post_init__(self) -> None:
        with placed(*self.place):
            if not isinstance(self.text, str):
                raise ModelFileError(f"expected an expression in quotes, got {shown(self.text)}")
            try:
                self.tree = parse(self.text, self.functions)
            except ValueError as error:
                raise ModelFileError(f"{error}{instead_of(self.text)}") from None


@dataclass(eq=False)
class Variable:
    """A variable of the file; numbers that it does not give are None."""

    name: str
    section: str
    start: float | bool | None = None
    min: float | None = None
    max: float | None = None
    nominal: float | None = None
    unit: str = ""  # as the file has it
    exponents: dict[str, int] = field(default_factory=dict)  # of the base units and rad
    description: str = ""
    expression: Expression | None = None  # derivative of a state, value of others
    initial: Expression | None = None  # start value that follows from parameters
    leaf: Any = None  # what a generator makes of a parameter, input, state or discrete variable
    arguments: tuple[Variable, ...] = ()  # those of [where] and [outputs] that it names

    @property
    def value(self) -> Any:
        """What the expression calculates."""
        return self.expression.value

    @property
    def place(self) -> str:
        """The section where the file has it."""
        return f"[{WRITTEN.get(self.section, self.section)}]"

    @property
    def is_boolean(self) -> bool:
        """Whether it is a condition."""
        return self.section in (OPTIONS, SWITCHES)


@dataclass
class Change:
    """New values, which an event or a sampler gives."""

    name: str
    during: Expression | None  # `while`
    reinit: dict[str, Expression]  # by state
    set: dict[str, Expression]  # by mode or discrete variable

    @property
    def given(self) -> dict[str, Expression]:
        """New values by variable or mode."""
        return self.reinit | self.set

    @property
    def conditions(self) -> list[Expression]:
        """Conditions on which it happens."""
        return [] if self.during is None else [self.during]

    @property
    def expressions(self) -> list[Expression]:
        """All of them."""
        return [*self.conditions, *self.given.values()]


@dataclass
class Event(Change):
    """An event of the file."""

    when: Expression

    @property
    def conditions(self) -> list[Expression]:
        """Conditions on which it happens."""
        return [self.when, *super().conditions]


@dataclass
class Sampler(Change):
    """A sampler of the file; its periods follow from parameters."""

    every: Expression
    offset: Expression

    @property
    def periods(self) -> list[Expression]:
        """Its times, in s."""
        return [self.every, self.offset]


@dataclass
class ModelFile:
    """All that the file says."""

    name: str
    description: str
    experiment: dict[str, float]
    path: Path
    text: str
    reserved: set[str]  # names that it must not give
    units: dict[str, dict[str, int]] = field(default_factory=dict)  # exponents, of [units]
    functions: dict[str, Function | Lookup] = field(default_factory=dict)
    tables: dict[str, Table] = field(default_factory=dict)
    table_units: dict[str, dict[str, int]] = field(default_factory=dict)  # by `table_unit`
    modes: dict[str, bool] = field(default_factory=dict)  # with their values at the start
    variables: dict[str, Variable] = field(default_factory=dict)
    sampled: list[Sampler] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    checks: dict[str, Expression] = field(default_factory=dict)  # conditions by message
    order: list[Expression] = field(default_factory=list)  # each after those that it names
    graph: Any = None  # what a generator makes of it
    relation_texts: list[str] = field(default_factory=list)  # with their places, for messages

    def expression(self, *given: Any, **more: Any) -> Expression:
        """Read an expression that may call the file's functions."""
        return Expression(*given, **more, functions=self.functions)

    def exponents_of(self, unit: str) -> dict[str, int]:
        """Return the exponents of a unit, which the file or SI has; ValueError if none has it."""
        return self.units[unit] if unit in self.units else exponents(unit)

    @property
    def has_units(self) -> bool:
        """Whether units are checked."""
        return any(variable.unit for variable in self.variables.values())

    @property
    def changes(self) -> list[Change]:
        """Samplers and events, in the order in which they happen at one instant."""
        return [*self.sampled, *self.events]

    @property
    def conditions(self) -> set[str]:
        """Names that are true or false."""
        return {*self.modes, *(v.name for v in self.variables.values() if v.is_boolean)}

    @property
    def calculated(self) -> list[Variable]:
        """Variables that follow from others at any time."""
        return self.of(FOLLOWS, "where", "outputs")

    @property
    def started(self) -> list[Variable]:
        """States and discrete variables whose start values follow from parameters."""
        return [v for v in self.of("states", "discrete") if v.initial is not None]

    @property
    def assigned(self) -> list[Expression]:
        """All expressions that may read everything."""
        found = [variable.expression for variable in self.of("states", "where", "outputs")]
        return found + [expression for change in self.changes for expression in change.expressions]

    @property
    def constant(self) -> list[Expression]:
        """All expressions of parameters only."""
        found = [v.expression for v in self.of(FOLLOWS)] + [v.initial for v in self.started]
        return found + [e for s in self.sampled for e in s.periods] + [*self.checks.values()]

    def of(self, *sections: str) -> list[Variable]:
        """Return variables of these sections, in the order of the file."""
        return [v for section in sections for v in self.variables.values() if v.section == section]


@contextmanager
def placed(*place: object) -> Iterator[None]:
    """Put the place in front of what is wrong inside."""
    try:
        yield
    except (ModelFileError, ValueError) as error:
        raise ModelFileError(": ".join([*map(str, place), str(error)])) from None


def instead_of(text: str) -> str:
    """Propose a replacement of what is not supported, or nothing."""
    found = [sentence for pattern, sentence in INSTEAD.items() if re.search(pattern, text)]
    return f"; {found[0]}" if found else ""
