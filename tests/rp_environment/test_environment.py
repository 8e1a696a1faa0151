"""RPEnvironment.fmu: force against the references' in complex numbers, with the plant, refusals."""

import math
import random
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from mpmath import mp
from rparm.models.rp_environment.references import make_references

from tests.support.instances import DISCARD, Instance, LoadedFmu, status_of

UNIT = "RPEnvironment"

PARAMETERS = ("stiffness", "damping", "position", "angle", "tip_x", "tip_z")
INPUTS, OUTPUTS = make_references.INPUTS, make_references.OUTPUTS
KNOWNS = (*PARAMETERS, *INPUTS)
PRESSED, RELEASED, OUTSIDE = "pressed", "released", "outside"
CASES = (PRESSED, RELEASED, OUTSIDE)

Values = dict[str, float]


# ---- The wall of the references ------------------------------------------------------------------


def evaluated(point: Values) -> np.ndarray:
    """Return the outputs, (5,)."""
    with mp.workdps(make_references.DIGITS):
        return np.array(make_references.values(point), dtype=float)


def case_of(point: Values) -> str:
    """Pressed, in the wall but too fast outwards to be pushed, or outside."""
    *_, depth, force = evaluated(point)
    return OUTSIDE if depth == 0 else RELEASED if force == 0 else PRESSED


def generic_point(case: str, seed: int) -> Values:
    """Parameters and inputs, none of them zero, at which the wall does what `case` says."""
    source = random.Random(f"{case} {seed}")
    while True:
        point = {name: source.choice((-1, 1)) * source.uniform(0.05, 1.0) for name in KNOWNS}
        point["stiffness"] = 10 ** source.uniform(1.0, 4.0)
        point["damping"] = 10 ** source.uniform(0.0, 3.0)
        point["angle"] *= 4.0
        point["ee_angle"] *= 4.0
        if case_of(point) == case:
            return point


# ---- Instances -----------------------------------------------------------------------------------


@contextmanager
def running(loaded: LoadedFmu, point: Values) -> Iterator[Instance]:
    with Instance(loaded) as instance:
        yield instance.initialize(**point)


# ---- Force ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", CASES)
def test_outputs_are_those_of_the_wall(loaded: LoadedFmu, case: str) -> None:
    for seed in range(20):
        point = generic_point(case, seed)
        expected = evaluated(point)
        scale = point["stiffness"] + point["damping"]
        with running(loaded, point) as instance:
            actual = np.array(instance.get(*OUTPUTS))
            assert (abs(actual - expected) <= 1e-14 * scale).all(), (seed, actual, expected)
            assert (actual[3] > 0) == (case != OUTSIDE) and (actual[4] > 0) == (case == PRESSED)


def test_an_input_that_leaves_all_numbers_ends_no_step(loaded: LoadedFmu) -> None:
    """The instance would else be in a state that it cannot read again."""
    with running(loaded, {"ee_x": 0.1}) as instance:
        instance.set_input_derivatives(ee_x=[1e200])
        assert status_of(instance.fmi.doStep, 0.0, 1e200) == DISCARD
        assert "an input at the end of the step" in instance.messages[-2].text
        assert instance.get("time", "ee_x") == [0.0, 0.1]


# ---- With the plant ------------------------------------------------------------------------------


def test_the_default_wall_touches_nothing_in_reach(loaded: LoadedFmu, path: Path) -> None:
    """At every pose with a slide of up to 2 m, at any velocity."""
    plant = LoadedFmu(path.with_name("RPPlant.fmu"), loaded.folder / "plant")
    source = random.Random(2)
    with running(loaded, {}) as wall_instance, Instance(plant).begin() as arm:
        for _ in range(50):
            names = ("q1", "q2", "dq1", "dq2")
            limits = (math.pi, 2.0, 20.0, 20.0)
            arm.set(**{n: source.uniform(-x, x) for n, x in zip(names, limits, strict=True)})
            wall_instance.set(**dict(zip(INPUTS, arm.get(*INPUTS), strict=True)))
            assert wall_instance.get(*OUTPUTS) == [0.0] * len(OUTPUTS)


def test_the_tip_is_where_the_plant_has_its_payload(loaded: LoadedFmu, path: Path) -> None:
    """A wall in every pose: the plant's potential energy gives the height of its payload."""
    plant = LoadedFmu(path.with_name("RPPlant.fmu"), loaded.folder / "arm")
    tip = {"payload_x": 0.07, "payload_z": -0.12}
    references = [plant.references["payload_attached"]]
    source = random.Random(5)
    for _ in range(10):
        pose = {"q1": source.uniform(-3, 3), "q2": source.uniform(-0.3, 0.3), "g": 1.0}
        energies = []
        for mass in (0.0, 1.0):
            with Instance(plant) as arm:
                arm.fmi.setBoolean(references, [True])
                arm.initialize(payload_mass=mass, **tip, **pose)
                energies.append(arm.get("potential_energy")[0])
                motion = dict(zip(INPUTS, arm.get(*INPUTS), strict=True))
        height = energies[1] - energies[0]
        floor = {"angle": math.pi / 2, "position": 2.0, "tip_x": 0.07, "tip_z": -0.12}
        with running(loaded, floor | motion) as instance:
            assert instance.get("penetration")[0] == pytest.approx(2.0 - height, abs=1e-12)


def test_power_of_the_wrench_is_what_the_plant_receives(loaded: LoadedFmu, path: Path) -> None:
    """The wrench changes the arm's energy as the force at the tip does."""
    plant = LoadedFmu(path.with_name("RPPlant.fmu"), loaded.folder / "driven")
    rate = ["ddq1", "ddq2"]
    for seed in range(5):
        source = random.Random(seed)
        state = {n: source.uniform(-1.0, 1.0) for n in ("q1", "q2", "dq1", "dq2")}
        with Instance(plant) as arm:
            arm.initialize(**state)
            motion = dict(zip(INPUTS, arm.get(*INPUTS), strict=True))
            tip = {"tip_x": source.uniform(-0.2, 0.2), "tip_z": source.uniform(-0.2, 0.2)}
            wall_at = {"angle": source.uniform(-3.0, 3.0), "position": 3.0, "damping": 40.0}
            with running(loaded, motion | tip | wall_at) as instance:
                before = np.array(arm.get(*rate))
                force = instance.get(*OUTPUTS)
                arm.set(ee_fx=force[0], ee_fy=force[1], ee_mz=force[2])
                added = np.array(arm.get(*rate)) - before
                d11, d12, d22 = arm.get("D11", "D12", "D22")
                # the depth after a short time in both directions
                depths = []
                for dt in (-1e-6, 1e-6):
                    instance.set(
                        ee_x=motion["ee_x"] + dt * motion["ee_vx"],
                        ee_y=motion["ee_y"] + dt * motion["ee_vy"],
                        ee_angle=motion["ee_angle"] + dt * motion["ee_rate"],
                    )
                    depths.append(instance.get("penetration")[0])
        power = np.array([state["dq1"], state["dq2"]]) @ [[d11, d12], [d12, d22]] @ added
        speed = -(depths[1] - depths[0]) / 2e-6
        assert power == pytest.approx(force[4] * speed, abs=1e-8 * force[4])


# ---- As a unit -----------------------------------------------------------------------------------


def test_a_force_beyond_all_numbers_is_discarded(loaded: LoadedFmu) -> None:
    with running(loaded, {"position": 0.0, "stiffness": 1e308, "ee_x": -1e3}) as instance:
        assert status_of(lambda: instance.get("wall_force")) == DISCARD
        assert "wall_force" in instance.messages[-1].text
