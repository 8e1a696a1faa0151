"""The content of a file with equations: variables, events, samplers and expressions."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from ..expressions.expression import ExpressionError, Node, in_order
from ..expressions.indexes import at_indexes
from ..expressions.kinds import CONDITION, NUMBER, Kind
from ..expressions.parser import RANDOM_FUNCTIONS, Function, Lookup, parse
from ..graph.tables import LookupTable
from ..interface import Terminal
from ..units import Exponents, Unit, parsed
from .code import CodeFile

FOLLOWS = "calculated"  # section of parameters that follow from others
# of parameters, inputs and discrete variables that are no real numbers
ALGEBRAIC = "algebraic"  # unknowns of equations
FORCES = "forces"  # unknowns of contacts
FIXED_LIMITS = ("lower", "upper")
OPTIONS, SWITCHES, COUNTS = "options", "switches", "counts"
WRITTEN = {  # where files have them
    FOLLOWS: "parameters",
    OPTIONS: "parameters",
    SWITCHES: "inputs",
    COUNTS: "discrete",
    FORCES: "forces of friction and stops",
}
CALCULATED = (ALGEBRAIC, "where", "outputs")  # sections of what follows from all others
BOOLEAN, INTEGER = "Boolean", "Integer"
FIXED, DISCRETE = "fixed", "discrete"  # variabilities: of parameters, and of what follows
MOST_NUMBERS = 16  # that a whole number may be, for conditions to be resolved
MOST_OPERATIONS = 1_000_000  # of all expressions
LONGEST_SHOWN = 60  # characters of a value in a message
PLACEHOLDER = re.compile(r"\{((?:\w+\.)*\w+(?:\[[0-9,]+\])?)\}")  # of a value in a message
# what other languages have, by what it looks like, and what to do instead
INSTEAD = {
    r"^(?:equations?|residuals?|dae)$": (
        "equations in implicit form are entries of [algebraic], each with an equation"
    ),
    r"\b(?:sample[rds]?|pre|previous|hold|clock|interval)\s*(?:\(|$)": (
        "samplers are written as [sampled.NAME] with every and set, which see the values before"
    ),
    r"\b(?:noise|random|rand|randn|gauss|normal|uniform)\s*(?:\(|$)": (
        "random numbers are noise(seed, k) and uniform(seed, k), of whole numbers"
    ),
}


class ModelFileError(Exception):
    """What is wrong with the file, in one line."""


@dataclass(frozen=True)
class Element:
    """An entry of the file, or one of those that `for` makes of it."""

    name: str
    shown: str  # in messages
    entry: Any
    indexes: dict[str, int] = field(default_factory=dict)


@dataclass(eq=False)
class Expression:
    """An expression of the file."""

    place: tuple[str, ...]
    text: str
    tree: Node
    kind: Kind | None = NUMBER  # None: any
    target: str = ""  # the variable or mode that it is assigned to; of a period: time
    is_rate: bool = False  # of the target
    event: str = ""  # "when" one happens, or "then"
    is_checked: bool = False  # of a component, which has been checked as a file of its own
    value: Any = field(init=False)  # what a generator makes of it


@dataclass(eq=False)
class Variable:
    """A variable of the file; numbers that it does not give are None."""

    name: str
    section: str
    start: float | bool | int | None = None  # of an enumeration the number of the item, from 1
    min: float | None = None
    max: float | None = None
    nominal: float | None = None
    kind: Kind = NUMBER
    unit: str = ""  # of SI, if the file has a name for it
    exponents: Exponents = field(default_factory=dict)
    display: tuple[str, float, float] | None = None  # unit in the file, with factor and offset
    description: str = ""
    derivative_of: str = ""  # the state of which the FMU has it as the derivative
    follows: tuple[str, ...] = ()  # what it follows from, if C by hand calculates it
    variability: str = ""  # "fixed" or "discrete" if the file says so
    causality: str = ""  # "local" of a state that is no output
    shown: bool = True  # the FMU has it as a variable
    field: str = ""  # where the C of the file has it, if not by its name
    expression: Expression | None = None  # derivative of a state, value of others
    guess: Expression | None = None  # of an unknown: where its search begins
    initial: Expression | None = None  # start value that follows from parameters and inputs
    leaf: Any = None  # what a generator makes of a parameter, input, state or discrete variable

    @property
    def value(self) -> Any:
        """What the expression calculates."""
        return self.expression.value

    @property
    def numbers(self) -> tuple[int, ...] | None:
        """What a whole number or an enumeration may be, if that is little."""
        if isinstance(self.kind, tuple):
            return tuple(range(1, 1 + len(self.kind)))
        if self.min is None or self.max is None or self.max - self.min >= MOST_NUMBERS:
            return None
        return tuple(range(int(self.min), int(self.max) + 1))

    @property
    def place(self) -> str:
        """The section where the file has it."""
        return f"[{WRITTEN.get(self.section, self.section)}]"

    @property
    def is_real(self) -> bool:
        """Whether it is neither a condition nor a whole number nor an enumeration."""
        return self.kind == NUMBER


@dataclass(eq=False)
class Block:
    """Entries that need each other: names of what they calculate."""

    names: list[str]  # all, in the order of the file
    unknowns: list[str]
    # the others, in the order of what they name: entries that give them and, of [algebraic],
    # factors of what they are solved for
    explicit: dict[str, tuple[str, float]]
    equations: list[str]  # entries that give the residuals, one for each unknown
    is_linear: bool = False  # in its unknowns

    @property
    def kind(self) -> str:
        """How it is solved."""
        return "linear" if self.is_linear else "nonlinear, by Newton's method"


@dataclass
class Change:
    """New values, which an event or a sampler gives."""

    name: str
    during: Expression | None  # `while`
    reinit: dict[str, Expression]  # by state
    set: dict[str, Expression]  # by mode or discrete variable
    where: list[Expression]  # which the others name
    gradients: dict[str, Expression] = field(default_factory=dict, kw_only=True)  # by their names

    @property
    def assigned(self) -> dict[str, Expression]:
        """New values by variable or mode, with those of gradients."""
        return self.given | self.gradients

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
        return [*self.conditions, *self.where, *self.given.values()]


@dataclass
class Event(Change):
    """An event of the file."""

    when: Expression
    terminate: str = ""  # why it ends the simulation, if it does

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


@dataclass(eq=False)
class Contact:
    """Dry friction or stops, which decide an unknown force."""

    name: str  # with its section
    is_friction: bool
    force: str
    given: dict[str, Expression]  # by key

    @property
    def fixed(self) -> list[Expression]:
        """Expressions of parameters only."""
        return [e for key, e in self.given.items() if key in FIXED_LIMITS]

    @property
    def moving(self) -> list[Expression]:
        """All others."""
        return [e for key, e in self.given.items() if key not in FIXED_LIMITS]

    def variable(self, key: str) -> str:
        """Return the name of a variable that it has."""
        return variable_of(self.name, key)


def variable_of(contact: str, key: str) -> str:
    """Return the name of a variable of a contact; those of an array are one themselves."""
    base, bracket, index = contact.partition("[")
    return f"{base}.{key}{bracket}{index}"


@dataclass(frozen=True)
class Hook:
    """Events that C by hand decides, NAME_events; it sets all discrete variables."""

    sources: list[str]  # C files, from the folder of the file
    indicators: list[str]  # variables, in the order of NAME_events
    series: list[str]  # those that may be of the model, not of a state
    reads: dict[str, list[str]]  # what discrete variables follow from between events, too
    reach: bool  # NAME_events limits how far a series holds


@dataclass
class ModelFile:
    """All that the file says."""

    name: str
    description: str
    experiment: dict[str, float]
    path: Path
    text: str
    reserved: set[str]  # names that it must not give
    sizes: dict[str, int] = field(default_factory=dict)
    units: dict[str, Unit] = field(default_factory=dict)  # of [units]
    functions: dict[str, Function | Lookup] = field(default_factory=dict)
    tables: dict[str, LookupTable] = field(default_factory=dict)
    code: CodeFile | None = None
    calculating: str = ""  # the function that writes variables, if not NAME_calculate
    parts: dict[str, ModelFile] = field(default_factory=dict)  # components, as they were read
    without_units: set[str] = field(default_factory=set)  # variables of components without any
    header: Any = None  # of its struct of values, if it has C
    hook: Hook | None = None
    sources: list[Path] = field(default_factory=list)  # the files of equations, included ones first
    table_units: dict[str, Exponents] = field(default_factory=dict)  # by `table_unit`
    dimensions: dict[str, int] = field(default_factory=dict)  # numbers of indexes, by name
    indexes: set[str] = field(default_factory=set)  # all that `for` gives
    parsed: dict[str, Node] = field(default_factory=dict)  # texts, before their indexes
    operations: int = 0  # of all expressions
    happening: dict[str, str] = field(default_factory=dict)  # samplers and events: their sections
    modes: dict[str, bool] = field(default_factory=dict)  # with their values at the start
    variables: dict[str, Variable] = field(default_factory=dict)
    sampled: list[Sampler] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    contacts: list[Contact] = field(default_factory=list)
    checks: list[tuple[str, Expression]] = field(default_factory=list)  # messages and conditions
    terminals: dict[str, Terminal] = field(default_factory=dict)
    gradients: Any = None  # read/gradients.py
    blocks: dict[Expression, Block] = field(default_factory=dict)  # by each of their expressions
    anchors: dict[str, Variable] = field(default_factory=dict)  # unknowns without a start
    is_by_hand: bool = False  # it has no equations: by_hand.py
    indicators: list[str] = field(default_factory=list)  # of C by hand
    time_events: bool = False  # of C by hand
    order: list[Expression] = field(default_factory=list)  # each after those that it names
    graph: Any = None  # what a generator makes of it
    fields: Any = None  # where it keeps the values
    relation_texts: list[str] = field(default_factory=list)  # with their places, for messages

    def expression(
        self, element: Element, place: tuple[str, ...], text: object, *more: Any, **options: Any
    ) -> Expression:
        """Read an expression of an entry that may call the file's functions."""
        with placed(*place):
            if not isinstance(text, str):
                raise ModelFileError(f"expected an expression in quotes, got {shown(text)}")
            try:
                if text not in self.parsed:
                    self.parsed[text] = parse(text, RANDOM_FUNCTIONS | self.functions, self.unit)
                indexes = self.sizes | element.indexes
                tree = at_indexes(self.parsed[text], indexes, are_known=False)
            except ValueError as error:
                raise ModelFileError(f"{error}{instead_of(text)}") from None
            nodes = in_order([tree])
            self.operations += len(nodes)
            always = [tree]  # calculated in any case; a branch need not have a value
            for node in always:
                always += node.arguments[:1] if node.op == "if" else node.arguments
                by = node.arguments[1] if node.op == "/" else node
                while by.op in ("unit", "negative"):
                    by = by.arguments[0]
                if node.op == "/" and by.op == "number" and by.value == 0:
                    at = ", ".join(f"{i} = {value}" for i, value in element.indexes.items())
                    raise ExpressionError(node.column, f"division by 0{at and f' at {at}'}")
            if self.operations > MOST_OPERATIONS:
                raise ModelFileError(f"the file has more than {MOST_OPERATIONS} operations")
        return Expression(place, text, tree, *more, **options)

    def unit(self, unit: str) -> Unit:
        """Return a unit, which the file or SI has; ValueError if none has it."""
        return self.units[unit] if unit in self.units else parsed(unit)

    @property
    def files(self) -> list[Path]:
        """All files that were read but those of tables."""
        code = self.code.program.files if self.code else []
        return [*self.sources, *(path for path in code if path.is_file())]

    @property
    def calculate(self) -> str:
        """The function of C that writes variables without a value; empty if there is none."""
        name = self.calculating or f"{self.path.stem}_calculate"
        return name if self.code and name in self.code.program.functions else ""

    @property
    def named_indicators(self) -> list[str]:
        """Variables that are event indicators of C by hand."""
        return self.hook.indicators if self.hook else self.indicators

    @property
    def has_units(self) -> bool:
        """Whether units are checked."""
        return any(variable.unit or variable.display for variable in self.variables.values())

    @property
    def changes(self) -> list[Change]:
        """Samplers and events, in the order in which they happen at one instant."""
        return [*self.sampled, *self.events]

    @property
    def kinds(self) -> dict[str, Kind]:
        """Kinds of names that are no real numbers."""
        found: dict[str, Kind] = {v.name: v.kind for v in self.variables.values() if not v.is_real}
        return found | dict.fromkeys(self.modes, CONDITION)

    @property
    def calculated(self) -> list[Variable]:
        """Variables that follow from others at any time."""
        return self.of(FOLLOWS, *CALCULATED)

    @property
    def calculated_reals(self) -> list[Variable]:
        """Those that are real numbers, and that the FMU shows."""
        return [v for v in self.calculated if v.is_real and v.shown]

    @property
    def calculated_counts(self) -> list[Variable]:
        """Those that are conditions, whole numbers or enumerations, and that the FMU shows."""
        return [v for v in self.calculated if not v.is_real and v.shown]

    @cached_property
    def places(self) -> dict[str, int]:
        """Places of the time and of the variables in the order of the file."""
        return {name: place for place, name in enumerate(("time", *self.variables))}

    @property
    def started(self) -> list[Variable]:
        """States and discrete variables whose start values follow from parameters and inputs."""
        return [v for v in self.of("states", "discrete", COUNTS) if v.initial is not None]

    @property
    def assigned(self) -> list[Expression]:
        """All expressions that may read everything."""
        unknowns, *others = CALCULATED
        found = [v.expression for v in self.of(unknowns, others[0], "states", *others[1:])]
        found += [v.guess for v in self.of(*CALCULATED) if v.guess is not None]
        found += [e for contact in self.contacts for e in contact.moving]
        return found + [expression for change in self.changes for expression in change.expressions]

    @property
    def constant(self) -> list[Expression]:
        """All expressions of parameters only."""
        found = [v.expression for v in self.of(FOLLOWS)]
        found += [e for s in self.sampled for e in s.periods]
        return found + [e for contact in self.contacts for e in contact.fixed]

    @property
    def checked(self) -> list[Expression]:
        """Conditions on parameters and on what follows from them."""
        return [condition for _, condition in self.checks]

    @property
    def initial(self) -> list[Expression]:
        """All start values that follow from parameters and inputs."""
        return [v.initial for v in self.started]

    def place_of(self, name: str) -> str:
        """Return the section that has a name."""
        return self.variables[name].place if name in self.variables else "modes"

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


def shown(value: object) -> str:
    """Write a value in short; an integer may have more digits than Python writes."""
    try:
        text = repr(value)
    except ValueError:
        return "a very large number"
    return text if len(text) <= LONGEST_SHOWN else text[: LONGEST_SHOWN - 3] + "..."


def instead_of(text: str) -> str:
    """Propose a replacement for an unsupported word, or nothing."""
    found = [sentence for pattern, sentence in INSTEAD.items() if re.search(pattern, text)]
    return f"; {found[0]}" if found else ""
