"""The closed loop in libcosim is what the references say of values read before inputs are set."""

from pathlib import Path

import pytest

from tests.closed_loop.test_system import (
    BOUND,
    ROUNDING,
    STRUCTURE,
    VARIANTS,
    difference,
    reference,
    rows_of,
    run,
)
from tests.importers.osp import libcosim, only_variant
from tests.support.ssp_files import SSP, edited


@pytest.mark.parametrize("variant", VARIANTS)
def test_libcosim_is_at_the_reference_of_its_order(variant: str, tmp_path: Path) -> None:
    """libcosim reads before it sets inputs: all variables are those of the sampled system."""
    path = SSP
    if variant != "nominal":
        path = edited(SSP, tmp_path / "one.ssp", {STRUCTURE: only_variant(variant)})
    expected = reference(variant, "sampled.csv")
    rows = rows_of(expected)
    names = [name for name in expected if name != "time"]
    result = libcosim(path, names, 6000, tmp_path)
    worst = {name: difference(result[name][rows[1:] - 1], expected[name][1:]) for name in names}
    assert max(worst.values()) <= BOUND, max(worst, key=worst.__getitem__)


def test_libcosim_differs_from_ecos_by_the_time_of_reading_alone(tmp_path: Path) -> None:
    """Efforts without integral action show up one step later, and nothing else differs."""
    result, steps = run("nominal"), 2000
    names = [name for name in result if name != "time"]
    other = libcosim(SSP, names, steps, tmp_path)
    late = {f"controller.{name}" for name in ("tau1", "f2")}
    late |= {name for name in names if name.startswith("controller.") and "error" in name}
    direct = {"arm.ddq1", "arm.ddq2", "arm.actuator_power"}
    for name in names:
        if name in late:
            assert difference(other[name], result[name][:steps]) <= ROUNDING, name
        elif name not in direct:
            assert difference(other[name], result[name][1 : steps + 1]) <= ROUNDING, name
    for name in direct | late:
        assert difference(other[name], result[name][1 : steps + 1]) > 1e4 * ROUNDING, name
