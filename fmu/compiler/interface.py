"""What an FMU declares: all that is written of its interface follows from this."""

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from .units import Exponents

# what users do not depend on: texts, and where C keeps the value
HIDDEN = ("owner", "field", "description", "display", "constants")


@dataclass(frozen=True)
class Display:
    """A display unit, in which a value is factor * value + offset."""

    name: str
    factor: float
    offset: float = 0.0


@dataclass(frozen=True)
class Variable:
    """A variable; numbers that it does not have are None."""

    reference: int
    field: str  # of the structure of its owner, as a designator of C
    causality: str
    variability: str
    description: str
    initial: str | None = None
    type: str = "float64"  # or int32, boolean, enumeration
    owner: str = "model"  # or instance
    unit: str = ""
    display: Display | None = None
    start: float | bool | None = None  # of an enumeration the number of the item, from 1
    min: float | None = None
    max: float | None = None
    nominal: float | None = None
    items: Mapping[str, str] = field(default_factory=dict)  # descriptions
    constants: tuple[str, ...] = ()  # that the items have in C
    derivative_of: str | None = None
    reinit: bool = False  # events may change this state
    # inputs, states and time that it follows from, and parameters; None: nobody asks
    dependencies: tuple[str, ...] | None = None
    parameters: tuple[str, ...] = ()
    initially: tuple[str, ...] | None = None  # in initialization mode, if other than both

    @property
    def initial_knowns(self) -> tuple[str, ...]:
        """What it follows from in initialization mode."""
        if self.initially is not None:
            return self.initially
        return (*(self.dependencies or ()), *self.parameters)

    @property
    def is_unknown(self) -> bool:
        """Whether the model structure lists it."""
        is_listed = self.causality in ("output", "calculatedParameter")
        return is_listed or self.derivative_of is not None


@dataclass(frozen=True)
class Terminal:
    """Variables that are connected together, by member, and terminals within."""

    rule: str
    description: str
    signals: Mapping[str, str] = field(default_factory=dict)
    inflows: Mapping[str, str] = field(default_factory=dict)
    outflows: Mapping[str, str] = field(default_factory=dict)
    terminals: Mapping[str, "Terminal"] = field(default_factory=dict)

    @property
    def members(self) -> list[tuple[str, str, str]]:
        """Kind, member and variable of each member."""
        kinds = {"signal": self.signals, "inflow": self.inflows, "outflow": self.outflows}
        return [(kind, *member) for kind, members in kinds.items() for member in members.items()]


@dataclass(frozen=True)
class Declaration:
    """All that is declared of a model; its variables are sorted by value reference."""

    name: str
    description: str
    header: str  # of C, with the structure of its values and the struct model
    values: str
    symbol: str
    experiment: Mapping[str, float]  # start, stop, step, tolerance
    units: Mapping[str, Exponents]
    variables: Mapping[str, Variable]
    terminals: Mapping[str, Terminal]
    indicators: tuple[str, ...]  # of events, in the order of the model
    has_time_events: bool
    # for `rparm linearize`: functions without slope, and switches whose time inputs decide
    flat: tuple[str, ...]
    modulated: tuple[str, ...]

    @property
    def has_events(self) -> bool:
        """Whether steps can meet events."""
        return bool(self.indicators) or self.has_time_events

    @property
    def naming(self) -> str:
        """Whether names have indexes or belong to components; no structured name goes on behind an
        index, as x[2]_by_k does.
        """
        has_parts = any("[" in name or "." in name for name in self.variables)
        is_legal = not any(re.search(r"\]\w", name) for name in self.variables)
        return "structured" if has_parts and is_legal else "flat"

    @property
    def guid(self) -> str:
        """Hash of the interface."""
        return self.token()

    def token(self, *versions: str) -> str:
        """Hash the interface in the form of a GUID, other than `guid` if versions are named."""
        variables = {
            name: {k: x for k, x in vars(v).items() if k not in HIDDEN} | {"items": [*v.items]}
            for name, v in self.variables.items()
        }
        interface = [self.name, self.units, variables, self.indicators, self.has_time_events]
        text = json.dumps([*interface, *versions], sort_keys=True, default=str)
        digest = hashlib.sha256(text.encode()).hexdigest()
        parts = (digest[0:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32])
        return "{" + "-".join(parts) + "}"
