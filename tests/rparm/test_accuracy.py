"""Errors against the references, their bounds, and the report that shows them; bad references."""

import lzma
import math
import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from rparm.errors import UserError
from rparm.fmi.fmu_file import Fmu
from rparm.report import scenario_page
from rparm.report.writer import ReportWriter
from rparm.runs import comparison, simulation
from rparm.runs.comparison import Reference, Runs, Sweep
from rparm.runs.scenario import Scenario
from tests.support.paths import FOLDERS
from tests.support.rparm_project import (
    LONG,
    MISTAKES,
    NAMES,
    SHORT,
    declared,
    edit,
    load,
    names_of,
    reference_file,
)

# bytes of a report for all scenarios, studies, the overview, scripts and styles
OF_SCENARIOS = 8_000_000
OTHER_METHODS = (2, 3, 4)  # than cvode_adams


@pytest.fixture(scope="module")
def runs(opened: Fmu) -> Iterator[Runs]:
    """Of all models, whose FMUs lie in one folder."""
    with ExitStack() as stack:
        fmus = {
            folder: stack.enter_context(Fmu(opened.path.with_name(f"{name}.fmu")))
            for name, folder in FOLDERS.items()
            if name != opened.path.stem
        }
        yield Runs({FOLDERS[opened.path.stem]: opened, **fmus})


@pytest.fixture(scope="module")
def sweeps(runs: Runs) -> dict[str, Sweep]:
    return {name: comparison.sweep(runs, load(name)) for name in NAMES}


def changed(fmu: Fmu, name: str, **parameters: float) -> tuple[Runs, Scenario]:
    """Return a scenario with more parameters, and runs of it alone: others share its name."""
    found = load(name)
    return Runs({found.model: fmu}), replace(found, parameters=found.parameters | parameters)


# ---- error measure and bounds


ENERGIES = ("kinetic_energy", "potential_energy")
SUMMED = {"potential_energy": ENERGIES, "total_energy": ENERGIES}


def measured(expected: dict[str, list[float]], got: dict[str, list[float]]) -> dict[str, float]:
    values = np.array([*expected.values()]).T
    table = Reference(Path("ref.csv"), np.arange(2.0), tuple(expected), values, SUMMED)
    result = SimpleNamespace(names=tuple(got), values=np.array([*got.values()]).T)
    return comparison.errors_against(result, table)


@pytest.mark.parametrize("case", MISTAKES["errors"])
def test_errors_are_relative(case: dict[str, dict[str, list[float]]]) -> None:
    assert measured(case["expected"], case["got"]) == pytest.approx(case["errors"])


def test_the_arms_energies_have_that_scale(runs: Runs) -> None:
    assert runs.run(load(SHORT), 1e-8).reference.summed == SUMMED


def test_values_that_are_not_finite_fail(runs: Runs) -> None:
    run = runs.run(load(SHORT), 1e-8)
    errors = {**run.errors, "q2": math.nan}
    broken = comparison.Run(run.scenario, run.fmu, run.result, run.reference, errors)
    assert math.isnan(broken.error) and broken.worst == "q2" and not broken.passed


@pytest.mark.parametrize(
    ("tolerance", "expected"),
    [(1e-4, 1e-1), (1e-7, 1e-4), (1e-8, 1e-6), (5e-9, 1e-6), (1e-9, 1e-6), (1e-10, 1e-7)]
    + [(1e-11, 1e-8), (1e-12, 1e-9)],
)
def test_bound(tolerance: float, expected: float) -> None:
    assert comparison.error_bound(tolerance) == pytest.approx(expected, rel=1e-12)
    assert tolerance not in comparison.BOUNDS or comparison.error_bound(tolerance) <= expected


def test_rules_on_errors_over_tolerances() -> None:
    tolerances = (1e-4, 1e-5, 1e-6)
    assert not comparison.sweep_violations(tolerances, (1e-3, 3e-3, 1e-6))
    assert not comparison.sweep_violations(tolerances, (2e-10, 5e-11, 9e-11))
    assert not comparison.sweep_violations(tolerances, (0.0, 0.0, 0.0))
    (above,) = comparison.sweep_violations(tolerances, (0.2, 1e-5, 1e-6))
    assert "2.00e-1 at tolerance 1e-4 is above its bound 1e-1" in above
    (rise,) = comparison.sweep_violations(tolerances, (1e-2, 1e-6, 3.1e-6))
    assert "more than 3 times" in rise
    (gain,) = comparison.sweep_violations(tolerances, (1e-4, 1e-5, 1.1e-7))
    assert "above 1/1000" in gain
    assert len(comparison.sweep_violations(tolerances, (1e-4, math.nan, 1e-8))) == 3


# ---- the built FMU


@pytest.mark.parametrize("name", NAMES)
def test_error_follows_the_tolerance(sweeps: dict[str, Sweep], name: str) -> None:
    swept = sweeps[name]
    assert swept.tolerances == (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11)
    assert swept.violations == []


@pytest.mark.parametrize("method", OTHER_METHODS)
@pytest.mark.parametrize("name", names_of("rp_manipulator"))
def test_errors_of_the_other_methods_stay_within_the_same_bounds(
    opened: Fmu, name: str, method: int
) -> None:
    runs, scenario = changed(opened, name, solver_method=method)
    for tolerance in comparison.TOLERANCES[1::3]:  # 1e-5, 1e-8, 1e-11
        assert runs.run(scenario, tolerance).passed, tolerance


@pytest.mark.parametrize("method", [1, *OTHER_METHODS])
def test_a_limit_of_the_step_keeps_the_bounds(opened: Fmu, method: int) -> None:
    runs, limited = changed(opened, "constant_effort", solver_method=method, max_step=1e-3)
    for tolerance in comparison.TOLERANCES[::7]:  # 1e-4, 1e-11
        run = runs.run(limited, tolerance)
        assert run.passed, run.worst
        assert run.result.solver_steps >= 5000  # 5 s


def test_nothing_runs_twice(
    runs: Runs, sweeps: dict[str, Sweep], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(simulation, "simulate")
    again = comparison.sweep(runs, load(LONG))
    assert again.errors == sweeps[LONG].errors
    assert runs.steps_ahead(load(LONG), comparison.TOLERANCES) == 0


# ---- report


def test_report_shows_every_scenario(runs: Runs, sweeps: dict[str, Sweep], tmp_path: Path) -> None:
    done = [runs.run(load(name), tolerance) for name in NAMES for tolerance in (1e-8, 1e-11)]
    writer = ReportWriter(tmp_path / "new" / "report")
    index = writer.write(writer.grouped(done), list(sweeps.values()))
    overview = index.read_text(encoding="utf-8")
    for name in NAMES:
        assert f'href="scenarios/{name}.html"' in overview
        page = (index.parent / "scenarios" / f"{name}.html").read_text(encoding="utf-8")
        assert f'href="{name}.csv"' in page
    assert 'href="studies/accuracy.html"' in overview
    assert sum(path.stat().st_size for path in index.parent.rglob("*.*")) < OF_SCENARIOS
    written = np.loadtxt(index.parent / "scenarios" / f"{LONG}.csv", delimiter=",", skiprows=1)
    result = runs.run(load(LONG), 1e-8).result
    digits = 10.0 ** (1 - scenario_page.DIGITS)
    outputs = written[:, 1 : 1 + len(result.names)]
    np.testing.assert_allclose(outputs, result.values, rtol=digits, atol=0)


def test_report_shows_failures(runs: Runs, tmp_path: Path) -> None:
    run = runs.run(load(SHORT), 1e-8)
    failed = comparison.Run(run.scenario, run.fmu, run.result, run.reference, {"q1": 1.0})
    broken = Sweep(run.scenario, (1e-4, 1e-5), (1e-3, math.nan), ["<broken>"])
    writer = ReportWriter(tmp_path)
    overview = writer.write(writer.grouped([failed]), [broken]).read_text(encoding="utf-8")
    assert overview.count("FAILED") == 2 and "2 of 2 failed" in overview
    assert "FAILED" in (tmp_path / "scenarios" / f"{SHORT}.html").read_text(encoding="utf-8")
    assert "&lt;broken&gt;" in (tmp_path / "studies/accuracy.html").read_text(encoding="utf-8")


# ---- Reading references --------------------------------------------------------------------------


Change = Callable[[list[str]], list[str]]  # of the lines of a file

MAKE_REFERENCES = "build/venv/bin/python models/make_references.py rp_manipulator"


def refused(project: Path, name: str = LONG) -> str:
    with pytest.raises(UserError) as caught:
        comparison.load_reference(load(name, project), declared("rp_manipulator"))
    text = str(caught.value)
    assert str(reference_file(project, name)) in text
    assert f"{MAKE_REFERENCES} {name}" in text
    assert "\n" not in text
    return text


def with_value(value: str) -> Change:
    """The last value of line 5 replaced."""
    return lambda lines: [*lines[:4], ",".join([*lines[4].split(",")[:-1], value]), *lines[5:]]


DAMAGE = {
    "empty": (lambda _: [], "empty"),
    "a header only": (lambda lines: [lines[0], ""], "has no values"),
    # all columns, the last number too short
    "cut in a line": (lambda lines: [*lines[:20], lines[20][:-5]], "line 21: is cut off"),
    "cut after a line": (lambda lines: [*lines[:20], ""], "line 20: does not match"),
    "a short line": (
        lambda lines: [*lines[:7], lines[7].partition(",")[2], *lines[8:]],
        "line 8: expected 15 values, found 14",
    ),
    "nan": (with_value("nan"), r"line 5: .*finite"),
    "inf": (with_value("-inf"), r"line 5: .*finite"),
    "no number": (with_value("x"), r"line 5: .*'x'"),
    "a column that is not compared": (
        lambda lines: [f'{lines[0]},"D11"', *(f"{line},1.0" for line in lines[1:-1]), ""],
        "line 1: 'D11' is not an output of the model",
    ),
    "columns exchanged": (
        lambda lines: [",".join(reversed(line.split(","))) for line in lines],
        "line 1: expected a header whose first column is 'time'",
    ),
    "empty lines": (lambda _: ["", "", ""], "expected a header"),
    "an endless header": (lambda _: ['"' + "a" * 200_000, ""], "line 1: not a header"),
    "quotes": (lambda _: ['"time"', *3 * ['"1'], ""], "line 2: expected numbers"),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_damaged_reference(project: Path, damage: str) -> None:
    change, reason = DAMAGE[damage]
    file = reference_file(project, LONG)
    file.write_text("\n".join(change(file.read_text().split("\n"))))
    assert re.search(reason, refused(project))


def test_missing_or_binary_reference(project: Path) -> None:
    reference_file(project, LONG).write_bytes(b"\xff\xfe\x00\n")
    assert "not a text file" in refused(project)
    reference_file(project, LONG).unlink()
    assert "no such file" in refused(project)


def test_a_reference_of_an_installed_package_is_compressed(project: Path) -> None:
    scenario, model = load(LONG, project), declared("rp_manipulator")
    expected = comparison.load_reference(scenario, model)
    file = reference_file(project, LONG)
    packed = file.with_name(f"{file.name}.xz")
    packed.write_bytes(lzma.compress(file.read_bytes()))
    file.unlink()
    assert comparison.load_reference(scenario, model).values.tobytes() == expected.values.tobytes()
    packed.write_bytes(packed.read_bytes()[:-9])
    assert "is damaged" in refused(project)


@pytest.mark.parametrize(("old", "new", "reason"), MISTAKES["columns"]["rows"])
def test_reference_with_wrong_columns(project: Path, old: str, new: str, reason: str) -> None:
    edit(reference_file(project, LONG), old, new)
    text = refused(project)
    assert "line 1: " in text and reason in text


def test_reference_of_another_scenario(project: Path) -> None:
    edit(project / f"models/rp_manipulator/scenarios/{LONG}.toml", "step = 0.01", "step = 0.0125")
    text = refused(project)
    assert "line 3: does not match" in text and "0.0125" in text


@pytest.mark.parametrize("content", ["total_energy = 1", "total_energy = []", "total_energy = [1]"])
def test_wrong_scales(project: Path, content: str) -> None:
    path = project / "models/rp_manipulator/references/scales.toml"
    path.write_text(content)
    with pytest.raises(
        UserError, match=r"scales\.toml: total_energy: expected a list of variables"
    ):
        comparison.load_reference(load(LONG, project), declared("rp_manipulator"))
    path.unlink()
    assert comparison.load_reference(load(LONG, project), declared("rp_manipulator")).summed == {}
