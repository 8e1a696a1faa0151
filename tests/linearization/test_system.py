"""Systems put together from their components: poles in closed form, what is refused."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import control
import numpy as np
import pytest

from rparm.errors import UserError
from rparm.linearization.linear import Linear
from rparm.linearization.margins import margins, open_loop
from rparm.linearization.study import Request, study
from rparm.linearization.system import SystemSubject, connected, looped
from rparm.systems import ssp
from rparm.systems.opened import opened as open_system
from rparm.systems.structure import Connection
from tests.equations.examples import MODELS, made


@contextmanager
def opened(fmu: Path, name: str, variant: str, **options: object) -> Iterator[SystemSubject]:
    with ExitStack() as stack:
        unpacked = stack.enter_context(ssp.unpacked(fmu.with_name(f"{name}.ssp")))
        yield stack.enter_context(SystemSubject(unpacked, variant, **options))


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_computed_torque_puts_all_poles_where_the_gains_say(version: str) -> None:
    """s^2 + 40 s + 400 for both joints."""
    found = study(Request("closed_loop", variant="nominal", version=version)).linear
    assert found.poles == pytest.approx([-20.0] * 4, abs=1e-5)
    assert found.held == ("controller.integral1", "controller.integral2")  # their gain is 0
    assert found.states == ("arm.q1", "arm.q2", "arm.dq1", "arm.dq2")


def test_it_answers_as_the_components_do_in_python_control(fmu: Path) -> None:
    """The same system, connected by python-control."""
    with opened(fmu, "ClosedLoop", "heavy_payload_integral") as subject:
        parts = subject.parts({})
        whole = connected(parts, subject.kept)
        systems = []
        for name, part in parts.items():
            named = {key: [v.replace(".", "_") for v in getattr(part, key)] for key in KINDS}
            named = {key: value for key, value in named.items() if value}
            systems.append(control.ss(part.A, part.B, part.C, part.D, name=name, **named))
        wires = [
            [f"{c.end_component}.{c.end_connector}", f"{c.start_component}.{c.start_connector}"]
            for c in subject.kept
            if c.end_connector in parts[c.end_component].inputs
        ]
        one, out = "arm.tau1", ["arm.q1", "controller.f2"]
        expected = control.interconnect(
            systems, wires, inplist=[one], outlist=out, check_unused=False
        )
    chosen = whole.select([one], out)
    for w in (0.3, 3.0, 30.0):
        at = chosen.C @ np.linalg.solve(1j * w * np.eye(len(chosen.A)) - chosen.A, chosen.B)
        assert at + chosen.D == pytest.approx(expected(1j * w), rel=1e-9)


KINDS = ("inputs", "outputs", "states")


def static(gain: float) -> Linear:
    """A gain without states."""
    none, one = np.zeros((0, 0)), np.zeros((0, 1))
    empty, zero = np.zeros(0), np.zeros(1)
    D = np.array([[gain]])
    return Linear(
        (), ("u",), ("y",), none, one, one.T.reshape(1, 0), D, x=empty, u=zero, y=zero, rates=empty
    )


def test_an_algebraic_loop_is_solved_or_refused_with_its_path() -> None:
    ring = [Connection(start, "y", end, "u") for start, end in ("ab", "bc", "ca")]
    found = connected({name: static(0.5) for name in "abc"}, ring)
    assert found.D[2] == pytest.approx(np.array([0.125, 0.25, 0.5]) / 0.875, rel=1e-14)
    with pytest.raises(UserError, match=r"loop (\w\.y -> ){3}\w\.y has no single solution"):
        connected({name: static(1.0) for name in "abc"}, ring)
    chain = connected({name: static(0.5) for name in "abc"}, ring[:2])
    assert chain.D[2, 0] == 0.125


def test_rounding_connects_nothing_and_a_small_entry_does() -> None:
    """0.1 + 0.2 - 0.3 leaves 5.6e-17; the inverse of a mass of 1e18 is as small and counts."""

    def mass(back: list[float]) -> Linear:
        A = np.array([[0.0, 1.0], [0.0, 0.0]])
        B, C = np.array([[0, 0, 0], [1e-18, 1e-18, 1e-18]]), np.outer(back, [1.0, 0.0])
        x, u, y = np.zeros(2), np.zeros(3), np.zeros(len(back))
        names = ("x", "v"), ("u0", "u1", "u2"), ("y0", "y1", "y2")
        return Linear(*names, A, B, C, np.zeros((3, 3)), x=x, u=u, y=y, rates=x)

    wires = [Connection("m", f"y{i}", "m", f"u{i}") for i in range(3)]
    cancelling, pulling = (
        connected({"m": mass(k)}, wires).A[1] for k in ([0.1, 0.2, -0.3], [-1.0] * 3)
    )
    assert cancelling.tolist() == [0.0, 0.0] and pulling == pytest.approx([-3e-18, 0.0], rel=1e-12)
    assert looped({"m": mass([-1.0] * 3)}, wires).parts["m"].states == ("x", "v")


@pytest.mark.parametrize(
    "options, message",
    [
        ({"variant": "pick_and_place"}, "component 'controller' is sampled"),
        ({"variant": "wall_contact"}, "component 'sensor' is sampled.*by --without sensor"),
        ({"variant": "wall_contact", "without": ["plant"]}, "has nothing to be fed by"),
        ({"variant": "wall_contact", "without": ["sensors"]}, "did you mean 'sensor'"),
        ({"variant": "wall"}, "no variant 'wall', did you mean 'wall_contact'"),
        ({"cut": "plant.tua1"}, "--break: plant.tua1: no connection ends there"),
        ({"at": {"plant.tau1": 1.0}, "variant": "stick_slip"}, "plant.tau1: is connected"),
        ({"at": {"q1": 1.0}}, "q1: expected COMPONENT.VARIABLE"),
        (
            {"inputs": ["plant.q9"], **{"variant": "stick_slip", "without": ["sensor"]}},
            "inputs: no",
        ),
    ],
)
def test_refused(options: dict, message: str) -> None:
    with pytest.raises(UserError, match=message) as caught:
        study(Request("machine", **options))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["RPSensor", "RPController"])
def test_a_sampled_fmu_is_refused(name: str) -> None:
    with pytest.raises(UserError, match="is sampled, .* can be: set sample_time to 0$"):
        study(Request(name, at={"sample_time": "1 ms"}))


def test_a_system_is_trimmed_with_all_loops_closed() -> None:
    """Integral action takes the whole load, also where the loop is broken afterwards."""
    free = ["arm.q1", "arm.q2", "controller.integral1", "controller.integral2"]
    found = study(
        Request("closed_loop", variant="heavy_payload_integral", free=free, cut="arm.tau1")
    )
    at = found.linear.at
    assert at["arm.q1"] == pytest.approx(at["controller.q1_ref"], abs=1e-9)
    # 0.2 kg more than the controller knows, at 0.5 m and across by 0.1 m
    q1, g = at["arm.q1"], 9.81
    lever = (0.5 + at["arm.q2"]) * np.cos(q1) - 0.1 * np.sin(q1)
    known = (2 * 0.25 + 0.5 + at["arm.q2"]) * np.cos(q1) - 0.1 * np.sin(q1)
    assert at["arm.tau1"] == pytest.approx(g * (known + 0.2 * lever), rel=1e-9)
    assert found.margins is not None and found.margins.stable


# ---- Margins -------------------------------------------------------------------------------------


def test_margins_of_computed_torque_are_those_of_its_law(fmu: Path) -> None:
    """L = (40 s + 400) / s^2: no gain margin, and the phase at the gain 1 in closed form."""
    with opened(fmu, "ClosedLoop", "nominal", cut="arm.tau1") as subject:
        broken = connected(subject.parts({}), subject.kept)
    loop = open_loop(broken.select(["arm.tau1"], ["controller.tau1"]))
    assert len(loop.states) == 2  # the other joint and integrators with gain 0 play no part
    found = margins(loop)
    w = np.sqrt((1600 + np.sqrt(1600**2 + 4 * 400**2)) / 2)
    assert found.stable and found.gain_up == np.inf and found.gain_down == 0.0
    assert [x.frequency for x in found.gain_crossings] == pytest.approx([w])
    lag = np.arctan(w / 10)
    assert found.phase == pytest.approx(np.degrees(lag), rel=1e-9)
    assert found.delay == pytest.approx(lag / w, rel=1e-9)


# ---- With a component in Python ------------------------------------------------------------------
MASS, KP, KI, KD = 2.0, 30.0, 12.0, 16.0
PID = """
import numpy as np

class Pid:
    inputs = ["q2"]
    outputs = ["f2"]
    gains = np.zeros(3)
    integral = last = 0.0

    def step(self, t, h, inputs):
        kp, ki, kd = self.gains
        self.integral += h * inputs["q2"]
        speed = (inputs["q2"] - self.last) / h
        self.last = inputs["q2"]
        return {"f2": -kp * inputs["q2"] - ki * self.integral - kd * speed}

    def save(self):
        return self.integral, [self.last]

    def restore(self, state):
        self.integral, (self.last,) = state
"""


def sampled_loop(fmu: Path, folder: Path, code: str = PID, step: float = 0.05) -> Path:
    """A file with the arm that lies flat: its slider alone is a double integrator."""
    law = "pid.py" if "class" in code else made(code).as_posix()
    gains = 'file = "gains.json"\n' if "class" in code else ""
    (folder / "pid.py").write_text(code, encoding="utf-8")
    (folder / "gains.json").write_text(f'{{"pid": {{"gains": [{KP}, {KI}, {KD}]}}}}')
    file = folder / "loop.toml"
    file.write_text(
        f'name = "Loop"\nstep = {step}\nstop = 1\n'
        f'[components]\narm = "{fmu.as_posix()}"\npid = "{law}"\n'
        '[connections]\n"arm.f2" = "pid.f2"\n"pid.q2" = "arm.q2"\n'
        f'[parameters]\n{gains}"arm.m2" = {MASS}\n"arm.g" = 0\n"arm.a" = 0\n'
    )
    return file


def pid_loop(h: float, late: int = 1) -> control.TransferFunction:
    """L by hand: held force on a mass, steps of delay, sums and differences of positions."""
    sums = np.polyadd([KP, -KP, 0.0], [KI * h, 0.0, 0.0])
    law = np.polyadd(sums, KD / h * np.array([1.0, -2.0, 1.0]))  # over z (z - 1)
    num = h * h / 2 / MASS * np.polymul([1.0, 1.0], law)
    return control.tf(num, np.poly([1.0, 1.0, 1.0, 0.0, *[0.0] * late]), h)


@pytest.mark.parametrize("late", [0, 1], ids=["samplers", "python"])
def test_a_sampled_law_has_poles_and_margins_of_its_z_transform(
    fmu: Path, tmp_path: Path, late: int
) -> None:
    """Python acts a step late, samplers at once; no tick reads the force of before."""
    code = PID if late else MODELS["samplers"]["LAW"]
    file, L = sampled_loop(fmu, tmp_path, code), pid_loop(0.05, late)
    found = study(Request(file)).linear
    assert found.dt == 0.05
    expected = [1.0, 1.0, *control.feedback(L).poles(), *[0.0] * (1 - late)]  # 1: the other joint

    def size(pole: complex) -> tuple[float, float]:
        return round(abs(pole), 6), pole.imag

    assert sorted(found.poles, key=size) == pytest.approx(sorted(expected, key=size), abs=1e-8)
    broken = study(Request(file, cut="arm.f2"))
    up, lag, _, _, crossing, _ = control.stability_margins(L)
    assert broken.margins.gain_up == pytest.approx(up, rel=1e-7)
    assert broken.margins.phase == pytest.approx(lag, rel=1e-7)
    assert broken.margins.delay == pytest.approx(np.radians(lag) / crossing, rel=1e-7)


def test_the_largest_step_of_python_is_where_a_pole_leaves_the_circle(
    fmu: Path, tmp_path: Path
) -> None:
    """In Jacobi order; the law is called once a step, so it changes with the step, too."""
    (jacobi, _) = study(Request(sampled_loop(fmu, tmp_path))).largest
    assert (jacobi.order, jacobi.inputs) == ("jacobi", "held")

    def radius(h: float) -> float:
        return float(np.abs(control.feedback(pid_loop(h)).poles()).max())

    assert radius(0.999 * jacobi.step) < 1.0 < radius(1.001 * jacobi.step)


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("def save", "def keep", r"pid\.py: has no save\(\) and restore\(state\), which a linear"),
        ("speed}", "abs(speed)}", "pid: f2 has a corner or a jump over saved\\[1\\]\\[0\\] at the"),
        (
            "speed}",
            "np.sign(speed)}",
            "pid: f2 has a corner or a jump over saved.*, or noise: diff",
        ),
        ("[self.last]", "{self.last}", r"pid: save\(\) gives a set, expected numbers"),
    ],
)
def test_a_law_without_a_linear_model_is_refused(
    fmu: Path, tmp_path: Path, old: str, new: str, message: str
) -> None:
    file = sampled_loop(fmu, tmp_path, PID.replace(old, new))
    with pytest.raises(UserError, match=message):
        study(Request(file))


@pytest.mark.parametrize(
    "law, point, slope, rounding",
    [
        ("-np.expm1(5.0 * q)", 0.1, -5.0 * np.exp(0.5), 1e-9),
        ("-3e-5 * np.sin(q / 1e-5)", 0.0, -3.0, 1e-9),
        ("-3 * np.sin(q)", 4000.0, -3.0 * np.cos(4000.0), 1e-7),
        ("-3 * np.sin(q)", 1e5, -3.0 * np.cos(1e5), 1e-6),
        ("-q * abs(q)", 0.0, 0.0, 1e-9),
        ("-max(q, 0.0)", 1e-7, -1.0, 1e-9),  # close to its corner
        ("-math.sqrt(0.2 - q)", 0.15, 0.5 / np.sqrt(0.05), 1e-9),  # close to its last value
        ("-float(np.float32(7) * np.float32(q))", 0.3, -7.0, 1e-3),  # few digits
        ("-np.round(q * 500) / 500", 0.1005, 0.0, 1e-9),  # a stair
        ("-3 * q - np.round(q * 500) / 500", 0.1005, -3.0, 1e-9),
        ("-min(max(q, 0.09), 0.11)", 0.1, -1.0, 1e-9),  # between limits
    ],
)
def test_a_law_that_bends_is_differentiated(
    fmu: Path, tmp_path: Path, law: str, point: float, slope: float, rounding: float
) -> None:
    """By steps that suit its own scale, at another variant's point."""
    code = PID.replace("import numpy as np", "import math\nimport numpy as np")
    code = code.replace('["f2"]', '["f2", "u"]').replace(
        "        return {",
        f"""\
        q = inputs["q2"]
        return {{"u": {law}, """,
    )
    with (
        open_system(sampled_loop(fmu, tmp_path, code)) as system,
        SystemSubject(system, "default") as subject,
    ):
        part = subject.parts({"arm.q2": point})["pid"]
    names = part.states
    assert part.B[names.index("u"), 0] == pytest.approx(slope, rel=0, abs=rounding)
    assert part.B[names.index("f2"), 0] == pytest.approx(-KP - KI * 0.05 - KD / 0.05, rel=1e-9)
    assert part.flat == (("a stair or flat part in u over q2",) if "round" in law else ())
