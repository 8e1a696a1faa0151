"""What co-simulations of the machine without encoders and sampling converge to."""

import numpy as np
import pytest
from rparm.models.machine import continuous
from rparm.models.machine.continuous import BOUND, METHODS, SMALLEST, VARIANTS, Columns, Method

from rparm.fmi.fmu_file import Fmu
from rparm.runs.convergence import slope
from rparm.systems.ssp import Ssp

STOP = 0.4  # s: the start and the grasp
# steps per second of the runs here, by method
SHORT = {
    "Ecos": (3000, 5000, 7000, 9000, 11000),
    "Gauss-Seidel, inputs extrapolated": (4000, 6000, 8000, 12000),
}
SHORT_METHODS = [method for method in METHODS if method.name in SHORT]


@pytest.fixture(scope="module")
def runs(opened: Ssp, fmus: dict[str, Fmu]) -> dict[tuple[str, str], list[Columns]]:
    return {
        (variant, method.name): [
            continuous.run(opened, fmus, method, variant, n, STOP) for n in SHORT[method.name]
        ]
        for variant in VARIANTS
        for method in SHORT_METHODS
    }


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


@pytest.mark.parametrize("method", SHORT_METHODS, ids=lambda method: method.name)
@pytest.mark.parametrize("variant", VARIANTS)
def test_errors_fall_by_the_order_and_vanish_in_the_limit(
    runs: dict[tuple[str, str], list[Columns]], variant: str, method: Method
) -> None:
    expected, found = continuous.reference(variant), runs[variant, method.name]
    per_second = SHORT[method.name]
    errors = np.array([continuous.largest_error(columns, expected)[0] for columns in found])
    assert slope(1 / np.array(per_second), errors) == pytest.approx(method.power, abs=0.1)
    assert errors.min() > 100 * BOUND  # so the step is not short enough by itself
    left, enlarged = continuous.limit(found, per_second, method.power)
    assert enlarged < 200
    reached, name = continuous.largest_error(left, expected)
    assert reached <= BOUND, name


def test_a_known_payload_is_tracked_ten_times_better(
    runs: dict[tuple[str, str], list[Columns]],
) -> None:
    """In continuous time, over the whole motion and in the limits of both engines at first."""
    known, unknown = (continuous.reference(variant) for variant in VARIANTS)
    assert continuous.tracking_error(known) < 0.1 * continuous.tracking_error(unknown)
    # hanging down at rest, the slide carries what the law does not know of: m2 Kp2 e = mp g
    sag = continuous.tracking_error(unknown)
    assert sag == pytest.approx(9.81 / 400, rel=0.03)
    rows = len(next(iter(runs.values()))[0]["plant.q1"])
    for method in SHORT_METHODS:
        ends = {}
        for variant in VARIANTS:
            columns = runs[variant, method.name]
            left, _ = continuous.limit(columns, SHORT[method.name], method.power)
            expected = {n: x[:rows] for n, x in continuous.reference(variant).items()}
            ends[variant] = continuous.tracking_error(left)
            assert ends[variant] == pytest.approx(
                continuous.tracking_error(expected), abs=BOUND * SMALLEST
            )
        assert ends["pick_and_place"] < 0.1 * ends["pick_and_place_untold"]
