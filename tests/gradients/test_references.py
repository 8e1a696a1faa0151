"""Gradients through events against runs in 60 digits: all methods, both versions of FMI."""

from collections.abc import Callable
from functools import cache
from itertools import product
from typing import NamedTuple

import numpy as np
import pytest

from tests.equations.examples import METHODS
from tests.gradients import references
from tests.gradients.models import EXACT, by, fmus, run
from tests.gradients.references import mpf

EACH_RUN = pytest.mark.parametrize(("method", "version"), [*product(METHODS, ["2.0", "3.0"])])


class Case(NamedTuple):
    """A model, what it is run with, and how near gradients must be, over their largest value."""

    model: str
    run: Callable
    stop: float  # s
    steps: int
    start: dict[str, float]  # others than the file's: parameters and starts in the order of `run`
    names: list[str]  # of what `run` returns
    bound: float
    by_taylor: float

    @property
    def times(self) -> np.ndarray:
        return self.stop / self.steps * np.arange(self.steps + 1)


CASES = [
    Case("Ball", references.ball, 1.9, 38, {"g": 9.7, "e": 0.72, "start(h)": 1.1},
         ["h", "v", "energy"], 1e-12, 1e-12),
    Case("Floor", references.floor, 2.1, 30, {"A": 0.11, "w": 5.2, "e": 0.8}, ["h", "v"],
         1e-11, 1e-11),
    Case("Belt", references.belt, 4.1, 41, {"belt": 0.55, "most": 3.1, "slides": 1.9},
         ["x", "v", "force"], 1e-9, 1e-11),
    Case("Thermostat", references.thermostat, 3.0, 40,
         {"low": 19.1, "high": 21.2, "tau": 1.9, "start(T)": 22.3}, ["T"], 1e-10, 1e-10),
    Case("Pulses", references.pulses, 0.95, 20, {"period": 0.11, "duty": 0.35, "R": 1.4},
         ["i", "begin"], 1e-9, 1e-9),
    Case("Pid", references.pid, 2.11, 30, {"Ts": 0.052, "Kp": 2.9, "Ki": 2.1, "Kd": 0.41},
         ["y", "v", "u", "sum", "last"], 1e-9, 1e-9),
    Case("Lorenz", references.lorenz, 5.0, 20,
         {"sigma": 10.0, "rho": 28.0, "beta": 8 / 3, "start(x)": 1.0, "start(y)": 2.0,
          "start(z)": 3.0}, ["x", "y", "z"], 1e-8, 1e-10),
]  # fmt: skip
EACH_CASE = pytest.mark.parametrize("case", CASES, ids=[case.model for case in CASES])
FIXED = {"Floor": ["A", "w"]}  # where not all parameters are asked for


@cache
def reference(model: str) -> tuple[np.ndarray, np.ndarray]:
    """Values (times, names), and their derivatives (parameters, times, names)."""
    (case,) = (case for case in CASES if case.model == model)
    values = case.run(case.times, *map(mpf, case.start.values()))

    def named(times: np.ndarray, **start: mpf) -> references.Values:
        return case.run(times, *start.values())

    found = references.gradient(named, case.times, case.start, FIXED.get(model, [*case.start]))
    return np.array(values, float), np.array(found, float)


@EACH_CASE
@EACH_RUN
def test_gradients_are_those_of_the_run(case: Case, method: str, version: str) -> None:
    values, gradients = reference(case.model)
    start = {name.removeprefix("start(").rstrip(")"): x for name, x in case.start.items()}
    found = run(fmus()[case.model], method, case.stop, case.stop / case.steps, version, **start)
    assert found["time"] == pytest.approx(case.times, abs=1e-12)
    bound, errors = case.by_taylor if method == "taylor" else case.bound, {}
    for k, name in enumerate(case.names):
        near = 1e-7 * np.abs(values[:, k]).max()
        assert found[name] == pytest.approx(values[:, k], abs=near, rel=0)
        for column, parameter in zip(gradients, FIXED.get(case.model, case.start), strict=True):
            size = np.abs(column[:, k]).max() or 1.0
            error = np.abs(found[by(name, parameter)] - column[:, k]).max() / size
            if not error <= bound:
                errors[by(name, parameter)] = error
    assert not errors, f"over their size, where {bound} is wanted: {errors}"
    assert found[EXACT].all()


@pytest.mark.parametrize(("method", "version"), [*product(["cvode_bdf", "taylor"], ["2.0", "3.0"])])
@pytest.mark.parametrize("model", ["VanDerPol", "Twice"])
def test_gradients_of_sensitivities_by_hand_are_second_derivatives(
    model: str, method: str, version: str
) -> None:
    """The section is applied to a file that has first derivatives as states, also at events."""
    case = {
        "VanDerPol": ({"mu": 1.5, "x": 2.0}, references.van_der_pol, ["x"], "mu", ["mu", "x"]),
        "Twice": ({"g": 9.81, "e": 0.7, "h": 1.0}, references.ball, ["h", "v"], "g", ["g", "e"]),
    }
    start, of, names, first, others = case[model]
    times = 0.08 * np.arange(22)

    def slope(times: np.ndarray, **start: mpf) -> references.Values:
        (rows,) = references.gradient(
            lambda times, **start: of(times, *start.values()), times, start, [first]
        )
        return rows

    found = run(fmus()[model], method, times[-1], 0.08, version, **start)
    for parameter, rows in zip(
        others, references.gradient(slope, times, start, others), strict=True
    ):
        exact = np.array(rows, float)
        for k, name in enumerate(names):
            other = "start(x)" if parameter == "x" else parameter
            near = 2e-8 * np.abs(exact[:, k]).max()
            assert found[by(f"{name}_{first}", other)] == pytest.approx(exact[:, k], abs=near)
    assert found[EXACT].all()
