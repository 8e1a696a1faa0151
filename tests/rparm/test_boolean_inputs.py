"""Scenarios with Boolean inputs: how they are read, and runs of the wheel of tests/wheel."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from rparm.errors import UserError
from rparm.fmi.fmu_file import CO_SIMULATION, INSTANCES, Fmu
from rparm.runs import scenario, simulation
from rparm.systems.master import Master
from rparm.systems.structure import Connection
from tests.support.rparm_project import BUILD, MISTAKES, fmi3_fmu
from tests.support.toy_model import DESCRIPTION, HEAD, TIME, timed, toy

SWITCHED = toy(
    DESCRIPTION.replace(
        "  </ModelVariables>",
        '<ScalarVariable name="brake" valueReference="11" causality="input" variability="discrete">'
        '<Boolean start="true"/></ScalarVariable>'
        '<ScalarVariable name="level" valueReference="12" causality="input" variability="discrete">'
        '<Integer start="3"/></ScalarVariable></ModelVariables>',
    )
)


def brake(write: Callable[..., object], text: str, time: str = TIME) -> np.ndarray:
    return scenario.load(write(f"{HEAD}{time}[inputs.brake]\n{text}\n"), SWITCHED).inputs["brake"]


def test_constant(write) -> None:
    values = brake(write, "constant = false")
    assert values.dtype == bool and values.tolist() == [False] * 5
    assert not values.flags.writeable


def test_start_value_where_nothing_is_given(write) -> None:
    values = scenario.load(write(HEAD + TIME), SWITCHED).input("brake")
    assert values.dtype == bool and values.tolist() == [True] * 5


def test_a_table_holds_from_each_time_on(write) -> None:
    values = brake(write, "table = [[0.25, true], [0.5, false], [0.9, true]]")
    assert values.tolist() == [True, True, False, False, True]


def test_rounding_of_times_does_not_delay_a_switch(write) -> None:
    """n steps of 0.1 s from 0.3 s on are often a bit less than n / 10 s after the start."""
    for n in range(1, 10):
        table = f"table = [[0, false], [{n / 10}, true]]"
        values = brake(write, table, f"[time]\nstart = 0.3\nstop = {0.3 + 1.0}\nstep = 0.1\n")
        assert values.tolist() == [False] * n + [True] * (11 - n)


@pytest.mark.parametrize(("text", "message"), MISTAKES["scenario_with_brake"]["rows"])
def test_mistakes_are_explained(write, text: str, message: str) -> None:
    path = write(f"{HEAD}{TIME}[inputs.brake]\n{text}\n")
    with pytest.raises(UserError) as caught:
        scenario.load(path, SWITCHED)
    said = str(caught.value)
    assert said.startswith(f"{path}: ") and message in said and "\n" not in said


def test_other_types_and_other_shapes_are_refused(write) -> None:
    with pytest.raises(UserError, match=r"level\]: is of type Integer, expected Real or Boolean$"):
        scenario.load(write(f"{HEAD}{TIME}[inputs.level]\nconstant = 1\n"), SWITCHED)
    with pytest.raises(UserError, match="constant: expected a number, got true"):
        scenario.load(write(f"{HEAD}{TIME}[inputs.force]\nconstant = true\n"), SWITCHED)


# ---- runs of the wheel ---------------------------------------------------------------------------


@pytest.fixture(params=["fmi2", "fmi3"])
def wheel(request: pytest.FixtureRequest) -> Iterator[Fmu]:
    path = BUILD / "tests" / "wheel" / "Wheel.fmu"
    with Fmu(path if request.param == "fmi2" else fmi3_fmu(path)) as fmu:
        yield fmu


INPUTS = "[inputs.speed]\nconstant = 3.0\n[inputs.is_counting]\n"


def test_a_boolean_input_and_parameter_reach_the_fmu(
    write, wheel: Fmu, monkeypatch: pytest.MonkeyPatch
) -> None:
    counted: list[tuple[float, int]] = []
    read = wheel.model.variables["turns"].reference
    instance_class = INSTANCES[wheel.model.fmi_version, CO_SIMULATION]
    do_step = instance_class.do_step

    def step_and_read(self, start: float, length: float, goes_back: bool = False) -> None:
        do_step(self, start, length, goes_back)
        counted.append((start + length, self._integer(read)))

    monkeypatch.setattr(instance_class, "do_step", step_and_read)
    text = timed(0, 10, 1) + "[parameters]\nis_reversed = true\n" + INPUTS
    text += "table = [[0, false], [4, true], [7, false]]\n"
    loaded = scenario.load(write(text), wheel.model)
    monkeypatch.setattr(simulation, "_steps_made", 0)  # else the compiled loop may step
    simulation.simulate(wheel, loaded)
    assert [time for time, _ in counted] == list(range(1, 11))
    for time, turns in counted:
        expected = -np.floor(3.0 * time / (2 * np.pi)) if 4 < time <= 7 else 0
        assert turns == expected


def test_only_boolean_inputs(write, wheel: Fmu) -> None:
    text = f"{timed(0, 2, 1)}[initial]\nangle = 1.0\n[inputs.is_counting]\nconstant = false\n"
    result = simulation.simulate(wheel, scenario.load(write(text), wheel.model))
    assert set(result.values[:, result.names.index("angle")]) == {1.0}


def turns(wheel: Fmu, counting: object) -> int | None:
    """Turns that one of two wheels counts, which give each other their speed in a master."""
    other = [Connection("a", "angle", "b", "speed"), Connection("b", "angle", "a", "speed")]
    with Master({"a": wheel, "b": wheel}, other) as master:
        start = {"angle": 20.0, "is_counting": counting}
        master.initialize(0.0, None, {"a": start, "b": {"angle": 1.0}})
        instance = master.components["a"].instance
        return instance.integer("turns")


def test_a_master_leaves_boolean_inputs_at_their_start(wheel: Fmu) -> None:
    assert turns(wheel, True) == 3
    assert turns(wheel, False) == 0
    with pytest.raises(UserError, match=r"^a\.is_counting: expected true or false, got 1$"):
        turns(wheel, 1)
