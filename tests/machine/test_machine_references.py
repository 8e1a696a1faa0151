"""The machine's references, sampled and continuous: made again, closed forms, refusals."""

import numpy as np
import pytest
from rparm.models.machine import continuous
from rparm.models.machine.continuous import VARIANTS
from rparm.models.machine.experiment import STEPS_PER_SECOND
from rparm.models.machine.references import make_references
from rparm.models.machine.references.machine import COMPONENTS, completed, declared
from rparm.models.machine.references.make_references import variants
from rparm.models.machine.references.monolithic import COLUMNS, monolithic
from rparm.models.rp_plant.references.solver import Solver

from rparm.errors import UserError
from tests.support.systems import MACHINE_SYSTEM as MACHINE

STOP = 0.3  # s, of what is made again


@pytest.fixture(scope="module")
def solver() -> Solver:
    return Solver()


def test_variants_are_those_of_the_system() -> None:
    assert set(make_references.variants()) == set(MACHINE.variants)


@pytest.mark.long
@pytest.mark.parametrize("variant", ["pick_and_place", "stick_slip", "noisy_sensor"])
def test_made_again_it_begins_alike(solver: Solver, variant: str) -> None:
    parameters = make_references.variants()[variant]
    made = make_references.make(solver, parameters, STOP)
    for file in make_references.FILES:
        times, columns = made[file]
        assert len(times) == round(STOP * STEPS_PER_SECOND) // make_references.KEPT + 1
        kept = MACHINE.reference(variant, file)
        assert list(kept) == ["time", *columns]
        for name, column in columns.items():
            rows = kept[name][: len(times)]
            scale = max(np.abs(rows).max(), 1e-3)
            assert np.abs(column - rows).max() <= 1e-13 * scale, (file, name)
    times, columns = made["tightest.csv"]  # of these 0.3 s: not all samples are among the tightest
    kept = MACHINE.reference(variant, "tightest.csv")
    listed = kept["time"] < STOP - 0.01
    rows = np.searchsorted(times.astype(float), kept["time"][listed])
    assert len(rows) > 10 or variant == "stick_slip"  # which has none so early
    for name, column in columns.items():
        np.testing.assert_allclose(column[rows], kept[name][listed], rtol=0, atol=1e-16)


def test_columns_are_all_outputs() -> None:
    names = [*make_references.columns(), *make_references.DISCRETE]
    assert len(names) == len(set(names))
    for component, model in declared().items():
        assert {f"{component}.{name}" for name in model.real_outputs} <= set(names)
    assert set(declared()) == set(COMPONENTS)


def test_unknown_parameters_are_refused() -> None:
    with pytest.raises(UserError, match=r"no parameter 'plant\.m3'"):
        completed({"plant.m3": 1.0})


# ---- In continuous time --------------------------------------------------------------------------


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
