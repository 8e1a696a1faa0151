"""The tables of a variables.toml, and the checks that need one table only.

include       further files, relative to this one, whose [variables] and [units] count too. A file
              that declares another model is { file, only, fields, description }: the names of the
              variables to include (default: all), { "old" = "new" } for how their C fields begin,
              and their description, with {} for the declared one
[changes.NAME]
    description, reinit
                  of an included variable, in place of the declared ones
    more_dependencies, more_parameters
                  beside the declared ones
[model]       name (also the identifier), description, header, values (C type of the value
              structure), symbol (the C object of type struct model), event_indicators (names of
              local continuous variables, in the order of the model's indicators; default: none),
              time_events (true: the model has time events), naming ("structured": names have
              indexes)
[experiment]  start, stop, tolerance, step: the default experiment
[units]       "name" = { exponents of the SI base units, display.NAME = factor }, beside those of
              STANDARD in compiler/units.py
[variables.NAME]
    reference     value reference, unique, 0 to 99999
    owner         "model" (default) or "instance": the structure that holds the value
    field         C designator of the value in that structure
    type          "float64" (default), "int32", "enumeration" or "boolean"
    causality, variability, initial, description
                  as in section 2.2.7 of the FMI 2.0 specification
    start         where initial is exact, and of inputs; of an enumeration the name of an item, of
                  a boolean true or false
    unit, nominal of a float64
    display       of a float64: name, factor and offset of its own display unit, in which a value
                  is factor * value + offset
    min, max      of a float64 or int32
    items         of an enumeration: [variables.NAME.items.ITEM] with description and, if C has
                  one of that value, constant; the values are 1, 2, ... in the order of the
                  file
    derivative_of name of the variable that this one is the time derivative of
    reinit        true: events may change this state
    dependencies  of outputs, derivatives and event indicators: the inputs, states and time they
                  depend on
    parameters    of calculated outputs, derivatives and event indicators: the parameters they
                  depend on
    initially     of calculated outputs and derivatives: what they depend on in initialization mode,
                  where that is something else: inputs, states, time and parameters, and outputs
                  that stand for what they depend on
[terminals.NAME]
    rule          "plug": terminals fit whose members have the same names; "bus": members of the
                  same name are connected; "none": no rule
    description
    signals, inflows, outflows
                  { member = "variable" }: an input or output each; flows of terminals that are
                  connected sum to zero, an inflow is positive into this model
    terminals     [terminals.NAME.terminals.NAME]: terminals in this one
"""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationInfo,
    field_validator,
    model_validator,
)

# allowed values of initial, the default first (table in section 2.2.7 of the specification)
INITIALS = {
    ("parameter", "fixed"): ("exact",),
    ("parameter", "tunable"): ("exact",),
    ("calculatedParameter", "fixed"): ("calculated",),
    ("calculatedParameter", "tunable"): ("calculated",),
    ("input", "discrete"): (None,),
    ("input", "continuous"): (None,),
    ("output", "discrete"): ("calculated", "exact"),
    ("output", "continuous"): ("calculated", "exact"),
    ("local", "fixed"): ("calculated",),
    ("local", "tunable"): ("calculated",),
    ("local", "discrete"): ("calculated", "exact"),
    ("local", "continuous"): ("calculated", "exact"),
    ("independent", "continuous"): (None,),
}


def identifier(text: str) -> str:
    """Refuse a text that is no C identifier."""
    if not re.fullmatch("[A-Za-z_][A-Za-z0-9_]*", text):
        raise ValueError("must be a C identifier")
    return text


def variable_name(text: str) -> str:
    """Refuse names that the generated header, where they get a prefix, needs for its macros."""
    if text in ("GUID", "NAME", "TOKEN_FMI3"):
        raise ValueError("is reserved for the generated header")
    identifier(re.sub(r"\[[0-9]+(,[0-9]+)*\]$", "", text))
    return text


def usual_initial(keys: dict[str, Any]) -> str | None:
    """`initial` of a variable that does not give it."""
    return INITIALS.get((keys["causality"], keys["variability"]), (None,))[0]


Identifier = Annotated[str, AfterValidator(identifier)]
VariableName = Annotated[str, AfterValidator(variable_name)]
Int32Value = Annotated[int, Field(ge=-(2**31), le=2**31 - 1)]


class TomlTable(BaseModel):
    """A table without unknown keys, whose values have the declared types and are finite."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


class Model(TomlTable):
    name: Identifier
    description: str
    header: str
    values: str
    symbol: Identifier
    event_indicators: list[str] = []
    time_events: bool = False
    naming: Literal["flat", "structured"] = "flat"
    # for `rparm linearize`: functions without slope, and switches whose time inputs decide
    flat: list[str] = []
    modulated: list[str] = []

    @property
    def has_events(self) -> bool:
        """Whether steps can meet events."""
        return bool(self.event_indicators) or self.time_events


class Experiment(TomlTable):
    """The default experiment, times in s."""

    start: float
    stop: float
    tolerance: float = Field(gt=0, lt=1)
    step: float = Field(gt=0)

    @model_validator(mode="after")
    def check_times(self) -> Self:
        """Refuse times at which nothing can be run."""
        if self.stop <= self.start:
            raise ValueError(f"stop = {self.stop} must be after start = {self.start}")
        if self.step > self.stop - self.start:
            raise ValueError(f"step = {self.step} is longer than the experiment")
        return self


class Display(TomlTable):
    """A display unit, in which a value is factor * value + offset."""

    name: str
    factor: float
    offset: float = 0.0


class UnitEntry(TomlTable):
    """Exponents of the SI base units, and factors of the display units."""

    kg: int = 0
    m: int = 0
    s: int = 0
    A: int = 0
    K: int = 0
    mol: int = 0
    cd: int = 0
    rad: int = 0
    display: dict[str, float] = {}
    further: dict[str, Display] = {}  # display units of some variables

    @property
    def exponents(self) -> dict[str, int]:
        """Exponents that are not 0, by base unit."""
        return self.model_dump(exclude={"display", "further"}, exclude_defaults=True)


class Item(TomlTable):
    constant: Identifier | None = None
    description: str


class Variable(TomlTable):
    """What variables of all types have; each type adds start, min and max as numbers or None."""

    reference: int = Field(ge=0, le=99999)
    owner: Literal["model", "instance"] = "model"
    field: str
    causality: Literal[
        "parameter", "calculatedParameter", "input", "output", "local", "independent"
    ]
    variability: Literal["fixed", "tunable", "discrete", "continuous"]
    initial: Literal["exact", "calculated"] | None = Field(default_factory=usual_initial)
    description: str
    derivative_of: str | None = None
    reinit: bool = False
    dependencies: list[str] | None = None
    parameters: list[str] = []
    initially: list[str] | None = None

    def initial_knowns(self, variables: dict[str, Variable]) -> list[str]:
        """What the variable depends on in initialization mode; `variables`: all of them."""
        if self.initially is None:
            return [*(self.dependencies or []), *self.parameters]
        found: dict[str, None] = {}
        for name in self.initially:
            other = variables[name]
            stands_for_more = other is not self and other.initial == "calculated"
            found |= dict.fromkeys(other.initial_knowns(variables) if stands_for_more else [name])
        return list(found)

    @property
    def is_unknown(self) -> bool:
        """Whether the model structure lists the variable."""
        is_listed = self.causality in ("output", "calculatedParameter")
        return is_listed or self.derivative_of is not None

    @property
    def interface(self) -> dict[str, Any]:
        """What users depend on: neither the texts nor where C keeps the value."""
        hidden = {"owner", "field", "description", "display"} | (
            set() if self.reinit else {"reinit"}
        )
        return self.model_dump(exclude=hidden, exclude_none=True)

    @model_validator(mode="after")
    def check_together(self) -> Self:
        """Check the keys against each other."""
        kind = (self.causality, self.variability)
        if kind not in INITIALS:
            raise ValueError(f"causality '{kind[0]}' with variability '{kind[1]}' does not exist")
        if self.initial not in INITIALS[kind]:
            allowed = " or ".join(str(initial) for initial in INITIALS[kind])
            raise ValueError(f"initial must be {allowed}, not {self.initial}")
        if self.is_unknown and self.dependencies is None:
            raise ValueError("dependencies is missing")
        needs_start = self.initial == "exact" or self.causality == "input"
        if needs_start != (self.start is not None):
            raise ValueError(f"start is {'missing' if needs_start else 'not allowed'}")
        below = needs_start and self.min is not None and self.start < self.min
        above = needs_start and self.max is not None and self.start > self.max
        if below or above:
            raise ValueError(f"start = {self.start} is outside [min, max]")
        return self


class Float64(Variable):
    type: Literal["float64"] = "float64"
    unit: str
    display: Display | None = None
    start: float | None = None
    min: float | None = None
    max: float | None = None
    nominal: float | None = Field(default=None, gt=0)


class Discrete(Variable):
    """What does not change continuously and has no unit."""

    @model_validator(mode="after")
    def check_discrete(self) -> Self:
        """Refuse what only a floating-point number can be."""
        article = "a" if self.type == "boolean" else "an"
        if self.variability == "continuous" or self.derivative_of is not None:
            raise ValueError(f"{article} {self.type} is not continuous")
        if self.causality != "parameter" and self.initial == "exact":
            raise ValueError(f"{article} {self.type} is no state: initial must be calculated")
        return self


class Int32(Discrete):
    type: Literal["int32"]
    start: Int32Value | None = None
    min: Int32Value | None = None
    max: Int32Value | None = None


class Enumeration(Discrete):
    """A choice, whose values count from 1 in the order of the items."""

    type: Literal["enumeration"]
    items: dict[str, Item]
    start_item: str | None = Field(default=None, alias="start")

    @field_validator("items")
    @classmethod
    def check_items(cls, items: dict[str, Item]) -> dict[str, Item]:
        if not items:
            raise ValueError("must have one item at least")
        without = [name for name, item in items.items() if item.constant is None]
        if without and len(without) < len(items):
            raise ValueError(f"have an item {without[0]}, where constant is missing")
        return items

    @field_validator("start_item", mode="before")
    @classmethod
    def check_start(cls, name: Any, info: ValidationInfo) -> Any:
        items = [*info.data.get("items", {})]
        if items and name not in items:
            raise ValueError(f"should be one of {', '.join(items)}")
        return name

    @property
    def start(self) -> int | None:
        """Value of the item at the start."""
        return None if self.start_item is None else [*self.items].index(self.start_item) + 1

    @property
    def min(self) -> int:
        return 1

    @property
    def max(self) -> int:
        return len(self.items)

    @property
    def interface(self) -> dict[str, Any]:
        """What users depend on: also the names and the order of the items."""
        return super().interface | {"items": [*self.items]}


class Boolean(Discrete):
    """True or false, which C keeps as 1 or 0."""

    type: Literal["boolean"]
    start: bool | None = None

    @property
    def min(self) -> int:
        return 0

    @property
    def max(self) -> int:
        return 1


TYPES = {"float64": Float64, "int32": Int32, "enumeration": Enumeration, "boolean": Boolean}


def type_of(variable: Any) -> Any:
    """`type` of a variable as it stands in the file."""
    return variable.get("type", "float64") if isinstance(variable, dict) else "float64"


AnyVariable = Annotated[
    Annotated[Float64, Tag("float64")]
    | Annotated[Int32, Tag("int32")]
    | Annotated[Enumeration, Tag("enumeration")]
    | Annotated[Boolean, Tag("boolean")],
    Discriminator(type_of),
]


class Terminal(TomlTable):
    """Variables that are connected together, by member, and terminals within."""

    rule: Literal["plug", "bus", "none"]
    description: str
    signals: dict[Identifier, str] = {}
    inflows: dict[Identifier, str] = {}
    outflows: dict[Identifier, str] = {}
    terminals: dict[Identifier, Terminal] = {}

    @property
    def members(self) -> list[tuple[str, str, str]]:
        """Kind, member and variable of each member."""
        kinds = {"signal": self.signals, "inflow": self.inflows, "outflow": self.outflows}
        return [(kind, *member) for kind, members in kinds.items() for member in members.items()]

    @model_validator(mode="after")
    def check_members(self) -> Self:
        """Refuse a terminal of nothing, and a member that is there twice."""
        members = [member for _, member, _ in self.members]
        if not (members or self.terminals):
            raise ValueError("has no members and no terminals")
        for member in members:
            if members.count(member) > 1:
                raise ValueError(f"member '{member}' is declared twice")
        return self


class Include(TomlTable):
    """Variables of another file that count here, too."""

    file: str
    only: list[str] | None = None
    fields: dict[str, str] = {}
    description: str = "{}"

    @model_validator(mode="before")
    @classmethod
    def check_path(cls, value: Any) -> Any:
        """Accept just a path."""
        return {"file": value} if isinstance(value, str) else value


class Change(TomlTable):
    """Changes of a variable that another file declares."""

    description: str = ""
    reinit: bool = False
    initially: list[str] | None = None
    more_dependencies: list[str] = []
    more_parameters: list[str] = []


class File(TomlTable):
    """One file: a variables.toml, or what it includes."""

    include: list[Include] = []
    changes: dict[VariableName, Change] = {}
    model: Model | None = None
    experiment: Experiment | None = None
    units: dict[str, UnitEntry] = {}
    variables: dict[VariableName, AnyVariable] = {}
    terminals: dict[Identifier, Terminal] = {}
