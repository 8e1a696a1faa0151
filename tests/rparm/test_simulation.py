"""One run of an FMU, and FMUs that cannot be run."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest
from fmpy import fmi2

from rparm import files
from rparm.console import Progress
from rparm.errors import StoppedError, UserError
from rparm.fmi.fmu_file import Fmu
from rparm.runs import simulation
from rparm.runs.scenario import Scenario
from tests.support.rparm_project import (
    FMUS,
    LONG,
    MISTAKES,
    NAMES,
    SHORT,
    edit,
    fmi3_fmu,
    load,
    repacked,
)
from tests.support.ssp_files import edited


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


def test_progress_is_silent_where_there_is_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with Progress("work", 200) as progress:
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

    def interrupt(_: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulation.simulate(opened, load(LONG), progress=interrupt)
    simulation.simulate(opened, load(LONG))
    assert calls == ["terminate", "freeInstance"] * 2


@pytest.mark.parametrize(("old", "new", "reason"), MISTAKES["failing_call"]["rows"])
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
    files.write_trajectory(file, np.array([0.0, 0.1]), ["q1", "a,b"], values)
    lines = file.read_text().splitlines()
    assert lines[0] == '"time","q1","a,b"'
    assert lines[1] == "0,0.33333333333333331,-0.10000000000000001"
    assert np.array_equal(np.loadtxt(file, delimiter=",", skiprows=1)[:, 1:], values)


def test_csv_appears_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "out.csv"
    file.write_text("before")

    def full(_: float) -> str:
        raise OSError("disk full")

    monkeypatch.setattr(files, "_shortest", full)
    with pytest.raises(OSError, match="disk full"):
        files.write_trajectory(file, np.zeros(2), ["q1"], np.zeros((2, 1)), None)
    assert file.read_text() == "before"
    assert list(tmp_path.iterdir()) == [file]


# ---- FMUs that cannot be run


def replaced(old: str, new: str) -> Callable[[str], str]:
    """Change of a model description."""
    return lambda xml: xml.replace(old, new)


def for_model_exchange(xml: str) -> str:
    """A model description without co-simulation."""
    exchange = '<ModelExchange modelIdentifier="RPManipulator"/>'
    return re.sub(r"<CoSimulation[^>]*(/>|.*</CoSimulation>)", exchange, xml, flags=re.DOTALL)


@pytest.mark.parametrize(
    ("version", "change", "drop", "reason"),
    [
        (2, str, "binaries/", r"has no binary for .+ \(has: none\)"),
        (2, lambda xml: xml[:300], "-", "wrong modelDescription.xml"),
        (2, replaced('"2.0"', '"7.0"'), "-", "7.0"),
        (2, str, "modelDescription", "has no modelDescription.xml"),
        (2, for_model_exchange, "-", "expected an FMU of FMI 2.0 or 3.0 for co-simulation"),
        (
            2,
            replaced('Identifier="RP', 'Identifier="../'),
            "-",
            r"expected a C identifier .*'\.\./",
        ),
        (3, str, "binaries/", r"has no binary for .+ \(has: none\)"),
        (3, replaced('fmiVersion="3.0"', 'fmiVersion="3.1"'), "-", "of FMI 2.0 or 3.0 .* FMI 3.1"),
        (3, replaced("<CoSimulation", "<Cosimulation"), "-", "wrong modelDescription.xml"),
        (3, replaced('valueReference="', 'valueReference="x'), "-", "wrong modelDescription.xml"),
    ],
)
def test_fmu_that_is_refused(
    fmu: Path, tmp_path: Path, version: int, change: Callable[[str], str], drop: str, reason: str
) -> None:
    source = fmu if version == 2 else fmi3_fmu(fmu)
    with pytest.raises(UserError, match=rf"wrong\.fmu.*{reason}") as caught:
        Fmu(repacked(source, tmp_path / "wrong.fmu", change, drop))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kept", [0, 40, 100, 3_000, 200_000])
def test_fmu_with_a_binary_that_is_cut_off(fmu: Path, tmp_path: Path, kept: int) -> None:
    """Or of something else; the folder of the process stays what it was."""
    library, here = "binaries/linux64/RPManipulator.so", Path.cwd()
    change = {library: lambda content: content[:kept] or b"no library"}
    path = edited(fmu, tmp_path / "cut.fmu", change)
    refused = r"cut\.fmu: (RPManipulator\.so: is cut off: |cannot be loaded: )"
    with pytest.raises(UserError, match=refused), Fmu(path) as other:
        simulation.simulate(other, load(SHORT))
    assert Path.cwd() == here


# ---- The loop ------------------------------------------------------------------------------------


both_versions = pytest.mark.parametrize("version", [2, 3])


def of_version(folder: str, version: int) -> Fmu:
    return Fmu(FMUS[folder] if version == 2 else fmi3_fmu(FMUS[folder]))


def by_hand(fmu: Fmu, scenario: Scenario) -> np.ndarray:
    """Return the rows of a scenario, each call made here."""
    variables = fmu.model.variables
    rows = []
    with fmu.instance("by_hand") as instance:
        simulation.initialize(instance, scenario, scenario.tolerance)
        outputs = instance.reals(fmu.model.real_outputs)
        outputs.get()
        rows.append(outputs.view.copy())
        for i, length in enumerate(np.diff(scenario.times)):
            for name, values in scenario.inputs.items():
                is_boolean = variables[name].type == "Boolean"
                instance.set(name, bool(values[i]) if is_boolean else float(values[i]))
            instance.do_step(scenario.times[i], length)
            outputs.get()
            rows.append(outputs.view.copy())
    return np.array(rows)[scenario.reference_rows]


@pytest.mark.parametrize("name", NAMES)
def test_a_scenario_has_the_same_bits(name: str) -> None:
    """In both versions of FMI, and by calls from Python."""
    scenario = replace(load(name), panels=())
    with of_version(scenario.model, 2) as fmu, of_version(scenario.model, 3) as other:
        expected = by_hand(fmu, scenario)
        result, newer = (simulation.simulate(x, scenario) for x in (fmu, other))
    assert len(result.values) == len(scenario.reference_rows)
    assert result.values.tobytes() == newer.values.tobytes() == expected.tobytes()
    for key in ("tolerance", "steps", "solver_steps", "solver_rhs_evaluations", "messages"):
        assert getattr(result, key) == getattr(newer, key)


@both_versions
def test_a_step_that_fails_keeps_the_rows_before_and_the_message(version: int) -> None:
    scenario = replace(load("constant_effort"), reference_every=3)
    force = np.where(np.arange(len(scenario.times)) < 100, 1.0, 1e308)
    scenario = replace(scenario, inputs={**scenario.inputs, "f2": force})
    gentle = replace(scenario, inputs={**scenario.inputs, "f2": np.ones_like(force)})
    with of_version("rp_manipulator", version) as fmu:
        with pytest.raises(StoppedError, match=r"in the step from t = 1\.0 s failed") as caught:
            simulation.simulate(fmu, scenario)
        expected = simulation.simulate(fmu, gentle)
    stopped = caught.value.result
    assert len(stopped.times) == 34 and stopped.solver_steps is None
    assert stopped.values.tobytes() == expected.values[:34].tobytes()


def test_progress_counts_all_steps_and_may_interrupt() -> None:
    counted: list[int] = []

    def interrupt(_: int) -> NoReturn:
        raise KeyboardInterrupt

    with of_version("rp_manipulator", 2) as fmu:
        scenario = load("sine_efforts")
        simulation.simulate(fmu, scenario, progress=counted.append)
        assert sum(counted) == len(scenario.times) - 1
        with pytest.raises(KeyboardInterrupt):
            simulation.simulate(fmu, scenario, progress=interrupt)
