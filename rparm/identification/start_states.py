"""A first guess of the state at the start of each segment, from what was measured there."""

from collections.abc import Mapping, Sequence

import fmpy
import numpy as np

from rparm.errors import UserError
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import INITIAL, Model
from rparm.identification.logs import Segment
from rparm.identification.parameters import Parameters
from rparm.identification.simulator import Simulator

WINDOW = 0.15  # of a segment, at its start, that a polynomial is fitted to
DEGREE = 3
FEWEST = 12  # rows of it
SHIFTS = (0.0, 1e-4, 1e-3, 1e-2, 0.1, 0.5)  # towards the middle of all states, if a start fails


def states(fmu: Fmu) -> list[str]:
    """Names of the states; UserError if one cannot be set."""
    for name in fmu.model.states:
        if not fmu.model.variables[name].is_a(INITIAL):
            raise UserError(f"{fmu.path}: state {name!r} cannot be set where a segment starts")
    return list(fmu.model.states)


def rates(fmu: Fmu) -> dict[str, str]:
    """States that are the derivative of another one: that one by their name."""
    description = fmpy.read_model_description(fmu.folder, validate=False)
    variables = fmu.model.variables
    of_reference = {variables[name].reference: name for name in fmu.model.states}
    found = {}
    for unknown in description.derivatives:
        rate, state = unknown.variable, unknown.variable.derivative
        if state is not None and rate.valueReference in of_reference:
            found[of_reference[rate.valueReference]] = state.name
    return found


def guess(
    fmu: Fmu, segments: Sequence[Segment], outputs: Sequence[str], given: Mapping[str, float]
) -> np.ndarray:
    """States (segments, states): measured ones, their derivatives, else start values."""
    model, of = fmu.model, rates(fmu)
    names = states(fmu)
    found = np.empty((len(segments), len(names)))
    for row, segment in zip(found, segments, strict=True):
        smooth = _polynomials(segment)
        for k, name in enumerate(names):
            if name in outputs:
                row[k] = smooth[0, outputs.index(name)]
            elif of.get(name) in outputs:
                row[k] = smooth[1, outputs.index(of[name])]
            else:
                row[k] = given.get(name, model.variables[name].start or 0.0)
    return np.clip(found, *_limits(model, names))


def _limits(model: Model, names: Sequence[str]) -> tuple[list[float], list[float]]:
    variables = [model.variables[name] for name in names]
    return [v.least for v in variables], [v.greatest for v in variables]


def _polynomials(segment: Segment) -> np.ndarray:
    """Value and derivative (2, outputs) at the start, of polynomials through the first rows."""
    there = np.flatnonzero(np.isfinite(segment.measured).all(axis=1))
    rows = there[: max(FEWEST, int(WINDOW * len(there)))]
    times = segment.times[rows] - segment.times[0]
    degree = min(DEGREE, len(rows) - 1)
    span = times[-1]
    powers = (times / span)[:, None] ** np.arange(degree + 1)
    found = np.linalg.lstsq(powers, segment.measured[rows], rcond=None)[0]
    return found[:2] / np.array([1.0, span])[:, None]


def scales(states: np.ndarray) -> np.ndarray:
    """Scales (states,) of guessed states (segments, states)."""
    largest = np.abs(states).max(axis=0)
    return np.where(largest > 0, largest, 1.0)


def admitted(
    simulator: Simulator, segments: Sequence[Segment], parameters: Parameters, states: np.ndarray
) -> np.ndarray:
    """States that the FMU starts from, near `states` (segments, states).

    What was measured a hair past a stop, for example, is moved inward. UserError if nothing helps.
    """
    values = parameters.values(np.zeros(len(parameters)))
    values = values[: len(simulator.names) - states.shape[1]]
    middle = (states.min(axis=0) + states.max(axis=0)) / 2

    def moved(i: int) -> np.ndarray:
        reason = UserError("")
        for shift in SHIFTS:
            tried = states[i] + shift * (middle - states[i])
            try:
                simulator.run(segments[i], np.append(values, tried))
            except UserError as error:
                reason = error
            else:
                return tried
        raise UserError(f"{simulator.fmu.path}: no segment runs with these starts: {reason}")

    return np.array(simulator.map(moved, range(len(segments))))
