"""Systems of connected components, however a file describes them, checked against their FMUs."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from rparm.errors import UserError, WrongValueError, did_you_mean, hint, placed
from rparm.files import difference, show
from rparm.fmi.fmu_file import LARGEST_SYSTEM, Fmu, describe
from rparm.fmi.model import INPUTS, TOLERANCE, Model, Value, Variable
from rparm.project import VERSIONS
from rparm.runs.inputs import Signal
from rparm.runs.scenario import are_whole, count_steps
from rparm.systems.python_component import ANY
from rparm.units import number

ALONE = "default"  # the variant of a system that has no parameter sets
STEPS = 1000  # of a run whose step nothing says
# order of a file's steps -> order and inputs of the master
WAYS = {
    "jacobi": ("jacobi", "held"),
    "gauss_seidel": ("gauss_seidel", "held"),
    "extrapolated": ("jacobi", "extrapolated"),
}
# type of a variable -> types of a parameter's value that engines can give it
SETTABLE = {
    "Real": ("Real",),
    "Integer": ("Integer",),
    "Enumeration": ("Integer",),
    "Boolean": ("Boolean",),
    "String": ("String",),
    ANY: (ANY,),  # of a component in Python
}
PARAMETERS = ("parameter", "input", "output")  # causalities of variables with a start value


# ---- Structure -----------------------------------------------------------------------------------
@dataclass(frozen=True)
class Connector:
    """A variable of a component that the system sees."""

    name: str
    kind: str  # input, output, parameter or calculatedParameter
    type: str | None  # Real, Integer, Boolean, String or Enumeration; None: the variable's
    unit: str | None  # None: the variable's


@dataclass(frozen=True)
class Component:
    """One FMU in the system, or what runs like one."""

    name: str
    source: str  # path of the FMU inside the SSP, or in the folder of what is opened
    connectors: dict[str, Connector]  # by name, in the order of the file


@dataclass(frozen=True)
class Connection:
    """An output that feeds an input."""

    start_component: str
    start_connector: str
    end_component: str
    end_connector: str

    @property
    def start(self) -> str:
        """Name "component.variable" of the output."""
        return f"{self.start_component}.{self.start_connector}"

    @property
    def end(self) -> str:
        """Name "component.variable" of the input."""
        return f"{self.end_component}.{self.end_connector}"

    def __str__(self) -> str:
        return f"{self.start} -> {self.end}"


@dataclass(frozen=True)
class Parameter:
    """A value that a parameter set gives to a variable."""

    type: str  # Real, Integer, Boolean or String
    value: Value
    unit: str | None

    @staticmethod
    def of(variable: Variable, given: Any) -> "Parameter":
        """Return a value to start from; WrongValueError if the variable does not take it."""
        if not (variable.can_start or variable.is_a(INPUTS)):
            wrong = f"is {causality(variable)} and cannot be set"
            raise WrongValueError(variable.why_it_follows if variable.follows else wrong)
        given = given.item() if isinstance(given, np.generic) else given
        if variable.type == "String" and not isinstance(given, str):
            raise WrongValueError(f"expected a text, got {show(given)}")
        value = given if variable.type == "String" else variable.checked(given)
        kind = "Integer" if variable.type == "Enumeration" else variable.type
        return Parameter(kind, value, variable.unit if kind == "Real" else None)


@dataclass(frozen=True)
class System:
    """Structure of a system, and the variants of its parameters."""

    name: str
    components: tuple[Component, ...]  # in the order of the file
    connections: tuple[Connection, ...]
    start: float  # s
    stop: float  # s
    step: float  # s, communication step
    # variant -> component -> variable -> value; {} for a component without values; without
    # parameter sets ALONE is the only variant
    parameters: dict[str, dict[str, dict[str, Parameter]]]
    descriptions: Mapping[str, str] = field(default_factory=dict)  # of variants that have one
    notes: tuple[str, ...] = ()  # choices where the file says nothing
    # of inputs that move from outside, by component.variable; times are s since the start
    inputs: Mapping[str, Signal] = field(default_factory=dict)
    outside: tuple[str, ...] = ()  # inputs, by component.variable, that only others can feed
    keep: tuple[str, ...] | None = None  # component.variable to record; None: all outputs
    description: str = ""
    order: str = "jacobi"  # of steps, one of WAYS
    rates: Mapping[str, float] = field(default_factory=dict)  # s, of components with their own
    subsystems: tuple[str, ...] = ()  # names before those of components, each before those in it

    def with_step(self, step: float) -> "System":
        """Return the system with another communication step, s; its rates change as much."""
        rates = {name: every * (step / self.step) for name, every in self.rates.items()}
        return replace(self, step=step, rates=rates)

    @property
    def parameter_sets(self) -> dict[str, dict[str, dict[str, Value]]]:
        """Only the values: variant -> component -> variable -> value, variants in file order."""
        return {
            variant: {
                component: {name: parameter.value for name, parameter in values.items()}
                for component, values in components.items()
            }
            for variant, components in self.parameters.items()
        }

    @property
    def steps(self) -> int:
        return round((self.stop - self.start) / self.step)

    @property
    def times(self) -> np.ndarray:
        """Communication points, (steps + 1,) s."""
        return self.start + self.step * np.arange(self.steps + 1)

    def component(self, name: str) -> Component:
        return next(component for component in self.components if component.name == name)

    @property
    def elapsed(self) -> np.ndarray:
        """Communication points since the start, (steps + 1,) s."""
        return self.step * np.arange(self.steps + 1)


# ---- Opened --------------------------------------------------------------------------------------
@dataclass(frozen=True)
class OpenedSystem:
    """A system of a file, with the FMUs of its components in a folder: it can be run."""

    path: Path  # of the file: an SSP, or a loop file
    folder: Path  # with the FMUs
    system: System
    models: Mapping[str, Model]  # description of each component
    # files of FMUs for messages, by component; an SSP has them inside
    files: Mapping[str, Path] = field(default_factory=dict)
    is_plain: bool = True  # as an SSP, Ecos reads it
    # what opens a component that is no FMU, by its name: it gives what runs like an Fmu
    python: Mapping[str, Callable[[], Fmu]] = field(default_factory=dict)
    version: str = VERSIONS[0]  # of FMI, of the project's FMUs and built ones
    read: Sequence[Path] = ()  # files, beside those of FMUs

    def variant(self, given: str | None) -> str:
        """Return the variant that is given; else "default" if there is one, else the first."""
        known = self.system.parameters
        name = given or (ALONE if ALONE in known else next(iter(known)))
        if name not in known:
            raise UserError(f"{self.path}: no variant {name!r}{hint(name, known)}")
        return name

    @property
    def is_ssp(self) -> bool:
        return not self.files and not self.python

    @property
    def passed_on(self) -> str:
        """An output that a tick at the start may change and another component passes on at once."""
        starts = {c.start for c in self.system.connections}
        for c in self.system.connections:
            component, end = self.split(c.end)
            outputs = self.models[component].dependencies.items()
            passing = any(end in known and f"{component}.{y}" in starts for y, known in outputs)
            start = self.variable(c.start)
            if passing and start.variability == "discrete" and start.initial != "calculated":
                return c.start
        return ""

    def fmu(self, component: str) -> Path:
        return self.folder / self.system.component(component).source

    def unpacked_fmu(self, component: str) -> Fmu:
        """Return the FMU of a component, unpacked; messages name the file that the user gave."""
        if component in self.python:
            return self.python[component]()
        inside = self.path / self.system.component(component).source
        return Fmu(self.fmu(component), shown=self.files.get(component, inside))

    @contextmanager
    def unpacked_fmus(self, names: Iterable[str] | None = None) -> Iterator[dict[str, Fmu]]:
        """Return the FMUs of all components, or of those named, in this order; each once."""
        with ExitStack() as stack:
            opened: dict[object, Fmu] = {}
            found = {}
            for name in self.models if names is None else names:
                of = name if name in self.python else (self.fmu(name), self.files.get(name))
                if of not in opened:
                    opened[of] = stack.enter_context(self.unpacked_fmu(name))
                found[name] = opened[of]
            yield found

    @property
    def notes(self) -> list[str]:
        """Choices for all runs that the file does not make."""
        fed = {c.end for c in self.system.connections}.union(self.system.inputs)
        for values in self.system.parameters.values():
            fed.update(f"{component}.{name}" for component in values for name in values[component])
        alone = [
            f"{component}.{variable.name}"
            for component, model in self.models.items()
            for variable in model.variables.values()
            if variable.is_a(INPUTS) and f"{component}.{variable.name}" not in fed
        ]
        outside = [name for name in alone if name in self.system.outside]
        kinds = {
            "not connected, constant": [name for name in alone if name not in outside],
            "inputs of the whole system, which nothing moves here, constant": outside,
        }
        held = [f"{kind}: {', '.join(names)}" for kind, names in kinds.items() if names]
        return [*self.system.notes, *self._rounded_rates(), *held]

    def _rounded_rates(self) -> Iterator[str]:
        """Say which components step at the points nearest to their times."""
        step = self.system.step
        for name, every in self.system.rates.items():
            if not are_whole(0.0, every, step):
                rate = f"every {number(every)} s is no multiple of the step, {number(step)} s"
                yield f"{name}: {rate}: it steps at the nearest points"

    def with_values(self, variant: str, given: Mapping[str, Any]) -> "OpenedSystem":
        """Replace values of a variant, by ``component.variable``; UserError for a wrong one."""
        values = {name: dict(own) for name, own in self.system.parameters[variant].items()}
        for name, value in given.items():
            with placed(f"{self.path}: parameters: {name}"):
                component, own = self.split(name)
                if component not in self.models:
                    known = hint(component, self.models)
                    raise WrongValueError(f"no component {component!r}{known}")
                values.setdefault(component, {})[own] = self._checked(component, own, value)
        sets = self.system.parameters | {variant: values}
        changed = replace(self.system, parameters=sets)
        check(self.path, changed, self.models)
        return replace(self, system=changed)

    def _checked(self, component: str, name: str, given: Any) -> Parameter:
        variable = self.models[component].variables.get(name)
        if variable is None:
            known = self.models[component].variables
            raise WrongValueError(
                f"{component!r} has no variable {name!r}{did_you_mean(name, known)}"
            )
        feeding = [c.start for c in self.system.connections if c.end == f"{component}.{name}"]
        if feeding:
            raise WrongValueError(f"is connected to {feeding[0]} and cannot be set")
        if f"{component}.{name}" in self.system.inputs:
            raise WrongValueError("is an input that moves")
        return Parameter.of(variable, given)

    def split(self, name: str) -> tuple[str, str]:
        """Return component and variable of a name, either of which may have dots."""
        return split(name, self.models)

    def variable(self, name: str) -> Variable:
        """Return the variable ``component.variable`` as the FMU declares it."""
        component, variable = self.split(name)
        return self.models[component].variables[variable]


def split(name: str, models: Mapping[str, Model]) -> tuple[str, str]:
    """Split "component.variable" where both may have dots.

    The longest component that has the variable wins, else the longest, else all before the first
    dot; `check` refuses names that two components have.
    """
    parts = [
        (component, name[len(component) + 1 :])
        for component in sorted(models, key=len, reverse=True)
        if name.startswith(f"{component}.")
    ]
    component, _, variable = name.partition(".")
    known = (part for part in parts if part[1] in models[part[0]].variables)
    return next(known, parts[0] if parts else (component, variable))


# ---- Times ---------------------------------------------------------------------------------------
def times(
    start: float, stop: float | None, step: float | None, models: Mapping[str, Model]
) -> tuple[float, float, float, list[str]]:
    """Return start, stop and communication step in s, and notes on choices.

    FMUs give the largest stop and the smallest step. WrongValueError if there is no way to choose.
    """
    notes = []
    if stop is None:
        ends = {name: model.experiment.stop for name, model in models.items()}
        later = {name: end for name, end in ends.items() if end is not None and end > start}
        if not later:
            raise WrongValueError("expected stop: no FMU has a default stop time after start")
        longest = max(later, key=lambda name: later[name])
        stop = later[longest]
        notes.append(f"stop time {number(stop)} s: the largest of its FMUs ({longest})")
    if step is None and math.isfinite(stop - start):
        step, reason = _chosen_step(start, stop, models)
        notes.append(f"communication step {number(step)} s: {reason}")
    if step is None or not start < stop or not math.isfinite(stop - start):
        raise WrongValueError(f"start {start!r} s, stop {stop!r} s: expected a later stop")
    if not 0 < step <= difference(stop, start):
        span = f"stop - start = {number(difference(stop, start))} s"
        raise WrongValueError(f"expected a step from 0 s to {span}, got {step!r} s")
    count_steps(start, stop, step)
    return start, stop, step, notes


def _chosen_step(start: float, stop: float, models: Mapping[str, Model]) -> tuple[float, str]:
    """Choose a step of which a whole number lead to the stop time; say why."""
    given = {name: model.experiment.step for name, model in models.items()}
    steps = {name: step for name, step in given.items() if step is not None and step > 0}
    shortest = min(steps, key=lambda name: steps[name], default=None)
    span = difference(stop, start)
    step = span / STEPS if shortest is None else min(steps[shortest], span)
    if not are_whole(start, stop, step):
        step = span / math.ceil(span / step)
    return step, f"the smallest of its FMUs ({shortest})" if shortest else f"1/{STEPS} of the run"


# ---- Checks against the FMUs ---------------------------------------------------------------------
class FmuReader:
    """Reads what the FMUs of one system declare; their content has a limit."""

    def __init__(self, path: Path) -> None:
        self.path = path  # of the system, for messages
        self.bytes = 0  # of the FMUs of all components, unpacked

    def read(self, component: str, file: Path, shown: object) -> Model:
        where = f"{self.path}: component {component!r}"
        with placed(f"{where}: {shown}"):
            found = describe(file)
        self.bytes += sum(found.sizes.values())
        if self.bytes > LARGEST_SYSTEM:
            most = f"{LARGEST_SYSTEM / 1e6:.0f} MB"
            text = f"the FMUs up to component {component!r} have more than {most} inside"
            raise UserError(f"{self.path}: {text}")
        return found.model


def check(path: Path, system: System, models: Mapping[str, Model]) -> None:
    """Check a system against what the FMU of each component declares.

    Connectors are variables of the same causality, type and unit, connections lead from outputs to
    inputs of the same type and unit, no input has two, parameters can be set; else UserError.
    """
    _Checker(path, system, models).check()


class _Checker:
    def __init__(self, path: Path, system: System, models: Mapping[str, Model]) -> None:
        self.path = path
        self.system = system
        self.models = models

    def fail(self, message: str) -> NoReturn:
        raise UserError(f"{self.path}: {message}")

    def check(self) -> None:
        self.names()
        for component in self.system.components:
            for connector in component.connectors.values():
                self.connector(component, connector)
        self.connections()
        for variant, components in self.system.parameters.items():
            for component, values in components.items():
                for name, parameter in values.items():
                    self.parameter(variant, component, name, parameter)
                self.tolerance(variant, component, values)

    def names(self) -> None:
        """Refuse two variables of one name, such as "arm.joint.q" of "arm" and of "arm.joint"."""
        owners: dict[str, str] = {}
        for component, model in self.models.items():
            for variable in model.variables:
                name = f"{component}.{variable}"
                owner = owners.setdefault(name, component)
                if owner != component:
                    both = f"components {owner!r} and {component!r}"
                    self.fail(f"{name!r} is a variable of {both}: rename one of them")

    def connector(self, component: Component, connector: Connector) -> None:
        where = f"component {component.name!r}: connector {connector.name!r}"
        variable = self.variable(component.name, connector.name, where, "such variable")
        if variable.causality != connector.kind:
            self.fail(f"{where} is an {connector.kind}, in its FMU {causality(variable)}")
        if connector.type is not None and variable.type != connector.type:
            self.fail(f"{where} is of type {connector.type}, in its FMU {variable.type}")
        if connector.unit is not None and variable.unit != connector.unit:
            self.fail(f"{where} is in {_unit(connector.unit)}, in its FMU {_unit(variable.unit)}")

    def variable(self, component: str, name: str, where: str, what: str) -> Variable:
        variables: Mapping[str, Variable] = self.models[component].variables
        if name not in variables:
            self.fail(f"{where}: its FMU has no {what}{did_you_mean(name, variables)}")
        return variables[name]

    def connections(self) -> None:
        fed: dict[tuple[str, str], str] = {}
        for connection in self.system.connections:
            where = f"connection {connection}"
            start = self.end(where, connection.start_component, connection.start_connector)
            end = self.end(where, connection.end_component, connection.end_connector)
            if start.causality != "output":
                self.fail(f"{where}: {connection.start_connector!r} is no output")
            if end.causality != "input":
                self.fail(f"{where}: {connection.end_connector!r} is no input")
            if start.type != end.type:
                self.fail(f"{where}: types differ, {start.type} and {end.type}")
            if start.unit != end.unit and start.unit and end.unit:
                self.fail(f"{where}: units differ, {_unit(start.unit)} and {_unit(end.unit)}")
            target = (connection.end_component, connection.end_connector)
            if target in fed:
                self.fail(f"{where}: the input has a connection already, {fed[target]}")
            fed[target] = str(connection)

    def end(self, where: str, component: str, connector: str) -> Variable:
        """Return the variable at one end of a connection."""
        names = [known.name for known in self.system.components]
        if component not in names:
            hint = did_you_mean(component, names)
            self.fail(f"{where}: there is no component {component!r}{hint}")
        connectors = self.system.component(component).connectors
        if connector not in connectors:
            known = self.models[component].variables.get(connector)
            hint = did_you_mean(connector, connectors)
            hint = f": it is {causality(known)}" if known else hint
            self.fail(f"{where}: component {component!r} has no connector {connector!r}{hint}")
        return self.models[component].variables[connector]

    def parameter(self, variant: str, component: str, name: str, parameter: Parameter) -> None:
        where = f"parameter set {variant!r}: component {component!r}"
        variable = self.variable(component, name, where, f"variable {name!r}")
        where = f"{where}: {name!r}"
        if variable.causality not in PARAMETERS or variable.start is None:
            self.fail(f"{where} is {causality(variable)} and cannot be set")
        if parameter.type not in SETTABLE[variable.type]:
            self.fail(f"{where} is of type {parameter.type}, in its FMU {variable.type}")
        if parameter.unit is not None and parameter.unit != variable.unit:
            self.fail(f"{where} is in {_unit(parameter.unit)}, in its FMU {_unit(variable.unit)}")
        if parameter.type in ("Real", "Integer"):
            least, greatest = variable.least, variable.greatest
            if not least <= parameter.value <= greatest:
                self.fail(f"{where} is {parameter.value!r}, expected {least:g} to {greatest:g}")

    def tolerance(self, variant: str, component: str, values: Mapping[str, Parameter]) -> None:
        """Refuse a tolerance that the component's method of integration cannot reach."""
        given = {name: parameter.value for name, parameter in values.items()}
        where = f"parameter set {variant!r}: component {component!r}: {TOLERANCE!r}"
        if given.get(TOLERANCE):
            with placed(f"{self.path}: {where}"):
                self.models[component].check_tolerance(given[TOLERANCE], given)


def _unit(unit: str | None) -> str:
    return "no unit" if unit is None else repr(unit)


def causality(variable: Variable) -> str:
    """Return "an input" and the like."""
    article = "an" if variable.causality[0] in "aeiou" else "a"
    return f"{article} {variable.causality}"
