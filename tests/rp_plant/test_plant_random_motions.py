"""Random motions of the built FMU, event by event, against the independent simulation.

long_plant_random_motions has two hundred of them.
"""

import os
from collections import Counter
from pathlib import Path

import pytest

from cosim.fmi.fmu_file import Fmu
from models.rp_plant.references.solver import Solver
from tests.rp_plant.plant_runs import METHODS
from tests.rp_plant.random_motions import MOST_EVENTS, Outcome, judge_all
from tests.support.paths import ROOT

CASES, SEED = 24, 7


@pytest.fixture(scope="module")
def outcomes() -> list[Outcome]:
    path = Path(os.environ.get("RP_FMU", ROOT / "build" / "RPManipulator.fmu"))
    with Fmu(path.with_name("RPPlant.fmu")) as fmu:
        return judge_all(fmu, Solver(), CASES, SEED)[0]


@pytest.mark.parametrize("method", METHODS)
def test_events_and_states_agree(outcomes: list[Outcome], method: str) -> None:
    """Times to 1e-9 s, states to 1e-8, and the same modes."""
    failed = [(x.number, x.errors[method]) for x in outcomes if not x.errors[method].passed]
    assert failed == []


def test_cases_are_worth_it(outcomes: list[Outcome]) -> None:
    """Joints come to rest, break away and strike both stops, with a payload that comes and goes."""
    kinds = Counter(event.what for x in outcomes for event in x.truth.events)
    assert kinds["forward"] > CASES and kinds["lower"] + kinds["upper"] > CASES
    assert kinds["backward"] > 0
    assert sum(len(x.truth.events) == MOST_EVENTS for x in outcomes) > CASES / 2
    assert any(x.case.changes for x in outcomes) and any(x.case.rates for x in outcomes)
