"""The whole motion with all methods and steps of the study: five minutes, with `ctest -C Long`."""

import numpy as np
import pytest
from rparm.models.machine import continuous
from rparm.models.machine.continuous import BOUND, METHODS, SMALLEST, VARIANTS, Method

from rparm.fmi.fmu_file import Fmu
from rparm.runs.convergence import slope
from rparm.systems.ssp import Ssp


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
@pytest.mark.parametrize("variant", VARIANTS)
def test_the_limit_is_the_solution(
    opened: Ssp, fmus: dict[str, Fmu], variant: str, method: Method
) -> None:
    expected = continuous.reference(variant)
    runs = [continuous.run(opened, fmus, method, variant, n) for n in method.per_second]
    errors = np.array([continuous.largest_error(columns, expected)[0] for columns in runs])
    assert slope(1 / np.array(method.per_second), errors) == pytest.approx(method.power, abs=0.1)
    left, _ = continuous.limit(runs, method.per_second, method.power)
    reached, name = continuous.largest_error(left, expected)
    assert reached <= BOUND, name
    tracking = continuous.tracking_error(left)
    assert abs(tracking - continuous.tracking_error(expected)) <= BOUND * SMALLEST
