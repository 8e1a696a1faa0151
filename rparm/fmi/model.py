"""A model as its FMU describes it: which variables there are, and which values they take."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

from fmpy.model_description import DefaultExperiment, ModelDescription, ModelVariable, SimpleType

from rparm.errors import WrongValueError, did_you_mean, hint
from rparm.files import show
from rparm.fmu_tools.compiler.units import ANGLE
from rparm.units import (
    Displays,
    Units,
    display_unit,
    finite_number,
    quantity,
    short,
    units_of,
)
from rparm.units import number as short_number

Value = float | int | bool | str
TURN = 2 * math.pi

INTEGER = (-(2**31), 2**31 - 1)  # range of an Integer of FMI 2.0 and an Int32 of FMI 3.0

# variables that a scenario may set, by the name of its section
PARAMETERS, INITIAL, INPUTS = "parameters", "initial", "inputs"
CALCULATED = "calculatedParameter"
KINDS = {PARAMETERS: "a parameter", INITIAL: "a state", INPUTS: "an input"}

# parameters of FMUs that bring their own integrator, as this project's do
METHOD, TOLERANCE = "solver_method", "relative_tolerance"
# of FMUs with gradients, which fmu/compiler/read/gradients.py names
ARE_EXACT = "gradients_are_exact"
START = re.compile(r"start\(\s*(.+?)\s*\)")
# smallest relative tolerance of each method: below it, FMUs integrate as at this one
SMALLEST_TOLERANCES = {"cvode_adams": 5e-12, "cvode_bdf": 5e-12, "erk": 1e-12, "taylor": 1e-13}


@dataclass(frozen=True)
class Variable:
    name: str
    reference: int  # value reference
    type: str  # Real, Integer, Boolean, String, Enumeration; others are neither read nor set
    causality: str
    initial: str | None  # exact, approx or calculated
    unit: str | None
    start: Value | None
    least: float  # -inf: no limit
    greatest: float  # inf: no limit
    items: Mapping[str, int] = field(default_factory=dict)  # numbers of an Enumeration, by name
    units: Units = field(default_factory=dict)  # in which a Real may be given; empty: has none
    description: str = ""
    variability: str | None = None
    # parameters that a calculated parameter, or the start value of a state, follows from
    follows: tuple[str, ...] = ()
    nominal: float | None = None  # usual size of a Real; None: not declared

    @property
    def why_it_follows(self) -> str:
        """A message for who tries to set it."""
        return f"{self.name!r} follows from {', '.join(self.follows)}: set these"

    def is_a(self, kind: str) -> bool:
        """Return whether it is one of `KINDS`."""
        if kind == INITIAL:
            return self.causality == "output" and self.initial == "exact"
        return self.causality == {PARAMETERS: "parameter", INPUTS: "input"}[kind]

    @property
    def can_start(self) -> bool:
        """Whether it is a parameter or the start value of a state, which need not be an output."""
        is_state = self.causality in ("output", "local") and self.initial == "exact"
        return self.causality == "parameter" or is_state

    def checked(self, given: Any) -> Value:
        """Return the value for a number, a text with a unit, or an item's name; WrongValueError."""
        if self.type not in TYPES.values():
            raise WrongValueError(f"is of type {self.type}, which cannot be set here")
        if self.type == "Enumeration":
            return self.item(given)
        if self.type == "Boolean":
            if not isinstance(given, bool):
                raise WrongValueError(f"expected true or false, got {show(given)}")
            return given
        if self.type == "Real":
            number = quantity(given, self.units)
        else:
            number = finite_number(given)
            if not number.is_integer():
                raise WrongValueError(f"expected a whole number, got {show(given)}")
            number = int(number)
        self.check_range(number, number)
        return number

    def question(self, given: Any) -> str:
        """Ask about a start value in rad without a unit beyond a turn; or nothing."""
        is_number = isinstance(given, int | float) and not isinstance(given, bool)
        if self.unit != ANGLE or self.initial != "exact" or not is_number or abs(given) <= TURN:
            return ""
        way_out = f' In degrees it is "{short_number(given)} deg".' if "deg" in self.units else ""
        turns = f"{short_number(given)} rad is {given / TURN:.3g} turns"
        return f"{turns}, is that meant?{way_out}"

    def written(self, value: Value) -> Value:
        """Return a value as a user gives it: an Enumeration's item by its name."""
        return next((name for name, item in self.items.items() if item == value), value)

    def item(self, name: Any) -> int:
        if not isinstance(name, str) or name not in self.items:
            guess = did_you_mean(name, self.items) if isinstance(name, str) else ""
            known = ", ".join(f'"{item}"' for item in self.items)
            raise WrongValueError(f"expected one of {known}, got {show(name)}{guess}")
        return self.items[name]

    def check_range(self, low: float, high: float) -> None:
        """Check the smallest and the largest of the values to set."""
        unit = f" {self.unit}" if self.unit else ""
        if low < self.least:
            raise WrongValueError(f"expected at least {self.least!r}{unit}, got {low!r}")
        if high > self.greatest:
            raise WrongValueError(f"expected at most {self.greatest!r}{unit}, got {high!r}")


@dataclass(frozen=True)
class Experiment:
    """Default experiment of an FMU; None: it has no such value."""

    start: float | None = None  # s
    stop: float | None = None  # s
    step: float | None = None  # s
    tolerance: float | None = None  # relative


@dataclass(frozen=True)
class Model:
    name: str
    fmi_version: str  # one of `project.VERSIONS`
    variables: Mapping[str, Variable]  # by name, in the order of the model description
    states: tuple[str, ...]  # names of the continuous states, in that order
    interpolates_inputs: bool  # takes inputs that are polynomials over a step
    gives_output_derivatives: bool
    saves_states: bool  # so that an instance can go back to an earlier point
    gives_directional_derivatives: bool
    # Versions of FMI name these differently, and list parameters or not: not compared.
    derivatives: tuple[str, ...] = field(default=(), compare=False)  # of `states`
    # dependencies of outputs and derivatives, by name; absent: on everything
    dependencies: Mapping[str, tuple[str, ...]] = field(default_factory=dict, compare=False)
    experiment: Experiment = Experiment()

    @property
    def asks_for_inputs(self) -> bool:
        """Whether it asks for the inputs at times within a step: intermediate update."""
        return self.interpolates_inputs and self.fmi_version == "3.0"

    @property
    def real_outputs(self) -> list[str]:
        found = (v for v in self.variables.values() if v.causality == "output")
        return [variable.name for variable in found if variable.type == "Real"]

    @property
    def own_states(self) -> list[str]:
        """Names of the states that are no gradients of others."""
        if ARE_EXACT not in self.variables:
            return list(self.states)
        by = [name for name, v in self.variables.items() if v.is_a(PARAMETERS)]
        by += [f"start({name})" for name in self.states]
        gradients = {gradient_name(name, each) for name in self.states for each in by}
        return [name for name in self.states if name not in gradients]

    @property
    def start_values(self) -> dict[str, Value]:
        return {v.name: v.start for v in self.variables.values() if v.start is not None}

    def method(self, values: Mapping[str, Value]) -> str:
        """Name the method of integration, with `values` for start values; "" if unknown."""
        variable = self.variables.get(METHOD)
        if variable is None or variable.start is None:
            return ""
        return str(variable.written(values.get(METHOD, variable.start)))

    def smallest_tolerance(self, values: Mapping[str, Value]) -> float:
        """Return the smallest relative tolerance that makes a difference; 0 if none is known."""
        return SMALLEST_TOLERANCES.get(self.method(values), 0.0)

    def check_tolerance(self, tolerance: float, values: Mapping[str, Value]) -> None:
        """Refuse a tolerance that the method of these values, or of start values, cannot reach."""
        smallest = self.smallest_tolerance(values)
        if tolerance < smallest:
            least = f"{short(smallest)}, the smallest of {self.method(values)}"
            raise WrongValueError(f"expected at least {least}, got {tolerance!r}")

    def find(self, name: str, kind: str) -> Variable:
        """Return a variable of one of `KINDS`; a WrongValueError names all of these."""
        variable = self.variables.get(name)
        if variable is not None and variable.is_a(kind):
            return variable
        if variable is not None and variable.follows:
            raise WrongValueError(variable.why_it_follows)
        meant = [other.name for other in self.variables.values() if other.is_a(kind)]
        if variable is None:
            raise WrongValueError(f"the model has no variable {name!r}{hint(name, meant)}")
        known = ", ".join(meant) or "none"
        raise WrongValueError(f"{name!r} is not {KINDS[kind]} of the model (known: {known})")


def gradient_name(of: str, by: str) -> str:
    """Name the derivative of a variable by a parameter, or by "start(NAME)" of a state."""
    start = START.fullmatch(by)
    return f"{of}_by_{f'start_{start[1]}' if start else by}"


def described(description: ModelDescription) -> Model:
    """Return the declared model, for co-simulation if it can; ValueError for a wrong number."""
    slave = description.coSimulation
    capabilities = slave or description.modelExchange
    interpolates = slave and (slave.canInterpolateInputs or slave.providesIntermediateUpdate)
    displays = {
        unit.name: {x.name: display_unit(x.factor, x.offset) for x in unit.displayUnits}
        for unit in description.unitDefinitions
    }
    derivatives = {
        unknown.variable.derivative.name: unknown.variable.name
        for unknown in description.derivatives
        if unknown.variable.derivative is not None
    }
    calculated = {v.name for v in description.modelVariables if v.causality == CALCULATED}
    follows = {
        unknown.variable.name: tuple(known.name for known in unknown.dependencies)
        for unknown in description.initialUnknowns
        if unknown.dependencies and unknown.variable.name in calculated.union(derivatives)
    }
    return Model(
        name=description.modelName,
        fmi_version=description.fmiVersion,
        variables={
            v.name: _variable(v, displays, follows.get(v.name, ()))
            for v in description.modelVariables
        },
        states=tuple(derivatives),
        interpolates_inputs=bool(interpolates),
        gives_output_derivatives=bool(slave and (slave.maxOutputDerivativeOrder or 0) >= 1),
        saves_states=bool(capabilities.canGetAndSetFMUstate),
        gives_directional_derivatives=bool(capabilities.providesDirectionalDerivative),
        derivatives=tuple(derivatives.values()),
        dependencies={
            unknown.variable.name: tuple(known.name for known in unknown.dependencies)
            for unknown in (*description.derivatives, *description.outputs)
            if unknown.dependencies is not None
        },
        experiment=_experiment(description.defaultExperiment),
    )


def _experiment(given: DefaultExperiment | None) -> Experiment:
    """Return the default experiment of a description, without what is not finite."""
    texts = given or DefaultExperiment()

    def number(text: str | None) -> float | None:
        return float(text) if text and math.isfinite(float(text)) else None

    every = texts.startTime, texts.stopTime, texts.stepSize, texts.tolerance
    return Experiment(*map(number, every))


# types of FMI 2.0 and FMI 3.0 -> type of `Variable`
TYPES = {
    "Real": "Real", "Integer": "Integer", "Float64": "Real", "Int32": "Integer",
    "Boolean": "Boolean", "String": "String", "Enumeration": "Enumeration",
}  # fmt: skip
# of the texts in a model description
CONVERT = {
    "Real": float,
    "Integer": int,
    "Enumeration": int,
    "Boolean": lambda text: text in ("true", "1"),
    "String": str,
}
NUMBERS = ("Real", "Integer", "Enumeration")


def _variable(variable: ModelVariable, displays: Displays, follows: tuple[str, ...]) -> Variable:
    kind = TYPES.get(variable.type, variable.type)
    if variable.dimensions:
        kind = f"array of {variable.type}"
    declared = variable.declaredType or SimpleType()
    low, high = (x or y for x, y in ((variable.min, declared.min), (variable.max, declared.max)))
    least, greatest = INTEGER if kind == "Integer" else (-math.inf, math.inf)
    convert = CONVERT.get(kind, lambda _: None)
    unit, nominal = variable.unit or declared.unit, variable.nominal or declared.nominal
    units = units_of(unit, displays) if kind == "Real" else {}
    if variable.relativeQuantity or declared.relativeQuantity:  # a difference
        units = {name: replace(other, offset=Fraction(0)) for name, other in units.items()}
    return Variable(
        name=variable.name,
        reference=variable.valueReference,
        type=kind,
        causality=variable.causality,
        initial=variable.initial,
        unit=unit,
        start=None if variable.start is None else convert(variable.start),
        least=convert(low) if low and kind in NUMBERS else least,
        greatest=convert(high) if high and kind in NUMBERS else greatest,
        items={item.name: int(item.value) for item in declared.items},
        units=units,
        description=variable.description or "",
        variability=variable.variability,
        follows=follows,
        nominal=float(nominal) if kind == "Real" and nominal else None,
    )
