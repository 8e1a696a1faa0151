"""The request: logs, settings and estimated parameters, checked against the FMU; and a demo's.

The fit works with numbers without unit or limits. A parameter with a limit is its distance from it,
times the exponential of such a number: no step leads across. One with two limits is a logistic
function between them, one without any is linear.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol, cast

import fmpy
import numpy as np

from rparm import project
from rparm.errors import UserError, WrongValueError, hint, placed
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import INITIAL, INPUTS, METHOD, PARAMETERS, Model, Value, Variable
from rparm.identification.logs import LENGTH, Column
from rparm.units import scale

CLOSEST = np.log(1e-6)  # of the distance from a limit at the start: nearer, a parameter is at it
LARGEST = 700.0  # whose exponential is a double: ends of very long intervals
DELAY = "delay"  # between the outputs and their measured values
FASTEST = "taylor", "erk"  # methods of integration, for steps as short as a log's
ABOVE = ">"  # in "name>other": the parameter stays above the other one


# ---- Parameters ----------------------------------------------------------------------------------
@dataclass(frozen=True)
class Parameter:
    """A parameter of the FMU, or the delay of what was measured."""

    name: str
    start: float
    least: float = -np.inf
    greatest: float = np.inf
    above: str = ""  # the parameter that is its limit from below, in place of `least`
    unit: str | None = None
    scale: float = 0.0  # of one without limits; 0: its start

    def check(self, low: float) -> None:
        """Refuse a start that is not between `low` and the upper limit: WrongValueError."""
        unit = f" {self.unit}" if self.unit else ""
        for limit, is_in, word in (
            (low, self.start > low, "above"),
            (self.greatest, self.start < self.greatest, "below"),
        ):
            if not is_in:
                raise WrongValueError(
                    f"expected a start {word} its limit {limit:g}{unit}, got {self.start:g}{unit}"
                )


class Parameters:
    """All parameters to estimate; `fixed` has the values of others, which some are `above`."""

    def __init__(self, every: Sequence[Parameter], fixed: Mapping[str, float]) -> None:
        self.every, self._fixed = tuple(every), fixed
        self.names = tuple(parameter.name for parameter in every)
        known = {**fixed, **{p.name: p.start for p in every}}
        self._low = {p.name: known[p.above] if p.above else p.least for p in every}  # at the start
        self._order = sorted(range(len(every)), key=lambda i: bool(every[i].above))

    def __len__(self) -> int:
        return len(self.every)

    def check(self) -> None:
        """Check all starts; WrongValueError names the parameter."""
        for parameter in self.every:
            try:
                parameter.check(self._low[parameter.name])
            except WrongValueError as error:
                raise WrongValueError(f"{parameter.name}: {error}") from None

    def values(self, z: np.ndarray) -> np.ndarray:
        """Return values (parameters,) in their units; `z` is 0 at the start."""
        return self._mapped(z)[0]

    def slopes(self, z: np.ndarray) -> np.ndarray:
        """Return the derivatives (parameters, parameters) of the values by `z`."""
        return self._mapped(z)[1]

    def _mapped(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, slopes = np.empty(len(z)), np.zeros((len(z), len(z)))
        z = np.clip(z, -LARGEST, LARGEST)
        for i in self._order:  # those above others come after these
            parameter = self.every[i]
            low, high = self._low[parameter.name], parameter.greatest
            if parameter.above in self.names:
                other = self.names.index(parameter.above)
                slopes[i] = slopes[other]
                base = values[other]
            else:
                base = low
            if np.isfinite(low) and np.isfinite(high):
                odds = (parameter.start - low) / (high - parameter.start) * np.exp(z[i])
                values[i] = low + (high - low) * odds / (1 + odds)
                slopes[i, i] = (high - low) * odds / (1 + odds) ** 2
            elif np.isfinite(low):
                distance = (parameter.start - low) * np.exp(z[i])
                values[i], slopes[i, i] = base + distance, distance
            elif np.isfinite(high):
                distance = (high - parameter.start) * np.exp(z[i])
                values[i], slopes[i, i] = high - distance, -distance
            else:
                scale = parameter.scale or abs(parameter.start) or 1.0
                values[i], slopes[i, i] = parameter.start + scale * z[i], scale
        return values, slopes

    @property
    def is_limited(self) -> np.ndarray:
        """Which (parameters,) have a limit."""
        return np.array([np.isfinite([self._low[p.name], p.greatest]).any() for p in self.every])

    def at_limit(self, z: np.ndarray) -> np.ndarray:
        """Return which (parameters,) have come to a limit."""
        return self.is_limited & (np.abs(z) >= -CLOSEST)

    def kept(self, z: np.ndarray) -> np.ndarray:
        """Return `z` where no parameter is closer to a limit than counts."""
        return np.where(self.is_limited, np.clip(z, CLOSEST, -CLOSEST), z)


# ---- The request ---------------------------------------------------------------------------------
@dataclass(frozen=True)
class Request:
    """Request of a user; all names are variables of the FMU."""

    logs: Sequence[Path]
    parameters: Sequence[str]  # or "name>other"
    inputs: Sequence[str]
    measured: Sequence[str]
    settings: Mapping[str, Any] = field(default_factory=dict)
    starts: Mapping[str, Any] = field(default_factory=dict)  # of parameters and states
    columns: Mapping[str, str] = field(default_factory=dict)  # names in the logs, where they differ
    units: Mapping[str, str] = field(default_factory=dict)  # of columns, where they differ
    with_delay: bool = False
    validation: Path | None = None
    segment: float = LENGTH  # s
    tolerance: float = 1e-8


@dataclass(frozen=True)
class Checked:
    """The same, checked."""

    parameters: Parameters
    settings: Mapping[str, Value]
    starts: Mapping[str, float]  # of states
    reals: Mapping[str, Column]  # of Real inputs
    switches: Mapping[str, Column]  # of Boolean inputs
    outputs: Mapping[str, Column]
    with_gradients: Fmu | None = None  # of the same model, if there is one

    @property
    def names(self) -> list[str]:
        """Names of the FMU's parameters that are estimated."""
        return [name for name in self.parameters.names if name != DELAY]


def checked(request: Request, fmu: Fmu) -> Checked:
    """Check a request; UserError if something in it is wrong."""
    model = fmu.model
    _check_names(request)
    with placed("set"):
        settings = _settings(request, model)
    if METHOD not in settings:
        settings |= _fastest(fmu, settings)
    with placed("measured"):
        for name in request.measured:
            _check_output(fmu, name)
    starts = {name: _start(model, name, given) for name, given in request.starts.items()}
    every = [_parameter(model, text, starts, settings) for text in request.parameters]
    if request.with_delay:
        if DELAY in (parameter.name for parameter in every):
            raise UserError(f"{DELAY}: is also the name of a parameter that is estimated")
        every.append(Parameter(DELAY, 0.0, unit="s", scale=request.segment / 100))
    estimated = {parameter.name for parameter in every}
    known = {
        name: v for name, v in model.start_values.items() if model.variables[name].type == "Real"
    }
    parameters = Parameters(every, known | settings | starts)
    with placed("parameters"):
        parameters.check()
    with placed("inputs"):
        inputs = [model.find(name, INPUTS) for name in request.inputs]
    for variable in inputs:
        if variable.type not in ("Real", "Boolean"):
            raise UserError(f"inputs: {variable.name} is of type {variable.type}")
    return Checked(
        parameters,
        settings,
        {name: value for name, value in starts.items() if name not in estimated},
        {v.name: _column(request, v) for v in inputs if v.type == "Real"},
        {v.name: _column(request, v) for v in inputs if v.type == "Boolean"},
        {name: _column(request, model.variables[name]) for name in request.measured},
    )


def _check_names(request: Request) -> None:
    """Refuse names that are there twice or lead nowhere, and a length that is none."""
    logs = [str(Path(log).absolute()) for log in request.logs]
    for given, option in (
        ([name.partition(ABOVE)[0] for name in request.parameters], "parameters"),
        (request.inputs, "inputs"),
        (request.measured, "measured"),
        (logs, "logs"),
    ):
        twice = [name for i, name in enumerate(given) if name in given[:i]]
        if twice:
            raise UserError(f"{option}: {twice[0]!r} is there twice")
    if request.validation and str(Path(request.validation).absolute()) in logs:
        raise UserError(f"validation: {request.validation} is fitted, expected another log")
    if not request.parameters or not request.measured:
        raise UserError("expected at least one of parameters and one of measured")
    if not 0 < request.segment < float("inf"):
        raise UserError(f"segment: expected a length above 0 s, got {request.segment!r}")
    for text in request.parameters:
        name, sign, above = text.partition(ABOVE)
        if sign and above in ("", name):
            raise UserError(f"parameters: {text!r}: expected another parameter after {ABOVE}")
    for name in request.starts:
        if name in request.measured:
            raise UserError(f"start: {name!r} is measured: the log says where it starts")
    used = [*request.inputs, *request.measured]
    if "time" in request.units:
        raise UserError("units: the times of a log are in s")
    for option, given in (("columns", request.columns), ("units", request.units)):
        for name in given:
            if name not in (*used, "time"):
                raise UserError(f"{option}: {name!r} is not used{hint(name, used)}")


def _settings(request: Request, model: Model) -> dict[str, Value]:
    """Return the values that are not estimated."""
    estimated = [name.partition(ABOVE)[0] for name in request.parameters]
    settings = {}
    for name, given in request.settings.items():
        if name in estimated:
            raise WrongValueError(f"{name} is estimated: its start is given by --start")
        variable = model.find(name, PARAMETERS)
        settings[name] = _value(variable, given)
    return settings


def _fastest(fmu: Fmu, settings: Mapping[str, Value]) -> dict[str, Value]:
    """Return the fastest method of integration that the FMU takes, if it has a choice."""
    variable = fmu.model.variables.get(METHOD)
    for method in FASTEST if variable is not None else ():
        if method in variable.items:
            chosen = {METHOD: variable.items[method]}
            with suppress(UserError), fmu.instance(fmu.model.name) as instance:
                instance.set_up(0.0, None)
                for name, value in {**settings, **chosen}.items():
                    instance.set(name, value)
                instance.enter_initialization()
                instance.exit_initialization()
                return chosen
    return {}


def _value(variable: Variable, given: Any) -> Value:
    try:
        return variable.checked(given)
    except WrongValueError as error:
        raise WrongValueError(f"{variable.name}: {error}") from None


def _start(model: Model, name: str, given: Any) -> float:
    """Start of a parameter that is estimated, or of a state."""
    with placed("start"):
        variable = model.variables.get(name)
        kind = INITIAL if variable is not None and variable.is_a(INITIAL) else PARAMETERS
        value = _value(model.find(name, kind), given)
    if not isinstance(value, float):
        raise UserError(f"start: {name}: expected a Real variable")
    return value


def _parameter(
    model: Model, text: str, starts: Mapping[str, float], settings: Mapping[str, Value]
) -> Parameter:
    name, _, above = text.partition(ABOVE)
    with placed("parameters"):
        variable = model.find(name, PARAMETERS)
        if above:
            model.find(above, PARAMETERS)
    for other in filter(None, (variable, model.variables.get(above))):
        if other.type != "Real":
            raise UserError(f"parameters: {other.name} is of type {other.type}, expected Real")
    start = starts.get(name, variable.start)
    assert isinstance(start, float)  # parameters have one
    limits = variable.least, variable.greatest
    return Parameter(name, start, *limits, above=above, unit=variable.unit)


def _check_output(fmu: Fmu, name: str) -> None:
    """Refuse a measured variable that is no Real output or local one that changes with time."""
    model = fmu.model
    variable = model.variables.get(name)
    continuous = _continuous(fmu)
    known = [output for output in model.real_outputs if output in continuous]
    if variable is None:
        raise WrongValueError(f"the model has no variable {name!r}{hint(name, known)}")
    if name not in continuous:
        meant = ", ".join(known) or "none"
        raise WrongValueError(f"{name!r} is no continuous output of the model (known: {meant})")


def _continuous(fmu: Fmu) -> list[str]:
    """Return the names of the continuous outputs and local variables."""
    described = fmpy.read_model_description(fmu.folder, validate=False).modelVariables
    return [
        variable.name
        for variable in described
        if variable.causality in ("output", "local")
        and variable.variability in (None, "continuous")
        and fmu.model.variables[variable.name].type == "Real"
    ]


def _column(request: Request, variable: Variable) -> Column:
    name = variable.name
    column = request.columns.get(name, name)
    if name not in request.units:
        return Column(column)
    one = f"1 {request.units[name]}"
    with placed(f"units: {name}"):
        return Column(column, scale(one, variable.units), one)


# ---- The demo ------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Demo:
    """A log and what to ask of it."""

    fmu: Path
    request: Request
    true: Mapping[str, float]  # true values of the parameters


class Recipe(Protocol):
    """The module of a system's folder."""

    @staticmethod
    def demo(folder: Path) -> Demo:
        """Make the logs in a folder."""


def make_demo(folder: Path) -> Demo:
    """Make the log of the system that has one, in a folder; UserError if none has."""
    for system in project.systems().values():
        if (system / f"{project.IDENTIFICATION}.py").is_file():
            module = import_module(f"rparm.models.{system.name}.{project.IDENTIFICATION}")
            return cast(Recipe, module).demo(folder)
    raise UserError(f"{project.models_folder()}: no system makes a log")
