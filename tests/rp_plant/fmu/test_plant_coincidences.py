"""Events of the built FMU at communication points, and after long internal steps."""

import random

import pytest

from rparm.fmi.fmu_file import Fmu
from tests.fmi2.rollback_sequences import times
from tests.rp_plant.fmu.plant_runs import (
    FIRM,
    RIGID,
    each_method,
    events,
    last_event,
    modes,
    near,
    read,
    started,
)
from tests.rp_plant.fmu.test_plant_rollback import busy, sequence


@each_method
@pytest.mark.parametrize(
    ("effort", "rate", "h", "expected", "values"),
    [
        ("f2", 2.0, 1e-3, 1.65, {"coulomb_friction2": 3.3, "coulomb_friction1": FIRM}),
        ("f2", 2.0, 1e-2, 1.65, {"coulomb_friction2": 3.3, "coulomb_friction1": FIRM}),
        # at (24.9 + 11.772) / 12
        ("tau1", 12.0, 1e-3, 3.056, {"coulomb_friction1": 24.9, "coulomb_friction2": FIRM}),
    ],
)
def test_a_joint_breaks_away_once_at_a_communication_point(
    plant: Fmu, method: str, effort: str, rate: float, h: float, expected: float, values: dict
) -> None:
    q2 = 0.2 if effort == "tau1" else 0.0
    with started(plant, method, smooth_inputs=(effort,), q2=q2, **values) as instance:
        found = events(instance, h, round(expected + 0.1, 1), {effort: rate})
        assert found == [(1, near(expected))]


@each_method
def test_a_motion_continues_after_an_impact_that_ends_a_long_step(plant: Fmu, method: str) -> None:
    """Before it the motion is uniform, and internal steps grow to seconds."""
    stops = {"stops1": RIGID, "lower1": -0.5, "upper1": 0.5}
    values = {"g": 0.0, "a": 0.15, "dq1": 0.8, "coulomb_friction2": 2.0}
    with started(plant, method, **stops, **values) as instance:
        instance.do_step(0.0, 0.5)
        instance.do_step(0.5, 0.5)
        # plastic: q1 stays, the slide moves at -a dq1 and friction stops it
        assert read(instance, "dq1", "dq2") == [0.0, 0.0]


@each_method
@pytest.mark.parametrize("seed", ["cvode_adams", 56])
def test_joints_that_kick_each_other_off_their_stops_come_to_rest(
    plant: Fmu, method: str, seed: str | int
) -> None:
    """From random sequences: bounces lower than the rounding of a position, which never ended."""
    moves = sequence(150, random.Random(seed))
    with busy(plant, method) as run:
        for t, move in zip(times(moves), moves, strict=False):
            run.do(t, move)
        assert last_event(run.instance).count > 50


@each_method
@pytest.mark.parametrize("e", [0.0, 0.5])
def test_two_joints_pushed_onto_their_stops_come_to_rest(plant: Fmu, method: str, e: float) -> None:
    """Each impact of one kicks the other off its stop, and it comes back."""
    stops = {"stops1": RIGID, "lower1": -0.5, "restitution1": e}
    stops |= {"stops2": RIGID, "lower2": -0.5, "restitution2": e}
    with started(plant, method, 1e-8, f2=-20.0, **stops) as instance:
        before, _ = read(instance, "total_energy", "impact_loss")
        for i in range(100):
            instance.do_step(i * 0.02, 0.02)
        assert modes(instance) == (0, 0)
        assert read(instance, "q1", "q2", "dq1", "dq2") == [-0.5, -0.5, 0.0, 0.0]
        after, loss = read(instance, "total_energy", "impact_loss")
        work = -20.0 * -0.5
        assert after == pytest.approx(before + work - loss, rel=0, abs=1e-6 * (before + work))
        # the stops carry gravity and f2
        gravity1, gravity2 = read(instance, "gravity1", "gravity2")
        forces = read(instance, "stop_force1", "stop_force2")
        assert forces == pytest.approx([gravity1, gravity2 + 20.0], rel=1e-12)
