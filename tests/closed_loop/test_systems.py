"""Several systems in one project: which variants the names of `system` stand for."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from rparm import project
from rparm.errors import UserError
from rparm.systems import comparison, ecos
from tests.support.rparm_project import Console
from tests.support.ssp_files import SSP, Edit, edited, replace
from tests.support.systems import CLOSED_LOOP

STRUCTURE = "SystemStructure.ssd"
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
