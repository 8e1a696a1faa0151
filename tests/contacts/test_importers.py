"""Friction and stops as importers run them: snapshots, event mode, Model Exchange."""

import ctypes
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi2 import FMU2Model

from tests.equations.hybrid_runs import Run, Unit, co_simulation, early_return, model_exchange

FOLDER = Path(__file__).parent
STOPS = {  # s
    "backlash": 0.6, "belt": 3.5, "bow": 3.0, "cradle": 0.5, "pendulum": 3.0, "shaken": 0.6,
    "stack": 6.0,
}  # fmt: skip
TIMED = {"blocks": 6.0, "clutch": 4.0, "valve": 12.0, "wheel": 4.0}  # with time events
EACH = pytest.mark.parametrize("name", STOPS | TIMED)
COUNT = 37  # steps, whose ends are no times of events


@pytest.fixture(scope="module")
def unit(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Unit]:
    made: dict[str, Unit] = {}

    def find(name: str) -> Unit:
        if name not in made:
            text = (FOLDER / f"{name}.toml").read_text(encoding="utf-8")
            made[name] = Unit(tmp_path_factory.mktemp(name), text)
        return made[name]

    return find


def agree(run: Run, other: Run, tolerance: float) -> None:
    assert run.failure == other.failure == ""
    size = np.maximum(1, np.abs(other.x).max(axis=0))
    assert np.all(np.abs(np.array(run.x) - other.x).max(axis=0) <= tolerance * size)


@EACH
def test_snapshots_and_event_mode_change_nothing(unit: Callable, name: str) -> None:
    """In FMI 2.0 within steps; in FMI 3.0 steps end at events: the same motion."""
    step, count, runs = (STOPS | TIMED)[name] / COUNT, COUNT, {}
    for method in ("cvode_adams", "cvode_bdf", "erk", "taylor"):
        within = co_simulation(
            unit(name), method, 1e-10, step, count, {}, step * np.array([1, 9, 21, 36])
        )
        ending = early_return(unit(name), method, 1e-10, step, count, snapshots=True)
        assert within.differences == ending.differences == []
        assert within.counts[-1] == ending.counts[-1] > 0
        agree(within, ending, 1e-7)
        runs[method] = within
    for method, run in runs.items():
        agree(run, runs["taylor"], 1e-7 if method != "erk" else 1e-6)


@pytest.mark.parametrize("name", STOPS)
def test_model_exchange_moves_alike(unit: Callable, name: str) -> None:
    """With an importer that knows no time events; bouncing ends earlier, where it sees no more."""
    step = STOPS[name] / COUNT
    inside = co_simulation(unit(name), "taylor", 1e-11, step, COUNT, {})
    outside = model_exchange(unit(name), 1e-9, step, COUNT, {})
    assert outside.differences == []
    agree(outside, inside, 1e-5)


@EACH
def test_directional_derivatives_are_those_of_the_modes(unit: Callable, name: str) -> None:
    """Against central differences in Model Exchange, where modes stay between events."""
    fmu = unit(name).instance(FMU2Model)
    fmu.instantiate()
    fmu.setupExperiment()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    while fmu.newDiscreteStates()[0]:
        pass
    fmu.enterContinuousTimeMode()
    count = len(unit(name).states)
    states = unit(name).of(*unit(name).states)
    rates = unit(name).of(
        *(f"der_{x}" for x in unit(name).states if f"der_{x}" in unit(name).references)
    )
    forces = unit(name).of(*(x for x in unit(name).references if x.endswith(".force")))
    x, h = np.array(fmu.getReal(states)), 1e-6

    def at(shift: np.ndarray) -> np.ndarray:
        values = (ctypes.c_double * count)(*(x + shift))
        fmu.setContinuousStates(values, count)
        return np.array(fmu.getReal([*rates, *forces]))

    for i in range(count):
        e = h * np.eye(count)[i]
        quotient = (at(e) - at(-e)) / (2 * h)
        at(0 * e)
        found = fmu.getDirectionalDerivative([*rates, *forces], [states[i]], [1.0])
        assert found == pytest.approx(quotient, abs=1e-7 * (1 + np.abs(quotient).max()))
    fmu.freeInstance()
