"""The command line with FMUs of FMI 2.0 and 3.0: bits compared, one of them chosen, mistakes."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rparm.fmi.fmu_file import Fmu
from rparm.runs import comparison, simulation
from rparm.runs.simulation import Result
from tests.support.rparm_project import BUILD, LONG, SHORT, Console, fmi3_fmu, repacked

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
    ("version", "full", "other"), [("2", "2.0", f"fmi3/{NAME}"), ("3", "3.0", NAME)]
)
def test_one_version_needs_no_other(
    built: Path, console: Console, version: str, full: str, other: str
) -> None:
    (built / other).unlink()
    for given in (version, full):
        report = built / given
        code, out, err = console("run", "--fmi", given, "--tolerance", "1e-8", "--report", report)
        assert (code, err) == (0, "") and "bits" not in out and "FMI" not in out
        page = (report / "scenarios" / f"{SHORT}.html").read_text(encoding="utf-8")
        assert f"RPManipulator (FMI {full})" in page and "bits" not in page


@pytest.mark.parametrize("name", [NAME, f"fmi3/{NAME}"])
def test_an_fmu_of_either_version_can_be_given(project: Path, console: Console, name: str) -> None:
    arguments = ["run", SHORT, "--tolerance", "1e-8", "--report", project / "report"]
    code, out, err = console(*arguments, "--fmu", BUILD / name)
    assert (code, err) == (0, "") and "bits" not in out and "passed: 1 scenario; " in out


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
