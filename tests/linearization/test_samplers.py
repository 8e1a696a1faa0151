"""Discrete linear models of files with samplers, against exponentials, textbooks and runs."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import block_diag, expm

import rparm
from rparm import __main__ as cli
from rparm.errors import UserError
from rparm.fmi.fmu_file import CO_SIMULATION
from rparm.linearization.largest_step import growth
from rparm.linearization.responses import frequency_response
from rparm.linearization.study import Request, study
from rparm.linearization.system import SystemSubject
from rparm.systems.master import Master
from rparm.systems.opened import opened as open_system
from tests.equations.examples import FOLDER, MODELS, axis, example, made

TEXTS = MODELS["samplers"] | MODELS["sampled"]
WAY = ("jacobi", "held")
TEXTS |= {n.upper(): (FOLDER / f"{n}.toml").read_text(encoding="utf-8") for n in ("axis", "pwm")}


def assert_close(found: np.ndarray, exact: np.ndarray) -> None:
    np.testing.assert_allclose(found, exact, rtol=0, atol=2e-13 * np.abs(exact).max())


def test_deadbeat_control_of_a_double_integrator_settles_in_two_samples() -> None:
    found = rparm.linearize(made(TEXTS["DEADBEAT"]))
    plant, input_ = np.array([[1, 1], [0, 1]]), np.array([[0.5], [1]])
    gain = np.array([[1, 1.5]])
    assert_close(found.A, np.block([[plant - input_ @ gain, np.zeros((2, 1))], [-gain, 0]]))
    assert_close(found.B, np.vstack([input_, [[1]]]))
    assert_close(found.C, np.vstack([np.eye(2, 3), [[-1, -1.5, 0]]]))
    assert_close(found.D, np.array([[0], [0], [1]]))
    assert not found.poles.any() and found.dt == 1.0


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_sampled_pid_controller_of_an_axis(fmi: int) -> None:
    path, h = example("axis"), 0.03
    at = {"M": 0.7, "m": 1.9, "k": 400.0, "c": 11.0, "Kp": 11.0, "Kd": 2.0, "Ki": 4.0}
    path = path if fmi == 2 else path.parent / "fmi3" / path.name
    point = {"Ts": h, "target": 0.2}
    found = rparm.linearize(path, at=at | point, trim=["x", "y", "u", "sum", "last"])
    assert found.states == ("x", "v", "y", "w", "u", "sum", "last")
    assert found.x == pytest.approx([0.2, 0, 0.2, 0, 0, 0, 0.2], abs=1e-10)
    tick, motion = axis(h, *at.values())
    assert_close(np.hstack([found.A, found.B]), (motion @ tick)[:7])
    assert_close(np.hstack([found.C, found.D]), tick[:7])


def crane(z: np.ndarray, h: float, r: float) -> np.ndarray:
    """A and B by hand: phi, w, u, e, r."""
    phi, w, u, e = z
    first, second, late = np.eye(5), np.eye(5), np.eye(5)
    first[2] = [-np.cos(2 * phi), -0.4, 0, 0, 1 + np.tan(r) ** 2]
    first[3] = [2 * phi, 0, 0, 0.5, -1]
    second[3] = [u, 0, phi, 1, 0]
    late[1] = [0, 0.9, 0, 0.05 * (1 - np.tanh(e) ** 2), 0]
    rates = np.zeros((5, 5))
    rates[0, 1] = 1
    rates[1, :3] = [-np.cos(phi) - u * np.sin(phi), -0.9 * w**2, np.cos(phi)]
    return (expm(0.7 * h * rates) @ late @ expm(0.3 * h * rates) @ second @ first)[:4]


@pytest.mark.parametrize("shift", [{"skipped": 3}, {"begin": 0.05}, {"begin": 1.0, "skipped": 5}])
def test_samplers_with_offsets_compose_in_the_order_of_time(shift: dict[str, float]) -> None:
    """A shift of all offsets, or of one by periods, changes nothing: the first tick begins."""
    point = {"phi": 0.5, "w": -0.1, "u": 0.2, "e": 0.3}  # phi follows from p0
    found = rparm.linearize(made(TEXTS["CRANE"]), at=point | shift | {"r": 0.4, "h": 0.5})
    assert found.states == tuple(point) and found.left_out == ("extra",)
    assert_close(np.hstack([found.A, found.B]), crane(np.array([*point.values()]), 0.5, 0.4))
    assert found.x.tolist() == [*point.values()]
    changes = {tick.name: tick.changes for tick in found.ticks}
    assert changes["never"] == {"u": 0.0} and changes["second"] == {"e": pytest.approx(0.1)}


@pytest.mark.parametrize("offset", [0, 23, 103, 140])
def test_the_period_of_several_rates_begins_with_the_slowest(offset: int) -> None:
    """Of 1, 4 and 10 ms it is 20 ms; at one instant samplers run in the order of the file."""
    w, begin = 0.3, offset % 100  # 0.1 ms
    at = {"offset": offset * 1e-4, "w": w}
    found = rparm.linearize(made(TEXTS["CASCADE"]), at=at)
    assert found.states == ("i", "w", "u", "e", "ref", "seen")
    assert found.dt == pytest.approx(0.02)
    whole, rates, seen = np.eye(7), np.zeros((7, 7)), []  # of states and r
    rates[:2] = [[-300, -50, 300, 0, 0, 0, 0], [40, -3 * w**2, 0, 0, 0, 0, 0]]
    sensor, speed, current = np.eye(7), np.eye(7), np.eye(7)
    sensor[5], speed[4] = np.eye(7)[1], [0, -0.2, 0, 0, 0, -3, 3]
    current[2:4] = [[-2, 0, 0, 1, 2, 0, 0], [-0.1, 0, 0, 1, 0.1, 0, 0]]
    for time in range(begin, begin + 200):
        for law, every, first in (sensor, 40, 0), (speed, 100, begin), (current, 10, 0):
            whole = law @ whole if (time - first) % every == 0 else whole
        seen = [*seen, whole]
        whole = expm(1e-4 * rates) @ whole
    assert_close(np.hstack([found.A, found.B]), whole[:6])
    assert_close(np.hstack([found.C, found.D]), seen[0][:6])


def test_samplers_with_indexes_have_names_with_indexes() -> None:
    found = rparm.linearize(made(TEXTS["TWO"]))
    assert found.states == ("x[1]", "x[2]", "u[1]", "u[2]") and found.outputs == found.states
    first, second = np.eye(4), np.eye(4)
    first[3] = second[2] = [3, 3, 0, 0]
    rates = np.vstack([np.eye(2, 4, 2) - np.eye(2, 4), np.zeros((2, 4))])
    assert_close(found.A, expm(0.08 * rates) @ second @ expm(0.02 * rates) @ first)
    assert_close(found.C, first)


def test_a_filter_is_discrete_without_continuous_states() -> None:
    found = rparm.linearize(made(TEXTS["FILTER"]), at={"a": 0.25})
    whole = np.hstack([found.A, found.B])
    assert_close(whole, np.array([[0.75, 0, 0.25], [1, 0, 0]]))
    assert_close(np.hstack([found.C, found.D]), whole)
    one, w = found.select(["u"], ["y"]), np.array([0.1, 3.0, 31.0])
    system = one.ss()
    assert system.dt == 0.1
    np.testing.assert_allclose(frequency_response(one)(w), system(np.exp(0.1j * w)), rtol=1e-9)


def test_a_state_that_no_tick_moves_is_held() -> None:
    """A brake holds both masses, but a tick moves one."""
    found = rparm.linearize(made(TEXTS["BRAKE"]))
    assert found.held == ("v",) and found.states == ("w", "x", "u")
    assert_close(np.diag(found.A), np.array([0.5, np.exp(-0.5), 0.0]))


REFUSED = {
    "modes": ("PWM", {}, "sampler end changes on at this point, expected a point at which"),
    "a time that inputs decide": ("CHOPPER", {}, r"Chopper: event end \(time >= off\): when it"),
    "a part of a period": (
        "SAW",
        {},
        r"Saw: time - 0.01 \* floor.* of \[states\] i: when it switches",
    ),
    "condition": ("TWO", {"at": {"x[1]": 2.0}}, r"sampler s\[1\] changes on, level at this point"),
    "no value": ("LIMITED", {"at": {"x": 1.5}}, "sampler s: the new value of u is not finite"),
    "no point": ("AXIS", {"trim": ["x", "y", "u"]}, "by x, y, u: the derivative of w stays at"),
    "moving": ("DEADBEAT", {"at": {"r": 1}, "trim": ["x2", "u"]}, "the derivative of x1 stays at"),
    "sampled twice": ("DEADBEAT", {}, "step: the model is sampled already, every 1 s"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_no_linear_model_is_made(case: str) -> None:
    name, options, message = REFUSED[case]
    with pytest.raises(UserError, match=message) as raised:
        rparm.linearize(made(TEXTS[name]), **options).zoh(0.1)
    assert "\n" not in str(raised.value)


def test_a_condition_is_taken_as_it_is_at_the_point() -> None:
    """The tick does nothing here, so that its new value need not be defined."""
    found = rparm.linearize(made(TEXTS["LIMITED"]), at={"x": 0.5})
    assert_close(found.A, block_diag(np.exp(-1), 1))


def test_what_has_no_discrete_model_says_what_to_do() -> None:
    with pytest.raises(UserError, match="has samplers: linearize it in model exchange"):
        study(Request(made(TEXTS["DEADBEAT"]), kind=CO_SIMULATION))


def loop(folder: Path, old: str = "", new: str = "") -> Path:
    """A system of FMUs, and of one in Python."""
    files = {name: text.replace(old, new) for name, text in MODELS["loop"]["files"].items()}
    system = files.pop("loop.toml")
    (folder / "sensor.py").write_text(files.pop("sensor.py"), encoding="utf-8")
    for name, text in files.items():
        system = system.replace(f'"{name}"', f'"{made(text).as_posix()}"')
    (folder / "loop.toml").write_text(system, encoding="utf-8")
    return folder / "loop.toml"


@pytest.mark.parametrize(("old", "new", "cut", "expected"), MODELS["loop"]["cases"])
def test_a_tick_sees_what_other_components_were_before(
    tmp_path: Path, old: str, new: str, cut: str, expected: str | float
) -> None:
    """u = -1.5 x of 0.2 s, and of a delay earlier; the sensor in Python is late by 0.1 s."""
    request = Request(loop(tmp_path, old, new), cut=cut)
    if isinstance(expected, str):
        with pytest.raises(UserError, match=expected):
            study(request)
    else:
        found, (a, b) = study(request).linear, np.exp([-0.2, expected - 0.2])
        characteristic = [1, -a + 1.5 * (1 - b), 1.5 * (b - a), 0]
        np.testing.assert_allclose(np.poly(found.poles), characteristic, atol=1e-12)
        assert found.dt == 0.2


def test_the_largest_step_of_samplers_is_a_multiple_of_their_period(tmp_path: Path) -> None:
    """In Jacobi order u acts three steps after x: runs die out at this step, not at the next."""
    file = loop(tmp_path, "2 * 0.1", "0.05")
    roots = [np.roots([1, -np.exp(-0.2 * k), 0, 1.5 * -np.expm1(-0.2 * k)]) for k in range(1, 30)]
    count = [np.abs(found).max() < 1 for found in roots].index(False)
    (limit,) = [x for x in study(Request(file)).largest if (x.order, x.inputs) == WAY]
    assert limit.step == pytest.approx(0.2 * count)
    for step in (limit.step, limit.step + 0.2):
        with (
            open_system(file) as system,
            SystemSubject(system, "default") as subject,
            Master(subject.fmus, subject.connections, *WAY) as master,
        ):
            master.initialize(0.0, None, subject.merged({"plant.x": 1e-3}))
            measured = growth(master, step, ["plant.x"])
        assert measured == pytest.approx(np.abs(roots[round(step / 0.2) - 1]).max(), rel=1e-3)


@pytest.mark.parametrize("version", ["", "fmi3"])
def test_functions_without_slope_and_counts_are_named(version: str) -> None:
    """r acts once, not twice, and x not at all; n counts, but nothing follows from it."""
    fmu = made(TEXTS["STEPS"])
    found = rparm.linearize(fmu.parent / version / fmu.name)
    assert found.flat == ("sign in y", "round in u") and found.left_out == ("n",)
    assert_close(found.A, np.array([[np.exp(-0.1), 0], [0, 0]]))
    assert_close(found.B, np.array([[1 - np.exp(-0.1)], [1]]))


def test_files_and_page_say_that_it_is_sampled(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    saved = tmp_path / "m.csv"
    options = ["--save", str(saved), "--output", str(tmp_path), "--json", "--at", "x1=0.5"]
    assert cli.main(["linearize", str(made(TEXTS["DEADBEAT"])), *options]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["dt"] == 1.0 and found["poles"] == [[0, 0]] * 3
    rows = [row[0] for row in csv.reader(saved.open(newline=""))]
    assert rows == ["", "next(x1)", "next(x2)", "next(u)", "x1", "x2", "u"]
    page = Path(found["page"]).read_text(encoding="utf-8")
    for text in ("Sampled every 1 s by feedback", "feedback changes u by −0.5", "unit circle"):
        assert text in page
    for name in ("bode", "steps", "poles"):
        assert f'"kind":"{name}"' in page
