"""Random motions of the built FMU with compliant stops, event by event, against the independent
simulation.

long_plant_compliant_motions has a hundred of them.
"""

import os
from collections import Counter
from pathlib import Path

import pytest

from cosim.fmi.fmu_file import Fmu
from models.rp_plant.references.solver import Solver
from tests.rp_plant.plant_runs import COMPLIANT, METHODS
from tests.rp_plant.random_motions import Outcome, compliant_case, judge_all
from tests.support.paths import ROOT

CASES, SEED = 8, 14


@pytest.fixture(scope="module")
def outcomes() -> list[Outcome]:
    path = Path(os.environ.get("RP_FMU", ROOT / "build" / "RPManipulator.fmu"))
    with Fmu(path.with_name("RPPlant.fmu")) as fmu:
        return judge_all(fmu, Solver(), CASES, SEED, compliant_case)[0]


@pytest.mark.parametrize("method", METHODS)
def test_events_and_states_agree(outcomes: list[Outcome], method: str) -> None:
    """Times to 1e-9 s, states to 1e-8, and the same modes."""
    failed = [(x.number, x.errors[method]) for x in outcomes if not x.errors[method].passed]
    assert failed == []


def test_cases_are_worth_it(outcomes: list[Outcome]) -> None:
    """Contacts begin and end at both stops, and one stop lets go of a joint."""
    compliant = [
        x for x in outcomes if COMPLIANT in (x.case.values["stops1"], x.case.values["stops2"])
    ]
    kinds = Counter(event.what for x in compliant for event in x.truth.events)
    assert kinds["lower"] > CASES and kinds["upper"] > CASES and kinds["push"] > 0
