"""Campaign files: what to run, over which parameters, and what to keep, read from TOML.

docs/campaigns.md explains the format. Here a file is checked by itself; what it says of
a model or system is checked by `rparm.campaign.planning`.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    FiniteFloat,
    NonNegativeInt,
    PositiveInt,
    ValidationError,
    model_validator,
)

from rparm import project
from rparm.errors import UserError, WrongValueError, hint
from rparm.files import read_toml, show
from rparm.fmu_tools.compiler.expressions.parser import Expression, parsed
from rparm.units import SECONDS, quantity

MAX_RUNS = 10**9
WHOLE = ("latin", "indices")  # samplings that make all points together
MAX_WHOLE = 10**7  # runs of those
BEYOND = 10**99  # no greater number of runs is written out
MAX_PARAMETERS = 1000
MAX_BLOCK = 100_000
LONGEST_NAME = 100

Name = Annotated[str, Field(min_length=1, max_length=LONGEST_NAME)]
Title = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f-\x9f]*$")]
Text = Annotated[str, Field(min_length=1, max_length=2000)]
Quantity = FiniteFloat | str  # a text has a unit: `rparm.campaign.bases` makes numbers of all
Pair = Annotated[list[Quantity], Field(min_length=2, max_length=2)]
Number = FiniteFloat | bool | str


def _seconds(given: Any) -> Any:
    try:
        return quantity(given, SECONDS) if isinstance(given, str) else given
    except WrongValueError as error:
        raise ValueError(str(error)) from None


Seconds = Annotated[FiniteFloat, BeforeValidator(_seconds, json_schema_input_type=Quantity)]


class _TomlTable(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


def _one_of(*keys: str) -> ConfigDict:
    """Say in a table's schema that it has exactly one of the keys; a validator says it to users."""
    return ConfigDict(json_schema_extra={"oneOf": [{"required": [key]} for key in keys]})


KINDS = ("uniform", "log_uniform", "normal", "values")


class Distribution(_TomlTable):
    """Values of a parameter: exactly one of the distributions."""

    model_config = _one_of(*KINDS)

    uniform: Pair | None = None  # lower and upper limit
    log_uniform: Pair | None = None  # the same, both positive
    normal: Pair | None = None  # mean and standard deviation
    values: Annotated[list[Quantity], Field(min_length=1, max_length=1_000_000)] | None = None
    points: PositiveInt | None = None  # of a grid between the limits

    @property
    def kind(self) -> str:
        return next(name for name in KINDS if getattr(self, name) is not None)

    @property
    def numbers(self) -> list[float]:
        """Given value, once no text with a unit is left."""
        return getattr(self, self.kind)

    @property
    def size(self) -> int:
        """Number of values of a grid."""
        return len(self.values) if self.kind == "values" else self.points

    @model_validator(mode="after")
    def _possible(self) -> Self:
        given = [name for name in KINDS if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"expected exactly one of {', '.join(KINDS)}, got {len(given)}")
        numbers = self.numbers
        if any(isinstance(number, str) for number in numbers):
            return self  # is checked as numbers
        if self.kind in ("uniform", "log_uniform"):
            if not numbers[0] < numbers[1] or not math.isfinite(numbers[1] - numbers[0]):
                raise ValueError(f"{self.kind}: expected a lower and an upper limit, got {numbers}")
            if self.kind == "log_uniform" and numbers[0] <= 0:
                raise ValueError(f"log_uniform: expected positive limits, got {numbers}")
        elif self.kind == "normal" and numbers[1] <= 0:
            raise ValueError(f"normal: expected a positive standard deviation, got {numbers[1]!r}")
        return self


class Settling(_TomlTable):
    """When a variable comes to stay within a band."""

    variable: Name
    target: Quantity
    band: Annotated[FiniteFloat, Field(gt=0)] | str


class Crossings(_TomlTable):
    """Count of upward crossings of a level by a variable."""

    variable: Name
    level: Quantity


class Tracking(_TomlTable):
    """Distance of a point from its reference, both given by their coordinates."""

    of: Annotated[
        list[Annotated[list[Name], Field(min_length=2, max_length=2)]],
        Field(min_length=1, max_length=10),
    ]


class Keep(_TomlTable):
    """Measures of each run, and the runs whose trajectories are kept."""

    start: list[Name] = []
    final: list[Name] = []
    minimum: list[Name] = []
    maximum: list[Name] = []
    rms: list[Name] = []
    integral: list[Name] = []
    settling: dict[Name, Settling] = {}
    tracking: dict[Name, Tracking] = {}
    crossings: dict[Name, Crossings] = {}
    lyapunov: bool = False
    trajectories: list[NonNegativeInt] = []  # numbers of the runs


class Map(_TomlTable):
    """A picture of one column over two others."""

    x: Name
    y: Name
    colour: Name


class Time(_TomlTable):
    """Times that replace the scenario's or system's, s."""

    start: Seconds | None = None
    stop: Seconds | None = None
    step: Annotated[Seconds, Field(gt=0)] | None = None


class Campaign(_TomlTable):
    model_config = _one_of("scenario", "system")
    title: Title
    description: Text
    scenario: Name | None = None  # or a file FILE.toml, beside this one
    system: Name | None = None  # or a loop file FILE.toml, or FILE.ssp, beside this one
    variant: Name | None = None  # of a system; without it "default", else the first
    sampling: Literal["random", "sobol", "latin", "grid", "indices"]
    seed: NonNegativeInt = 0
    runs: PositiveInt | None = None
    block: Annotated[int, Field(ge=1, le=MAX_BLOCK)] = 200  # runs of a file of results
    output: Name | None = None  # folder, beside this file
    worst: list[Name] = []  # columns whose largest values the page lists
    time: Time = Time()
    set: dict[Name, Number] = {}
    parameters: Annotated[dict[Name, Distribution], Field(min_length=1, max_length=MAX_PARAMETERS)]
    derived: dict[Name, str] = {}
    keep: Keep
    maps: list[Map] = []

    @property
    def count(self) -> int:
        if self.sampling == "grid":
            return math.prod(d.size for d in self.parameters.values())
        if self.sampling == "indices":
            return self.runs * (len(self.parameters) + 2)
        return self.runs

    @property
    def blocks(self) -> int:
        """Number of blocks; all but the last have `block` runs."""
        return -(-self.count // self.block)

    def block_range(self, block: int) -> range:
        """Return the numbers of the runs of a block."""
        return range(block * self.block, min((block + 1) * self.block, self.count))

    @property
    def expressions(self) -> dict[str, Expression]:
        """Expressions of the derived values, in the order of the file."""
        return {name: parsed(text) for name, text in self.derived.items()}

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if (self.scenario is None) == (self.system is None):
            raise ValueError("expected exactly one of scenario, system")
        if self.variant is not None and self.system is None:
            raise ValueError("variant: goes with system")
        self._check_sampling()
        for name, text in self.derived.items():
            if name in self.parameters:
                raise ValueError(f"[derived] {name}: is one of [parameters]")
            try:
                parsed(text)
            except ValueError as error:
                raise ValueError(f"[derived] {name}: {error}") from None
        for name in self.set:
            if name in self.parameters or name in self.derived:
                raise ValueError(f"[set] {name}: is in [parameters] or [derived], too")
        for number in self.keep.trajectories:
            if number >= self.count:
                raise ValueError(
                    f"[keep] trajectories: expected runs from 0 to {self.count - 1}, got {number}"
                )
        return self

    def _check_sampling(self) -> None:
        if self.sampling == "grid":
            if self.runs is not None:
                raise ValueError("runs: a grid has as many as it has points, leave it out")
            for name, distribution in self.parameters.items():
                if distribution.kind != "values" and distribution.points is None:
                    raise ValueError(f"[parameters.{name}] points: is missing, for a grid")
                if distribution.kind == "normal":
                    raise ValueError(f"[parameters.{name}] normal: makes no grid")
        else:
            if self.runs is None:
                raise ValueError("missing key 'runs'")
            for name, distribution in self.parameters.items():
                if distribution.points is not None:
                    raise ValueError(f"[parameters.{name}] points: goes with a grid only")
        if self.sampling == "indices" and self.runs & (self.runs - 1):
            raise ValueError(
                "runs: expected a power of 2 for indices, which make runs x (parameters + 2) of "
                f"them, got {self.runs}"
            )
        most = MAX_WHOLE if self.sampling in WHOLE else MAX_RUNS
        if self.count > most:
            about = f"{min(self.count, BEYOND):.4g}"
            raise ValueError(f"runs: makes {about}, expected at most {most}")


def grid_value(distribution: Distribution, index: int) -> float:
    """Return the value of a parameter on a grid; of two or more, limits are among them."""
    if distribution.kind == "values":
        return distribution.values[index]
    low, high = distribution.numbers
    last = distribution.size - 1
    if index in (0, last):
        return high if index else low
    if distribution.kind == "log_uniform":
        return low * (high / low) ** (index / last)
    return low + (high - low) * index / last


def read(path: Path) -> Campaign:
    """Read and check a campaign; UserError for the first mistake, with its place."""
    content = read_toml(path)
    project.refuse_other(path, content, "campaign")
    return checked(content, path)


def checked(content: Mapping[str, Any], where: object) -> Campaign:
    """Return the campaign of this content; a UserError begins with `where`."""
    try:
        return Campaign.model_validate(content)
    except ValidationError as error:
        raise UserError(f"{where}: {_explained(error)}") from None


# plain words for pydantic's, by the type of the mistake
EXPECTED = {
    "dict_type": "expected a table",
    "list_type": "expected a list",
    "model_type": "expected a table",
    "string_pattern_mismatch": "expected one line of text",
    "too_short": "expected a longer list",
}


def _explained(error: ValidationError) -> str:
    """Explain the first mistake in one line: its place, what is expected, what is there."""
    first = error.errors()[0]
    # pydantic adds the members of a union that it tried
    place = [x for x in first["loc"] if x not in ("float", "bool", "str", "constrained-float")]
    where = _where(place)
    key = str(place[-1]) if place else ""
    if first["type"] == "missing":
        return f"{_where(place[:-1])}missing key {key!r}"
    if first["type"] == "extra_forbidden":
        return f"{_where(place[:-1])}unknown key {key!r}{hint(key, _keys(place))}"
    message = first["msg"].removeprefix("Value error, ")
    if first["type"] == "value_error":
        return f"{where}{message}"
    message = EXPECTED.get(first["type"], message[0].lower() + message[1:])
    return f"{where}{message.replace('input should be', 'expected')}, got {show(first['input'])}"


def _where(place: list[int | str]) -> str:
    if not place:
        return ""
    text = str(place[0])
    for part in place[1:]:
        text += f"[{part}]" if isinstance(part, int) else f".{part}"
    return f"{text}: "


def _keys(place: list[int | str]) -> list[str]:
    """Return the known keys of the table that an unknown key stands in."""
    tables = {
        "parameters": Distribution, "time": Time, "maps": Map, "settling": Settling,
        "tracking": Tracking, "crossings": Crossings,
    }  # fmt: skip
    for part in reversed(place[:-1]):
        if part in tables:
            return list(tables[part].model_fields)
    return list((Keep if place[0] == "keep" else Campaign).model_fields)
