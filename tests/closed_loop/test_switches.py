"""Booleans under the master: a trajectory attaches a payload to the plant and its controller."""

from collections.abc import Iterator
from contextlib import ExitStack

import numpy as np
import pytest

from rparm.errors import UserError
from rparm.fmi.fmu_file import Fmu
from rparm.systems.master import Master, Snapshot
from rparm.systems.structure import Connection
from tests.support.paths import ROOT

COMPONENTS = {"trajectory": "RPTrajectory", "controller": "RPController", "plant": "RPPlant"}
REFERENCES = [f"{d}q{i}_ref" for d in ("", "d", "dd") for i in (1, 2)]
STATES = ("q1", "q2", "dq1", "dq2")
SWITCHES = [
    Connection("trajectory", "payload_attached", end, "payload_attached")
    for end in ("controller", "plant")
]
REAL = [
    *(Connection("trajectory", name, "controller", name) for name in REFERENCES),
    *(Connection("plant", name, "controller", name) for name in STATES),
    *(Connection("controller", name, "plant", name) for name in ("tau1", "f2")),
]
# 0: the reference rests until 0.5 s
WRENCH = [
    Connection("trajectory", "ddq2_ref", "plant", name) for name in ("ee_fx", "ee_fy", "ee_mz")
]
PAYLOAD = {"payload_mass": 1.0, "payload_inertia": 0.004, "payload_x": 0.02, "payload_z": 0.05}
H, GRASP = 2.0**-9, 2.0**-6  # s; the grasp is a communication point


@pytest.fixture(scope="module", params=["2.0", "3.0"])
def fmus(request: pytest.FixtureRequest) -> Iterator[dict[str, Fmu]]:
    folder = ROOT / "build" / ("fmi3" if request.param == "3.0" else "")
    with ExitStack() as stack:
        yield {
            name: stack.enter_context(Fmu(folder / f"{fmu}.fmu"))
            for name, fmu in COMPONENTS.items()
        }


def wired(fmus: dict[str, Fmu], **options: str) -> Master:
    return Master(fmus, [*REAL, *WRENCH, *SWITCHES], **options)


def parameters(grasp: float, release: float = 1.0) -> dict[str, dict[str, float]]:
    carried = {"grasp_time": grasp, "release_time": release}
    plant = {"damping2": 20.0, "relative_tolerance": 1e-10}
    return {"trajectory": carried, "controller": dict(PAYLOAD), "plant": plant | PAYLOAD}


@pytest.mark.parametrize("order", ["jacobi", "gauss_seidel"])
@pytest.mark.parametrize("inputs", ["held", "extrapolated"])
def test_all_follows_a_switch_at_its_time(fmus: dict[str, Fmu], order: str, inputs: str) -> None:
    """At the grasp, efforts are those of a start with the payload from the same state."""
    with wired(fmus, order=order, inputs=inputs) as master:
        master.initialize(0.0, None, parameters(GRASP))
        rows = master.run(np.arange(round(GRASP / H) + 2) * H)
        before, after, later = (dict(zip(master.names, row, strict=True)) for row in rows[-3:])
    start = parameters(0.0)
    start["plant"] |= {name: after[f"plant.{name}"] for name in STATES}
    with wired(fmus) as other:
        other.initialize(0.0, None, start)
        wanted = dict(zip(other.names, other.values, strict=True))
    assert after["controller.tau1"] == pytest.approx(wanted["controller.tau1"], rel=1e-12)
    assert after["controller.tau1"] > before["controller.tau1"] + 4.0
    # the plant carries the payload from the next step on: until then it shows an acceleration,
    # which is the slope of dq1 in that step
    assert after["plant.ddq1"] > 10.0
    assert abs(later["plant.ddq1"]) < (1.0 if inputs == "extrapolated" else 1e-12)


def test_a_switch_between_points_counts_from_the_next_one(fmus: dict[str, Fmu]) -> None:
    rows = []
    for grasp in (GRASP, GRASP - 0.5 * H, GRASP + 0.5 * H):
        with wired(fmus) as master:
            master.initialize(0.0, None, parameters(grasp))
            rows.append(master.run(np.arange(17) * H))
    np.testing.assert_array_equal(rows[0], rows[1])
    assert np.any(rows[0] != rows[2])


def test_a_release_is_passed_on_too(fmus: dict[str, Fmu]) -> None:
    with wired(fmus) as master:
        master.initialize(0.0, None, parameters(GRASP, 2 * GRASP))
        rows = master.run(np.arange(25) * H)
        force = rows[:, master.names.index("controller.tau1")]
    jumps = np.flatnonzero(np.abs(np.diff(force)) > 3.0) + 1
    np.testing.assert_array_equal(jumps * H, [GRASP, 2 * GRASP])


def test_going_back_over_a_switch_repeats_bit_for_bit(fmus: dict[str, Fmu]) -> None:
    with wired(fmus) as master:
        master.initialize(0.0, None, parameters(GRASP))
        master.run(np.arange(5) * H)
        with Snapshot(master) as snapshot:
            snapshot.take()
            first = master.run(np.arange(4, 17) * H)
            snapshot.restore()
            np.testing.assert_array_equal(master.run(np.arange(4, 17) * H), first)


def test_a_boolean_feeds_a_boolean_only(fmus: dict[str, Fmu]) -> None:
    wrong = Connection("trajectory", "payload_attached", "plant", "tau1")
    with pytest.raises(UserError, match=r"payload_attached -> plant\.tau1: a Boolean feeds"):
        Master(fmus, [wrong])
    with pytest.raises(UserError, match=r"^plant\.payload_attached: is connected more than once"):
        Master(fmus, [*REAL, *WRENCH, *SWITCHES, SWITCHES[-1]])
