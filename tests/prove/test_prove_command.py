"""`prove` from the command line and from Python."""

import json
import math
import random
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from flint import arb

import rparm
from rparm import project
from rparm.__main__ import main
from rparm.commands import prove
from rparm.errors import UserError
from rparm.fmi.fmu_file import Fmu
from rparm.proof import enclosure
from rparm.proof import errors as proof
from rparm.runs import comparison
from rparm.runs import scenario as scenarios
from rparm.runs.scenario import Scenario
from rparm.units import minus, rounded_up
from tests.equations.examples import FOLDER, quick
from tests.prove.problems import PENDULUM
from tests.support.rparm_project import MISTAKES

PROVER = enclosure.prover_of(project.scenario_file("free_fall"))
SCENARIOS = sorted(project.models()["rp_manipulator"].glob("scenarios/*.toml"))
STATES = {"q1", "q2", "dq1", "dq2"}
OWN = """
model = "rp_manipulator"
title = "Own"
description = "A short fall."
tolerance = 1e-8
time = { start = 0.0, stop = 0.2, step = 0.01 }
"""


@pytest.fixture
def own(tmp_path: Path) -> Path:
    path = tmp_path / "own.toml"
    path.write_text(f"{OWN}initial = {{ q1 = 0.3 }}\n")
    return path


@contextmanager
def opened(path: Path) -> Iterator[tuple[Fmu, Scenario]]:
    """The arm, and a scenario of it."""
    with Fmu(rparm.fmu("rp_manipulator")) as fmu:
        yield fmu, scenarios.load(path, fmu.model)


def document(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict:
    with TemporaryDirectory() as folder:
        main(["prove", "--output", folder, *arguments, "--json"])
    return json.loads(capsys.readouterr().out)


def test_errors_of_each_method(
    own: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The page has a plot a state, a curve a method; its table has what is printed."""
    found = document(capsys, str(own), "--check", "--output", str(tmp_path))
    page = (tmp_path / "proofs" / "own.html").read_text()
    assert found["exit_code"] == 0 and found["checked"]["steps"] >= 20
    assert set(found["methods"]) == {"cvode_adams", "cvode_bdf", "erk", "taylor"}
    for errors in found["methods"].values():
        assert set(errors) == STATES
        for name, error in errors.items():
            assert 0 < error["radius"] < 1e-28 < error["error"] < 1e-6
            assert 0 <= error["at"] <= 0.2
            assert f"proven error of {name}" in page
            assert minus(f"{rounded_up(error['error'], 2)} at {error['at']:.4g} s") in page
    assert Path(found["page"]).samefile(tmp_path / "proofs" / "own.html")
    assert "The proof assumes the equations of motion" in page


def test_proven_error_is_what_a_run_and_the_interval_say(own: Path) -> None:
    with opened(own) as (fmu, scenario):
        found = PROVER.enclose(scenario).of(PROVER.states)
        bounds = proof.error_bounds(fmu, scenario, found, "erk", 1e-8)
        error = proof.largest_errors(bounds, found)["q1"]
    own.write_text(own.read_text() + 'parameters = { solver_method = "erk" }\n')
    run = rparm.Scenario(own).run()
    apart = np.abs(run["q1"] - found.high[:, 0])
    assert error.error == pytest.approx(apart.max(), rel=1e-3)
    assert error.at == run["time"][apart.argmax()]


def test_start_within_an_interval(
    own: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The fall multiplies what the start was off by: each bound is that, and more."""
    arguments = ["--method", "taylor", "--within", "0.01deg", "--output", str(tmp_path)]
    found = document(capsys, str(own), *arguments)["methods"]["taylor"]
    for name in STATES:
        assert 1e-5 < found[name]["radius"] < 1e-2 or name == "q2"
    assert found["q1"]["error"] >= np.radians(0.01)
    page = (tmp_path / "proofs" / "own.html").read_text()
    assert "--within</span>" in page and "0.01deg" in page
    assert '"kind":"bounds"' in page and '"name":"taylor at ' in page


TYPED = {
    "1deg": arb.pi() / 180, "0.3deg": arb.pi() / 600,
    "0.7mrad": arb("0.0007"), "1mrad": arb("0.001"),
}  # fmt: skip


@pytest.mark.parametrize(("typed", "exact"), TYPED.items())
def test_no_start_is_lost_in_rounding(typed: str, exact: arb) -> None:
    """The radius is not below what was typed, and hardly above."""
    with Fmu(rparm.fmu("rp_manipulator")) as fmu:
        radius = prove._within(typed, PROVER, fmu)["q1"]
    assert exact < arb(radius) < exact * (1 + 2.0**-40)


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_each_scenario(path: Path) -> None:
    """Intervals are narrow, the reference is right, and `taylor` is proven to 1e-13."""
    with opened(path) as (fmu, scenario):
        found = PROVER.enclose(scenario)
        good = proof.proven_reference(fmu, scenario, found)
        states = found.of(PROVER.states)
        errors = proof.error_bounds(fmu, scenario, states, "taylor", 1e-13)
    assert states.radius.max() < 1e-27 and good.radius < 1e-25
    assert good.passed and not good.wrong
    assert errors.max() <= 1e-13


# ---- Models of equations -------------------------------------------------------------------------

OF_EQUATIONS = {  # the largest error that is proven, and how wide intervals are at most
    "van_der_pol": (1e-7, 1e-26), "lorenz": (1e-2, 1e-20), "two_body_orbit": (10.0, 1e-13),
    "dc_motor": (1e-6, 1e-26), "bouncing_ball": (1e-9, 1e-28), "pendulum": (1e-5, 1e-24),
}  # fmt: skip


@pytest.mark.parametrize("name", OF_EQUATIONS)
def test_a_file_with_equations(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Its experiment runs, as a scenario that says the same, up to the first event."""
    path = PENDULUM if name == "pendulum" else FOLDER / f"{name}.toml"
    most, widest = OF_EQUATIONS[name]
    checked = ["--check"] if name in ("pendulum", "bouncing_ball") else []
    found = document(capsys, str(path), *checked)
    assert found["exit_code"] == 0 and len(found["methods"]) == 4
    for errors in found["methods"].values():
        for error in errors.values():
            assert 0 <= error["radius"] < widest and error["error"] < most
    assert not checked or found["checked"]["steps"] > 10
    event = (found["event"], found["holds_up_to"]) if "event" in found else None
    ball = ("event impact (h < 0)", pytest.approx(math.sqrt(2 / 9.81)))
    assert event == (ball if name == "bouncing_ball" else None)


def test_a_scenario_of_a_model_of_equations(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its FMU has the equations with it; values and held inputs are those of the scenario."""
    fmu = quick(FOLDER / "dc_motor.toml", tmp_path / "built")
    path = tmp_path / "run.toml"
    head = OWN.replace('model = "rp_manipulator"', f'fmu = "{fmu.name}"')
    path.write_text(f"{head}[parameters]\nR = 2.0\n[inputs.voltage]\ntable = [[0, 0], [0.2, 6]]\n")
    fmu.rename(tmp_path / fmu.name)
    found = document(capsys, str(path), "--check", "--method", "taylor")
    assert found["exit_code"] == 0
    assert all(
        e["radius"] < 1e-26 and e["error"] < 1e-6 for e in found["methods"]["taylor"].values()
    )


def test_what_cannot_be_enclosed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "model.toml"
    head = 'name = "M"\nexperiment = { stop = 2.0, step = 0.5 }\n[states]\n'
    path.write_text(head + 'x = { start = 1.0, derivative = "-1 / x" }')
    assert main(["prove", str(path), "--quiet", "--output", str(tmp_path)]) == 1
    (line,) = capsys.readouterr().out.splitlines()
    reason = "no further: [states]: x: derivative: -1 / x: the divisor may be 0"
    assert line.startswith("failed: the proof holds up to 0.4999999999") and line.endswith(reason)
    path.write_text(head + 'x = { derivative = "1" }\n[sampled.s]\nevery = "1"\nset = { x = "0" }')
    assert main(["prove", str(path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert str(path) in line


# ---- References ----------------------------------------------------------------------------------


@pytest.fixture
def copies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Copies of the references, which `prove` reads."""
    folder = tmp_path / "references"
    shutil.copytree(project.references(project.model("rp_manipulator")), folder)
    monkeypatch.setattr(project, "references", lambda _: folder)
    return folder


def table_of(path: Path) -> list[list[str]]:
    return [line.split(",") for line in path.read_text().splitlines()]


def write_table(path: Path, table: list[list[str]]) -> None:
    path.write_text("".join(",".join(row) + "\n" for row in table))


COLUMNS = [
    "q1", "q2", "dq1", "dq2", "ddq1", "ddq2", "ee_x", "ee_y", "ee_vx", "ee_vy",
    "kinetic_energy", "potential_energy", "total_energy", "actuator_power",
]  # fmt: skip
FAULTS: list[Callable[[float], float]] = [
    lambda x: math.nextafter(x, math.inf), lambda x: math.nextafter(x, -math.inf),
    lambda x: x + 3 * math.ulp(x), lambda x: x + 1e-9, lambda x: x + 1e-3,
    lambda x: -x or 1.0, lambda x: 0.0 if x else 5e-324, lambda _: 1e300,
]  # fmt: skip


@pytest.mark.parametrize("name", ["early_start", "coasting"])  # coasting has columns of zeros
def test_every_wrong_value_of_a_reference_is_found(name: str, copies: Path) -> None:
    """One fault at a time, of each kind, in every column: at the start, the end and between."""
    draw = random.Random(40)
    with opened(project.scenario_file(name)) as (fmu, scenario):
        exact = PROVER.enclose(scenario)
        right = comparison.load_reference(scenario, fmu.model)
        assert list(right.names) == COLUMNS
        for i, column in enumerate(COLUMNS):
            for row in (0, draw.randrange(1, len(right.values) - 1), len(right.values) - 1):
                for kind, fault in enumerate(FAULTS):
                    values = right.values.copy()
                    values[row, i] = fault(float(values[row, i]))
                    planted = replace(right, values=values)
                    with pytest.MonkeyPatch.context() as patch:
                        patch.setattr(comparison, "load_reference", lambda *_, x=planted: x)
                        good = proof.proven_reference(fmu, scenario, exact)
                    (wrong,) = good.wrong
                    assert not good.passed and good.values - good.nearest == 1, kind
                    assert (wrong.line, wrong.column) == (row + 2, column), kind
                    text = f"{copies / name / 'RPManipulator_ref.csv'}, line {row + 2}, "
                    assert str(wrong).startswith(f"{text}column {column}: found "), kind


@pytest.mark.parametrize("column", ["q2", "actuator_power"])
def test_a_scenario_fails_with_a_wrong_value_in_its_reference(
    column: str, copies: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = copies / "constant_effort_single_step" / "RPManipulator_ref.csv"
    table = table_of(path)
    place = table[0].index(f'"{column}"')
    table[2][place] = repr(math.nextafter(float(table[2][place]), math.inf))
    write_table(path, table)
    arguments = ["prove", path.parent.name, "--method", "taylor", "--output", str(tmp_path)]
    where = f"{path}, line 3, column {column}: found {table[2][place]}, the exact value is within"
    assert main([*arguments, "--quiet"]) == 1
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith(f"failed: {where}")
    assert where in (tmp_path / "proofs" / f"{path.parent.name}.html").read_text()
    found = document(capsys, path.parent.name, "--within", "1e-12", "--method", "erk")
    assert found["exit_code"] == 1
    (wrong,) = found["reference"]["wrong"]
    assert (Path(wrong["file"]), wrong["line"], wrong["column"]) == (path, 3, column)


def test_all_references_fail_with_one(copies: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Rows whose values are swapped, while times stay."""
    path = copies / "sixtieth" / "RPManipulator_ref.csv"
    table = table_of(path)
    table[8][1:], table[9][1:] = table[9][1:], table[8][1:]
    write_table(path, table)
    with TemporaryDirectory() as folder:
        assert main(["prove", "--output", folder]) == 1
        page = (Path(folder) / "proofs" / "references.html").read_text()
    out = capsys.readouterr().out.splitlines()
    changing = sum(a != b for a, b in zip(table[8][1:], table[9][1:], strict=True))
    assert out[-1].startswith(f"failed: {path}, line 9, column q1: found {float(table[8][1])}, ")
    assert f"; {2 * changing} values are wrong; " in out[-1]
    assert sum(line.endswith("passed") for line in out) == 10
    assert [line.split()[0] for line in out if line.endswith("FAILED")] == ["sixtieth"]
    assert "FAILED" in page and "line 9, column q1" in page


def test_a_truncated_reference_is_refused(copies: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = copies / "sixtieth" / "RPManipulator_ref.csv"
    path.write_bytes(path.read_bytes()[:-30])
    assert main(["prove", "sixtieth"]) == 2
    assert f"{path}, line 362: is cut off in the middle" in capsys.readouterr().err


ABOVE, BELOW, HALF = math.nextafter(1.0, 2.0), math.nextafter(1.0, 0.0), 2.0**-53


@pytest.mark.parametrize(
    ("value", "low", "is_nearest"),
    [
        (1.0, 0.0, True), (ABOVE, 0.0, False), (BELOW, 0.0, False), (1.0, 0.99 * HALF, True),
        (1.0, -0.51 * HALF, False),  # doubles are denser
        (1.0, HALF, False),  # between two doubles
    ],
)  # fmt: skip
def test_a_value_that_is_not_the_nearest(value: float, low: float, is_nearest: bool) -> None:
    """Of an exact value in a tiny interval around 1 + low."""
    one = np.ones((1, 1))
    exact = enclosure.Enclosure(np.zeros(1), ("x",), one, low * one, 1e-20 * one, None, ())
    assert proof.is_nearest(value * one, exact, np.arange(1)) == is_nearest


def test_where_the_proof_ends(own: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = document(capsys, str(own), "--within", "100")
    assert found["exit_code"] == 1
    assert 0 <= found["holds_up_to"] < 0.2


@pytest.mark.parametrize(("arguments", "text"), MISTAKES["prove"]["rows"])
def test_mistakes(arguments: list[str], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["prove", *arguments]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert text in line


def test_a_proof_that_takes_too_long_is_given_up() -> None:
    with (
        opened(project.scenario_file("sine_efforts")) as (_, scenario),
        pytest.raises(UserError, match="takes too long"),
    ):
        PROVER.enclose(scenario, seconds=0.01)


def test_from_python(own: Path) -> None:
    """The exact start, and a bound that is near what two methods differ by."""
    scenario = rparm.Scenario(own)
    tight, loose = (scenario.proven_errors(method="erk", tolerance=x) for x in (1e-11, 1e-5))
    assert set(tight) == STATES
    assert all(tight[name] < loose[name] for name in STATES)


def test_a_broad_start_is_proven_in_pieces() -> None:
    """The pieces cover the start, and their intervals hold motions from its ends."""
    with opened(project.scenario_file("hanging_swing")) as (_, scenario):
        broad = PROVER.enclose(scenario, {"q1": 2e-4})
        assert broad.stopped is None and len(broad.starts) > 1
        for off in (-1.99e-4, -0.5e-4, 0.0, 1.99e-4):
            q1 = scenario.start_values["q1"] + off
            one = PROVER.enclose(replace(scenario, initial=scenario.initial | {"q1": q1}))
            assert np.all(np.abs(one.high - broad.high) <= broad.radius)


def test_halves_cover_a_start() -> None:
    start = {"x": (0.1, 0.3), "y": (1.0, 0.0)}
    left, right = enclosure.halves(start)
    assert left["y"] == right["y"] == (1.0, 0.0)
    ends = [(Fraction(value), Fraction(radius)) for value, radius in (left["x"], right["x"])]
    assert ends[0][0] - ends[0][1] <= Fraction(0.1) - Fraction(0.3)
    assert ends[0][0] + ends[0][1] >= ends[1][0] - ends[1][1]
    assert ends[1][0] + ends[1][1] >= Fraction(0.1) + Fraction(0.3)


def test_the_page_of_a_scenario_says_what_is_proven(tmp_path: Path) -> None:
    assert main(["run", "coasting", "--tolerance", "1e-8", "--output", str(tmp_path)]) == 0
    page = (tmp_path / "scenarios" / "coasting.html").read_text()
    assert "proven error at most" in page
    assert "assumes the equations of motion, exact parameters and inputs" in page
