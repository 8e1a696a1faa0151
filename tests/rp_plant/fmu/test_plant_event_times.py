"""Events of the built FMU do not depend on communication points, bit for bit; too many of them.
In FMI 3.0's Co-Simulation the importer sees more or less of them, with and without event mode and
early return in fmpy; the motion has the same bits.

Rollback: tests/models/test_every_fmu.py, and with events that are due tests/fuzz.
"""

import random
import re
from pathlib import Path

import fmpy
import numpy as np
import pytest

from rparm.fmi.fmu_file import Fmu
from tests.rp_plant.fmu.plant_runs import (
    AT_REST,
    BOUNCY_STOPS,
    COMPLIANT,
    FIRM,
    FRICTION,
    METHODS,
    RIGID,
    each_method,
    events,
    last_event,
    started,
)
from tests.support.instances import DISCARD, Instance, LoadedFmu, status_of
from tests.support.rparm_project import fmi3_fmu

# stops that give way, one of them damped
BUFFERS = {
    "stops1": COMPLIANT, "lower1": -0.6, "upper1": 0.9, "stop_stiffness1": 500.0,
    "stops2": COMPLIANT, "lower2": -0.1, "upper2": 0.2, "stop_stiffness2": 4000.0,
    "stop_damping2": 0.5,
}  # fmt: skip


# ---- The same bits of every event time -------------------------------------------------------

CONSTANT = {
    "bounces": BOUNCY_STOPS
    | {"q1": 0.7, "dq2": 0.5, "coulomb_friction1": FIRM, "restitution2": 0.8},
    "slides": FRICTION | {"tau1": 14.0, "f2": 3.0, "dq1": -1.0, "dq2": 0.8},
    "buffers": BUFFERS
    | {"dq1": 1.2, "dq2": -0.8, "coulomb_friction1": 0.5, "coulomb_friction2": 0.5},
    "everything": FRICTION | BOUNCY_STOPS | {"dq1": 1.2, "dq2": -0.4},
}


@pytest.mark.parametrize("method", ["cvode_adams", "cvode_bdf", "taylor"])
@pytest.mark.parametrize("motion", CONSTANT)
def test_later_communication_points_do_not_matter(
    fmi2_plant: Fmu, method: str, motion: str
) -> None:
    """With constant inputs and the same first step: all event times, and the state at the end."""
    stop, first = 3.0, 1e-3
    with started(fmi2_plant, method, **CONSTANT[motion]) as instance:
        expected = dict(events(instance, first, stop))
        end = last_event(instance)
    assert end.count >= 3
    for seed in range(4):
        chance = random.Random(seed)
        longest = (2e-3, 0.02, 0.3, 2.0)[seed]
        with started(fmi2_plant, method, **CONSTANT[motion]) as instance:
            t, h = 0.0, first
            while t < stop:
                instance.do_step(t, h)
                t += h
                event = last_event(instance)
                if event.count > 0:
                    assert event.time == expected.get(event.count, event.time)
                h = min(chance.uniform(1e-6, longest), stop - t) if stop - t > 1e-6 else stop - t
            assert last_event(instance) == end


# ---- Too many events -------------------------------------------------------------------------


@each_method
def test_one_event_too_many_discards_the_step(fmu: Path, tmp_path: Path, method: str) -> None:
    """The message names indicator and time; FMI 2.0 says how far the step came."""
    g, height, e = 9.81, 0.5, 0.5
    t1 = (2 * height / g) ** 0.5
    third = t1 * (1 + 2 * e + 2 * e**2)
    loaded = LoadedFmu(fmu.with_name("RPPlant.fmu"), tmp_path)
    with Instance(loaded) as instance:
        integers = {"solver_method": METHODS[method], "stops2": RIGID, "max_events": 2}
        references = [loaded.references[name] for name in integers]
        instance.fmi.setInteger(references, [*integers.values()])
        start = {"a": 0.0, "q1": 1.5707963267948966, "q2": height, "coulomb_friction1": FIRM}
        limits = {"lower2": 0.0, "upper2": 2.0, "restitution2": e}
        instance.initialize(tolerance=1e-10, **start, **limits)
        before = instance.fmi.getFMUstate()
        assert status_of(instance.fmi.doStep, 0.0, 10.0) == DISCARD
        text = instance.messages[-1].text
        assert "stop2_lower" in text and "max_events = 2" in text
        named = float(text.split("t = ")[1].split(":")[0])
        assert named == pytest.approx(third, rel=0, abs=1e-9)
        assert instance.fmi.getRealStatus(2) == named  # fmi2LastSuccessfulTime
        # a shorter step has fewer of them
        instance.fmi.setFMUstate(before)
        instance.step(0.0, named - 1e-6)
        assert instance.count("event_count") == 2
        instance.step(named - 1e-6, 2e-6)
        assert instance.count("event_count") == 3


def test_the_message_of_both_versions_names_indicator_and_time(plant: Fmu) -> None:
    stops = {"stops2": RIGID, "lower2": 0.0, "upper2": 2.0, "restitution2": 0.5, "max_events": 2}
    with started(plant, q1=1.5, q2=0.5, coulomb_friction1=FIRM, **stops) as instance:
        assert status_of(instance.do_step, 0.0, 10.0) == DISCARD
        assert re.search(
            r"ended at t = 0\.\d+: stop2_lower.* more than max_events = 2", instance.messages[-1]
        )


# ---- Event mode ------------------------------------------------------------------------------

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
