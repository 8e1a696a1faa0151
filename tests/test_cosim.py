"""The cosim package: running, references, error measure, accuracy, report, command line."""

import math
import os
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import ROOT
from fmpy import fmi2

from cosim import __main__ as cli
from cosim import accuracy, reference, report, simulation, variables
from cosim import scenario as scenarios
from cosim.accuracy import Runs, Sweep
from cosim.errors import UserError
from cosim.files import write_csv
from cosim.reference import Reference
from cosim.scenario import Scenario
from cosim.unit import Fmu

NAMES = list(scenarios.find_all(ROOT))
SHORT, LONG = "constant_effort_single_step", "constant_effort"  # the same motion
MAKE_REFERENCES = "build/venv/bin/python models/rp_manipulator/references/make_references.py"


def load(name: str, root: Path = ROOT) -> Scenario:
    return scenarios.load(scenarios.find(root, name))


@pytest.fixture(scope="module")
def opened(fmu: Path) -> Iterator[Fmu]:
    with Fmu(fmu) as unit:
        yield unit


@pytest.fixture(scope="module")
def runs(opened: Fmu) -> Iterator[Runs]:
    """Of all models, whose FMUs lie in one folder."""
    others = {"rp_controller": "RPController.fmu", "rp_trajectory": "RPTrajectory.fmu"}
    with ExitStack() as stack:
        fmus = {
            model: stack.enter_context(Fmu(opened.path.parent / name))
            for model, name in others.items()
        }
        yield Runs({"rp_manipulator": opened, **fmus})


@pytest.fixture(scope="module")
def sweeps(runs: Runs) -> dict[str, Sweep]:
    return {name: accuracy.sweep(runs, load(name)) for name in NAMES}


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the project with two scenarios, for the command line to work in."""
    model = tmp_path / "models" / "rp_manipulator"
    (model / "scenarios").mkdir(parents=True)
    (tmp_path / "src").mkdir()
    shutil.copy(ROOT / "models" / "rp_manipulator" / "variables.toml", model)
    for file in (ROOT / "src").glob("*.toml"):
        shutil.copy(file, tmp_path / "src")
    for name in (SHORT, LONG):
        original = load(name)
        shutil.copy(original.path, model / "scenarios")
        shutil.copytree(original.reference_folder, model / "references" / name)
    monkeypatch.setattr(cli, "ROOT", tmp_path)
    return tmp_path


def reference_file(project: Path, name: str) -> Path:
    return project / f"models/rp_manipulator/references/{name}/RPManipulator_ref.csv"


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


def repacked(source: Path, target: Path, change: Callable[[str], str], drop: str = "-") -> Path:
    """Copy of an FMU with a changed modelDescription.xml and without files under `drop`."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "modelDescription.xml":
                content = change(content.decode()).encode()
            if not name.startswith(drop):
                new.writestr(name, content)
    return target


# ---- error measure and bounds ------------------------------------------------------------------


def measured(expected: dict[str, list[float]], got: dict[str, list[float]]) -> dict[str, float]:
    names = tuple(expected)
    table = Reference(Path("ref.csv"), np.arange(2.0), names, np.array([*expected.values()]).T)
    result = SimpleNamespace(names=tuple(got), values=np.array([*got.values()]).T)
    return reference.errors(result, table)


def test_error_is_relative_to_the_largest_reference() -> None:
    errors = measured({"q1": [1.0, -4.0]}, {"q1": [1.5, -4.0]})
    assert errors == {"q1": 0.5 / 4.0}


def test_small_references_count_as_a_thousandth() -> None:
    errors = measured({"q1": [0.0, 1e-5], "q2": [0.0, 0.0]}, {"q1": [0.0, 3e-5], "q2": [0.0, 2e-6]})
    assert errors == pytest.approx({"q1": 2e-5 / 1e-3, "q2": 2e-6 / 1e-3})


def test_energies_are_relative_to_what_is_exchanged() -> None:
    expected = {
        "kinetic_energy": [0.0, 6.0],
        "potential_energy": [5.0, -1.0],  # |K| + |P| = 5, 7
        "total_energy": [0.0, 0.0],
    }
    got = {
        "kinetic_energy": [0.0, 6.6],
        "potential_energy": [5.7, -1.0],
        "total_energy": [0.0, 1.4],
    }
    errors = measured(expected, got)
    wanted = {"kinetic_energy": 0.1, "potential_energy": 0.1, "total_energy": 0.2}
    assert errors == pytest.approx(wanted)


def test_energy_scale_needs_both_energies() -> None:
    assert measured({"total_energy": [2.0, 2.0]}, {"total_energy": [2.0, 3.0]}) == {
        "total_energy": 0.5
    }


def test_values_that_are_not_finite_fail(runs: Runs) -> None:
    run = runs.run(load(SHORT), 1e-8)
    errors = {**run.errors, "q2": math.nan}
    broken = accuracy.Run(run.scenario, run.fmu, run.result, run.reference, errors)
    assert math.isnan(broken.error) and broken.worst == "q2" and not broken.passed


@pytest.mark.parametrize(
    ("tolerance", "expected"),
    [(1e-4, 1e-1), (1e-7, 1e-4), (1e-8, 1e-6), (5e-9, 1e-6), (1e-9, 1e-6), (1e-10, 1e-7)]
    + [(1e-11, 1e-8), (1e-12, 1e-9)],
)
def test_bound(tolerance: float, expected: float) -> None:
    assert reference.bound(tolerance) == pytest.approx(expected, rel=1e-12)


def test_bounds_are_met_exactly_at_their_tolerances() -> None:
    assert reference.bound(1e-8) <= 1e-6
    assert reference.bound(1e-11) <= 1e-8


def test_rules_on_errors_over_tolerances() -> None:
    tolerances = (1e-4, 1e-5, 1e-6)
    assert not accuracy.violations(tolerances, (1e-3, 3e-3, 1e-6))
    assert not accuracy.violations(tolerances, (2e-10, 5e-11, 9e-11))
    assert not accuracy.violations(tolerances, (0.0, 0.0, 0.0))
    (above,) = accuracy.violations(tolerances, (0.2, 1e-5, 1e-6))
    assert "2.00e-01 at tolerance 0.0001 is above its bound 1e-01" in above
    (rise,) = accuracy.violations(tolerances, (1e-2, 1e-6, 3.1e-6))
    assert "more than 3 times" in rise
    (gain,) = accuracy.violations(tolerances, (1e-4, 1e-5, 1.1e-7))
    assert "above 1/1000" in gain
    assert len(accuracy.violations(tolerances, (1e-4, math.nan, 1e-8))) == 3


# ---- reference reader --------------------------------------------------------------------------


def refused(project: Path, name: str = LONG) -> str:
    with pytest.raises(UserError) as caught:
        reference.load(load(name, project))
    text = str(caught.value)
    assert str(reference_file(project, name)) in text
    assert f"{MAKE_REFERENCES} {name}" in text
    assert "\n" not in text
    return text


def test_reads_references() -> None:
    for name in NAMES:
        loaded = load(name)
        read = reference.load(loaded)
        declared = variables.load(loaded.model_folder)
        outputs = [name for name, v in declared.items() if v["causality"] == "output"]
        assert list(read.names) == outputs
        assert read.values.shape == (len(loaded.reference_rows), len(read.names))
        assert np.array_equal(read.times, loaded.times[loaded.reference_rows])


def test_missing_reference(project: Path) -> None:
    reference_file(project, LONG).unlink()
    assert "no such file" in refused(project)


def test_empty_reference(project: Path) -> None:
    reference_file(project, LONG).write_text("")
    assert "empty" in refused(project)


def test_reference_with_a_header_only(project: Path) -> None:
    file = reference_file(project, LONG)
    file.write_text(file.read_text().splitlines()[0] + "\n")
    assert "has no values" in refused(project)


def test_binary_reference(project: Path) -> None:
    reference_file(project, LONG).write_bytes(b"\xff\xfe\x00\n")
    assert "not a text file" in refused(project)


def test_reference_cut_in_a_line(project: Path) -> None:
    file = reference_file(project, LONG)
    lines = file.read_text().splitlines(keepends=True)
    file.write_text("".join(lines[:20]) + lines[20][:-5])  # all columns, the last number too short
    assert "line 21: is cut off" in refused(project)


def test_reference_cut_after_a_line(project: Path) -> None:
    file = reference_file(project, LONG)
    file.write_text("".join(file.read_text().splitlines(keepends=True)[:20]))
    assert "line 20: does not match" in refused(project)


def test_reference_with_a_short_line(project: Path) -> None:
    file = reference_file(project, LONG)
    lines = file.read_text().splitlines(keepends=True)
    lines[7] = lines[7].partition(",")[2]
    file.write_text("".join(lines))
    assert "line 8: expected 15 values, found 14" in refused(project)


@pytest.mark.parametrize(("value", "reason"), [("nan", "finite"), ("-inf", "finite"), ("x", "'x'")])
def test_reference_with_a_value_that_is_no_number(project: Path, value: str, reason: str) -> None:
    file = reference_file(project, LONG)
    lines = file.read_text().splitlines(keepends=True)
    lines[4] = ",".join([*lines[4].split(",")[:-1], value]) + "\n"
    file.write_text("".join(lines))
    text = refused(project)
    assert "line 5: " in text and reason in text


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ('"time"', '"t"', "'time'"),
        ('"ddq1"', '"ddq3"', "'ddq3'"),
        ('"ddq1"', '"D11"', "has no column 'ddq1'"),
        ('"ddq1"', '"q1"', "twice"),
        ('"ddq1"', '"solver_steps"', "no Real variable 'solver_steps'"),
    ],
)
def test_reference_with_wrong_columns(project: Path, old: str, new: str, reason: str) -> None:
    edit(reference_file(project, LONG), old, new)
    text = refused(project)
    assert "line 1: " in text and reason in text


def test_reference_of_another_scenario(project: Path) -> None:
    edit(project / f"models/rp_manipulator/scenarios/{LONG}.toml", "step = 0.01", "step = 0.0125")
    text = refused(project)
    assert "line 3: does not match" in text and "0.0125" in text


# ---- simulation --------------------------------------------------------------------------------


def test_rows_are_what_an_importer_reads(opened: Fmu) -> None:
    loaded = load("sine_efforts")
    result = simulation.simulate(opened, loaded)
    rows = loaded.reference_rows
    assert np.array_equal(result.times, loaded.times[rows])
    assert result.steps == len(loaded.times) - 1
    assert result.solver_steps > 0 and result.solver_rhs_evaluations > 0
    held = {name: values[np.maximum(rows - 1, 0)] for name, values in loaded.inputs.items()}
    column = dict(zip(result.names, result.values.T, strict=True))
    power = held["tau1"] * column["dq1"] + held["f2"] * column["dq2"]
    np.testing.assert_allclose(column["actuator_power"], power, rtol=1e-12, atol=1e-12)


def test_the_same_run_gives_the_same_bits(opened: Fmu) -> None:
    first, second = (simulation.simulate(opened, load(LONG)) for _ in range(2))
    assert np.array_equal(first.values, second.values)


def test_progress_counts_all_steps(opened: Fmu, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulation, "PROGRESS_CALL_EVERY", 0.0)
    counted: list[int] = []
    result = simulation.simulate(opened, load(LONG), progress=counted.append)
    assert sum(counted) == result.steps and len(counted) > 1


def test_progress_prints_lines_where_there_is_no_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(simulation, "PROGRESS_LINE_EVERY", 0.0)
    with simulation.Progress("work", 200) as progress:
        progress(50)
        progress(50)
    assert capsys.readouterr().err == "work: 25 %, 0 s\nwork: 50 %, 0 s\n"


def test_instances_are_freed_whatever_happens(opened: Fmu, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []
    for name in ("terminate", "freeInstance"):
        original = getattr(fmi2.FMU2Slave, name)

        def counted(self, name=name, original=original):
            calls.append(name)
            return original(self)

        monkeypatch.setattr(fmi2.FMU2Slave, name, counted)
    monkeypatch.setattr(simulation, "PROGRESS_CALL_EVERY", 0.0)

    def interrupt(_: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulation.simulate(opened, load(LONG), progress=interrupt)
    simulation.simulate(opened, load(LONG))
    assert calls == ["terminate", "freeInstance"] * 2


def test_a_step_that_fails_is_explained(project: Path, opened: Fmu) -> None:
    path = project / f"models/rp_manipulator/scenarios/{SHORT}.toml"
    edit(path, "[parameters]", "[parameters]\nmax_internal_steps = 3")
    with pytest.raises(UserError) as caught:
        simulation.simulate(opened, scenarios.load(path))
    text = str(caught.value)
    assert text.startswith(f"{SHORT}: fmi2DoStep in the step from t = 0.0 s failed (discard): ")
    assert not text.endswith("no message")


def test_a_failing_initialization_is_explained(project: Path, opened: Fmu) -> None:
    path = project / f"models/rp_manipulator/scenarios/{SHORT}.toml"
    edit(path, "I2z = 0.1", "I1z = 0.0\nI2z = 0.0\nm1 = 0.0")
    with pytest.raises(UserError, match=r"ExitInitializationMode .* failed \(error\): .*m1"):
        simulation.simulate(opened, scenarios.load(path))


def test_csv_is_in_the_cross_check_layout(tmp_path: Path) -> None:
    file = tmp_path / "out.csv"
    values = np.array([[1 / 3, -0.1], [1e300, 5e-324]])
    write_csv(file, np.array([0.0, 0.1]), ["q1", "a,b"], values)
    lines = file.read_text().splitlines()
    assert lines[0] == '"time","q1","a,b"'
    assert lines[1] == "0,0.33333333333333331,-0.10000000000000001"
    assert np.array_equal(np.loadtxt(file, delimiter=",", skiprows=1)[:, 1:], values)


def test_csv_appears_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "out.csv"
    file.write_text("before")

    def half(stream, *_: object, **__: object) -> None:
        stream.write('"time","q1"\n0,')
        raise OSError("disk full")

    monkeypatch.setattr(np, "savetxt", half)
    with pytest.raises(OSError, match="disk full"):
        write_csv(file, np.zeros(2), ["q1"], np.zeros((2, 1)))
    assert file.read_text() == "before"
    assert list(tmp_path.iterdir()) == [file]


# ---- FMUs that cannot be run -------------------------------------------------------------------


def test_fmu_with_another_guid(project: Path, fmu: Path, tmp_path: Path) -> None:
    def change(xml: str) -> str:
        return xml.replace('guid="', 'guid="x', 1)

    reason = r"guid\.fmu: fmi2Instantiate failed: .*(?i:guid)"
    with (
        Fmu(repacked(fmu, tmp_path / "guid.fmu", change)) as other,
        pytest.raises(UserError, match=reason),
    ):
        simulation.simulate(other, load(SHORT, project))


@pytest.mark.parametrize(
    ("change", "drop", "reason"),
    [
        (lambda xml: xml, "binaries/", "no binary for"),
        (lambda xml: xml[:300], "-", "wrong modelDescription.xml"),
        (lambda xml: xml.replace('"2.0"', '"7.0"', 1), "-", "7.0"),
        (lambda xml: xml, "modelDescription", "has no modelDescription.xml"),
    ],
)
def test_fmu_that_is_refused(
    fmu: Path, tmp_path: Path, change: Callable[[str], str], drop: str, reason: str
) -> None:
    with pytest.raises(UserError) as caught:
        Fmu(repacked(fmu, tmp_path / "wrong.fmu", change, drop))
    assert reason in str(caught.value) and "wrong.fmu" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_fmu_for_model_exchange(fmu: Path, tmp_path: Path) -> None:
    def change(xml: str) -> str:
        begin, end = xml.index("<CoSimulation"), xml.index(">", xml.index("<CoSimulation"))
        rest = xml[end + 1 :]
        if xml[end - 1] != "/":
            rest = rest.split("</CoSimulation>", 1)[1]
        return xml[:begin] + '<ModelExchange modelIdentifier="RPManipulator"/>' + rest

    with pytest.raises(UserError, match="expected an FMU of FMI 2.0 for co-simulation"):
        Fmu(repacked(fmu, tmp_path / "me.fmu", change))


def test_fmu_with_a_damaged_binary(project: Path, fmu: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(tmp_path / "bad.fmu", "w") as new:
        for name in old.namelist():
            new.writestr(name, b"no library" if name.startswith("binaries/") else old.read(name))
    here = Path.cwd()
    with Fmu(tmp_path / "bad.fmu") as other, pytest.raises(UserError, match="cannot be loaded"):
        simulation.simulate(other, load(SHORT, project))
    assert Path.cwd() == here


def test_fmu_without_a_variable_of_the_scenario(project: Path, fmu: Path, tmp_path: Path) -> None:
    def change(xml: str) -> str:
        return xml.replace('name="l1"', 'name="length1"')

    reason = rf"{SHORT}\.toml: .*old\.fmu has no parameter 'l1'"
    with (
        Fmu(repacked(fmu, tmp_path / "old.fmu", change)) as other,
        pytest.raises(UserError, match=reason),
    ):
        simulation.simulate(other, load(SHORT, project))


# ---- accuracy of the built FMU -----------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_error_at_the_default_tolerance(runs: Runs, name: str) -> None:
    run = runs.run(load(name), load(name).tolerance)
    assert run.error <= 1e-6, run.worst


@pytest.mark.parametrize("name", NAMES)
def test_error_at_the_tightest_tolerance(runs: Runs, name: str) -> None:
    run = runs.run(load(name), 1e-11)
    assert run.error <= 1e-8, run.worst


@pytest.mark.parametrize("name", NAMES)
def test_error_follows_the_tolerance(sweeps: dict[str, Sweep], name: str) -> None:
    swept = sweeps[name]
    assert swept.tolerances == (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11)
    assert swept.violations == []
    errors = np.array(swept.errors)
    assert np.all(errors <= 1000 * np.array(swept.tolerances) * (1 + 1e-15))
    assert np.all(errors[1:] <= 3 * errors[:-1])
    assert errors[-1] <= errors[0] / 1000 or errors[-1] < 1e-10


def test_nothing_runs_twice(
    runs: Runs, sweeps: dict[str, Sweep], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(simulation, "simulate")
    again = accuracy.sweep(runs, load(LONG))
    assert again.errors == sweeps[LONG].errors
    assert runs.steps_ahead(load(LONG), accuracy.TOLERANCES) == 0


# ---- report ------------------------------------------------------------------------------------


def test_report_shows_every_scenario(runs: Runs, sweeps: dict[str, Sweep], tmp_path: Path) -> None:
    done = [runs.run(load(name), tolerance) for name in NAMES for tolerance in (1e-8, 1e-11)]
    index = report.write(tmp_path / "new" / "report", done, list(sweeps.values()))
    page = index.read_text(encoding="utf-8")
    for name in [*NAMES, "accuracy"]:
        picture = index.with_name(f"{name}.png").read_bytes()
        assert picture.startswith(b"\x89PNG") and len(picture) > 20_000
        assert b"tEXt" not in picture and b"tIME" not in picture
        assert f'src="{name}.png"' in page
    written = np.loadtxt(index.with_name(f"{LONG}.csv"), delimiter=",", skiprows=1)
    assert np.array_equal(written[:, 1:], runs.run(load(LONG), 1e-8).result.values)


def test_report_shows_failures(runs: Runs, tmp_path: Path) -> None:
    run = runs.run(load(SHORT), 1e-8)
    failed = accuracy.Run(run.scenario, run.fmu, run.result, run.reference, {"q1": 1.0})
    broken = Sweep(run.scenario, (1e-4, 1e-5), (1e-3, math.nan), ["<broken>"])
    page = report.write(tmp_path, [failed], [broken]).read_text(encoding="utf-8")
    assert page.count("FAILED") == 2
    assert "&lt;broken&gt;" in page


# ---- command line ------------------------------------------------------------------------------


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    """Exit code, standard output and standard error."""
    code = cli.main([str(argument) for argument in arguments])
    return code, *capsys.readouterr()


def assert_one_line(error: str) -> None:
    assert error.startswith("error: ") and error.count("\n") == 1 and "Traceback" not in error


def test_run_passes(project: Path, fmu: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = project / "report"
    code, out, err = call(capsys, "run", "--fmu", fmu, "--report", folder)
    assert code == 0 and err == ""
    rows = [line.split() for line in out.splitlines() if line.endswith("passed")]
    assert [row[:3] for row in rows[:4]] == [
        [LONG, "1e-08", "500"],
        [LONG, "1e-11", "500"],
        [SHORT, "1e-08", "1"],
        [SHORT, "1e-11", "1"],
    ]
    assert [row[0] for row in rows[4:]] == [LONG, SHORT] and len(rows[4]) == 10
    assert f"report: {folder / 'index.html'}" in out and "passed: 2 scenarios" in out
    assert (folder / f"{SHORT}.png").is_file() and (folder / "accuracy.png").is_file()


def test_run_of_one_scenario_at_one_tolerance(
    project: Path, fmu: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = project / "report"
    arguments = ("run", SHORT, SHORT, "--tolerance", "1e-6", "--fmu", fmu, "--report", folder)
    code, out, _ = call(capsys, *arguments)
    assert code == 0 and "passed: 1 scenario\n" in out
    assert out.count("1e-06") == 1 and "1e-11" not in out
    assert not (folder / "accuracy.png").exists()


def test_slow_scenarios_called_by_name_are_not_swept(
    project: Path, fmu: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cli, "QUICK", 0.0)
    code, out, _ = call(capsys, "run", SHORT, "--fmu", fmu, "--report", project / "report")
    assert code == 0 and f"{SHORT}: no sweep" in out and "error at tolerance" not in out


def test_run_with_a_worse_reference_fails(
    project: Path, fmu: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = reference_file(project, LONG)
    lines = file.read_text().splitlines()
    header, row = lines[0].split(","), lines[250].split(",")
    column = header.index('"ee_vy"')
    row[column] = repr(float(row[column]) + 1e-3)
    lines[250] = ",".join(row)
    file.write_text("\n".join(lines) + "\n")
    code, out, err = call(capsys, "run", "--fmu", fmu, "--report", project / "report")
    assert code == 1 and err == ""
    assert out.count("FAILED (ee_vy)") == 2
    assert f"{LONG}: error" in out and out.endswith(f"FAILED: {LONG}\n")


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["run", "constant_efort"], "did you mean 'constant_effort'"),
        (["run", "--fmu", "/nowhere/X.fmu"], "/nowhere/X.fmu: no such file"),
        (["run", "--fmu", "/"], "is a folder"),
        (["run"], "RPManipulator.fmu: no such file, ./run.sh builds it"),
        (["run", "--tolerance", "0"], "between 0 and 1"),
        (["run", "--tolerance", "tight"], "between 0 and 1"),
        (["run", "--fmux", "a"], "--fmux"),
        (["simulate"], "simulate"),
        ([], "COMMAND"),
    ],
)
def test_mistakes_of_the_user(
    project: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], reason: str
) -> None:
    code, out, err = call(capsys, *arguments)
    assert code == 2 and out == ""
    assert reason in err
    assert_one_line(err)


def test_file_that_is_no_fmu(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (project / "text.fmu").write_text("not a zip archive")
    code, _, err = call(capsys, "run", "--fmu", project / "text.fmu")
    assert code == 2 and "text.fmu: not an FMU" in err
    assert_one_line(err)


def test_cut_fmu(project: Path, fmu: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content = fmu.read_bytes()
    for length in (0, 100, len(content) // 2, len(content) - 10):
        (project / "cut.fmu").write_bytes(content[:length])
        code, _, err = call(capsys, "run", "--fmu", project / "cut.fmu")
        assert code == 2 and "cut.fmu" in err
        assert_one_line(err)


def test_fmu_with_another_guid_on_the_command_line(
    project: Path, fmu: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = repacked(fmu, project / "guid.fmu", lambda xml: xml.replace('guid="', 'guid="x', 1))
    code, _, err = call(capsys, "run", SHORT, "--fmu", other, "--report", project / "report")
    assert code == 2 and "guid.fmu: fmi2Instantiate failed: " in err and "guid" in err.lower()
    assert_one_line(err)


def test_misspelt_parameter(project: Path, fmu: Path, capsys: pytest.CaptureFixture[str]) -> None:
    edit(project / f"models/rp_manipulator/scenarios/{SHORT}.toml", "I2z", "I2y")
    code, _, err = call(capsys, "run", SHORT, "--fmu", fmu)
    assert code == 2 and f"{SHORT}.toml" in err and "'I2y'" in err
    assert_one_line(err)


def test_report_that_cannot_be_written(
    project: Path, fmu: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (project / "taken").write_text("")
    arguments = ("run", SHORT, "--tolerance", "1e-8", "--fmu", fmu, "--report", project / "taken")
    code, _, err = call(capsys, *arguments)
    assert code == 2 and "the report cannot be written" in err
    assert_one_line(err)


def test_interruption(
    project: Path,
    fmu: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(simulation, "simulate", interrupt)
    code, _, err = call(capsys, "run", SHORT, "--fmu", fmu)
    assert code == 130 and err == "interrupted\n"


def test_list(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = call(capsys, "list")
    assert code == 0
    assert [line.split()[0] for line in out.splitlines()] == [LONG, SHORT]
    assert load(LONG).title in out


def test_help(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (["--help"], ["run", "--help"], ["list", "--help"]):
        with pytest.raises(SystemExit) as caught:
            cli.main(arguments)
        assert caught.value.code == 0
    assert "--tolerance" in capsys.readouterr().out


def test_runs_as_a_module_and_stops_at_once_on_ctrl_c(project: Path, fmu: Path) -> None:
    path = project / f"models/rp_manipulator/scenarios/{LONG}.toml"
    edit(path, "step = 0.01", "step = 2e-6")
    edit(path, "tolerance = 1e-8", "tolerance = 1e-8\nreference_every = 5000")
    file = reference_file(project, LONG)
    rows = np.loadtxt(file, delimiter=",", skiprows=1)
    rows[:, 0] = load(LONG, project).times[load(LONG, project).reference_rows]
    names = [name.strip('"') for name in file.read_text().splitlines()[0].split(",")]
    write_csv(file, rows[:, 0], names[1:], rows[:, 1:])

    shutil.copytree(ROOT / "cosim", project / "cosim")
    command = [sys.executable, "-u", "-m", "cosim", "run", LONG, "--fmu", str(fmu)]
    with subprocess.Popen(
        command, cwd=project, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        process.stdout.readline()  # the head of the table: everything is imported and read
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=10)
    assert process.returncode == 130
    assert err == "interrupted\n" and "Traceback" not in out


def test_runs_from_anywhere(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "cosim", "list"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert [line.split()[0] for line in done.stdout.splitlines()] == NAMES
