"""The machine in Ecos does what its page says."""

from pathlib import Path

import numpy as np
import pytest
from rparm.models.machine.experiment import STEPS_PER_SECOND

from tests.support.rparm_project import Console
from tests.support.ssp_files import read_csv
from tests.support.systems import MACHINE_SYSTEM as MACHINE
from tests.support.systems import Columns

run = MACHINE.run


def distance(columns: Columns) -> np.ndarray:
    """Of the end effector from its reference, (rows,) m."""
    return np.hypot(*(columns[f"plant.ee_{x}"] - columns[f"trajectory.ee_{x}_ref"] for x in "xy"))


def changes(mode: np.ndarray) -> np.ndarray:
    """Rows after which a mode is another one."""
    return np.flatnonzero(np.diff(mode))


def test_a_controller_that_is_told_tracks_ten_times_better() -> None:
    told, untold = (run(name) for name in MACHINE.variants[:2])
    assert distance(told).max() < 0.1 * distance(untold).max()
    attached = untold["trajectory.payload_attached"] == 1
    np.testing.assert_array_equal(attached, told["trajectory.payload_attached"] == 1)
    time = told["time"][attached]
    assert (time[0], time[-1]) == pytest.approx((0.201, 3.7), abs=1e-9)
    # the object keeps its velocity, so that the arm feels no jump
    assert np.abs(np.diff(told["plant.dq1"])).max() < 0.03
    np.testing.assert_array_equal(told["plant.grasp_loss"], 0.0)
    # until the payload comes, both are the same
    first = int(np.argmax(attached))
    for name in ("plant.q1", "plant.q2", "controller.tau1", "controller.f2"):
        np.testing.assert_array_equal(told[name][:first], untold[name][:first])
    # hanging down at rest, the slide carries what the law does not know of: m2 Kp e = mp g
    sag = untold["trajectory.q2_ref"] - untold["plant.q2"]
    row = round(3.69 * STEPS_PER_SECOND)
    assert untold["trajectory.q1_ref"][row] == pytest.approx(-np.pi / 2)
    assert sag[row] == pytest.approx(-9.81 / 400, rel=0.01)
    assert abs(told["trajectory.q2_ref"] - told["plant.q2"])[row] < 1e-4


def test_integral_action_against_friction_hunts() -> None:
    """Sticking and slipping in turn, in motion and on after the reference has come to rest."""
    columns = run("stick_slip")
    for joint in (1, 2):
        mode, rate = columns[f"plant.mode{joint}"], columns[f"plant.dq{joint}"]
        assert set(mode) == {-1.0, 0.0, 1.0}
        assert (rate[mode == 0] == 0.0).all()
        moves = np.abs(mode) == 1
        assert 0.2 < np.mean(moves) < 0.8
        assert (np.sign(rate[moves]) * mode[moves] >= 0).all()
        still = columns["time"] > 2.2
        assert np.ptp(columns[f"trajectory.q{joint}_ref"][still]) < 1e-12
        assert len(changes(mode[still])) >= 3
        # slips are far faster than the motion that is wanted
        wanted = np.abs(columns[f"trajectory.dq{joint}_ref"]).max()
        assert np.abs(rate).max() > 3 * wanted
        # read after inputs are set, a joint that is about to break away shows more
        friction = np.abs(columns[f"plant.friction{joint}"])
        assert (friction[moves] <= 1.2).all()
        assert friction.max() == pytest.approx(1.2, rel=0.01)


def test_the_command_runs_it(tmp_path: Path, console: Console) -> None:
    pictures = tmp_path / "pictures"
    arguments = ("--report", tmp_path, "--pictures", pictures)
    code, out, _ = console("system", "stick_slip", *arguments)
    assert code == 0 and "passed: 1 variant; " in out.splitlines()[-1]
    assert max(map(len, out.split("passed: ")[0].splitlines())) <= 80
    page = (tmp_path / "system/stick_slip.html").read_text(encoding="utf-8")
    assert 'src="machine.svg"' in page and 'href="stick_slip.csv"' in page
    assert (tmp_path / "system/machine.svg").stat().st_size > 1000
    assert (pictures / "stick_slip.png").stat().st_size > 50_000
    written = read_csv(tmp_path / "system/stick_slip.csv")
    rows = np.rint(written["time"] * STEPS_PER_SECOND).astype(int)  # those that the page draws
    for name, values in run("stick_slip").items():
        np.testing.assert_allclose(written[name], values[rows], rtol=1e-11)  # twelve digits
