"""rparm drives any FMU: it names no model."""

import re
from pathlib import Path

import pytest

from tests.support.paths import ROOT
from tests.support.rparm_project import FMUS, declared

SOURCES = sorted(path for path in (ROOT / "rparm").rglob("*") if path.suffix in (".py", ".html"))
# of every model with states
SOLVER = {"time", "solver_steps", "solver_rhs_evaluations", "solver_restarts"}
SOLVER |= {"solver_failed_steps", "effective_relative_tolerance"}
SOLVER |= {"solver_method", "relative_tolerance"}
# words of English, letters and an argument of Ecos that are names of variables too
WORDS = {"branch", "mode", "motion", "radius", "turns", "duration", "frequency", "a", "g"}
WORDS |= {"start_time", "position"}
WORDS |= {"delay"}  # an argument of tqdm
WORDS |= {"seed"}  # of random numbers
WORDS |= {"angle", "damping"}  # of complex numbers and of poles


@pytest.fixture(scope="module")
def names() -> set[str]:
    """Names of models, FMUs, systems and variables."""
    found = {*FMUS, *(fmu.stem for fmu in FMUS.values()), "closed_loop", "ClosedLoop", "Machine"}
    for model in FMUS:
        found |= set(declared(model).variables) - SOLVER - WORDS
    assert {"q1", "tau1", "Kp1", "q1_ref", "kinetic_energy"} <= found
    return found


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_model_is_named(path: Path, names: set[str]) -> None:
    assert names.intersection(re.findall(r"\w+", path.read_text(encoding="utf-8"))) == set()
