"""What a program gives of a run: its times, start values and inputs, checked."""

from collections.abc import Callable, Mapping, Sequence
from numbers import Real
from typing import Any

import numpy as np

from rparm.errors import UserError, placed
from rparm.files import difference
from rparm.fmi.model import INITIAL, INPUTS, PARAMETERS, Model, Value
from rparm.scenarios.scenario import MAX_STEPS

Input = float | bool | np.ndarray | Sequence[float] | tuple[Any, Any] | Callable[[float], float]
WHOLE = 1e-9  # of a step: largest distance of the stop time from a communication point


def is_finite_number(given: object) -> bool:
    """Whether it is a real number, neither infinite nor nan; a Boolean is none."""
    return isinstance(given, Real) and not isinstance(given, bool) and bool(np.isfinite(given))


def times(start: float, stop: float, step: float) -> np.ndarray:
    """Communication points in s; UserError if no whole number of steps leads to the stop time."""
    for name, value in (("start_time", start), ("stop_time", stop), ("step", step)):
        if not is_finite_number(value):
            raise UserError(f"{name}: expected a finite number, got {value!r}")
    if start < 0 or stop <= start or step <= 0:
        raise UserError(
            "expected 0 <= start_time < stop_time and step > 0, "
            f"got {start!r}, {stop!r} and {step!r}"
        )
    exact = difference(stop, start) / step
    count = round(exact)
    if not 1 <= count <= MAX_STEPS:
        raise UserError(f"expected 1 to {MAX_STEPS} steps, got {exact:.6g}")
    if abs(exact - count) > WHOLE * max(count, 1):
        raise UserError(f"step: expected a whole number of steps to the stop time, got {exact:.6g}")
    times = start + step * np.arange(count + 1)
    times[-1] = stop
    return times


def start_values(model: Model, given: Mapping[str, Any]) -> dict[str, Value]:
    """Parameters and states to set; UserError if one is wrong."""
    checked = {}
    for name, value in given.items():
        with placed(f"start_values: {name}"):
            variable = model.variables.get(name)
            kind = INITIAL if variable is not None and variable.is_a(INITIAL) else PARAMETERS
            value = value.item() if isinstance(value, np.generic) else value
            checked[name] = model.find(name, kind).checked(value)
    return checked


def input_values(model: Model, name: str, given: Any, times: np.ndarray) -> np.ndarray:
    """Values of an input at all communication points `times` (s), of their shape.

    `given` is a number, a value for each point, a pair (times, values) to interpolate, or a
    function of the time. UserError if a value is not finite or not in the input's range.
    """
    with placed(f"inputs: {name}"):
        variable = model.find(name, INPUTS)
    boolean = variable.type == "Boolean"
    try:
        values = _sampled(given, times, bool if boolean else float)
    except (TypeError, ValueError) as error:
        raise UserError(f"inputs: {name}: expected numbers: {error}") from error
    if values.shape != times.shape:
        raise UserError(f"inputs: {name}: expected {len(times)} values, got {values.shape}")
    if not boolean:
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            at = float(times[bad[0]])
            raise UserError(f"inputs: {name}: is {values[bad[0]]} at t = {at!r} s, not finite")
        with placed(f"inputs: {name}"):
            variable.check_range(float(values.min()), float(values.max()))
    return values


def _sampled(given: Any, times: np.ndarray, kind: type) -> np.ndarray:
    if isinstance(given, str):
        raise TypeError(f"got the text {given!r}")
    if callable(given):
        return np.array([given(float(t)) for t in times], dtype=kind)
    if isinstance(given, tuple) and len(given) == 2:
        points, values = (np.asarray(part, dtype=float) for part in given)
        if points.ndim != 1 or points.shape != values.shape or not len(points):
            raise ValueError("times and values of a table have the same length")
        if not np.all(np.diff(points) > 0):
            raise ValueError("the times of a table increase")
        return np.interp(times, points, values).astype(kind)
    values = np.asarray(given, dtype=kind)
    return np.full(times.shape, values) if values.ndim == 0 else values
