"""Systems in Ecos are what the references say; failures leave nothing; names of variants."""

import html
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from rparm.models.closed_loop.study import EXPERIMENT

from rparm import project
from rparm.errors import UserError
from rparm.report import overview
from rparm.systems import comparison, ecos, ssp
from tests.support.paths import ROOT
from tests.support.rparm_project import MISTAKES, Console
from tests.support.ssp_files import SSP, Edit, edited, edited_fmu, not_a_number, read_csv, replace
from tests.support.systems import BOUND, CASES, CLOSED_LOOP, System, difference

SSP3 = SSP.parent / "fmi3" / SSP.name
STRUCTURE = "SystemStructure.ssd"
REPORT = ("{0}.html", "{0}.csv")


# ---- the command ---------------------------------------------------------------------------------


def test_the_command_checks_and_reports(tmp_path: Path, console: Console) -> None:
    code, out, _ = console("system", "heavy_payload", "nominal", "--report", tmp_path)
    assert code == 0 and "passed: 2 variants; " in out.splitlines()[-1]
    assert max(map(len, out.split("passed: ")[0].splitlines())) <= 80
    names = [line.split()[0] for line in out.splitlines() if " passed" in line]
    assert names == ["heavy_payload", "nominal"]
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    for name in names:
        for file in REPORT:
            assert (tmp_path / "system" / file.format(name)).stat().st_size > 10_000
        assert f'href="system/{name}.html"' in page
    written, result = read_csv(tmp_path / "system/nominal.csv"), CLOSED_LOOP.run("nominal")
    assert list(written) == list(result)
    rows = np.rint(written["time"] / result["time"][1]).astype(int)  # those that the page draws
    for name in result:
        np.testing.assert_allclose(written[name], result[name][rows], rtol=1e-11)
    diagram = ROOT / "models" / "closed_loop" / "system.svg"
    assert (tmp_path / "system/closed_loop.svg").read_bytes() == diagram.read_bytes()
    assert 'src="closed_loop.svg"' in (tmp_path / "system/nominal.html").read_text("utf-8")
    assert len(list((tmp_path / "system").iterdir())) == 7


def test_a_run_beyond_the_bound_fails(tmp_path: Path, console: Console) -> None:
    """Another payload is not what the reference is of."""
    path = edited(
        SSP, tmp_path / "other.ssp", {"resources/arm_heavy_payload.ssv": replace("1.2", "1.2001")}
    )
    report = ("--report", tmp_path / "report")
    code, out, _ = console("system", "heavy_payload", "--ssp", path, *report)
    assert code == 1 and "FAILED" in out


def fails(path: Path, variant: str, folder: Path, console: Console, ran: bool = True) -> str:
    """Error of a run that fails; neither older results nor temporary files stay.

    If it `ran`, there is a page of the failure, with values if there are any.
    """
    report = folder / "report"
    (report / "system").mkdir(parents=True, exist_ok=True)
    files = ("index.html", *(f"system/{name.format(variant)}" for name in REPORT))
    for file in (*files, f"system/{variant}.entry.json"):
        (report / file).write_text("of an earlier run", encoding="utf-8")
    before = set(folder.iterdir())
    err = console.failed("system", variant, "--ssp", path, "--report", report)
    assert bool(list(report.iterdir())) == ran
    if ran:
        page = html.unescape((report / f"system/{variant}.html").read_text(encoding="utf-8"))
        assert err.removeprefix("error: ").strip() in page and "FAILED" in page
        assert f'href="system/{variant}.html"' in (report / "index.html").read_text("utf-8")
        assert [entry.status for entry in overview.read(report, "system")] == ["FAILED"]
        rows = (report / f"system/{variant}.csv").is_file()
        assert rows == ("in initialization" not in err and "Ecos failed" not in err)
    assert set(folder.iterdir()) == before
    return err


@pytest.mark.parametrize(("old", "new", "words"), MISTAKES["not_compared"]["rows"])
def test_a_system_that_cannot_be_compared_is_refused(
    tmp_path: Path, console: Console, old: str, new: str, words: list[str]
) -> None:
    path = edited(SSP, tmp_path / "other.ssp", {"SystemStructure.ssd": replace(old, new)})
    text = fails(path, "nominal", tmp_path, console, ran=False)
    for word in words:
        assert word in text


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Temporary files are those of the test."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))


@pytest.mark.usefixtures("temporary")
def test_a_component_that_gives_nan_is_named(tmp_path: Path, console: Console) -> None:
    """The effort of the controller is NaN from the tenth step on."""
    library = {"binaries/linux64/RPController.so": not_a_number(40, 10, tmp_path)}
    edits = {"resources/RPController.fmu": edited_fmu(library)}
    err = fails(edited(SSP, tmp_path / "nan.ssp", edits), "nominal", tmp_path, console)
    assert err == "error: nominal: component 'controller': 'tau1' is nan at t = 0.01 s\n"


@pytest.mark.usefixtures("temporary")
@pytest.mark.parametrize("source", [SSP, SSP3], ids=["2.0", "3.0"])
def test_a_component_that_fails_in_initialization_is_named(
    tmp_path: Path, console: Console, source: Path
) -> None:
    """A path through the joint axis; Ecos itself would continue."""
    edits = {"resources/trajectory_nominal.ssv": replace('value="0.1"', 'value="0.4"')}
    path = edited(source, tmp_path / "unreachable.ssp", edits)
    err = fails(path, "nominal", tmp_path, console)
    assert "component 'trajectory' failed in initialization (error): " in err
    assert "0.1 m" in err  # the smallest reachable distance


@pytest.mark.usefixtures("temporary")
@pytest.mark.parametrize("source", [SSP, SSP3], ids=["2.0", "3.0"])
def test_a_component_that_fails_in_a_step_is_named(
    tmp_path: Path, console: Console, source: Path
) -> None:
    limited = '<ssv:Parameter name="max_internal_steps"><ssv:Integer value="1"/></ssv:Parameter>'
    edits = {"resources/arm_nominal.ssv": replace("<ssv:Parameters>", f"<ssv:Parameters>{limited}")}
    path = edited(source, tmp_path / "impatient.ssp", edits)
    err = fails(path, "nominal", tmp_path, console)
    assert f"component 'arm' failed by t = 0.00{'1 s' if source is SSP else ''}" in err


@pytest.mark.usefixtures("temporary")
def test_ecos_that_crashes_is_reported(tmp_path: Path, console: Console) -> None:
    library: Edit = lambda _: b"no shared object"  # noqa: E731
    fmu_edit = edited_fmu({"binaries/linux64/RPController.so": library})
    path = edited(SSP, tmp_path / "crash.ssp", {"resources/RPController.fmu": fmu_edit})
    err = fails(path, "nominal", tmp_path, console)
    assert "Ecos failed" in err


def test_a_damaged_reference_is_refused(tmp_path: Path) -> None:
    good = ROOT / "models" / "closed_loop" / "references" / "nominal" / "ecos.csv"
    lines = good.read_text(encoding="utf-8").splitlines(keepends=True)
    system = tmp_path / "closed_loop"
    path = system / "references" / "nominal" / "ecos.csv"
    path.parent.mkdir(parents=True)
    cases = {
        "no such file": None,
        "header": lines[1:],
        "has no column": [
            line.partition(",")[2] and line.rpartition(",")[0] + "\n" for line in lines
        ],
        "ends before": lines[:-1],
        "cut off": [*lines[:-1], lines[-1][:-1]],
        "finite numbers": [*lines[:5], lines[5].replace(",", ",nan,", 1).rpartition(",")[0] + "\n"],
        "expected numbers": [*lines[:5], lines[5].replace(",", ",x", 1)],
        "no communication point": [*lines[:3], lines[3].replace("0.04", "0.0405", 1), *lines[4:]],
    }
    with ssp.unpacked(SSP) as opened:
        for message, content in cases.items():
            if content is not None:
                path.write_text("".join(content), encoding="utf-8")
            with pytest.raises(UserError, match=message) as caught:
                comparison.load_reference(opened, "nominal", system, EXPERIMENT)
            assert "make_references.py closed_loop nominal" in str(caught.value)


# with and without limits that are reached, events and Booleans
DIFFERENT = ("nominal", "limited_effort", "pick_and_place", "wall_contact")
OF_FMI_3 = [case for case in CASES if case[1] in DIFFERENT]


@pytest.mark.parametrize(("system", "variant"), CASES, ids=lambda x: getattr(x, "folder", x))
def test_ecos_is_at_the_reference_of_its_order(system: System, variant: str) -> None:
    """All Real outputs within the bound; counts, modes and Booleans to the last bit."""
    expected, result = system.reference(variant), system.run(variant)
    rows = system.rows(expected)
    with ssp.unpacked(system.path) as opened:
        recorded, discrete = comparison.recorded(opened), set(comparison.discrete(opened))
    assert {"time", *recorded} <= set(expected) <= set(result)
    for name, values in expected.items():
        assert difference(result[name][rows], values) <= (0 if name in discrete else BOUND), name


@pytest.mark.parametrize(("system", "variant"), OF_FMI_3, ids=lambda x: getattr(x, "folder", x))
def test_fmus_of_fmi_3_give_the_same_bits(system: System, variant: str) -> None:
    first, second = system.run(variant), system.run(variant, "fmi3")
    assert list(first) == list(second)
    for name, values in first.items():
        assert values.tobytes() == second[name].tobytes(), name


# ---- Several systems in one project --------------------------------------------------------------


SECOND = tuple(f"{name}_2" for name in CLOSED_LOOP.variants)
Add = Callable[[str, str, str], Path]


@pytest.fixture
def add(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Add:
    """Puts a copy of the closed loop, with other names, into a project without systems."""
    monkeypatch.setattr(project, "ROOT", tmp_path)
    (tmp_path / "build").mkdir()

    def one(name: str, archive: str, suffix: str) -> Path:
        (tmp_path / "models" / name).mkdir(parents=True)
        (tmp_path / "models" / name / project.LOOP).touch()
        edits: dict[str, Edit] = {
            STRUCTURE: replace('System name="closed_loop"', f'System name="{name}"')
        }
        for component in ("trajectory", "controller", "arm"):
            for variant in CLOSED_LOOP.variants:
                file = f"resources/{component}_{variant}.ssv"
                edits[file] = replace(f'name="{variant}"', f'name="{variant}{suffix}"')
        return edited(SSP, tmp_path / "build" / archive, edits)

    return one


def listed(console: Console, *arguments: object) -> dict[str, list[str]]:
    """What --list prints: variants by system."""
    code, out, _ = console("system", "--list", *arguments)
    assert code == 0
    found: dict[str, list[str]] = {}
    for line in out.splitlines():
        if line.startswith("  "):
            found[list(found)[-1]].append(line.strip())
        else:
            found[line] = []
    return found


def test_names_are_those_of_variants_and_systems(add: Add, console: Console) -> None:
    add("loop", "Loop.ssp", "")
    second = add("loop_two", "LoopTwo.ssp", "_2")
    both = {"loop": list(CLOSED_LOOP.variants), "loop_two": list(SECOND)}
    assert listed(console) == both
    assert listed(console, "loop_two") == {"loop_two": list(SECOND)}
    assert listed(console, "loop_two", "loop") == both
    assert listed(console, "nominal_2") == {"loop_two": ["nominal_2"]}
    mixed = listed(console, "nominal", "loop_two", "nominal_2", "nominal")
    assert mixed == {"loop": ["nominal"], "loop_two": list(SECOND)}
    assert listed(console, "--ssp", second) == {"loop_two": list(SECOND)}


def test_an_unknown_name_is_refused(add: Add, console: Console) -> None:
    add("loop", "Loop.ssp", "")
    add("loop_two", "LoopTwo.ssp", "_2")
    err = console.refused("system", "nominal", "lop_two")
    assert "no variant 'lop_two', did you mean 'loop_two'? (./run.sh system --list names" in err
    assert "variant 'nope' (./run.sh system --list names them)" in console.refused(
        "system", "loop", "nope"
    )


def test_a_name_stands_for_one_thing(add: Add, console: Console) -> None:
    add("loop", "Loop.ssp", "")
    path = add("loop_two", "LoopTwo.ssp", "")
    wanted = f"{path}: the name of variant 'nominal' is taken by a variant of loop\n"
    assert console.refused("system", "--list") == f"error: {wanted}"


def test_a_variant_has_not_the_name_of_a_system(add: Add, console: Console) -> None:
    path = add("nominal", "Nominal.ssp", "")
    wanted = f"{path}: the name of variant 'nominal' is taken by a system\n"
    assert console.refused("system", "--list") == f"error: {wanted}"


def test_a_system_that_is_not_built_is_named(add: Add, console: Console) -> None:
    add("loop", "Loop.ssp", "")
    add("loop_two", "LoopTwo.ssp", "_2").unlink()
    assert "has no SSP of loop_two: ./run.sh builds it" in console.refused("system", "--list")
    assert listed(console, "loop") == {"loop": list(CLOSED_LOOP.variants)}


def test_a_system_without_a_folder_has_no_references(
    add: Add, tmp_path: Path, console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ecos, "absent", lambda: "no Ecos")
    path = add("loop", "Loop.ssp", "")
    other = edited(path, tmp_path / "x.ssp", {STRUCTURE: replace('name="loop"', 'name="lop"')})
    assert listed(console, "--ssp", other) == {"lop": list(CLOSED_LOOP.variants)}
    given = ("nominal", "--step", "10ms", "--output", tmp_path / "report")
    code, out, error = console("system", other, *given)
    assert (code, error) == (0, "") and "no Ecos: the master of rparm steps lop" in out
    assert "coupling error about" in out and "passed" not in out
    same = shutil.copy(path, tmp_path / "same.ssp")  # a user's file with the project's name
    code, out, error = console("system", same, *given)
    assert (code, error) == (0, "") and "coupling error about" in out and "passed" not in out


def test_one_system_has_a_study_of_its_coupling(monkeypatch: pytest.MonkeyPatch) -> None:
    folder, known = comparison.coupling_study()
    assert folder.name == "closed_loop" and callable(known.study_coupling)
    for folders, found in (({}, "none"), ({"a": folder, "b": folder}, "closed_loop, closed_loop")):
        paths = {name: Path(name) / path.name for name, path in folders.items()}
        monkeypatch.setattr(project, "systems", lambda paths=paths: paths)
        monkeypatch.setattr(comparison, "load_study", lambda _: known)
        with pytest.raises(UserError, match=f"study of its coupling, found {found}"):
            comparison.coupling_study()
