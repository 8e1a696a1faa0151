"""What is asked for, checked against what the FMU declares."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import fmpy

from rparm.errors import UserError, WrongValueError, hint, placed
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import INITIAL, INPUTS, METHOD, PARAMETERS, Model, Value, Variable
from rparm.identification.logs import LENGTH, Column
from rparm.identification.parameters import DELAY, Parameter, Parameters
from rparm.units import quantity

FASTEST = "taylor", "erk"  # methods of integration, for steps as short as those of logs
ABOVE = ">"  # in "name>other": the parameter stays above the other one


@dataclass(frozen=True)
class Request:
    """What a user asks for; all names are those of variables of the FMU."""

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
    """Values that are not estimated."""
    estimated = [name.partition(ABOVE)[0] for name in request.parameters]
    settings = {}
    for name, given in request.settings.items():
        if name in estimated:
            raise WrongValueError(f"{name} is estimated: its start is given by --start")
        variable = model.find(name, PARAMETERS)
        settings[name] = _value(variable, given)
    return settings


def _fastest(fmu: Fmu, settings: Mapping[str, Value]) -> dict[str, Value]:
    """The fastest method of integration that the FMU takes, if it has a choice."""
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
    """A measured variable is a Real output, or a local one, that changes with time."""
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
    """Names of the continuous outputs and local variables."""
    described = fmpy.read_model_description(fmu.folder, validate=False).modelVariables
    return [
        variable.name
        for variable in described
        if variable.causality in ("output", "local")
        and variable.variability in (None, "continuous")
        and fmu.model.variables[variable.name].type == "Real"
    ]


def _column(request: Request, variable: Variable) -> Column:
    name, scale = variable.name, 1.0
    if name in request.units:
        with placed(f"units: {name}"):
            scale = quantity(f"1 {request.units[name]}", variable.units, True)
    return Column(request.columns.get(name, name), scale)
