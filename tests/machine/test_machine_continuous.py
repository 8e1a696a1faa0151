"""The limit of co-simulations of the machine without encoders and sampling: the whole motion."""

import numpy as np
import pytest
from rparm.models.machine import continuous
from rparm.models.machine.continuous import BOUND, METHODS, SMALLEST, VARIANTS, Method

from rparm.fmi.fmu_file import Fmu
from rparm.runs.convergence import slope
from rparm.systems.structure import OpenedSystem


@pytest.mark.parametrize("power", [1, 2])
def test_the_limit_of_a_polynomial_is_its_constant_term(power: int) -> None:
    per_second = (40, 60, 80)
    steps = [40 / n for n in per_second]
    runs = [
        {"x": np.array([3.0 - 2.0 * h**power, 5.0 + h**power + 7.0 * h ** (power + 1)])}
        for h in steps
    ]
    found, enlarged = continuous.limit(runs, per_second, power)
    np.testing.assert_allclose(found["x"], [3.0, 5.0], rtol=0, atol=1e-13)
    # rounding of the runs, with the signs that add up
    spread = [{"x": np.array([s])} for s in (1.0, -1.0, 1.0)]
    assert abs(continuous.limit(spread, per_second, power)[0]["x"][0]) == pytest.approx(enlarged)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
@pytest.mark.parametrize("variant", VARIANTS)
def test_errors_fall_by_the_order_and_vanish_in_the_limit(
    opened: OpenedSystem, fmus: dict[str, Fmu], variant: str, method: Method
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
