"""Events of the plant in FMI 3.0's Co-Simulation: with and without event mode and early return, in
fmpy. The importer sees more or less of the events; the motion has the same bits."""

import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.model_description import ModelDescription

from tests.rp_plant.fmu.plant_runs import (
    AT_REST,
    BOUNCY_STOPS,
    FIRM,
    FRICTION,
    METHODS,
    each_method,
)
from tests.support.instances import instantiated, set_value
from tests.support.rparm_project import fmi3_fmu

STEP, STOP = 0.01, 1.5  # s
COMBINATIONS = [(False, False), (False, True), (True, False), (True, True)]
OUTPUTS = ["q1", "q2", "dq1", "dq2", "ddq1", "ddq2", "friction1", "stop_force2", "impact_loss"]
COUNTERS = ["event_count", "last_event_time", "mode1", "mode2", "solver_rhs_evaluations"]

GRASP = {"payload_mass": 0.8, "payload_x": 0.05, "payload_z": 0.1, "grasp": AT_REST}
MOTIONS = {
    "bounces to rest": BOUNCY_STOPS | {"q1": 0.7, "dq2": 0.5, "coulomb_friction1": FIRM},
    "both joints": FRICTION | BOUNCY_STOPS | {"dq1": 1.2, "dq2": -0.4},
    "slips and grasps": FRICTION | GRASP | {"g": 0.0, "dq1": -1.0, "dq2": 0.8},
}


@pytest.fixture(scope="module")
def paths(fmu: Path) -> dict[str, Path]:
    """RPPlant of both versions of FMI."""
    path = fmu.with_name("RPPlant.fmu")
    return {"fmi2": path, "fmi3": fmi3_fmu(path)}


def held_inputs() -> np.ndarray:
    """Both drives and the gripper change every 0.1 s and are held in between.

    Powers of two, which fmpy's interpolation between equal values gives back bit for bit.
    """
    chance = random.Random(3)
    powers = [-8.0, -4.0, 0.0, 4.0, 8.0]
    rows = []
    for k in range(15):
        values = (chance.choice(powers), chance.choice(powers), k % 6 >= 3)
        rows += [(0.1 * k, *values), (0.1 * (k + 1), *values)]
    kinds = [("time", float), ("tau1", float), ("f2", float), ("payload_attached", bool)]
    return np.array(rows, dtype=kinds)


def simulate(
    path: Path, combination: tuple[bool, bool], inputs: np.ndarray | None, **values: float
) -> np.ndarray:
    """All that fmpy records, by time (s)."""
    event_mode, early_return = combination
    return fmpy.simulate_fmu(
        str(path),
        fmi_type="CoSimulation",
        use_event_mode=event_mode,
        early_return_allowed=early_return,
        start_values=values,
        input=inputs,
        output=OUTPUTS + COUNTERS,
        stop_time=STOP,
        output_interval=STEP,
        relative_tolerance=1e-8,
    )


def at_communication_points(result: np.ndarray) -> np.ndarray:
    """The first row of each communication point: before an event mode there."""
    k = np.rint(result["time"] / STEP).astype(int)
    on_grid = np.flatnonzero(np.abs(result["time"] - k * STEP) < 1e-12)
    points, first = np.unique(k[on_grid], return_index=True)
    np.testing.assert_array_equal(points, np.arange(round(STOP / STEP) + 1))
    return result[on_grid[first]]


@each_method
@pytest.mark.parametrize("motion", MOTIONS)
def test_the_motion_has_the_same_bits(paths: dict[str, Path], motion: str, method: str) -> None:
    """As with FMI 2.0: states, outputs, events and the integrator's work at all points."""
    inputs = held_inputs() if "grasps" in motion else None
    values = MOTIONS[motion] | {"solver_method": METHODS[method]}
    expected = at_communication_points(simulate(paths["fmi2"], (False, False), inputs, **values))
    count = expected["event_count"][-1]
    assert count >= 4
    for combination in COMBINATIONS:
        result = simulate(paths["fmi3"], combination, inputs, **values)
        found = at_communication_points(result)
        for name in OUTPUTS + COUNTERS:
            np.testing.assert_array_equal(found[name], expected[name], err_msg=name)
        returns_early = combination[1]
        event_times = set(result["last_event_time"])
        if returns_early:
            assert len(event_times) == count + 1  # and the start
            assert event_times <= set(result["time"])
        else:
            assert event_times.isdisjoint(result["time"][result["time"] > 0.0])


# ---- Rollback --------------------------------------------------------------------------------


class Plant:
    """An instance that uses event mode and early return, in step mode."""

    NAMES = ("time", "q1", "q2", "dq1", "dq2", "impact_loss", "stop_impulse2")

    def __init__(self, fmu: Any, description: ModelDescription) -> None:
        self.fmu = fmu
        self.variables = {v.name: v for v in description.modelVariables}
        self.reference = {name: v.valueReference for name, v in self.variables.items()}

    def values(self) -> list[float]:
        reals = self.fmu.getFloat64([self.reference[name] for name in self.NAMES])
        names = ("mode1", "mode2", "event_count")
        return [*reals, *self.fmu.getInt32([self.reference[name] for name in names])]

    def update(self) -> None:
        self.fmu.enterEventMode()
        assert not any(self.fmu.updateDiscreteStates()[:-1])
        self.fmu.enterStepMode()

    def advance(self, target: float) -> bool:
        """One step towards `target` (s); whether it ends at an event, which is due."""
        time = self.values()[0]
        has_event, terminates, early, reached = self.fmu.doStep(time, target - time)
        assert reached == self.values()[0] and early == (reached < target) and not terminates
        assert has_event or not early
        return has_event

    def step(self, target: float) -> None:
        """Advance to `target` (s) or to an event, which is handled."""
        if self.advance(target):
            self.update()


@contextmanager
def started(path: Path, **values: float) -> Iterator[Plant]:
    options = {"early_return_allowed": True, "event_mode_used": True}
    with instantiated(path, "CoSimulation", **options) as (fmu, description):
        plant = Plant(fmu, description)
        fmu.enterInitializationMode(startTime=0.0, tolerance=1e-8)
        for name, value in values.items():
            set_value(fmu, plant.variables[name], value)
        fmu.exitInitializationMode()
        fmu.updateDiscreteStates()
        fmu.enterStepMode()
        yield plant


@each_method
def test_rollback_over_events_that_are_due(paths: dict[str, Path], method: str) -> None:
    """Saved at any time, also before fmi3UpdateDiscreteStates; all that follows is the same."""
    chance = random.Random(15)

    def disturb(plant: Plant) -> None:
        """Go on for a while, and back."""
        state = plant.fmu.getFMUState()
        before = plant.values()
        if chance.random() < 0.3:
            plant.update()
        for _ in range(chance.randrange(3)):
            plant.step(plant.values()[0] + chance.choice([1e-3, 0.02, 0.3]))
        plant.fmu.setFMUState(state)
        plant.fmu.freeFMUState(state)
        assert plant.values() == before

    def run(disturb: Callable[[Plant], None]) -> list[list[float]]:
        seen = []
        with started(paths["fmi3"], solver_method=METHODS[method], **motion) as plant:
            for point in np.arange(1, 16) * 0.1:
                while plant.values()[0] < point:
                    disturb(plant)
                    has_event = plant.advance(point)
                    seen.append(plant.values())
                    disturb(plant)
                    if has_event:
                        plant.update()
                        seen.append(plant.values())
        return seen

    motion = MOTIONS["both joints"]
    expected = run(lambda _: None)
    assert expected[-1][-1] > 20  # events
    assert run(disturb) == expected
