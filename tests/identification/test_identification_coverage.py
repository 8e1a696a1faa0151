"""Eight logs of each case of the study: nearly all intervals hold the true values."""

import pytest

from tests.identification.coverage import CASES, study


@pytest.mark.parametrize("name", CASES)
def test_intervals_hold(name: str) -> None:
    row = study(CASES[name], range(8))
    assert row.found == 8
    # of 48 intervals or more, 95 % each: with fewer than 41 the chance is below 0.5 %
    assert row.coverage > 0.84
    if name == "effort noise":
        assert row.classical < 0.5  # what the scatter is for
