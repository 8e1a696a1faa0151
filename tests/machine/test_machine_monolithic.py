"""The machine in continuous time: made again, and what it cannot have is refused.

test_machine_continuous.py compares it with the limit of co-simulations of the FMUs.
"""

import numpy as np
import pytest
from rparm.models.machine import continuous
from rparm.models.machine.continuous import VARIANTS
from rparm.models.machine.references.make_references import variants
from rparm.models.machine.references.monolithic import COLUMNS, monolithic

from rparm.errors import UserError


@pytest.mark.long
@pytest.mark.parametrize("variant", VARIANTS)
def test_made_again_it_is_the_same(variant: str) -> None:
    expected = continuous.reference(variant)
    assert set(expected) == {"time", *COLUMNS}
    times = expected["time"][:60]
    assert times[-1] > 1.0
    for name, column in monolithic(variants()[variant], times).items():
        scale = max(np.abs(expected[name]).max(), 1e-3)
        assert np.abs(column - expected[name][:60]).max() <= 1e-13 * scale, name


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"plant.coulomb_friction1": 0.1}, r"plant\.coulomb_friction1 has to be 0"),
        ({"controller.Ki2": 1.0}, r"controller\.Ki2 has to be 0"),
        ({"controller.mode": 1}, r"controller\.mode keeps its default"),
        ({"environment.position": 0.6}, r"the wall is touched"),
        ({"controller.tau1_max": 5.0}, r"controller\.tau1 reaches its limit 5\.0"),
        ({"actuator.voltage_max1": 0.1}, r"actuator\.voltage1 reaches its limit 0\.1"),
    ],
)
def test_what_the_equations_do_not_have_is_refused(changes: dict[str, float], message: str) -> None:
    with pytest.raises(UserError, match=message):
        monolithic(variants()["pick_and_place"] | changes, [0.0, 0.1, 0.3])


def test_times_must_ascend_from_0() -> None:
    for times in ([], [0.1, 0.2], [0.0, 0.2, 0.2]):
        with pytest.raises(UserError, match="times must ascend from 0"):
            monolithic(variants()["pick_and_place"], times)
