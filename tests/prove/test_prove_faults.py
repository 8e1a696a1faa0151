"""Faults in the program that encloses motions do not get past the checkers."""

import pytest

from tests.prove import faults


@pytest.mark.parametrize("fault", faults.PLANTED, ids=lambda fault: fault.name)
def test_planted_faults_are_noticed(fault: faults.Fault) -> None:
    how = faults.verdict(fault.file, faults.source_of(fault))
    assert how not in (None, faults.UNCOMPILABLE)


@pytest.mark.parametrize("mutant", faults.sample(), ids=lambda mutant: mutant.description()[:80])
def test_random_faults_are_noticed_or_change_no_bound(mutant: faults.sites.Mutant) -> None:
    noticed = faults.verdict(mutant.file, faults.source_of(mutant)) is not None
    assert noticed or mutant.statement in faults.MASKED
