"""The machine's references, sampled and continuous: made again, closed forms, refusals."""

import numpy as np
import pytest
from rparm.models.machine import continuous
from rparm.models.machine.continuous import VARIANTS
from rparm.models.machine.experiment import STEPS_PER_SECOND
from rparm.models.machine.references import make_references
from rparm.models.machine.references.components import Environment, Sensor, real
from rparm.models.machine.references.machine import COMPONENTS, completed, declared
from rparm.models.machine.references.make_references import variants
from rparm.models.machine.references.monolithic import COLUMNS, monolithic
from rparm.models.rp_plant.references.solver import Solver

from rparm.errors import UserError
from tests.support.systems import MACHINE_SYSTEM as MACHINE

STOP = 0.3  # s, of what is made again


@pytest.fixture(scope="module")
def solver() -> Solver:
    return Solver()


def test_variants_are_those_of_the_system() -> None:
    assert set(make_references.variants()) == set(MACHINE.variants)


@pytest.mark.long
@pytest.mark.parametrize("variant", ["pick_and_place", "stick_slip", "noisy_sensor"])
def test_made_again_it_begins_alike(solver: Solver, variant: str) -> None:
    parameters = make_references.variants()[variant]
    made = make_references.make(solver, parameters, STOP)
    for file in make_references.FILES:
        times, columns = made[file]
        assert len(times) == round(STOP * STEPS_PER_SECOND) // make_references.KEPT + 1
        kept = MACHINE.reference(variant, file)
        assert list(kept) == ["time", *columns]
        for name, column in columns.items():
            rows = kept[name][: len(times)]
            scale = max(np.abs(rows).max(), 1e-3)
            assert np.abs(column - rows).max() <= 1e-13 * scale, (file, name)
    times, columns = made["tightest.csv"]  # of these 0.3 s: not all samples are among the tightest
    kept = MACHINE.reference(variant, "tightest.csv")
    listed = kept["time"] < STOP - 0.01
    rows = np.searchsorted(times.astype(float), kept["time"][listed])
    assert len(rows) > 10 or variant == "stick_slip"  # which has none so early
    for name, column in columns.items():
        np.testing.assert_allclose(column[rows], kept[name][listed], rtol=0, atol=1e-16)


def test_columns_are_all_outputs() -> None:
    names = [*make_references.columns(), *make_references.DISCRETE]
    assert len(names) == len(set(names))
    for component, model in declared().items():
        assert {f"{component}.{name}" for name in model.real_outputs} <= set(names)
    assert set(declared()) == set(COMPONENTS)


def test_unknown_parameters_are_refused() -> None:
    with pytest.raises(UserError, match=r"no parameter 'plant\.m3'"):
        completed({"plant.m3": 1.0})


def test_counts_come_late_and_round_half_up() -> None:
    values = completed({})["sensor"] | {"sample_time": 1.5e-3, "latency": 1}
    values |= {"resolution1": 0.5, "resolution2": 1.0}
    sensor = Sensor(values, {"q1": 0.0, "q2": 0.0})
    shown = []
    for i in range(1, 7):
        q = {"q1": 0.25 * i, "q2": -0.5 * i}
        if i == 3:  # its end is a tick
            with pytest.raises(UserError, match=r"tick 2 is at the communication point 0\.003 s"):
                sensor.step(q, real(2) / 1000, real(3) / 1000)
            break
        sensor.step(q, real(i - 1) / 1000, real(i) / 1000)
        shown.append([int(sensor.outputs({})[f"counts{j}"]) for j in (1, 2)])
    assert shown == [[0, 0], [0, 0]]
    assert sensor._counts == [[0, 0], [1, -1]]
    # whole counts are half a count away from others
    assert [[float(x) for x in s.margins] for s in sensor.samples] == [[0.25, 0.5], [0.25, 0.5]]
    assert [[float(x) for x in s.positions] for s in sensor.samples] == [[0.0, 0.0], [0.5, -1.0]]
    assert [float(s.time) for s in sensor.samples] == [0.0, 0.001]


def test_the_wall_answers_by_its_law() -> None:
    values = completed({})["environment"]
    values |= {"stiffness": 100.0, "damping": 3.0, "position": 1.0, "angle": np.pi / 2}
    values |= {"tip_x": 0.2, "tip_z": 0.1}
    wall = Environment(values)
    # frame 2 turned by 90 degrees: z2 points along y0, x2 along -x0
    motion = {"ee_x": 2.0, "ee_y": 0.5, "ee_vx": 0.0, "ee_vy": -1.0}
    motion |= {"ee_angle": np.pi / 2, "ee_rate": 0.5}
    found = {name: float(value) for name, value in wall.outputs(motion).items()}
    depth, speed = 1.0 - 0.6, -1.0 + 0.5 * -0.2
    force = 100.0 * depth - 3.0 * speed
    assert found["penetration"] == pytest.approx(depth, rel=1e-14)
    assert found["wall_force"] == pytest.approx(force, rel=1e-14)
    assert found["ee_fy"] == pytest.approx(force, rel=1e-14)
    assert found["ee_mz"] == pytest.approx(-0.2 * force, rel=1e-12)
    away = wall.outputs(motion | {"ee_vy": 50.0})
    assert away["wall_force"] == 0 and away["ee_fy"] == 0


# ---- In continuous time --------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("variant", VARIANTS)
def test_made_again_it_is_the_same(variant: str) -> None:
    expected = continuous.reference(variant)
    assert set(expected) == {"time", *COLUMNS}
    times = expected["time"][:60]
    assert times[-1] > 1.0
    for name, column in monolithic(variants()[variant], times).items():
        scale = max(np.abs(expected[name]).max(), 1e-3)
        assert np.abs(column - expected[name][:60]).max() <= 1e-13 * scale, name


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"plant.coulomb_friction1": 0.1}, r"plant\.coulomb_friction1 has to be 0"),
        ({"controller.Ki2": 1.0}, r"controller\.Ki2 has to be 0"),
        ({"controller.mode": 1}, r"controller\.mode keeps its default"),
        ({"environment.position": 0.6}, r"the wall is touched"),
        ({"controller.tau1_max": 5.0}, r"controller\.tau1 reaches its limit 5\.0"),
        ({"actuator.voltage_max1": 0.1}, r"actuator\.voltage1 reaches its limit 0\.1"),
    ],
)
def test_what_the_equations_do_not_have_is_refused(changes: dict[str, float], message: str) -> None:
    with pytest.raises(UserError, match=message):
        monolithic(variants()["pick_and_place"] | changes, [0.0, 0.1, 0.3])


def test_times_must_ascend_from_0() -> None:
    for times in ([], [0.1, 0.2], [0.0, 0.2, 0.2]):
        with pytest.raises(UserError, match="times must ascend from 0"):
            monolithic(variants()["pick_and_place"], times)
