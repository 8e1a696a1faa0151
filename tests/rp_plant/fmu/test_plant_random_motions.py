"""Random motions of the built FMU, event by event, against the independent simulation."""

from collections import Counter
from collections.abc import Callable

import pytest
from rparm.models.rp_plant.references.solver import Solver

from rparm.fmi.fmu_file import Fmu
from tests.rp_plant.fmu.plant_runs import COMPLIANT
from tests.rp_plant.fmu.random_motions import (
    BOUNDS,
    MOST_EVENTS,
    Outcome,
    compliant_case,
    judge_all,
    random_case,
)

Outcomes = dict[str, list[Outcome]]


@pytest.fixture(scope="module")
def outcomes(fmi2_plant: Fmu) -> Outcomes:
    """Of cases with rigid stops, and with compliant ones."""
    solver = Solver()
    kinds = {"rigid": (24, 7, random_case), "compliant": (8, 14, compliant_case)}
    return {kind: judge_all(fmi2_plant, solver, *draws) for kind, draws in kinds.items()}


@pytest.mark.parametrize("method", BOUNDS)
@pytest.mark.parametrize("kind", ["rigid", "compliant"])
def test_events_and_states_agree(outcomes: Outcomes, kind: str, method: str) -> None:
    """Times to 1e-9 s, states to 1e-8 (in Model Exchange ten times that), and the same modes."""
    errors = [(x.number, x.errors[method]) for x in outcomes[kind] if method in x.errors]
    assert len(errors) >= 6 and [(n, e) for n, e in errors if not e.pass_by(method)] == []


def test_rigid_cases_are_worth_it(outcomes: Outcomes) -> None:
    """Joints come to rest, break away and strike both stops, with a payload that comes and goes."""
    cases = outcomes["rigid"]
    kinds = Counter(event.what for x in cases for event in x.truth.events)
    assert kinds["forward"] > len(cases) and kinds["lower"] + kinds["upper"] > len(cases)
    assert kinds["backward"] > 0
    assert sum(len(x.truth.events) == MOST_EVENTS for x in cases) > len(cases) / 2
    assert any(x.case.changes for x in cases) and any(x.case.rates for x in cases)


def test_compliant_cases_are_worth_it(outcomes: Outcomes) -> None:
    """Contacts begin and end at both stops, and one stop releases a joint."""
    cases = outcomes["compliant"]
    assert all(COMPLIANT in (x.case.values["stops1"], x.case.values["stops2"]) for x in cases)
    kinds = Counter(event.what for x in cases for event in x.truth.events)
    assert kinds["lower"] > len(cases) and kinds["upper"] > len(cases) and kinds["push"] > 0


@pytest.mark.long
@pytest.mark.parametrize(("count", "draw"), [(200, random_case), (100, compliant_case)])
def test_hundreds_of_others_agree(fmi2_plant: Fmu, count: int, draw: Callable) -> None:
    for outcome in judge_all(fmi2_plant, Solver(), count, 0, draw):
        for method, errors in outcome.errors.items():
            assert errors.pass_by(method), (method, errors, outcome)
