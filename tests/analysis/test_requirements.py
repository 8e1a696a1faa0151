"""The lists of Python packages and their locks, in requirements/ and tests/importers/requirements.

Each lock has what its list asks for and all dependencies of that, with hashes. Each command
imports packages of its lock only.
"""

import ast
import re
import sys
from collections.abc import Iterator
from functools import cache
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.support.paths import ROOT

FOLDER = ROOT / "requirements"
IMPORTERS = ROOT / "tests" / "importers" / "requirements"
LISTS = sorted([*FOLDER.glob("*.in"), *IMPORTERS.glob("*.in")])
LOCKS = sorted([*FOLDER.glob("*.txt"), *IMPORTERS.glob("*.txt")])
OPTIONS = {"-r run.in", "-r run.txt", "--only-binary :all:"}

# What each environment runs: patterns of files; what they import of the project belongs to it too.
COMMANDS = {
    "run": (
        "rparm/__main__.py", "rparm/commands/[!cfil]*.py", "rparm/commands/completion.py",
        "rparm/commands/files.py", "rparm/systems/ecos.py",
        "models/*/animation.py", "models/*/study.py",
        "fmu/generate.py", "fmu/document.py", "fmu/references.py", "fmu/package.py",
        "fmu/source_code.py", "fmu/equations_to_fmu.py",
        "fmu/equations_schema.py",
    ),
    "campaign": (
        "rparm/commands/campaign.py", "rparm/campaign/*.py",
    ),
    "control": (
        "rparm/commands/linearize.py", "rparm/linearization/*.py", "rparm/commands/identify.py",
        "rparm/identification/*.py",
    ),
    "federation": ("rparm/commands/fed*.py", "rparm/federation/*.py"),
    "release": ("fmu/bill_of_materials.py", "fmu/built.py", "fmu/wheel.py", "playground/build.py"),
    "dev": ("rparm/report/recording.py", "fmu/[!w]*.py", "models/**/*.py", "tests/**/*.py"),
}  # fmt: skip
# what others use only where its packages are installed
OPTIONAL = (
    "rparm/campaign/*.py", "rparm/federation/*.py", "rparm/identification/*.py",
    "rparm/linearization/*.py",
)  # fmt: skip
# each of these runs in the environment of its importer
ELSEWHERE = [*(ROOT / "tests" / "importers").glob("run_*.py")]
# in one environment: the tests'
TOGETHER = ("run", "campaign", "federation", "control", "dev")

Lock = dict[str, Requirement]


def lines(path: Path) -> list[str]:
    """Logical lines without comments and options."""
    text = re.sub(r"\\\n", " ", path.read_text())
    whole = [re.sub(r"(^|\s)#.*", "", line).strip() for line in text.splitlines()]
    return [line for line in whole if line and line not in OPTIONS]


def requirement(line: str) -> Requirement:
    return Requirement(line.partition("--hash")[0])


def named(path: Path) -> Lock:
    """What the file itself names."""
    every = [requirement(line) for line in lines(path)]
    return {canonicalize_name(each.name): each for each in every}


def with_run(path: Path) -> Lock:
    """What the file installs: most add to the list or lock `run`."""
    run = path.with_stem("run")
    return (named(run) if f"-r {run.name}" in path.read_text() else {}) | named(path)


@pytest.mark.parametrize("path", LISTS, ids=lambda path: path.stem)
def test_a_list_is_exact_and_locked(path: Path) -> None:
    lock = with_run(path.with_suffix(".txt"))
    for name, listed in with_run(path).items():
        assert re.fullmatch(r"==[^,*]+", str(listed.specifier)), f"{listed} is no exact version"
        assert lock[name].specifier == listed.specifier, f"{listed}: call requirements/lock.sh"


def test_each_list_has_a_lock() -> None:
    assert {path.with_suffix("") for path in LISTS} == {path.with_suffix("") for path in LOCKS}


@pytest.mark.parametrize("path", LOCKS, ids=lambda path: path.stem)
def test_a_lock_has_exact_versions_with_hashes_and_names_no_place(path: Path) -> None:
    for line in lines(path):
        assert re.fullmatch(r"==[^,*]+", str(requirement(line).specifier)), line
        assert re.search(r"( +--hash=sha256:[0-9a-f]{64})+$", line), line
    assert not re.search(r"//|@|index|find-links", path.read_text())


def test_locks_of_one_environment_agree() -> None:
    seen: dict[str, tuple[str, str]] = {}
    for path in sorted(FOLDER.glob("*.txt")):
        for line in lines(path):
            found = (str(requirement(line).specifier), line.partition("--hash")[2])
            assert seen.setdefault(requirement(line).name, found) == found, line


def reached(start: Lock) -> Iterator[str]:
    """What these need on this machine, as the installed packages say it."""
    done: set[tuple[str, str]] = set()
    todo = [(name, extra) for name, each in start.items() for extra in ("", *each.extras)]
    while todo:
        name, extra = todo.pop()
        if (name, extra) in done:
            continue
        done.add((name, extra))
        yield name
        if name == "ziglang":  # for releases only; it needs nothing
            continue
        for text in metadata.distribution(name).requires or ():
            need = Requirement(text)
            if need.marker is None or need.marker.evaluate({"extra": extra}):
                todo += [(canonicalize_name(need.name), extra) for extra in ("", *need.extras)]


@pytest.mark.parametrize("name", COMMANDS)
def test_a_lock_has_all_that_its_list_needs_and_nothing_else(name: str) -> None:
    lock = with_run(FOLDER / f"{name}.txt")
    here = {name for name, each in lock.items() if each.marker is None or each.marker.evaluate()}
    assert here == set(reached(with_run(FOLDER / f"{name}.in"))), "call requirements/lock.sh"


# ---- Imports


@cache
def imported(path: Path) -> set[str]:
    """Modules that a file imports, anywhere in it, but for those that only type checkers see."""
    tree = ast.parse(path.read_text())
    unseen = {  # nodes
        node
        for test in ast.walk(tree)
        if isinstance(test, ast.If) and ast.unparse(test.test) == "TYPE_CHECKING"
        for statement in test.body
        for node in ast.walk(statement)
    }
    found: set[str] = set()
    for node in set(ast.walk(tree)) - unseen:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = path.relative_to(ROOT).parts[: -node.level] if node.level else ()
            module = ".".join([*above, *filter(None, [node.module])])
            found |= {module, *(f"{module}.{alias.name}" for alias in node.names)}
    return {name.replace("rparm.fmu_tools.", "fmu.", 1) for name in found}


@cache
def own_modules() -> dict[str, list[Path]]:
    """The project's files by names to import, from the root or, of scripts, a folder."""
    found: dict[str, list[Path]] = {}
    for top in ("rparm", "fmu", "models", "playground", "tests"):
        for path in (ROOT / top).rglob("*.py"):
            parts = path.relative_to(ROOT).with_suffix("").parts
            parts = parts[:-1] if path.stem == "__init__" else parts
            if top == "models":  # rparm/models.py
                parts = ("rparm", *parts)
            for i in range(len(parts)):
                found.setdefault(".".join(parts[i:]), []).append(path)
    return found


def top_folder(path: Path) -> str:
    return path.relative_to(ROOT).parts[0] if path.is_relative_to(ROOT) else ""


def foreign_imports(patterns: tuple[str, ...]) -> dict[str, Path]:
    """Packages that are neither Python's nor the project's: by which file, of those reached."""
    todo = sorted({path for pattern in patterns for path in ROOT.glob(pattern)} - {*ELSEWHERE})
    assert todo
    done = {path for pattern in OPTIONAL for path in ROOT.glob(pattern)} - {*todo}
    own = own_modules()
    folders = {path.parent.name for paths in own.values() for path in paths}
    found: dict[str, Path] = {}
    while todo:
        path = todo.pop()
        if path in done:
            continue
        done.add(path)
        for module in imported(path):
            top = module.partition(".")[0]
            named = own.get(module, [])
            nearer = [other for other in named if top_folder(other) == top_folder(path)]
            todo += nearer or named
            if top not in {*own, *folders, *sys.stdlib_module_names}:
                found.setdefault(top, path)
    return found


def test_imports_are_found(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text(
        "import os, one.part\nimport b\nif TYPE_CHECKING:\n    import unseen\n"
        "def f():\n    from two import x\n"
    )
    assert imported(tmp_path / "a.py") == {"os", "one.part", "b", "two", "two.x"}
    assert {"numpy", "fmpy"} <= set(foreign_imports(("rparm/runs/simulation.py",)))


@pytest.mark.parametrize("name", COMMANDS)
def test_each_command_imports_only_what_its_lock_has(name: str) -> None:
    files = TOGETHER if name == "dev" else (name,)
    locked = {package for file in files for package in with_run(FOLDER / f"{file}.txt")}
    packages = metadata.packages_distributions()
    wrong = {
        module: str(path.relative_to(ROOT))
        for module, path in foreign_imports(COMMANDS[name]).items()
        if locked.isdisjoint(map(canonicalize_name, packages.get(module, ())))
    }
    assert not wrong
