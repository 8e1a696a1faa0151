"""Every variant of every system in Ecos is what the references say, of FMUs of both versions."""

import pytest

from rparm.systems import comparison, ssp
from tests.support.systems import BOUND, CASES, CLOSED_LOOP, System, difference

OF_FMI_3 = [case for case in CASES if case[1] not in ("heavy_payload", "horizontal_plane")]


@pytest.mark.parametrize(("system", "variant"), CASES, ids=lambda x: getattr(x, "folder", x))
def test_ecos_is_at_the_reference_of_its_order(system: System, variant: str) -> None:
    """All Real outputs within the bound; counts, modes and Booleans to the last bit."""
    expected, result = system.reference(variant), system.run(variant)
    rows = system.rows(expected)
    with ssp.unpacked(system.path) as opened:
        recorded, discrete = comparison.recorded(opened), set(comparison.discrete(opened))
    assert {"time", *recorded} <= set(expected) <= set(result)
    for name, values in expected.items():
        assert difference(result[name][rows], values) <= (0 if name in discrete else BOUND), name


def test_the_bound_tells_one_order_from_another() -> None:
    """A delay of one step more or less, or none at all, is far beyond it."""
    other = CLOSED_LOOP.reference("nominal", "monolithic.csv")
    result, rows = CLOSED_LOOP.run("nominal"), CLOSED_LOOP.rows(other)
    assert difference(result["arm.q1"][rows], other["arm.q1"]) > 100 * BOUND
    sampled = CLOSED_LOOP.reference("nominal", "sampled.csv")
    effort = "controller.tau1"
    assert difference(result[effort][rows], sampled[effort]) > 100 * BOUND


@pytest.mark.parametrize(("system", "variant"), OF_FMI_3, ids=lambda x: getattr(x, "folder", x))
def test_fmus_of_fmi_3_give_the_same_bits(system: System, variant: str) -> None:
    first, second = system.run(variant), system.run(variant, "fmi3")
    assert list(first) == list(second)
    for name, values in first.items():
        assert values.tobytes() == second[name].tobytes(), name
