"""One run of an FMU on fmpy, and FMUs that cannot be run."""

import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fmpy import fmi2

from rparm import trajectory_csv
from rparm.errors import UserError
from rparm.fmi.fmu_file import Fmu
from rparm.output import progress as progress_module
from rparm.runs import simulation
from rparm.scenarios import scenario as scenarios
from tests.support.rparm_project import LONG, SHORT, edit, fmi3_fmu, load, repacked


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
    monkeypatch.setattr(simulation, "PROGRESS_EVERY", 0.0)
    counted: list[int] = []
    result = simulation.simulate(opened, load(LONG), progress=counted.append)
    assert sum(counted) == result.steps and len(counted) > 1


def test_progress_is_silent_where_there_is_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_module.Progress("work", 200) as progress:
        progress(50)
    assert capsys.readouterr() == ("", "")


def test_instances_are_freed_whatever_happens(opened: Fmu, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []
    for name in ("terminate", "freeInstance"):
        original = getattr(fmi2.FMU2Slave, name)

        def counted(self, name=name, original=original):
            calls.append(name)
            return original(self)

        monkeypatch.setattr(fmi2.FMU2Slave, name, counted)
    monkeypatch.setattr(simulation, "PROGRESS_EVERY", 0.0)

    def interrupt(_: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulation.simulate(opened, load(LONG), progress=interrupt)
    simulation.simulate(opened, load(LONG))
    assert calls == ["terminate", "freeInstance"] * 2


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        (
            "[parameters]",
            "[parameters]\nmax_internal_steps = 3",
            r"DoStep in the step from t = 0\.0 s failed \(discard\): .*3",
        ),
        (
            "I2z = 0.1",
            "I1z = 0.0\nI2z = 0.0\nm1 = 0.0",
            r"ExitInitializationMode .* failed \(error\): .*m1",
        ),
    ],
)
@pytest.mark.parametrize("version", [2, 3])
def test_a_call_that_fails_is_explained(
    project: Path, fmu: Path, version: int, old: str, new: str, reason: str
) -> None:
    """By the FMU's message, which FMUs of FMI 3.0 send only if they are asked to."""
    edit(project / f"models/rp_manipulator/scenarios/{SHORT}.toml", old, new)
    with (
        Fmu(fmu if version == 2 else fmi3_fmu(fmu)) as opened,
        pytest.raises(UserError, match=f"^{SHORT}: fmi{version}{reason}") as caught,
    ):
        simulation.simulate(opened, load(SHORT, project))
    assert not str(caught.value).endswith("no message")


def test_csv_is_in_the_cross_check_layout(tmp_path: Path) -> None:
    file = tmp_path / "out.csv"
    values = np.array([[1 / 3, -0.1], [1e300, 5e-324]])
    trajectory_csv.write(file, np.array([0.0, 0.1]), ["q1", "a,b"], values)
    lines = file.read_text().splitlines()
    assert lines[0] == '"time","q1","a,b"'
    assert lines[1] == "0,0.33333333333333331,-0.10000000000000001"
    assert np.array_equal(np.loadtxt(file, delimiter=",", skiprows=1)[:, 1:], values)


def test_csv_appears_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "out.csv"
    file.write_text("before")

    def full(_: float) -> str:
        raise OSError("disk full")

    monkeypatch.setattr(trajectory_csv, "_shortest", full)
    with pytest.raises(OSError, match="disk full"):
        trajectory_csv.write(file, np.zeros(2), ["q1"], np.zeros((2, 1)), None)
    assert file.read_text() == "before"
    assert list(tmp_path.iterdir()) == [file]


# ---- FMUs that cannot be run


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

    with pytest.raises(UserError, match="expected an FMU of FMI 2.0 or 3.0 for co-simulation"):
        Fmu(repacked(fmu, tmp_path / "me.fmu", change))


def test_fmu_with_a_damaged_binary(project: Path, fmu: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(tmp_path / "bad.fmu", "w") as new:
        for name in old.namelist():
            new.writestr(name, b"no library" if name.startswith("binaries/") else old.read(name))
    here = Path.cwd()
    with Fmu(tmp_path / "bad.fmu") as other, pytest.raises(UserError, match="cannot be loaded"):
        simulation.simulate(other, load(SHORT, project))
    assert Path.cwd() == here


@pytest.mark.parametrize("kept", [40, 100, 3_000, 200_000])
def test_fmu_with_a_binary_that_is_cut_off(fmu: Path, tmp_path: Path, kept: int) -> None:
    library = "binaries/linux64/RPManipulator.so"
    with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(tmp_path / "cut.fmu", "w") as new:
        for name in old.namelist():
            content = old.read(name)
            new.writestr(name, content[:kept] if name == library else content)
    refused = r"cut\.fmu: (RPManipulator\.so: is cut off: |cannot be loaded: )"
    with pytest.raises(UserError, match=refused), Fmu(tmp_path / "cut.fmu") as other:
        simulation.simulate(other, load(SHORT))


def test_fmu_whose_identifier_is_a_path(fmu: Path, tmp_path: Path) -> None:
    def change(text: str) -> str:
        return text.replace('modelIdentifier="RPManipulator"', 'modelIdentifier="../../x"')

    with pytest.raises(UserError, match=r"expected a C identifier .*'\.\./\.\./x'"):
        Fmu(repacked(fmu, tmp_path / "path.fmu", change))


def test_fmu_without_a_variable_of_the_scenario(project: Path, fmu: Path, tmp_path: Path) -> None:
    def change(xml: str) -> str:
        return xml.replace('name="l1"', 'name="length1"')

    path = project / f"models/rp_manipulator/scenarios/{SHORT}.toml"
    reason = rf"{SHORT}\.toml: \[parameters\]: the model has no variable 'l1', .*known: .*length1"
    with (
        Fmu(repacked(fmu, tmp_path / "old.fmu", change)) as other,
        pytest.raises(UserError, match=reason),
    ):
        scenarios.load(path, other.model)
