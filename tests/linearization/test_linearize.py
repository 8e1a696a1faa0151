"""`linearize` and `rparm.linearize`: documents, files, the page, a run; the largest stable step."""

import csv
import json
import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import control
import mpmath
import numpy as np
import pytest
from rparm.models.closed_loop.study import REST as LOOP
from rparm.models.machine.study import REST as MACHINE
from rparm.models.machine.wall_limit import Contact, growth
from scipy.io import loadmat
from scipy.linalg import expm

import rparm
from rparm import __main__ as cli
from rparm.linearization.largest_step import (
    LargestStep,
    Resting,
    factor,
    largest_steps,
    resting,
    transition,
)
from rparm.linearization.linear import Linear, closure
from rparm.linearization.page import steps_chart
from rparm.linearization.responses import frequency_response
from rparm.linearization.sampling import exponential, hold
from rparm.systems.master import INPUT_MODES, ORDERS
from rparm.systems.structure import Connection
from tests.equations.examples import made
from tests.support.browser import Browser
from tests.support.paths import ROOT
from tests.support.rparm_project import MISTAKES

POSE = {"q1": "30 deg", "q2": "0.1 m"}
H = 0.01


def document(command: list[str], capsys: pytest.CaptureFixture[str]) -> dict:
    """The document of a command that goes well."""
    assert cli.main(["linearize", "--json", *command]) == 0
    return json.loads(capsys.readouterr().out)


# ---- The model -----------------------------------------------------------------------------------


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_multisine_tells_the_nonlinear_arm_from_its_sampled_model_by_the_amplitude(
    fmi: int,
) -> None:
    """The difference is of second order: relative to the motion, it falls as the amplitude."""
    hanging = {"q1": "-90 deg", "q2": "0.1 m"}
    model = rparm.linearize("RPManipulator", at=hanging, trim=["tau1", "f2"], fmi=fmi)
    sampled = model.zoh(H)
    times = H * np.arange(101)
    lines = np.random.default_rng(3).uniform(0, 2 * np.pi, size=(2, 8))
    waves = [sum(np.sin(2 * np.pi * k * times + p) for k, p in enumerate(x, 1)) for x in lines]
    differences = []
    for amplitude in (1e-3, 1e-5):
        u = amplitude * np.array(waves)
        run = rparm.simulate(
            rparm.fmu("RPManipulator", fmi=fmi),
            stop_time=times[-1],
            step=H,
            start_values={**hanging, "solver_method": "taylor"},
            inputs={name: model.at[name] + u[i] for i, name in enumerate(model.inputs)},
            outputs=list(model.states),
            tolerance=1e-13,
        )
        x = np.zeros((len(times), 4))
        for i in range(len(times) - 1):
            x[i + 1] = sampled.A @ x[i] + sampled.B @ u[:, i]
        moved = np.column_stack([run[name] - model.at[name] for name in model.states])
        differences.append(np.abs(moved - x).max() / np.abs(x).max())
    assert differences[0] < 1e-3
    assert differences[1] / differences[0] == pytest.approx(1e-2, rel=0.05)


def test_it_is_that_of_python_control() -> None:
    model = rparm.linearize("RPPlant", at={**POSE, "damping1": 1.0}, trim=["tau1", "f2"])
    plain, sampled = model.ss(), model.zoh(H)
    assert plain.state_labels == list(model.states) and sampled.dt == H
    expected = control.c2d(plain, H, "zoh")
    for name in "ABCD":
        np.testing.assert_allclose(getattr(sampled, name), getattr(expected, name), atol=1e-12)
    one = model.select(["tau1"], ["q1"])
    w = np.array([0.1, 1.0, 50.0])
    np.testing.assert_allclose(frequency_response(one)(w), one.ss()(1j * w), rtol=1e-9)
    response = frequency_response(one.sampled(H))(w)
    np.testing.assert_allclose(response, one.zoh(H)(np.exp(1j * w * H)), rtol=1e-9)


def test_units_and_numbers_of_any_kind_are_taken() -> None:
    texts = rparm.linearize("RPPlant", at={"q1": "90 deg", "damping1": 1, "q2": "20 cm"})
    numbers = rparm.linearize(
        "rp_plant", at={"q1": np.pi / 2, "damping1": "1 N.m.s/rad", "q2": np.float64(0.2)}
    )
    np.testing.assert_array_equal(texts.A, numbers.A)


# ---- The command ---------------------------------------------------------------------------------

COMMAND = ["RPPlant", "--at", "q1=30deg", "coulomb_friction1=0.5", "--trim", "tau1", "f2"]


def test_the_document_and_the_files_have_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [tmp_path / f"m.{kind}" for kind in ("json", "mat", "csv")]
    command = [*COMMAND, "--step", "10ms", "--output", str(tmp_path / "page"), "--save"]
    found = document([*command, *map(str, files)], capsys)
    assert {"states", "inputs", "outputs", "A", "B", "C", "D", "at", "held", "poles"} <= set(found)
    assert found["states"] == ["q2", "dq2"] and found["held"] == ["q1", "dq1"]
    assert found["at"]["q1"] == pytest.approx(np.pi / 6)
    assert set(found["left_out"]) == {"stop_impulse1", "stop_impulse2", "impact_loss", "grasp_loss"}
    low, high = found["intervals"]["tau1"]
    assert low < found["at"]["tau1"] < high
    api = rparm.linearize(
        "RPPlant", at={"q1": "30 deg", "coulomb_friction1": 0.5}, trim=["tau1", "f2"]
    )
    np.testing.assert_array_equal(found["A"], api.A)
    assert found["zoh"]["A"] == api.zoh(0.01).A.tolist()

    saved = json.loads(files[0].read_text())
    assert saved == {key: found[key] for key in saved}
    mat = loadmat(files[1], squeeze_me=True)
    np.testing.assert_array_equal(mat["C"], found["C"])
    assert mat["states"].tolist() == found["states"] and mat["zoh"]["step"] == 0.01
    rows = list(csv.reader(files[2].open(newline="")))
    whole = np.block([[api.A, api.B], [api.C, api.D]])
    np.testing.assert_array_equal([[float(x) for x in row[1:]] for row in rows[1:]], whole)
    assert rows[0] == ["", *api.states, *api.inputs]


def test_an_end_that_is_nowhere_is_null(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A rigid stop bears every effort: files and documents have no infinity."""
    at = ["--at", "q1=2.5", "stops1=rigid", "--trim", "tau1", "f2"]
    saved = tmp_path / "m.json"
    found = document(
        ["RPPlant", *at, "--save", str(saved), "--output", str(tmp_path / "page")], capsys
    )
    low, high = found["intervals"]["tau1"]
    assert low < found["at"]["tau1"] and high is None
    assert json.loads(saved.read_text())["intervals"] == found["intervals"]


def printed(command: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """What a command prints that goes well."""
    assert cli.main(["linearize", *command]) == 0
    return capsys.readouterr().out


def test_the_terminal_says_what_was_asked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = ["--output", str(tmp_path)]
    out = printed([*COMMAND, "--inputs", "tau1,f2", "--outputs", "q2", *output], capsys)
    rows = [line.split() for line in out.splitlines()]
    tau1, f2 = ([row for row in rows if row[:1] == [name]][0] for name in ("tau1", "f2"))
    gravity = 9.81 * (np.cos(np.pi / 6) - 0.1 * np.sin(np.pi / 6))
    assert [float(x) for x in tau1[1:4]] == pytest.approx(
        [gravity, gravity - 0.5, gravity + 0.5], abs=1e-4
    )
    assert f2[1:] == ["4.905", "–", "–", "N"]
    assert ["dq2'", "0", "0", "0", "1"] in rows and ["q2", "1", "0", "0", "0"] in rows
    out = printed([*COMMAND, *output], capsys)
    assert "A, B, C and D" not in out and "Matrices: --json" in out  # too wide to be read
    held = ["RPPlant", "--at", "coulomb_friction1=99", "coulomb_friction2=99", *output]
    assert "Poles" not in printed(held, capsys)


def test_a_given_velocity_is_a_steady_motion(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    at = ["--at", "q1=30deg", "dq1=0.02", "--output", str(tmp_path)]
    out = printed(["RPPlant", *at, "--trim", "tau1", "f2"], capsys)
    assert "In steady motion: q1' = 0.02." in out and "no equilibrium" not in out
    assert "This is no equilibrium: q1' = 0.02, dq1'" in printed(["RPPlant", *at], capsys)


@pytest.mark.parametrize("width, dark", [(400, True), (900, False), (1400, True)])
def test_margins_stand_in_the_charts_and_the_page_fits(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    each_browser: Browser,
    width: int,
    dark: bool,
) -> None:
    command = ["ClosedLoop", "--break", "arm.tau1", "--step", "0.01", "--output", str(tmp_path)]
    found, browser = document(command, capsys), each_browser
    assert found["margins"]["phase"] == pytest.approx(76.345, abs=1e-3)
    assert found["margins"]["gain_up"] is None and found["margins"]["stable"]
    page = Path(found["page"]).read_text(encoding="utf-8")
    for text in ("Margins", "76.345", "32.3705 ms", "Held: controller.integral1", "--break"):
        assert text in page
    browser.open(Path(found["page"]), width=width, dark=dark)
    browser.wait("document.documentElement.dataset.ready === 'yes'")
    browser.check_quiet()
    assert browser.overflow() == 0 and browser.violations() == []
    bode, nyquist, step, poles, _ = browser.run(
        "return [...document.querySelectorAll('.drawing')].map(x => x.data.map("
        "({ x, y, name, meta, text }) => ({ x, y, name, meta, text })))"
    )
    hertz = browser.run(
        "return [...document.querySelectorAll('tr')].find(row => row.innerText.startsWith('phase'))"
        ".cells[2].innerText"
    )
    gain, phase, *_, mark = bode
    assert mark["meta"] == "phase" and mark["x"] == pytest.approx([float(hertz)] * 2, rel=1e-5)
    assert np.interp(mark["x"][0], gain["x"], gain["y"]) == pytest.approx(0.0, abs=1e-3)
    ends = np.interp(mark["x"][0], phase["x"], phase["y"]), -180.0
    assert mark["y"] == pytest.approx(ends, abs=1e-3)
    assert mark["y"][0] - mark["y"][1] == pytest.approx(76.345, abs=1e-3)
    (dot,) = [trace for trace in nyquist if trace.get("meta") == "phase"]
    assert np.hypot(dot["x"][0], dot["y"][0]) == pytest.approx(1.0, abs=1e-6)
    assert step[0]["name"] == "step of arm.tau1 by 1 N·m"
    for text in poles[0]["text"]:
        assert re.search(r"pole (0|-20) 1/s<br>(damping 1<br>)?arm\.d?q[12] \d+ %<br>", text)


PRESS = """
name = "Press"
[parameters]
p0 = { start = 2e7, unit = "Pa" }
G = { start = 2.5e-13, unit = "m3/(s.Pa)" }
E = { start = 1e12, unit = "Pa/m3" }
[inputs]
q = { start = 5e-6, unit = "m3/s" }
spare = {}
[states]
"p[i,j]" = { for = "i = 1..2, j = 1..2", unit = "Pa", derivative = "E * (q - G * p[i,j])" }
[outputs]
leak = { value = "G * p[1,2]", unit = "m3/s" }
fixed = { value = "G * p0", unit = "m3/s" }
"""


def test_small_units_are_shown_and_what_is_missing_in_charts_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Names with indexes between commas; a flow of 5e-6 m3/s beside 200 bar."""
    command = [str(made(PRESS)), "--output", str(tmp_path), "--trim", "p[1,1],p[1,2]"]
    command += ["p[2,1], p[2,2]", "--outputs", "p[1,2],leak,fixed"]
    found = document(command, capsys)
    assert found["outputs"] == ["p[1,2]", "leak", "fixed"]
    page = Path(found["page"]).read_text(encoding="utf-8")
    assert "5e−6" in page and "leak by q" in page
    assert "These outputs respond to no input and are not in the charts: fixed." in page
    assert "These inputs move no output and are not in the charts: spare." in page


def test_samples_too_dense_to_be_seen_are_not_drawn() -> None:
    model = rparm.linearize("RPManipulator").select(["tau1"], ["q1"])
    counts = [len(steps_chart(model, step, {}).data["curves"]) for step in (1e-2, 1e-9)]
    assert counts == [2, 1]


def test_a_system_says_its_largest_steps(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = document(["closed_loop", "--output", str(tmp_path)], capsys)
    steps = {(x["order"], x["inputs"]): x["step"] for x in found["largest_steps"]}
    assert steps["jacobi", "held"] == pytest.approx(21.297e-3, rel=1e-4)
    assert "Largest stable communication step" in Path(found["page"]).read_text()


@pytest.mark.parametrize("turns", [0.0, 0.5, 1.0, -0.5])
def test_at_gives_a_first_guess_of_what_is_trimmed(turns: float) -> None:
    """Without a torque the arm hangs or stands, its center of mass below or above the joint."""
    m1, m2, lc1, l1, a, q2 = 2.0, 1.0, 0.25, 0.5, 0.1, 0.1
    exact = math.atan2(m1 * lc1 + m2 * (l1 + q2), m2 * a) + 2 * math.pi * turns
    guess = {"q1": exact + 0.2, "q2": q2, "f2": 20.0}
    found = rparm.linearize("RPPlant", at=guess, trim=["q1", "f2"])
    assert found.at["q1"] == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize("command, message", MISTAKES["linearize"]["rows"])
def test_mistakes_are_one_line(
    tmp_path: Path, command: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["linearize", *command, "--output", str(tmp_path)]) == 2
    error = capsys.readouterr().err.strip()
    assert message in error and "\n" not in error


# ---- The largest stable step ---------------------------------------------------------------------


WAYS = [(order, inputs) for order in ORDERS for inputs in INPUT_MODES]
NEAR = 0.005  # of the predicted step: where simulations die out and grow
SYSTEMS = {"ClosedLoop": replace(LOOP, sequence=()), "Machine": MACHINE}


@contextmanager
def opened(fmu: Path, name: str, **changes: object) -> Iterator[Resting]:
    with resting(fmu.with_name(f"{name}.ssp"), replace(SYSTEMS[name], **changes)) as system:
        yield system


@pytest.mark.parametrize("way", WAYS, ids=", ".join)
@pytest.mark.parametrize("name", SYSTEMS)
def test_simulations_die_out_below_and_grow_above(
    fmu: Path, name: str, way: tuple[str, str]
) -> None:
    with opened(fmu, name) as system:
        step = system.predicted(way).step
        below, above = system.growth(way, step * (1 - NEAR)), system.growth(way, step * (1 + NEAR))
        assert below < 1.0 < above
        limit = system.limit(way)
    assert limit.predicted == step and limit.passed
    assert limit.measured == pytest.approx(step, rel=NEAR)


def test_pages_say_what_is_predicted(fmu: Path) -> None:
    with opened(fmu, "Machine") as system:
        found = {way: system.predicted(way).step for way in WAYS}
    page = (ROOT / "models" / "machine" / "README.md").read_text(encoding="utf-8")
    for order, start in (("jacobi", "| Jacobi |"), ("gauss_seidel", "| Gauss-Seidel, in the")):
        (row,) = [line for line in page.splitlines() if line.startswith(start)]
        for inputs, cell in zip(INPUT_MODES, row.split("|")[2:], strict=False):
            assert cell.strip() == f"{1e3 * found[order, inputs]:.3f} ms"
    page = (ROOT / "models" / "closed_loop" / "coupling.md").read_text(encoding="utf-8")
    with opened(fmu, "ClosedLoop", sequence=LOOP.sequence) as system:
        for order, inputs in WAYS:
            step = system.predicted((order, inputs)).step
            name = f"{order.replace('_', '-').title()}, {inputs}"
            assert f"| {name} | {1e3 * step:.3f} ms |" in page


@pytest.mark.parametrize("way", WAYS, ids=", ".join)
@pytest.mark.parametrize("step", [1e-3, 2e-2])
def test_a_mass_at_a_sampled_wall_grows_as_its_theory_says(
    way: tuple[str, str], step: float
) -> None:
    """The factor of models/machine/wall_limit.py, which is derived by hand."""
    contact = Contact(mass=2.0, stiffness=300.0, damping=1.5)
    zero = np.zeros(1)
    mass = Linear(
        ("x", "v"), ("f",), ("x", "v"), np.array([[0.0, 1], [0, 0]]), np.array([[0.0], [-0.5]]),
        np.eye(2), np.zeros((2, 1)), np.zeros(2), zero, np.zeros(2), np.zeros(2),
    )  # fmt: skip
    wall = Linear(
        (), ("x", "v"), ("f",), np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)),
        np.array([[300.0, 1.5]]), np.zeros(0), np.zeros(2), zero, np.zeros(0),
    )  # fmt: skip
    wires = [Connection("mass", n, "wall", n) for n in "xv"] + [
        Connection("wall", "f", "mass", "f")
    ]
    found = np.abs(np.linalg.eigvals(transition({"mass": mass, "wall": wall}, wires, step, *way)))
    assert found.max() == pytest.approx(growth(contact, step, *way), rel=1e-9)


def test_an_unstable_system_has_no_stable_step(fmu: Path) -> None:
    undamped = {"controller.Kd1": 0.0, "controller.Kd2": 0.0}
    with opened(fmu, "ClosedLoop", values=undamped) as system:
        found = [system.predicted(way) for way in WAYS]
    assert all(x.step == 0 and math.isnan(x.frequency) for x in found)


def test_without_a_loop_there_is_no_limit() -> None:
    zero = np.zeros(1)
    alone = Linear(
        ("x",), ("u",), ("x",), -np.eye(1), np.eye(1), np.eye(1), np.zeros((1, 1)), *[zero] * 4
    )
    assert largest_steps({"a": alone, "b": alone}, [Connection("a", "x", "b", "u")]) == []
    opposed = replace(alone, B=-alone.B)  # x' = -x - x
    stable = largest_steps({"a": opposed}, [Connection("a", "x", "a", "u")])
    assert all(isinstance(x, LargestStep) and x.step > 0 for x in stable)


def test_steps_of_years_keep_their_digits() -> None:
    """x' = -a x + c y, y' = -g x, and a^2 above c g: late by a step, x dies out up to a / (c g)."""
    a, c, g = 4e-4, 1.3, 1e-12
    A, B, zero = np.array([[-a, c], [0, 0]]), np.array([[0.0], [1.0]]), np.zeros
    plant = Linear(
        ("x", "y"), ("u",), ("x",), A, B, np.eye(1, 2), zero((1, 1)), *map(zero, (2, 1, 1, 2))
    )
    none = zero((0, 0)), zero((0, 1)), zero((1, 0)), np.array([[-g]])
    law = Linear((), ("x",), ("u",), *none, *map(zero, (0, 1, 1, 0)))
    wires = [Connection("plant", "x", "law", "x"), Connection("law", "u", "plant", "u")]
    ways = [("jacobi", "held"), ("gauss_seidel", "held")]
    steps = [x.step for x in largest_steps({"plant": plant, "law": law}, wires, ways)]
    assert steps == pytest.approx([a / c / g, 2 * a / c / g], rel=1e-5)  # but for 1 / (a h)
    h = 6.7e8
    F, G, S = hold(A, B, h)
    exact = c / a * np.array([1, h - 1 / a, h * h / 2 - h / a + 1 / a**2])
    np.testing.assert_allclose([F[0, 1], G[0, 0], S[0, 0]], exact, rtol=1e-13)


def test_a_motion_that_neither_grows_nor_dies_out_has_no_stable_step() -> None:
    """An undamped mass on a spring, at each step exactly; in units 12 decades apart."""
    for unit in (1.0, 1e12):
        A = np.array([[0, unit, 0], [-1 / unit, 0, 0], [0, 0, -1.0]])
        opposed = Linear(
            ("x", "v", "y"), ("u",), ("x",), A, np.zeros((3, 1)), np.eye(1, 3), np.zeros((1, 1)),
            *map(np.zeros, (3, 1, 1, 3)),
        )  # fmt: skip
        whole = transition({"a": opposed}, [Connection("a", "x", "a", "u")], 0.01)
        assert factor(whole) == 1.0
    assert factor(np.diag([0.5, 1 - 1e-9])) == 1 - 1e-9
    memory = [[1 - 1e-8, 0.5, 0], [0, 0, 1], [0, 0, 0]]  # a delay of two steps
    assert factor(np.array(memory)) == 1 - 1e-8


def test_what_no_power_leads_to_is_exactly_0() -> None:
    """exp of two chains, and of a slow state beside fast ones, in units 12 decades apart."""
    source = np.random.default_rng(7)
    for _ in range(10):
        units = 10 ** source.uniform(-6, 6, 6)
        A = np.triu(source.normal(size=(6, 6))) * (source.random((6, 6)) < 0.5)
        A[np.diag_indices(6)] = -(10 ** source.uniform(-4, 2, 6))
        found, reached = exponential(A * units[:, None] / units), closure(A != 0)
        assert not found[~reached].any()
        with mpmath.workdps(80):
            exact = np.array(mpmath.expm(mpmath.matrix(A.tolist())).tolist(), float)
        rounding = 1e-13 * expm(np.where(np.eye(6), A, np.abs(A)))
        assert (np.abs(found / units[:, None] * units - exact) <= rounding).all()
