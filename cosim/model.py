"""A model as its FMU describes it: which variables there are, and which values they take."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fmpy.model_description import ModelDescription, ModelVariable, SimpleType

from cosim.errors import did_you_mean
from cosim.input_files import show

Value = float | int | bool | str

VERSIONS = ("2.0", "3.0")  # of FMI
INTEGER = (-(2**31), 2**31 - 1)  # what an Integer of FMI 2.0 and an Int32 of FMI 3.0 hold

# what a scenario may set, by the name of its section
PARAMETERS, INITIAL, INPUTS = "parameters", "initial", "inputs"
KINDS = {PARAMETERS: "a parameter", INITIAL: "a state", INPUTS: "an input"}


class WrongValueError(Exception):
    """Why a variable does not take a value, or is not of a kind, in one line."""


@dataclass(frozen=True)
class Variable:
    """A variable of a model."""

    name: str
    reference: int  # value reference
    type: str  # Real, Integer, Boolean, String, Enumeration, or one that is neither read nor set
    causality: str
    initial: str | None  # exact, approx or calculated
    unit: str | None
    start: Value | None
    least: float  # -inf: no limit
    greatest: float  # inf: no limit
    items: Mapping[str, int] = field(default_factory=dict)  # numbers of an Enumeration, by name
    description: str = ""

    def is_a(self, kind: str) -> bool:
        """Whether it is one of `KINDS`."""
        if kind == INITIAL:
            return self.causality == "output" and self.initial == "exact"
        return self.causality == {PARAMETERS: "parameter", INPUTS: "input"}[kind]

    def checked(self, given: Any) -> Value:
        """Value to set, from what a user gives: a number, or the name of an Enumeration's item.

        Raises
        ------
        WrongValueError
            If it is not of the variable's type or out of range.
        """
        if self.type not in TYPES.values():
            raise WrongValueError(f"is of type {self.type}, which cannot be set here")
        if self.type == "Enumeration":
            return self.item(given)
        if self.type == "Boolean":
            if not isinstance(given, bool):
                raise WrongValueError(f"expected true or false, got {show(given)}")
            return given
        number = finite_number(given)
        if self.type == "Integer":
            if not number.is_integer():
                raise WrongValueError(f"expected a whole number, got {show(given)}")
            number = int(number)
        self.check_range(number, number)
        return number

    def written(self, value: Value) -> Value:
        """A value as a user gives it: an Enumeration's item by its name."""
        return next((name for name, item in self.items.items() if item == value), value)

    def item(self, name: Any) -> int:
        """Number of an Enumeration's item."""
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


def finite_number(given: Any) -> float:
    """`given` as a float; WrongValueError if it is not a finite number."""
    if isinstance(given, bool) or not isinstance(given, int | float):
        raise WrongValueError(f"expected a number, got {show(given)}")
    try:
        number = float(given)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise WrongValueError(f"expected a finite number, got {show(given)}")
    return number


@dataclass(frozen=True)
class Model:
    """What an FMU declares."""

    name: str
    fmi_version: str  # one of `VERSIONS`
    variables: Mapping[str, Variable]  # by name, in the order of the model description
    states: tuple[str, ...]  # names of the continuous states, in that order
    interpolates_inputs: bool  # takes inputs that are polynomials over a step
    gives_output_derivatives: bool
    saves_states: bool  # so that an instance can go back to an earlier point

    @property
    def asks_for_inputs(self) -> bool:
        """Whether it asks for the inputs at times within a step: intermediate update."""
        return self.interpolates_inputs and self.fmi_version == "3.0"

    @property
    def real_outputs(self) -> list[str]:
        """Names of all outputs of type Real."""
        found = (v for v in self.variables.values() if v.causality == "output")
        return [variable.name for variable in found if variable.type == "Real"]

    @property
    def start_values(self) -> dict[str, Value]:
        """Start values of all variables that have one."""
        return {v.name: v.start for v in self.variables.values() if v.start is not None}

    def find(self, name: str, kind: str) -> Variable:
        """Variable called `name`.

        Raises
        ------
        WrongValueError
            If it is not of the kind, one of `KINDS`; lists those that are.
        """
        variable = self.variables.get(name)
        if variable is not None and variable.is_a(kind):
            return variable
        meant = [other.name for other in self.variables.values() if other.is_a(kind)]
        known = ", ".join(meant) or "none"
        if variable is None:
            guess = did_you_mean(name, meant)
            raise WrongValueError(f"the model has no variable {name!r}{guess} (known: {known})")
        raise WrongValueError(f"{name!r} is not {KINDS[kind]} of the model (known: {known})")


def is_known(description: ModelDescription) -> bool:
    """Whether a description as fmpy reads it is of a known version of FMI and for co-simulation."""
    return description.fmiVersion in VERSIONS and description.coSimulation is not None


def described(description: ModelDescription) -> Model:
    """Model that a description declares that `is_known`.

    Raises
    ------
    ValueError
        If a start value or a limit is not a number.
    """
    capabilities = description.coSimulation
    derivatives = (unknown.variable.derivative for unknown in description.derivatives)
    return Model(
        name=description.modelName,
        fmi_version=description.fmiVersion,
        variables={variable.name: _variable(variable) for variable in description.modelVariables},
        states=tuple(dict.fromkeys(state.name for state in derivatives if state is not None)),
        interpolates_inputs=bool(
            capabilities.canInterpolateInputs or capabilities.providesIntermediateUpdate
        ),
        gives_output_derivatives=(capabilities.maxOutputDerivativeOrder or 0) >= 1,
        saves_states=bool(capabilities.canGetAndSetFMUstate),
    )


# names of FMI 2.0 and FMI 3.0 -> that of `Variable`
TYPES = {
    "Real": "Real",
    "Integer": "Integer",
    "Float64": "Real",
    "Int32": "Integer",
    "Boolean": "Boolean",
    "String": "String",
    "Enumeration": "Enumeration",
}
# of the texts in a model description
CONVERT = {
    "Real": float,
    "Integer": int,
    "Enumeration": int,
    "Boolean": lambda text: text in ("true", "1"),
    "String": str,
}
NUMBERS = ("Real", "Integer", "Enumeration")


def _variable(variable: ModelVariable) -> Variable:
    kind = TYPES.get(variable.type, variable.type)
    if variable.dimensions:
        kind = f"array of {variable.type}"
    declared = variable.declaredType or SimpleType()
    low, high = (x or y for x, y in ((variable.min, declared.min), (variable.max, declared.max)))
    least, greatest = INTEGER if kind == "Integer" else (-math.inf, math.inf)
    convert = CONVERT.get(kind, lambda _: None)
    return Variable(
        name=variable.name,
        reference=variable.valueReference,
        type=kind,
        causality=variable.causality,
        initial=variable.initial,
        unit=variable.unit or declared.unit,
        start=None if variable.start is None else convert(variable.start),
        least=convert(low) if low and kind in NUMBERS else least,
        greatest=convert(high) if high and kind in NUMBERS else greatest,
        items={item.name: int(item.value) for item in declared.items},
        description=variable.description or "",
    )
