"""One run of an FMU by both loops, and FMUs that cannot be run."""

import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest
from fmpy import fmi2

import rparm
from rparm import files
from rparm.console import Progress
from rparm.errors import StoppedError, UserError
from rparm.fmi.fmu_file import Fmu
from rparm.runs import simulation
from rparm.runs.scenario import Scenario
from rparm.runs.simulation import Result
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
    monkeypatch.setattr(simulation, "PROGRESS_EVERY", 0.0)

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


# ---- The compiled loop ---------------------------------------------------------------------------


both_versions = pytest.mark.parametrize("version", [2, 3])


def of_version(folder: str, version: int) -> Fmu:
    return Fmu(FMUS[folder] if version == 2 else fmi3_fmu(FMUS[folder]))


@pytest.fixture(autouse=True)
def which_loop(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """Names of the loops that ran."""
    ran: list[str] = []
    for name in ("_step_through", "_step_compiled"):
        loop = getattr(simulation, name)

        def named(*arguments: object, loop: Callable = loop, name: str = name) -> object:
            ran.append(name)
            return loop(*arguments)

        monkeypatch.setattr(simulation, name, named)
    monkeypatch.setattr(simulation, "_steps_made", 0)
    return ran


def assert_same(scenario: Scenario, plain: Fmu, compiled: Fmu) -> Result:
    """Both loops make the same of a scenario; what it is."""
    plain = simulation.simulate(plain, scenario, compiled=False)
    fast = simulation.simulate(compiled, scenario, compiled=True)
    assert plain.names == fast.names and plain.messages == fast.messages
    for name in ("tolerance", "steps", "solver_steps", "solver_rhs_evaluations"):
        assert getattr(plain, name) == getattr(fast, name)
    assert plain.values.tobytes() == fast.values.tobytes()
    assert plain.times.tobytes() == fast.times.tobytes() and not fast.integers
    return fast


@pytest.mark.parametrize("name", NAMES)
def test_a_scenario_has_the_same_bits(name: str, which_loop: list[str]) -> None:
    """In FMI 2.0 by the plain loop, and in FMI 3.0 by the compiled one."""
    scenario = replace(load(name), panels=())
    with of_version(scenario.model, 2) as fmu, of_version(scenario.model, 3) as other:
        result = assert_same(scenario, fmu, other)
    assert len(result.values) == len(scenario.reference_rows)
    assert which_loop == ["_step_through", "_step_compiled"]


@both_versions
def test_a_step_that_fails_keeps_the_rows_before_and_the_message(version: int) -> None:
    scenario = replace(load("constant_effort"), reference_every=3)
    force = np.where(np.arange(len(scenario.times)) < 100, 1.0, 1e308)
    scenario = replace(scenario, inputs={**scenario.inputs, "f2": force})
    with of_version("rp_manipulator", version) as fmu:
        stopped = []
        for compiled in (False, True):
            with pytest.raises(StoppedError) as caught:
                simulation.simulate(fmu, scenario, compiled=compiled)
            stopped.append(caught.value)
    plain, fast = stopped
    assert str(plain) == str(fast) and "in the step from t = 1.0 s failed" in str(fast)
    assert len(fast.result.times) == 34 and fast.result.solver_steps is None
    assert plain.result.values.tobytes() == fast.result.values.tobytes()


@pytest.mark.parametrize("compiled", [False, True])
def test_progress_counts_all_steps_and_may_interrupt(
    monkeypatch: pytest.MonkeyPatch, compiled: bool
) -> None:
    monkeypatch.setattr(simulation, "PROGRESS_EVERY", 0.0)
    counted: list[int] = []

    def interrupt(_: int) -> NoReturn:
        raise KeyboardInterrupt

    with of_version("rp_manipulator", 2) as fmu:
        scenario = load("sine_efforts")
        simulation.simulate(fmu, scenario, progress=counted.append, compiled=compiled)
        assert sum(counted) == len(scenario.times) - 1 and len(counted) > 3
        with pytest.raises(KeyboardInterrupt):
            simulation.simulate(fmu, scenario, progress=interrupt, compiled=compiled)
        assert_same(scenario, fmu, fmu)


def test_it_is_used_where_it_pays(monkeypatch: pytest.MonkeyPatch, which_loop: list[str]) -> None:
    """After enough steps of one process, by programs at once, and never for drawn Integers."""
    monkeypatch.setattr(simulation, "WORTH_COMPILING", 1200)
    with of_version("rp_manipulator", 2) as fmu:
        for _ in range(4):
            simulation.simulate(fmu, load("constant_effort"))
    rparm.Scenario("constant_effort").run()
    rparm.simulate(FMUS["rp_manipulator"], stop_time=1.0, step=0.1)
    with of_version("rp_plant", 2) as fmu:
        assert simulation.simulate(fmu, load("stick_slip")).integers
    plain, compiled = ["_step_through"], ["_step_compiled"]
    assert which_loop == plain * 2 + compiled * 4 + plain


def test_without_numba_the_plain_loop_runs(
    monkeypatch: pytest.MonkeyPatch, which_loop: list[str]
) -> None:
    monkeypatch.setitem(sys.modules, "rparm.fmi.compiled_loop", None)
    table = rparm.simulate(FMUS["rp_manipulator"], stop_time=1.0, step=0.1)
    assert len(table["time"]) == 11 and which_loop == ["_step_through"]
