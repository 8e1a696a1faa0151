"""The references of the plant's scenarios: made again they come out the same, and are worth it."""

import csv
from pathlib import Path

import numpy as np
from rparm.models.reference_files import write_scenario
from rparm.models.rp_plant.references.make_references import INPUTS, outputs

from rparm.runs.scenario import Scenario
from tests.support.rparm_project import load, names_of

SCENARIOS = {name: load(name) for name in names_of("rp_plant")}
FILES = ("RPPlant_ref.csv", "RPPlant_in.csv", "RPPlant_ref.opt")
MADE_AGAIN = ("spin_up", "thrown_against_stop")  # impacts, friction, rest; the others take longer


def columns(run: Scenario) -> dict[str, np.ndarray]:
    with (run.reference_folder / FILES[0]).open(newline="") as file:
        rows = list(csv.reader(file))
    return dict(zip(rows[0], np.array(rows[1:], dtype=float).T, strict=True))


def test_made_again_they_are_the_same(tmp_path: Path) -> None:
    for name in MADE_AGAIN:
        run = SCENARIOS[name]
        write_scenario(run, tmp_path / name, "RPPlant", INPUTS, outputs(run))
        for file in FILES:
            made, kept = tmp_path / name / file, run.reference_folder / file
            assert made.read_bytes() == kept.read_bytes(), (name, file)


def test_the_slide_kicks_joint_1_loose_and_the_arm_rests_on_its_stop() -> None:
    run = SCENARIOS["thrown_against_stop"]
    found = columns(run)
    hit = np.flatnonzero(found["stop_impulse2"])[0]
    assert np.all(found["dq1"][:hit] == 0) and abs(found["dq1"][hit]) > 0.1
    assert found["q1"][-1] == run.parameters["lower1"]
    assert found["dq1"][-1] == found["dq2"][-1] == 0
    assert np.sum(np.diff(found["impact_loss"]) > 0) >= 3


def test_the_buffers_push_and_friction_holds_both_joints_pressed_in() -> None:
    run = SCENARIOS["rubber_buffers"]
    found = columns(run)
    assert np.min(found["stop_force1"]) >= 0 and np.max(found["stop_force1"]) > 20
    assert np.min(found["stop_force2"]) < -20 and np.max(found["stop_force2"]) > 20
    assert found["q1"][-1] < run.parameters["lower1"] and found["q2"][-1] > run.parameters["upper2"]
    assert found["dq1"][-1] == found["dq2"][-1] == 0
    # pulled out, the slide is in its lower buffer without a force for a moment
    left = (found["q2"] < run.parameters["lower2"]) & (found["stop_force2"] == 0)
    assert np.any(left)
    assert not np.any(found["stop_impulse2"]) and not np.any(found["impact_loss"])


def test_the_arm_sticks_and_slips() -> None:
    moves = columns(SCENARIOS["stick_slip"])["dq1"] != 0
    assert np.sum(np.diff(moves.astype(int)) == 1) >= 4


def test_without_power_the_arm_is_held_to_the_bit() -> None:
    found = columns(SCENARIOS["power_off"])
    late = found["time"] > 1
    for name in ("q1", "q2"):
        assert np.ptp(found[name][late]) == 0
    assert np.all(found["actuator_power"][late] == 0)
    assert found["friction1"][-1] != 0 and found["friction2"][-1] != 0


def test_the_grasp_takes_energy_and_the_release_none() -> None:
    found = columns(SCENARIOS["grasp_at_rest"])
    assert np.sum(np.diff(found["grasp_loss"]) > 0) == 1
    before, after = (np.flatnonzero(found["time"] <= t)[-1] for t in (0.5, 0.505))
    assert found["dq1"][after] < 0.8 * found["dq1"][before]


def test_the_slide_is_thrown_out_and_stays_on_its_stop() -> None:
    run = SCENARIOS["spin_up"]
    found = columns(run)
    held = found["time"] < 1
    assert np.all(found["dq2"][held] == 0) and np.all(found["dq1"][held][1:] > 0)
    assert found["q2"][-1] == run.parameters["upper2"] and found["stop_force2"][-1] < 0
