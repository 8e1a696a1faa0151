"""cosim drives any FMU: it imports nothing else of the project, and it names no model."""

import ast
import re
from pathlib import Path

import pytest
from conftest import ROOT
from cosim_project import FMUS, declared

FOLDERS = {folder.name for folder in ROOT.iterdir() if folder.is_dir()}
SOURCES = sorted(path for path in (ROOT / "cosim").rglob("*") if path.suffix in (".py", ".html"))
PYTHON = [path for path in SOURCES if path.suffix == ".py"]
STUDIES = sorted((ROOT / "models").rglob("*.py"))
SOLVER = {"time", "solver_steps", "solver_rhs_evaluations"}  # of every model with states
# words of English, letters and an argument of Ecos that are names of variables too
WORDS = {"branch", "mode", "motion", "radius", "turns", "duration", "frequency", "a", "g"}
WORDS |= {"start_time"}


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


def imported(path: Path) -> set[str]:
    """Top-level packages that a module imports, in functions too."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative import"
            found.add(node.module.partition(".")[0])
    return found


@pytest.mark.parametrize("path", PYTHON, ids=name_of)
def test_cosim_imports_nothing_else(path: Path) -> None:
    assert {"models", "fmu", "tests"} <= FOLDERS
    assert imported(path) & FOLDERS <= {"cosim"}


@pytest.mark.parametrize("path", STUDIES, ids=name_of)
def test_studies_and_references_import_only_cosim(path: Path) -> None:
    assert imported(path) & FOLDERS <= {"cosim", "models"}


@pytest.fixture(scope="module")
def names() -> set[str]:
    """Names of models, FMUs, systems and variables."""
    found = {*FMUS, *(fmu.stem for fmu in FMUS.values()), "closed_loop", "ClosedLoop"}
    for model in FMUS:
        found |= set(declared(model).variables) - SOLVER - WORDS
    assert {"q1", "tau1", "Kp1", "q1_ref", "kinetic_energy"} <= found
    return found


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_cosim_names_no_model(path: Path, names: set[str]) -> None:
    assert names.intersection(re.findall(r"\w+", path.read_text(encoding="utf-8"))) == set()
