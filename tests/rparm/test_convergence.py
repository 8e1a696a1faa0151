"""How the error falls with the communication step: slopes 1 to 4 with input derivatives 0 to 3, and
slope 4 with intermediate update of FMI 3.0."""

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from rparm import result_tables
from rparm.errors import UserError
from rparm.fmi.fmu_file import Fmu
from rparm.runs import convergence
from rparm.runs.convergence import (
    FACTORS,
    NAMES,
    POWERS,
    Convergence,
    Problem,
)
from tests.support.paths import ROOT
from tests.support.rparm_project import MISTAKES, Console, declared, load, repacked

MODEL = ROOT / "models" / "rp_manipulator"
PATH = MODEL / "convergence" / "smooth_inputs.toml"


@pytest.fixture(scope="module")
def problem() -> Problem:
    return convergence.load(PATH, declared(MODEL.name))


@pytest.fixture(scope="module")
def updated(opened: Fmu) -> Iterator[Fmu]:
    """The FMU of FMI 3.0 beside the other one."""
    with Fmu(opened.path.parent / "fmi3" / opened.path.name) as fmu:
        yield fmu


@pytest.fixture(scope="module")
def study(opened: Fmu, updated: Fmu, problem: Problem) -> Convergence:
    return convergence.study(opened, problem, updated=updated)


def made_up(problem: Problem, *coefficients: float, floor: float = 1e-13) -> Convergence:
    """Errors that are coefficient * step^power + floor."""
    powers = zip(coefficients, POWERS, strict=False)
    errors = [c * problem.steps**power + floor for c, power in powers]
    return Convergence(problem, np.array(errors))


# ---- The FMU -----------------------------------------------------------------------------------


@pytest.mark.parametrize("case", range(len(NAMES)))
def test_order_of_convergence(study: Convergence, case: int) -> None:
    errors, used = study.errors[case], study.fitted[case]
    assert np.all(np.isfinite(errors))
    assert list(study.problem.steps) == pytest.approx([1e-3 * factor for factor in FACTORS])
    assert np.all(errors[used] >= 100 * study.integration_error)
    assert used.all() if case <= 2 else used[:4].all()
    slope = np.polyfit(np.log10(study.problem.steps[used]), np.log10(errors[used]), 1)[0]
    assert study.slopes[case] == pytest.approx(slope, rel=1e-9)
    assert abs(slope - (1, 2, 3, 4, 4)[case]) <= 0.2
    assert study.holds(case)


# ---- Fit and verdict ---------------------------------------------------------------------------


def test_errors_near_that_of_the_integration_do_not_count(problem: Problem) -> None:
    found = made_up(problem, 1.0, 10.0, 100.0, 100.0)
    assert found.integration_error == pytest.approx(1e-13 + 1e-10)
    assert found.fitted.tolist()[-1] == [True] * 5 + [False] * 2
    assert found.passed and found.slopes[3] == pytest.approx(4, abs=0.01)


@pytest.mark.parametrize(
    ("coefficients", "floor", "complaint"),
    [
        ((1.0, 2.0, 3.0, 0.0), 1e-4, "1st derivatives: slope"),  # all lost in the integration
        ((1.0, 2.0, 1e-3, 4.0), 1e-9, "2nd derivatives: slope"),
    ],
)
def test_slopes_from_too_few_errors_fail(
    problem: Problem,
    coefficients: tuple[float, ...],
    floor: float,
    complaint: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    found = made_up(problem, *coefficients, floor=floor)
    assert not found.passed
    assert any(text.startswith(complaint) for text in found.violations)
    result_tables.print_convergence(found)
    assert "FAILED" in capsys.readouterr().out


def test_wrong_slopes_fail(problem: Problem) -> None:
    found = made_up(problem, 1.0, 10.0, 100.0, 100.0, 2.0, floor=0.0)
    found.errors[0], found.errors[-1] = problem.steps**1.3, problem.steps**3.5
    assert [text[:31] for text in found.violations] == [
        "inputs held: slope 1.30 over 7 ", "intermediate update: slope 3.50",
    ]  # fmt: skip


def test_values_that_are_not_finite_fail(problem: Problem) -> None:
    found = made_up(problem, 1.0, 10.0, 100.0, 100.0, floor=0.0)
    found.errors[1, 2] = np.nan
    assert not found.passed


def test_errors_that_cancel_are_no_estimate(problem: Problem) -> None:
    """With intermediate update, the error at the shortest step may be small by chance."""
    found = made_up(problem, 1.0, 10.0, 100.0, 100.0, 2.0, floor=0.0)
    found.errors[-1, -1] = 1e-15
    assert found.integration_error == found.errors[-1, -2]
    assert found.fitted[-1].tolist() == [True] * 4 + [False] * 3
    assert found.passed


# ---- Files and report --------------------------------------------------------------------------


def test_inputs_that_are_not_smooth_are_refused(problem: Problem) -> None:
    with pytest.raises(UserError, match=r"hanging_swing.toml: \[inputs.f2\]: expected sines"):
        convergence.smooth_inputs(load("hanging_swing"))


@pytest.mark.parametrize(
    ("content", "reason"), [(None, "cannot be used"), *MISTAKES["exact_state"]["rows"]]
)
def test_damaged_exact_states_are_refused(tmp_path: Path, content: str | None, reason: str) -> None:
    model = tmp_path / "models" / "arm"
    for folder in ("convergence", "references/smooth_inputs"):
        (model / folder).mkdir(parents=True)
    path = model / "convergence" / PATH.name
    path.write_bytes(PATH.read_bytes())
    if content is not None:
        (model / "references/smooth_inputs/exact.json").write_text(content)
    with pytest.raises(UserError, match=f"exact.json: {reason}"):
        convergence.load(path, declared(MODEL.name))


# ---- Command line ------------------------------------------------------------------------------


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the project with one quick scenario, for the command line to work in."""
    model, scenario = tmp_path / "models" / MODEL.name, "constant_effort_single_step"
    (model / "scenarios").mkdir(parents=True)
    shutil.copy(MODEL / "scenarios" / f"{scenario}.toml", model / "scenarios")
    shutil.copytree(PATH.parent, model / "convergence")
    for name in (scenario, PATH.stem):
        shutil.copytree(MODEL / "references" / name, model / "references" / name)
    monkeypatch.setattr("rparm.project.ROOT", tmp_path)
    return tmp_path


@pytest.mark.parametrize("versions", ["2", "23"])
def test_run_of_all_measures_the_order(
    project: Path,
    fmu: Path,
    updated: Fmu,
    study: Convergence,
    console: Console,
    monkeypatch: pytest.MonkeyPatch,
    versions: str,
) -> None:
    """Intermediate update only with the FMU of FMI 3.0."""

    def known(fmu: Fmu, problem: Problem, _: object, other: Fmu | None) -> Convergence:
        assert [x.model.fmi_version[0] for x in (fmu, other) if x] == list(versions)
        return Convergence(problem, study.errors[: 3 + len(versions)])

    monkeypatch.setattr(convergence, "study", known)
    build, report = project / "build", project / "report"
    (build / "fmi3").mkdir(parents=True)
    shutil.copy(fmu, build)
    if "3" in versions:
        shutil.copy(updated.path, build / "fmi3")
    one = () if versions == "23" else ("--fmi", versions)
    code, out, _ = console("run", *one, "--report", report)
    found = [line.split() for line in out.splitlines() if line.startswith(NAMES)]
    slopes = [1, 2, 3, 4, 4] if "3" in versions else [1, 2, 3, 4]
    assert code == 0 and [row[-1] for row in found] == ["passed"] * len(slopes)
    assert [round(float(row[-2])) for row in found] == slopes
    href = f'href="studies/{PATH.stem}.html"'
    assert href in (report / "index.html").read_text(encoding="utf-8")
    page = (report / "studies" / f"{PATH.stem}.html").read_text(encoding="utf-8")
    for name, row in zip(NAMES, found, strict=False):
        assert f"<td>{name}</td>" in page and f">{float(row[-2]):.2f}</td>" in page
    assert "FAILED" not in page and ("at four times of a step" in page) == ("3" in versions)


@pytest.mark.parametrize("arguments", [["constant_effort_single_step"], ["--tolerance", "1e-6"]])
def test_other_runs_do_not(
    project: Path, fmu: Path, console: Console, arguments: list[str]
) -> None:
    folder = project / "report"
    code, out, _ = console("run", *arguments, "--fmu", fmu, "--report", folder)
    assert code == 0 and PATH.stem not in out
    assert not (folder / "studies" / f"{PATH.stem}.html").exists()


def test_run_with_another_exact_state_fails(project: Path, fmu: Path, console: Console) -> None:
    file = project / "models" / MODEL.name / "references" / PATH.stem / "exact.json"
    content = json.loads(file.read_text())
    content["final"]["q1"] += 1e-4
    file.write_text(json.dumps(content))
    code, out, _ = console("run", "--fmu", fmu, "--report", project / "report")
    assert code == 1 and "smooth_inputs: 3rd derivatives: slope" in out
    assert "\nfailed: 1 scenario: smooth_inputs; " in out
    assert "FAILED" in (project / "report/index.html").read_text(encoding="utf-8")
    page = (project / f"report/studies/{PATH.stem}.html").read_text(encoding="utf-8")
    assert "3rd derivatives: slope" in page and "intermediate update" not in page


def test_fmu_that_does_not_interpolate_is_left_out(
    project: Path, fmu: Path, console: Console
) -> None:
    def change(xml: str) -> str:
        return xml.replace(' canInterpolateInputs="true"', "")

    plain = repacked(fmu, project / "plain.fmu", change)
    code, out, _ = console("run", "--fmu", plain, "--report", project / "report")
    assert code == 0 and "smooth_inputs: left out" in out
