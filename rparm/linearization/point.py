"""The point of a linear model, as users give it: texts with units, or numbers."""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from rparm.errors import UserError, WrongValueError, placed
from rparm.fmi.model import Value, Variable
from rparm.linearization.derivatives import is_settable
from rparm.linearization.linear import Linear
from rparm.units import typed_quantity


class Subject(Protocol):
    """What can be linearized: an FMU or a system."""

    def variable(self, name: str) -> Variable:
        """What is declared of a variable; UserError if there is none of that name."""
        ...

    def at(self, values: Mapping[str, Value]) -> Linear:
        """The linear model where parameters, states and inputs have these values."""
        ...


def checked(
    subject: Subject, given: Mapping[str, Any], with_outputs: bool = False
) -> tuple[dict[str, Value], dict[str, float]]:
    """Values to set, and values that outputs are to have; in the variables' units.

    UserError if a variable is unknown, cannot be set, or does not take the value.

    Parameters
    ----------
    given : mapping
        Numbers, or texts with or without a unit ("30deg"), by name.
    with_outputs : bool
        Whether outputs may be given.
    """
    values: dict[str, Value] = {}
    targets: dict[str, float] = {}
    for name, value in given.items():
        variable = subject.variable(name)
        is_target = variable.causality == "output" and not is_settable(variable)
        if is_target and variable.variability == "discrete":
            raise UserError(f"{name}: is discrete, which no equilibrium can aim at")
        if is_target and not with_outputs:
            raise UserError(f"{name}: is an output, which --trim leads to a value")
        if not is_target and not is_settable(variable):
            raise UserError(f"{name}: is calculated, expected a state, an input or a parameter")
        with placed(name):
            number = _value(variable, value)
        if is_target:
            targets[name] = float(number)
        else:
            values[name] = number
    return values, targets


def _value(variable: Variable, given: Any) -> Value:
    given = given.item() if isinstance(given, np.generic) else given
    if not isinstance(given, str):
        return variable.checked(given)
    if variable.type == "Real":
        number = typed_quantity(given, variable.units)
        variable.check_range(number, number)
        return number
    if variable.type == "Boolean":
        if given not in ("true", "false"):
            raise WrongValueError(f"expected true or false, got {given!r}")
        return given == "true"
    return variable.checked(int(given) if given.lstrip("-").isdecimal() else given)
