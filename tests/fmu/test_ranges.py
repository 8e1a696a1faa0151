"""Values that all FMUs refuse in both versions: out of their ranges, or not fitting each other.

All cases of the latter are in the C tests of each model; here the model's words reach the importer.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cache
from math import isfinite
from pathlib import Path

import pytest

from rparm.errors import UserError
from rparm.fmi.fmu_file import Fmu
from tests.support.tables import tables

MISTAKES = tables(str(Path(__file__).with_name("mistakes")))
CASES = [
    (unit, name, value)
    for unit, names in MISTAKES["ranges"].items()
    for name, values in names.items()
    for value in values
]


@pytest.fixture(scope="module")
def opened_unit(fmu: Path) -> Iterator[Callable[[str], Fmu]]:
    """Opens FMUs by their paths below the folder of the build, each once."""
    with ExitStack() as stack:
        yield cache(lambda name: stack.enter_context(Fmu(fmu.parent / name)))


@pytest.mark.parametrize("below", ["", "fmi3/"])
@pytest.mark.parametrize(("unit", "name", "value"), CASES)
def test_values_out_of_range_are_refused(
    opened_unit: Callable[[str], Fmu], below: str, unit: str, name: str, value: float
) -> None:
    opened = opened_unit(f"{below}{unit}.fmu")
    start = opened.model.variables[name].start
    with opened.instance("unit") as instance:
        with pytest.raises(UserError):
            instance.set(name, value)
        message = instance.messages[-1]
        assert f"{name} = {value:g} is refused" in message
        assert ": a value from " in message or not isfinite(value)
        instance.set_up(0.0, None)
        instance.enter_initialization()
        instance.exit_initialization()
        if isinstance(value, float) and start is not None:
            reals = instance.reals([name])
            reals.get()
            assert reals.view.item() == start


@pytest.mark.parametrize("below", ["", "fmi3/"])
@pytest.mark.parametrize(("unit", "values", "words"), MISTAKES["together"]["rows"])
def test_values_that_do_not_fit_each_other_are_refused(
    opened_unit: Callable[[str], Fmu], below: str, unit: str, values: dict[str, float], words: str
) -> None:
    with opened_unit(f"{below}{unit}.fmu").instance("unit") as instance:
        instance.set_up(0.0, None)
        for name, value in values.items():
            instance.set(name, value)
        with pytest.raises(UserError) as refusal:
            instance.enter_initialization()
            instance.exit_initialization()
        assert words in str(refusal.value)
