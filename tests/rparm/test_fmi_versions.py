"""FMUs of FMI 2.0 and 3.0 on the command line: bits compared, one of them chosen, mistakes; then
the same models read from both, and instances of FMI 3.0."""

import math
import re
import shutil
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from rparm.errors import UserError, WrongValueError
from rparm.fmi.fmu_file import Fmu, read_model
from rparm.fmi.model import Variable
from rparm.runs import comparison, simulation
from rparm.runs.simulation import Result
from tests.support.rparm_project import (
    FMUS,
    LONG,
    SHORT,
    Console,
    declared,
    fmi3_fmu,
    load,
    repacked,
)

NAME = "RPManipulator.fmu"


@pytest.fixture
def built(project: Path, fmu: Path) -> Path:
    """A copy of the project with its FMUs; folder of what is built."""
    build = project / "build"
    (build / "fmi3").mkdir(parents=True)
    shutil.copy(fmu, build)
    shutil.copy(fmi3_fmu(fmu), build / "fmi3")
    return build


def rows(out: str) -> list[list[str]]:
    """Rows of the first table."""
    return [line.split() for line in out.split("\n\n")[0].splitlines()[3:]]


def test_a_run_compares_the_bits(built: Path, console: Console) -> None:
    report = built / "report"
    code, out, err = console("run", "--report", report)
    assert (code, err) == (0, "")
    assert [[row[0], row[-1]] for row in rows(out)] == [[LONG, "passed"], [SHORT, "passed"]]
    assert "\nsame bits in FMI 2.0 and 3.0: 2 scenarios\n" in out
    for name in (LONG, SHORT):
        page = (report / "scenarios" / f"{name}.html").read_text(encoding="utf-8")
        assert page.count("<td>same bits</td>") == 2 and ">in FMI 3.0</th>" in page
    assert "RPManipulator (FMI 2.0)" in (report / "index.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("given", "full", "other"), [("2", "2.0", f"fmi3/{NAME}"), ("3.0", "3.0", NAME)]
)
def test_one_version_needs_no_other(
    built: Path, console: Console, given: str, full: str, other: str
) -> None:
    (built / other).unlink()
    report = built / given
    code, out, err = console("run", "--fmi", given, "--tolerance", "1e-8", "--report", report)
    assert (code, err) == (0, "") and "bits" not in out and "FMI" not in out
    page = (report / "scenarios" / f"{SHORT}.html").read_text(encoding="utf-8")
    assert f"RPManipulator (FMI {full})" in page and "bits" not in page


def test_one_bit_that_differs_fails(
    built: Path, console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulate = simulation.simulate

    def spoiled(fmu: Fmu, *arguments: object) -> Result:
        result = simulate(fmu, *arguments)
        if fmu.model.fmi_version == "3.0":
            place = -1, result.names.index("ee_x")
            result.values[place] = np.nextafter(result.values[place], np.inf)
        return result

    monkeypatch.setattr(simulation, "simulate", spoiled)
    report = built / "report"
    code, out, err = console("run", SHORT, "--tolerance", "1e-8", "--report", report)
    assert (code, err) == (1, "")
    assert rows(out)[0][-1] == "FAILED" and "same bits in FMI 2.0 and 3.0: 0 scenarios" in out
    assert "  tolerance 1e-8: other bits in FMI 3.0: ee_x\n" in out
    assert f"\nfailed: 1 scenario: {SHORT}; " in out
    page = (report / "scenarios" / f"{SHORT}.html").read_text(encoding="utf-8")
    assert "<td>other bits</td>" in page and "other bits in FMI 3.0: ee_x" in page


def test_bits_are_compared_and_not_numbers() -> None:
    def result(**columns: list[float]) -> Result:
        values = np.array([*columns.values()]).T
        return Result(1e-8, np.zeros(2), tuple(columns), values, 1, 0.0, None, None, ())

    one = result(x=[0.0, np.nan], y=[1.0, 2.0], z=[3.0, 4.0])
    assert comparison.differing(one, one) == ()
    assert comparison.differing(one, replace(one, values=one.values.copy())) == ()
    other = result(x=[-0.0, np.nan], y=[1.0, 2.0], w=[3.0, 4.0])
    assert comparison.differing(one, other) == ("x", "z", "w")


# ---- mistakes ------------------------------------------------------------------------------------


def rename_a_variable(twin: Path) -> None:
    older = twin.rename(twin.with_name("older.fmu"))
    repacked(older, twin, lambda xml: xml.replace('name="l1"', 'name="length1"'))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (Path.unlink, "build/fmi3: has no FMU of rp_manipulator: ./run.sh builds it\n"),
        (lambda twin: twin.write_text("no archive"), f"fmi3/{NAME}: not an FMU"),
        (rename_a_variable, "the model has no variable 'l1'"),
    ],
)
def test_a_wrong_twin_is_reported_before_anything_runs(
    built: Path, console: Console, change: Callable[[Path], None], reason: str
) -> None:
    change(built / "fmi3" / NAME)
    assert reason in console.refused("run", SHORT)


# ---- messages ------------------------------------------------------------------------------------

SAID = {  # what the standards say of a message, and what a user reads
    "2.0": {"#r20# > 5 %%, bus ##4, 100 %%%%": "tau1 > 5 %, bus #4, 100 %%", "#i20# #r9999#": ""},
    "3.0": {"#20# > 5 %, bus ##4, 100 %%": "tau1 > 5 %, bus #4, 100 %%", "#r20# #9999#": ""},
}


@pytest.mark.parametrize("version", SAID)
def test_a_message_names_the_variables_that_it_refers_to(fmu: Path, version: str) -> None:
    path = fmu if version == "2.0" else fmi3_fmu(fmu)
    with Fmu(path) as opened, opened.instance("one") as instance:
        for text, expected in SAID[version].items():
            instance._keep_unless_ok(1, text.encode())
            assert instance.messages[-1] == (expected or text)


# ---- Instances of FMI 3.0 ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def opened3(fmu: Path) -> Iterator[Fmu]:
    with Fmu(fmi3_fmu(fmu)) as opened:
        yield opened


# ---- the same as in FMI 2.0 ----------------------------------------------------------------------


@pytest.mark.parametrize("path", FMUS.values(), ids=lambda path: path.stem)
def test_the_models_are_the_same(path: Path) -> None:
    first, second = read_model(path), read_model(fmi3_fmu(path))
    assert (first.fmi_version, second.fmi_version) == ("2.0", "3.0")
    own = first.variables.keys() ^ second.variables.keys()
    assert own <= {"der_q1", "der_q2"}  # other names of dq1 and dq2, which FMI 3.0 does not need
    for name in first.variables.keys() & second.variables.keys():
        assert first.variables[name] == second.variables[name]
    empty = {"variables": {}, "fmi_version": ""}
    assert replace(first, **empty) == replace(second, **empty)
    assert first.real_outputs == second.real_outputs


# ---- failures ------------------------------------------------------------------------------------


def test_the_folder_of_binaries_of_fmi_2_is_not_looked_at(fmu: Path, tmp_path: Path) -> None:
    """fmpy loads an FMU of FMI 3.0 from the folder of FMI 3.0 only."""
    with zipfile.ZipFile(fmi3_fmu(fmu)) as old, zipfile.ZipFile(tmp_path / "x.fmu", "w") as new:
        for name in old.namelist():
            new.writestr(name.replace("binaries/x86_64-linux", "binaries/linux64"), old.read(name))
    with pytest.raises(UserError, match=r"has no binary for .* \(has: linux64\)"):
        Fmu(tmp_path / "x.fmu")


def test_an_fmu_may_end_the_simulation(opened3: Fmu, monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = load(SHORT)
    with opened3.instance("one") as instance:
        simulation.initialize(instance, loaded, 1e-8)
        do_step = instance.fmi.fmi3DoStep

        def end(*arguments: object) -> int:
            status = do_step(*arguments)
            arguments[5]._obj.value = True
            return status

        monkeypatch.setattr(instance.fmi, "fmi3DoStep", end)
        with pytest.raises(UserError, match=r"^one: the FMU ends the simulation at t = 0\.25 s$"):
            instance.do_step(loaded.start, 0.25)


@pytest.mark.parametrize("error", [KeyboardInterrupt(), FMICallException("fmi3SetFloat64", 3)])
def test_what_is_raised_within_a_step_is_not_lost(opened3: Fmu, error: BaseException) -> None:
    """ctypes would print it and continue."""
    loaded = load(SHORT)
    times: list[float] = []

    def fail(time: float) -> list[float]:
        times.append(time - loaded.start)
        raise error

    with opened3.instance("one", ["tau1"]) as instance:
        simulation.initialize(instance, loaded, 1e-8)
        instance.input_functions(["tau1"], fail)
        with pytest.raises(type(error)):
            instance.do_step(loaded.start, 0.3)
        assert times == [0.0]  # the host is not asked again
        instance.input_functions(["tau1"], lambda _: [1.0])
        instance.do_step(loaded.start + 0.3, 0.3)  # nothing is left of it


def test_an_input_that_does_not_exist_within_steps_is_refused(opened3: Fmu) -> None:
    with (
        pytest.raises(UserError, match="fmi3InstantiateCoSimulation failed: "),
        opened3.instance("one", ["m2"]),
    ):
        pass


# ---- descriptions of other FMUs ------------------------------------------------------------------


def test_other_types_are_neither_read_nor_set(fmu: Path, tmp_path: Path) -> None:
    """Arrays and Float32 in the place of a parameter and an output."""

    def change(xml: str) -> str:
        array = r'<Float64\1start="1 2"\2><Dimension start="2"/></Float64>'
        xml, arrays = re.subn(r'<Float64( name="m1".*?)start=".*?"(.*?)/>', array, xml)
        short = r'<Float32 name="kinetic_energy"'
        xml, shorts = re.subn(r'<Float64 name="kinetic_energy"', short, xml)
        assert (arrays, shorts) == (1, 1)
        return xml

    other = read_model(repacked(fmi3_fmu(fmu), tmp_path / "types.fmu", change))
    m1: Variable = other.variables["m1"]
    assert (m1.type, m1.start) == ("array of Float64", None)
    assert (m1.least, m1.greatest) == (-math.inf, math.inf)
    with pytest.raises(WrongValueError, match="is of type array of Float64, which cannot be set"):
        m1.checked(1.0)
    missing = set(declared("rp_manipulator").real_outputs) - set(other.real_outputs)
    assert missing == {"kinetic_energy"}
