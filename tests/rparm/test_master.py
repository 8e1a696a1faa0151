"""The master, on oscillators x'' = -omega^2 x + gain u; its step-size control; Booleans."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rparm.errors import CodeError, UserError
from rparm.fmi.fmu_file import Fmu
from rparm.runs.inputs import Polyline
from rparm.systems import step_control
from rparm.systems.master import Master, SystemSnapshot
from rparm.systems.python_component import PythonComponent
from rparm.systems.structure import Connection
from tests.support.intercepted import intercept
from tests.support.paths import ROOT
from tests.support.rparm_project import BUILD, MISTAKES, fmi3_fmu

H, STEPS = 0.05, 40
OMEGA = {"a": 2.0, "b": 3.0}
GAIN = {"a": 0.7, "b": -1.3}
START = {"a": (1.0, 0.0), "b": (0.2, -1.0)}
RING = [Connection("a", "x", "b", "u"), Connection("b", "x", "a", "u")]
PARAMETERS = {
    name: {
        "omega": OMEGA[name],
        "gain": GAIN[name],
        "x": START[name][0],
        "v": START[name][1],
        "relative_tolerance": 1e-11,
    }
    for name in "ab"
}


@pytest.fixture(scope="module", params=["2.0", "3.0"])
def oscillator(request: pytest.FixtureRequest) -> Iterator[Fmu]:
    """The FMU of tests/oscillator, of each version of FMI."""
    path = BUILD / "tests" / "oscillator" / "Oscillator.fmu"
    with Fmu(path if request.param == "2.0" else fmi3_fmu(path)) as fmu:
        yield fmu


def exact_step(
    name: str, state: tuple[float, float], u: float, slope: float, h: float = H
) -> tuple[float, float]:
    """x, v after h with the input u + slope t: a straight particular solution plus a vibration."""
    omega, gain = OMEGA[name], GAIN[name]
    rest, drift = gain * u / omega**2, gain * slope / omega**2
    c, s = np.cos(omega * h), np.sin(omega * h)
    x, v = state[0] - rest, state[1] - drift
    return (rest + drift * h + x * c + v / omega * s, drift - x * omega * s + v * c)


def recurrence(order: str, inputs: str, sequence: str = "ab") -> np.ndarray:
    """x and v of a and b, (STEPS + 1, 4)."""
    state, linear = dict(START), inputs == "extrapolated"
    rows = [[*state["a"], *state["b"]]]
    for _ in range(STEPS):
        first, second = sequence
        # the component in front, and in Jacobi order both, know only the beginning of the step
        x, v = state[second]
        ahead = exact_step(first, state[first], x, v * linear)
        if order == "jacobi":
            x, v = state[first]
            behind = exact_step(second, state[second], x, v * linear)
        else:
            x, v = ahead
            behind = exact_step(second, state[second], x - H * v * linear, v * linear)
        state = {first: ahead, second: behind}
        rows.append([*state["a"], *state["b"]])
    return np.array(rows)


@contextmanager
def ring(
    fmu: Fmu,
    sequence: str = "ab",
    stop: float | None = None,
    parameters: dict = PARAMETERS,
    **options: str,
) -> Iterator[Master]:
    """Both oscillators at time 0."""
    with Master({name: fmu for name in sequence}, RING, **options) as master:
        master.initialize(0.0, stop, parameters)
        yield master


@contextmanager
def beside(fmu: Fmu, component: PythonComponent, *ends: Connection) -> Iterator[Master]:
    """An oscillator beside a component in Python, at time 0."""
    with Master({"a": fmu, "pid": component}, ends or LOOP) as master:
        master.initialize(0.0, None, {"a": PARAMETERS["a"]})
        yield master


def places(master: Master, *names: str) -> list[int]:
    return [master.names.index(name) for name in names]


@pytest.mark.parametrize("sequence", ["ab", "ba"])
@pytest.mark.parametrize("inputs", ["held", "extrapolated"])
@pytest.mark.parametrize("order", ["jacobi", "gauss_seidel"])
def test_steps_are_those_of_a_recurrence_by_hand(
    oscillator: Fmu, order: str, inputs: str, sequence: str
) -> None:
    with ring(oscillator, sequence, STEPS * H, order=order, inputs=inputs) as master:
        rows = master.run(np.arange(STEPS + 1) * H)
        columns = places(master, "a.x", "a.v", "b.x", "b.v")
        assert master.do_steps == 2 * STEPS
    expected = recurrence(order, inputs, sequence)
    np.testing.assert_allclose(rows[:, columns], expected, rtol=0, atol=1e-8)
    others = [(o, i) for o in ("jacobi", "gauss_seidel") for i in ("held", "extrapolated")]
    for other in others:
        if other != (order, inputs):  # so the test distinguishes them
            assert np.abs(expected - recurrence(*other, sequence)).max() > 1e-4


def test_rows_are_read_before_inputs_are_set(oscillator: Fmu) -> None:
    with ring(oscillator) as master:
        before = master.values.copy()
        master.advance(H)
        a, x, other = places(master, "b.a", "b.x", "a.x")
        expected = GAIN["b"] * before[other] - OMEGA["b"] ** 2 * master.values[x]
        assert master.values[a] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("sequence", ["abc", "cba", "bca"])
def test_initialization_follows_direct_feedthrough(oscillator: Fmu, sequence: str) -> None:
    chain = [
        Connection("a", "x", "b", "u"),
        Connection("b", "a", "c", "u"),
        Connection("c", "x", "a", "u"),
    ]
    values = {
        name: {"omega": omega, "gain": gain, "x": x, "v": v}
        for name, omega, gain, x, v in (
            ("a", 2.0, 0.7, 1.0, 0.5),
            ("b", 3.0, -1.3, 0.2, -1.0),
            ("c", 1.5, 2.0, -0.4, 0.3),
        )
    }
    fmus = {name: oscillator for name in sequence}
    with Master(fmus, chain, inputs="extrapolated") as master:
        master.initialize(0.0, None, values)
        got = master.values[places(master, "a.a", "b.a", "c.a")]
        slope = master.slopes[places(master, "b.a")]
    b = -9.0 * 0.2 - 1.3 * 1.0
    np.testing.assert_allclose(got, [-4.0 - 0.7 * 0.4, b, 2.25 * 0.4 + 2.0 * b], rtol=1e-14)
    # before its first step, an FMU of FMI 3.0 knows no slopes of inputs
    of_input = 0.0 if oscillator.model.fmi_version == "3.0" else 0.5
    np.testing.assert_allclose(slope, [9.0 * 1.0 - 1.3 * of_input], rtol=1e-14)


LOOPED = [Connection("a", "a", "b", "u"), Connection("b", "a", "a", "u")]


@pytest.mark.parametrize("order", ["jacobi", "gauss_seidel"])
@pytest.mark.parametrize("inputs", ["held", "extrapolated"])
def test_an_algebraic_loop_is_solved_at_each_point(
    oscillator: Fmu, order: str, inputs: str
) -> None:
    """The accelerations: a = -4 x_a + 0.7 b and b = -9 x_b - 1.3 a."""
    with Master({"a": oscillator, "b": oscillator}, LOOPED, order, inputs) as master:
        master.initialize(0.0, None, PARAMETERS)
        for _ in range(4):
            x, y, *found = master.values[places(master, "a.x", "b.x", "a.a", "b.a")]
            expected = np.linalg.solve([[1, -0.7], [1.3, 1]], [-4 * x, -9 * y])
            np.testing.assert_allclose(found, expected, rtol=1e-14)
            master.advance(master.time + H)


def test_an_algebraic_loop_without_solution_is_named(oscillator: Fmu) -> None:
    changed = {name: values | {"gain": 1.0} for name, values in PARAMETERS.items()}
    with (
        Master({"a": oscillator, "b": oscillator}, LOOPED) as master,
        pytest.raises(
            UserError, match=r"^no solution .* loop of 2 connections .*: \w\.a -> \w\.u is off"
        ),
    ):
        master.initialize(0.0, None, changed)


@pytest.mark.parametrize("inputs", ["held", "extrapolated"])
@pytest.mark.parametrize("ends", [RING, LOOPED], ids=["ring", "loop"])
def test_going_back_repeats_bit_for_bit(
    oscillator: Fmu, inputs: str, ends: list[Connection]
) -> None:
    fmus, rates = {"a": oscillator, "b": oscillator}, {"b": 0.05}
    with Master(fmus, ends, "gauss_seidel", inputs, rates=rates) as master:
        master.initialize(0.0, None, PARAMETERS)
        master.advance(0.1)
        with SystemSnapshot(master) as snapshot:
            snapshot.take()
            first = master.run([0.1, 0.15, 0.3])
            for _ in range(2):
                snapshot.restore()
                assert master.time == 0.1
                np.testing.assert_array_equal(master.run([0.1, 0.15, 0.3]), first)
            snapshot.take()  # at 0.3, in place of the first
            master.advance(0.4)
            snapshot.restore()
            assert master.time == 0.3
            np.testing.assert_array_equal(master.values, first[-1])


def test_every_snapshot_is_freed(oscillator: Fmu, monkeypatch: pytest.MonkeyPatch) -> None:
    with ring(oscillator) as master:
        freed = []
        name = {"2.0": "fmi2FreeFMUstate", "3.0": "fmi3FreeFMUState"}[oscillator.model.fmi_version]
        for component in master.components.values():
            fmi = component.instance.fmi
            free = getattr(fmi, name)
            monkeypatch.setattr(
                fmi, name, lambda *arguments, free=free: (freed.append(arguments), free(*arguments))
            )
        with pytest.raises(RuntimeError), SystemSnapshot(master) as snapshot:
            snapshot.take()
            snapshot.take()
            raise RuntimeError
        assert len(freed) == 2
        assert all(state._state.value is None for state in snapshot._states)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_value_that_is_not_finite_is_named(oscillator: Fmu, value: float) -> None:
    with ring(oscillator) as master:
        component = master.components["b"]
        energy = component.outputs.names.index("energy")

        def spoil(read: Callable[..., int], *arguments: Any) -> int:
            status = read(*arguments)
            if master.time >= 0.1:
                arguments[3][energy] = value
            return status

        reads = {"2.0": "fmi2GetReal", "3.0": "fmi3GetFloat64"}
        kept = intercept(component, reads[oscillator.model.fmi_version], spoil)
        with pytest.raises(UserError, match=rf"b\.energy is {value} at t = 0\.15000"):
            master.run(np.arange(10) * H)
        del kept


def test_a_failing_step_is_explained_with_the_message_of_the_fmu(oscillator: Fmu) -> None:
    parameters = {**PARAMETERS, "b": {**PARAMETERS["b"], "max_internal_steps": 1}}
    with (
        ring(oscillator, parameters=parameters) as master,
        pytest.raises(UserError, match=r"^b: fmi[23]DoStep in the step from t = 0\.0 s .*ended"),
    ):
        master.advance(1.0)


@pytest.mark.parametrize(
    ("connections", "message"),
    [
        ([*RING, Connection("a", "v", "b", "u")], r"b\.u: is connected more than once"),
        ([*RING, Connection("c", "x", "b", "u")], r"c: no such component .*a, b"),
        ([*RING, Connection("a", "y", "b", "u")], r"a: .* has no Real output 'y'"),
        ([*RING, Connection("a", "x", "b", "v")], r"b: .* has no Real input 'v'"),
        ([*RING, Connection("a", "solver_steps", "b", "u")], r"a: .* no Real output 'solver_"),
    ],
)
def test_wrong_connections_are_named(
    oscillator: Fmu, connections: list[Connection], message: str
) -> None:
    with pytest.raises(UserError, match=message):
        Master({"a": oscillator, "b": oscillator}, connections)


@pytest.mark.parametrize(("parameters", "message"), MISTAKES["parameters_of_systems"]["rows"])
def test_wrong_parameters_are_named(oscillator: Fmu, parameters: dict, message: str) -> None:
    with pytest.raises(UserError, match=message), ring(oscillator, parameters=parameters):
        pass


def test_unknown_orders_are_refused(oscillator: Fmu) -> None:
    with pytest.raises(UserError, match="jacobi"), ring(oscillator, order="random"):
        pass


# ---- Step-size control --------------------------------------------------------------------------


def control(**changes: object) -> step_control.Control:
    settings = {
        "tolerance": 1e-6,
        "scales": dict.fromkeys(("a.x", "a.v", "b.x", "b.v"), 1.0),
        "first": 1.0,
        "shortest": 1e-6,
        "longest": 2.0,
    }
    return step_control.Control(**settings | changes)


@pytest.mark.parametrize(("inputs", "tolerance"), [("held", 1e-4), ("extrapolated", 1e-6)])
def test_a_controlled_run_is_one_of_half_steps(
    oscillator: Fmu, inputs: str, tolerance: float
) -> None:
    """What was tried and rolled back leaves no trace."""
    with ring(oscillator, stop=3.0, order="gauss_seidel", inputs=inputs) as master:
        run = step_control.run(master, 3.0, control(tolerance=tolerance, corners=(1.25,)))
    assert run.rejected >= 1
    assert run.do_steps == 6 * (run.accepted + run.rejected)
    assert run.times[-1] == 3.0
    assert 1.25 in run.times
    assert run.estimates.max() <= tolerance
    with ring(oscillator, stop=3.0, order="gauss_seidel", inputs=inputs) as master:
        for i, (begin, end) in enumerate(zip(run.times[:-1], run.times[1:], strict=True)):
            master.advance(begin + (end - begin) / 2)
            master.advance(end)
            np.testing.assert_array_equal(master.values, run.values[i + 1])


@pytest.mark.parametrize(("inputs", "tolerance"), [("held", 1e-4), ("extrapolated", 1e-6)])
def test_the_local_error_is_what_is_asked_for(
    oscillator: Fmu, inputs: str, tolerance: float
) -> None:
    """Against the matrix exponential of the coupled system, from each accepted state on."""
    with ring(oscillator, stop=3.0, order="gauss_seidel", inputs=inputs) as master:
        run = step_control.run(master, 3.0, control(tolerance=tolerance))
        columns = places(master, "a.x", "a.v", "b.x", "b.v")
    (a, b), (ga, gb) = OMEGA.values(), GAIN.values()
    system = np.array([[0, 1, 0, 0], [-a * a, 0, ga, 0], [0, 0, 0, 1], [gb, 0, -b * b, 0]])
    values, vectors = np.linalg.eig(system)
    states = run.values[:, columns]
    errors = []
    for i, h in enumerate(np.diff(run.times)):
        propagator = (vectors * np.exp(values * h)) @ np.linalg.inv(vectors)
        errors.append(np.abs(states[i + 1] - (propagator @ states[i]).real).max())
    errors = np.array(errors) / tolerance
    assert errors.max() <= 3.0
    assert np.median(errors[~run.limited]) >= 1 / 3


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"shortest": 0.5}, r"from t = 0\.0 s would have to be below 0\.5 s"),
        ({"scales": {"a.y": 1.0}}, r"a\.y: the system has no such value"),
    ],
)
def test_control_that_cannot_be_is_refused(
    oscillator: Fmu, change: dict[str, object], message: str
) -> None:
    with (
        ring(oscillator, stop=3.0, order="gauss_seidel") as master,
        pytest.raises(UserError, match=message),
    ):
        step_control.run(master, 3.0, control(**change))


# ---- Signals and components in Python -----------------------------------------------------------
PID = """
class Pid:
    inputs = ["x", "v"]
    outputs = ["u"]
    kp, ki, kd = 1.0, 0.5, 0.2
    start = {"u": 0.75}

    def __init__(self):
        self.integral = 0.0

    def step(self, t, h, inputs):
        self.integral += h * inputs["x"]
        return {"u": -self.kp * inputs["x"] - self.ki * self.integral - self.kd * inputs["v"]}
"""
SAVES = """
    def save(self):
        return {"integral": self.integral}

    def restore(self, state):
        self.integral = state["integral"]
"""
LOOP = [
    Connection("a", "x", "pid", "x"),
    Connection("a", "v", "pid", "v"),
    Connection("pid", "u", "a", "u"),
]


def python(folder: Path, text: str, name: str = "", **ends: list[str]) -> PythonComponent:
    (folder / "code.py").write_text(text, encoding="utf-8")
    return PythonComponent.read(f"code.py{name}", folder, **ends)


def test_signals_are_held_over_each_step(oscillator: Fmu) -> None:
    signal = Polyline(((0.0, 0.0), (0.5, 2.0), (1.0, -1.0)))
    with Master({"a": oscillator}, [], signals={"a.u": signal}) as master:
        master.initialize(3.0, None, {"a": PARAMETERS["a"]})
        rows = master.run(3.0 + np.arange(STEPS + 1) * H)
        columns = places(master, "a.x", "a.v", "a.u")
    state = START["a"]
    for k in range(STEPS):
        u = float(np.interp(k * H, [0.0, 0.5, 1.0], [0.0, 2.0, -1.0]))
        assert rows[k, columns] == pytest.approx([*state, u], abs=1e-8)
        state = exact_step("a", state, u, 0.0)


def test_python_steps_by_its_law_with_a_delay_of_one_step(oscillator: Fmu, tmp_path: Path) -> None:
    fmus = {"a": oscillator, "pid": python(tmp_path, PID)}
    with Master(fmus, LOOP) as master:
        master.initialize(0.0, None, {"a": PARAMETERS["a"], "pid": {"kp": 3.0}})
        rows = master.run(np.arange(STEPS + 1) * H)
        columns = places(master, "a.x", "a.v", "pid.u")
    state, u, integral = START["a"], 0.75, 0.0
    for k in range(STEPS):
        assert rows[k, columns] == pytest.approx([*state, u], abs=1e-8)
        integral += H * state[0]
        later = -3.0 * state[0] - 0.5 * integral - 0.2 * state[1]
        state, u = exact_step("a", state, u, 0.0), later


def test_python_goes_back_where_it_can_and_is_refused_elsewhere(
    oscillator: Fmu, tmp_path: Path
) -> None:
    with beside(oscillator, python(tmp_path, PID + SAVES)) as master:
        master.advance(0.1)
        with SystemSnapshot(master) as snapshot:
            snapshot.take()
            first = master.run([0.1, 0.15, 0.3])
            snapshot.restore()
            np.testing.assert_array_equal(master.run([0.1, 0.15, 0.3]), first)
    with (
        beside(oscillator, python(tmp_path, PID)) as master,
        pytest.raises(UserError, match=r"^pid: .*code\.py has no save\(\) and restore"),
    ):
        step_control.run(master, 1.0, control(scales={"a.x": 1.0}))


def test_a_function_has_the_names_of_its_connections(oscillator: Fmu, tmp_path: Path) -> None:
    text = "def step(t, h, inputs):\n    return {'u': -2.0 * inputs['x'] + t}\n"
    law = python(tmp_path, text, inputs=["x"], outputs=["u"])
    with beside(oscillator, law, LOOP[0], LOOP[2]) as master:
        rows = master.run(np.arange(3) * H)
        x, u = rows[:, places(master, "a.x", "pid.u")].T
    assert u.tolist() == [0.0, -2.0 * x[0], -2.0 * x[1] + H]


def test_whole_numbers_of_python_stay_whole(tmp_path: Path) -> None:
    text = "class C:\n    inputs, outputs, n = [], ['u'], 3\n"
    with Master({"c": python(tmp_path, text + STEP + "return {'u': len([0] * self.n)}")}, []) as c:
        c.initialize(0.0, None, {"c": {"n": 4.0}})
        assert c.run([0.0, 1.0])[1].tolist() == [4.0]


ENDS = "class C:\n    inputs = ['x']\n    outputs = ['u']\n"
STEP = "    def step(self, t, h, inputs):\n        "


@pytest.mark.parametrize(("text", "name", "message", "code"), MISTAKES["python_components"]["rows"])
def test_mistakes_in_python_are_named_in_one_line(
    tmp_path: Path, text: str, name: str, message: str, code: int
) -> None:
    other = PID.replace("Pid", "Pi")
    for word, meant in {"ENDS": ENDS, "STEP": STEP, "PID": PID, "OTHER": other}.items():
        text = text.replace(word, meant)

    def run() -> None:
        with Master({"c": python(tmp_path, text, name)}, []) as master:
            master.initialize(0.0)
            master.advance(1.0)

    with pytest.raises(UserError, match=message) as caught:
        run()
    assert "\n" not in str(caught.value)
    assert caught.value.code == code
    assert isinstance(caught.value, CodeError) == (code == 1)


# ---- Booleans: a trajectory attaches a payload to the plant and its controller -------------------


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
STEP_SIZE, GRASP = 2.0**-9, 2.0**-6  # s; the grasp is a communication point


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


def carrying(grasp: float) -> dict[str, dict[str, float]]:
    carried = {"grasp_time": grasp, "release_time": 1.0}
    plant = {"damping2": 20.0, "relative_tolerance": 1e-10}
    return {"trajectory": carried, "controller": dict(PAYLOAD), "plant": plant | PAYLOAD}


@pytest.mark.parametrize("order", ["jacobi", "gauss_seidel"])
@pytest.mark.parametrize("inputs", ["held", "extrapolated"])
def test_all_follows_a_switch_at_its_time(fmus: dict[str, Fmu], order: str, inputs: str) -> None:
    """At the grasp, efforts are those of a start with the payload from the same state."""
    with wired(fmus, order=order, inputs=inputs) as master:
        master.initialize(0.0, None, carrying(GRASP))
        rows = master.run(np.arange(round(GRASP / STEP_SIZE) + 2) * STEP_SIZE)
        before, after, later = (dict(zip(master.names, row, strict=True)) for row in rows[-3:])
    start = carrying(0.0)
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


def test_going_back_over_a_switch_repeats_bit_for_bit(fmus: dict[str, Fmu]) -> None:
    with wired(fmus) as master:
        master.initialize(0.0, None, carrying(GRASP))
        master.run(np.arange(5) * STEP_SIZE)
        with SystemSnapshot(master) as snapshot:
            snapshot.take()
            first = master.run(np.arange(4, 17) * STEP_SIZE)
            snapshot.restore()
            np.testing.assert_array_equal(master.run(np.arange(4, 17) * STEP_SIZE), first)


def test_a_boolean_feeds_a_boolean_only(fmus: dict[str, Fmu]) -> None:
    wrong = Connection("trajectory", "payload_attached", "plant", "tau1")
    with pytest.raises(UserError, match=r"payload_attached -> plant\.tau1: a Boolean feeds"):
        Master(fmus, [wrong])
    with pytest.raises(UserError, match=r"^plant\.payload_attached: is connected more than once"):
        Master(fmus, [*REAL, *WRENCH, *SWITCHES, SWITCHES[-1]])
