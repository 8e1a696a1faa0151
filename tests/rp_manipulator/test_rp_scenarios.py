"""The scenarios of the RP manipulator are worth running."""

import csv

import numpy as np
import pytest

from rparm.runs.scenario import Scenario
from tests.support.rparm_project import declared, load, names_of

SHIPPED = {name: load(name) for name in names_of("rp_manipulator")}
DECLARED = declared("rp_manipulator").start_values
SHORT = {"free_fall", "constant_effort_single_step"}  # need not last, step and turn as the others


def reference_column(run: Scenario, name: str) -> np.ndarray:
    """Column of the reference file of a scenario, (rows,)."""
    with (run.reference_folder / "RPManipulator_ref.csv").open(newline="") as file:
        return np.array([float(row[name]) for row in csv.DictReader(file)])


def is_driven(run: Scenario) -> bool:
    return any(np.any(values != 0) for values in run.inputs.values())


def gravity(run: Scenario) -> float:
    return run.start_values["g"]


def test_expected_scenarios_are_there() -> None:
    assert SHIPPED.keys() >= {
        "free_fall", "coasting", "constant_effort", "constant_effort_single_step", "sine_efforts",
        "hanging_swing", "negative_offset", "late_start", "early_start", "irregular_steps",
        "sixtieth",
    }  # fmt: skip


@pytest.mark.parametrize("run", SHIPPED.values(), ids=SHIPPED.keys())
class TestShipped:
    def test_is_worth_running(self, run: Scenario) -> None:
        assert run.tolerance == 1e-8
        if run.name in SHORT:
            assert run.stop - run.start >= 2
            return
        assert run.stop - run.start >= 5
        assert len(run.times) > 300
        assert np.ptp(reference_column(run, "q1")) > 1

    def test_motion_stays_sensible(self, run: Scenario) -> None:
        assert np.max(np.abs(reference_column(run, "q2"))) < 4
        assert np.max(np.abs(reference_column(run, "dq1"))) < 15

    def test_differs_from_start_values(self, run: Scenario) -> None:
        for name, value in (run.parameters | run.initial).items():
            assert value != DECLARED[name], name


def test_every_parameter_is_off_its_start_value_somewhere() -> None:
    given = {name for run in SHIPPED.values() for name in run.parameters}
    assert given >= {"m1", "m2", "I1z", "I2z", "l1", "lc1", "a", "g"}


def test_initial_states_differ() -> None:
    states = [tuple(sorted(run.initial.items())) for run in SHIPPED.values()]
    assert len(set(states)) == len(states) - 1  # constant_effort and its single step


def test_free_motions_are_free() -> None:
    assert not is_driven(SHIPPED["free_fall"]) and gravity(SHIPPED["free_fall"]) == 9.81
    assert not is_driven(SHIPPED["coasting"]) and gravity(SHIPPED["coasting"]) == 0


def test_constant_effort_in_500_steps_and_in_one() -> None:
    many, one = SHIPPED["constant_effort"], SHIPPED["constant_effort_single_step"]
    assert (len(many.times), len(one.times)) == (501, 2)
    assert (many.parameters, many.initial) == (one.parameters, one.initial)
    assert (many.start, many.stop) == (one.start, one.stop)
    for name in ("tau1", "f2"):
        assert set(many.inputs[name]) == set(one.inputs[name]) != {0.0}
    for name in ("q1", "q2", "dq1", "dq2"):
        ends = [reference_column(run, name)[-1] for run in (many, one)]
        assert ends[0] == pytest.approx(ends[1], rel=1e-15)


def test_sine_efforts_are_sampled_every_millisecond() -> None:
    run = SHIPPED["sine_efforts"]
    assert run.steps == (0.001,)
    assert all(len(set(run.inputs[name])) > 1000 for name in ("tau1", "f2"))


def test_hanging_swing_hangs_and_swings() -> None:
    run = SHIPPED["hanging_swing"]
    angle = reference_column(run, "q1") + np.pi / 2
    assert np.sum(np.diff(np.sign(angle)) != 0) >= 4
    weight = run.parameters["m2"] * gravity(run)
    assert run.inputs["f2"] == pytest.approx(-weight, rel=0.15)


def test_negative_offset_draws_link_2_past_the_joint() -> None:
    run = SHIPPED["negative_offset"]
    assert run.parameters["a"] < 0
    distance = run.parameters["l1"] + reference_column(run, "q2")
    assert 0.3 < np.mean(distance < 0) < 0.7


def test_start_times_and_steps() -> None:
    assert SHIPPED["late_start"].start == 1e6
    assert SHIPPED["early_start"].start == -0.5
    assert SHIPPED["sixtieth"].steps == (1 / 60,)
    lengths = np.diff(SHIPPED["irregular_steps"].times)
    assert lengths.min() == pytest.approx(1e-6, rel=1e-6)
    assert lengths.max() == pytest.approx(0.1)
    assert len({run.steps for run in SHIPPED.values()}) >= 7
