"""A, B, C and D of one FMU at a point, by its directional derivatives."""

from collections.abc import Mapping
from contextlib import ExitStack

import numpy as np

from rparm.errors import UserError, did_you_mean
from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import PARAMETERS, Model, Value, Variable
from rparm.linearization.linear import Linear
from rparm.linearization.modes import held_states, is_sampled


def linear_model(instance: Instance) -> Linear:
    """The linear model of an instance after its initialization, with all states.

    UserError if a value is not finite.
    """
    model = instance.fmu.model
    variables = model.variables.values()
    inputs = [v.name for v in variables if v.causality == "input" and v.type == "Real"]
    outputs = [n for n in model.real_outputs if model.variables[n].variability != "discrete"]
    unknowns, knowns = [*model.derivatives, *outputs], [*model.states, *inputs]
    values = instance.reals([*knowns, *unknowns])
    with instance.explained("at the point"):
        values.get()
    partials = instance.partials(unknowns, knowns)
    _check_finite(instance, values.names, values.view)
    _check_finite(instance, unknowns, partials.sum(axis=1))
    n, m = len(model.states), len(inputs)
    x, u, rates, y = np.split(values.view, np.cumsum([n, m, n]))
    return Linear(
        states=model.states,
        inputs=tuple(inputs),
        outputs=tuple(outputs),
        A=partials[:n, :n],
        B=partials[:n, n:],
        C=partials[n:, :n],
        D=partials[n:, n:],
        x=x,
        u=u,
        y=y,
        rates=rates,
        at=dict(zip(knowns, [*x.tolist(), *u.tolist()], strict=True)),
        left_out=tuple(name for name in model.real_outputs if name not in outputs),
    )


def _check_finite(instance: Instance, names: list[str], numbers: np.ndarray) -> None:
    bad = np.flatnonzero(~np.isfinite(numbers))
    if len(bad):
        raise UserError(f"{instance.name}: {names[bad[0]]} or a derivative of it is not finite")


def require_derivatives(fmu: Fmu) -> None:
    """Refuse an FMU that gives no directional derivatives."""
    if not fmu.model.gives_directional_derivatives:
        raise UserError(f"{fmu.path}: gives no directional derivatives, which A, B, C, D are from")


class FmuSubject(ExitStack):
    """One FMU to linearize; a context manager, which keeps one instance.

    Parameters
    ----------
    fmu : Fmu
        Open as long as this; of either kind.
    time : float
        s.
    """

    def __init__(self, fmu: Fmu, time: float = 0.0) -> None:
        super().__init__()
        require_derivatives(fmu)
        self.fmu, self.time = fmu, time
        self._is_new = True
        self._instance = self.enter_context(fmu.instance(fmu.path.stem))

    def variable(self, name: str) -> Variable:
        """What the FMU declares of a variable; UserError if it has none of that name."""
        return known_variable(self.fmu.model, name, str(self.fmu.path))

    def at(self, values: Mapping[str, Value]) -> Linear:
        """The linear model where parameters, states and inputs have these values."""
        instance = self._instance
        if not self._is_new:
            instance.reset()
        self._is_new = False
        instance.set_up(self.time, None)
        for name, value in values.items():
            instance.set(name, value)
        instance.enter_initialization()
        instance.exit_initialization()
        return linear_model(instance)

    def held(self, found: Linear) -> list[str]:
        """States of `found` that are held."""
        return held_states(found, self.fmu.model)

    def check(self, found: Linear) -> None:
        """Refuse an FMU that is sampled: its derivatives are 0 between samples."""
        instance, model = self._instance, self.fmu.model
        if is_sampled(found, model, model.real_outputs, lambda: next_event(instance)):
            raise UserError(f"{self.fmu.path}: {SAMPLED}")


def next_event(instance: Instance) -> float | None:
    """Time of the next time event in s, if the FMU can be asked: model exchange only."""
    return getattr(instance, "next_event", None)


SAMPLED = (
    "is sampled, which no linear model in continuous time can be: set its sample time to 0 if it "
    "has one"
)


def known_variable(model: Model, name: str, where: str) -> Variable:
    """A variable of a model; UserError if there is none of that name."""
    if name not in model.variables:
        known = [v.name for v in model.variables.values() if v.causality == "input"]
        guess = did_you_mean(name, model.variables)
        label = f" (states and inputs: {', '.join([*model.states, *known])})"
        raise UserError(f"{where}: has no variable {name!r}{guess or label}")
    return model.variables[name]


def is_settable(variable: Variable) -> bool:
    """Whether a point may say its value: a state, an input or a parameter."""
    is_state = variable.causality in ("output", "local") and variable.initial == "exact"
    return is_state or variable.causality == "input" or variable.is_a(PARAMETERS)
