"""Events that end the simulation, as importers of both versions and the program see it."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import fmi2LastSuccessfulTime, fmi2Terminated

from rparm.errors import StoppedError, UserError
from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import MODEL_EXCHANGE, Fmu
from rparm.runs import simulation
from rparm.runs.scenario import load
from rparm.systems.master import Master
from tests.equations.examples import METHODS, made, quick
from tests.support.instances import DISCARD, ERROR, restore, serialized, status_of

# by Torricelli's law, the root of h falls by k / 2 in a second
TANK = """name = "Tank"
[parameters]
k = { start = 0.1 }
limit = { start = 0.01 }
[inputs]
pump = {}
[states]
h = { start = 1, derivative = "pump - k * sqrt(h) if h > 0 else pump" }
[discrete]
calls = {}
[outputs]
outflow = { value = "k * sqrt(h)" }
[events.half]
when = "h < 0.25"
set = { calls = "1" }
[events.empty]
when = "h < limit"
set = { calls = "calls + 1" }
terminate = "the tank is 99% empty: {outflow} of {k}"
"""
EMPTY = 18.0  # s
REASON = "event empty: the tank is 99% empty: 0.01 of 0.1"
VERSIONS = pytest.mark.parametrize("version", ["2.0", "3.0"])


def of_version(fmu: Path, version: str) -> Path:
    return fmu if version == "2.0" else fmu.parent / "fmi3" / fmu.name


def begun(instance: Instance, **values: float) -> Instance:
    """An instance at the start, with these values."""
    instance.set_up(0.0, None, 1e-9)
    for name, value in values.items():
        instance.set(name, value)
    instance.enter_initialization()
    instance.exit_initialization()
    return instance


def step(instance: Instance, t: float, h: float) -> float | None:
    """Make a step; the time at which the FMU ends the simulation, if it does."""
    fmi = instance.fmi
    if instance.fmu.model.fmi_version == "3.0":
        _, ends, early, time = fmi.doStep(t, h)
        assert not early  # which is not allowed
        return time if ends else None
    try:
        fmi.doStep(t, h)
    except FMICallException as error:
        assert error.status == DISCARD and fmi.getBooleanStatus(fmi2Terminated)
        return fmi.getRealStatus(fmi2LastSuccessfulTime)
    assert not fmi.getBooleanStatus(fmi2Terminated)
    return None


def run(instance: Instance, t: float = 0.0, h: float = 0.7) -> tuple[float, float]:
    """Step until the FMU ends the simulation; this time, and the begin of the last step."""
    while (end := step(instance, t, h)) is None:
        t += h
    return end, t


def values(instance: Instance, *names: str) -> list[float]:
    reals = instance.reals(names)
    reals.get()
    return reals.view.tolist()


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
@VERSIONS
def test_a_step_ends_where_the_tank_is_empty(version: str, method: int) -> None:
    with Fmu(of_version(made(TANK), version)) as fmu, fmu.instance("one") as instance:
        end, begin = run(begun(instance, solver_method=method))
        assert end == pytest.approx(EMPTY, abs=1e-8) and begin < end < begin + 0.7
        assert values(instance, "h", "calls") == [pytest.approx(0.01, abs=1e-9), 2.0]
        assert list(instance.messages) == [f"the simulation ends at t = {end!r}: {REASON}"]
        if version == "2.0":  # after a discarded step none is allowed
            assert status_of(instance.fmi.doStep, end, 0.7) == ERROR
        else:
            assert step(instance, end, 0.7) == end and len(instance.messages) == 1
            instance.fmi.terminate()
        assert values(instance, "calls") == [2.0]
        instance.reset()
        assert run(begun(instance, solver_method=method))[0] == end


@VERSIONS
@pytest.mark.parametrize(
    "options",
    [
        {"fmi_type": "ModelExchange"},
        {},
        {"early_return_allowed": True},
        {"use_event_mode": True},
        {"use_event_mode": True, "early_return_allowed": True},
    ],
)
def test_other_importers_stop_there(version: str, options: Mapping[str, Any]) -> None:
    found = fmpy.simulate_fmu(
        str(of_version(made(TANK), version)),
        stop_time=32,
        output_interval=0.8,
        relative_tolerance=1e-9,
        output=["h"],
        **options,
    )[-1]  # fmpy integrates with a tolerance of its own
    may_not_return = version == "3.0" and not {"fmi_type", "early_return_allowed"} & options.keys()
    end = 18.4 if may_not_return else EMPTY  # fmpy asks no FMU how far it came then
    assert found["time"] == pytest.approx(end, abs=1e-3)
    assert found["h"] == pytest.approx(0.01, abs=1e-5)


@VERSIONS
def test_a_state_from_before_the_end_goes_there_again(version: str) -> None:
    with (
        Fmu(of_version(made(TANK), version)) as fmu,
        fmu.instance("one") as one,
        fmu.instance("other") as other,
    ):
        begun(one)
        for t in range(10):
            assert step(one, float(t), 1.0) is None
        before = serialized(one)
        end, last = run(one, 10.0)
        after = serialized(one)
        restore(begun(other), after)
        assert serialized(other) == after and values(other, "calls") == [2.0]
        if version == "2.0":
            assert other.fmi.getBooleanStatus(fmi2Terminated)
        else:
            assert step(other, end, 1.0) == end
        for instance in (one, other):
            restore(instance, before)
            assert run(instance, 10.0) == (end, last)
            assert serialized(instance) == after


@VERSIONS
def test_what_is_true_at_the_start_ends_the_first_step_there(version: str) -> None:
    fmu = of_version(made(TANK), version)
    with Fmu(fmu) as opened, opened.instance("one") as instance:
        assert step(begun(instance, limit=2.0), 0.0, 1.0) == 0.0
        assert values(instance, "h", "calls") == [1.0, 1.0]
    said = "^one: the FMU ends the simulation at t = 0: event empty"
    with (
        Fmu(fmu, kind=MODEL_EXCHANGE) as opened,
        opened.instance("one") as instance,
        pytest.raises(UserError, match=said),
    ):
        begun(instance, limit=2.0)


@VERSIONS
def test_an_input_that_jumps_ends_the_next_step_at_its_begin(version: str) -> None:
    text = TANK.replace('"h < limit"', '"pump > 1"')
    with Fmu(of_version(made(text), version)) as fmu, fmu.instance("one") as instance:
        assert step(begun(instance), 0.0, 1.0) is None
        instance.set("pump", 2.0)
        assert step(instance, 1.0, 1.0) == 1.0
        assert values(instance, "h")[0] == pytest.approx(0.95**2)


def test_the_instant_is_completed_and_the_first_event_is_named() -> None:
    """A tick, a jump, and two events that end the simulation at once; the file has their order."""
    text = """name = "Instant"
[states]
x = { derivative = "1" }
[discrete]
n = {}
[sampled.s]
every = "0.5"
set = { n = "n + 1" }
[events]
silent = { when = "x >= 1", reinit = { x = "x + 4" } }
second = { when = "x >= 4", terminate = "x is {x}, n is {n}" }
third = { when = "x >= 3", set = { n = "-n" }, terminate = "not said" }
"""
    with Fmu(made(text)) as fmu, fmu.instance("one") as instance:
        assert step(begun(instance), 0.0, 3.0) == 1.0
        assert values(instance, "x", "n") == [5.0, -3.0]
        assert instance.messages[-1].endswith("t = 1: event second: x is 5, n is -3")


def test_events_of_components_have_their_names(tmp_path: Path) -> None:
    (tmp_path / "tank.toml").write_text(TANK)
    inner = 'name = "Inner"\n[components]\nb = "tank.toml"\n'
    (tmp_path / "inner.toml").write_text(inner)
    whole = tmp_path / "whole.toml"
    whole.write_text(inner.replace("Inner", "Whole").replace('b = "tank', 'a = "inner'))
    with Fmu(quick(whole, tmp_path)) as fmu, fmu.instance("one") as instance:
        assert run(begun(instance))[0] == pytest.approx(EMPTY)
        assert instance.messages[-1].endswith(REASON.replace("empty:", "a.b.empty:", 1))


@VERSIONS
def test_a_run_keeps_its_rows_and_says_why_it_ended(version: str, tmp_path: Path) -> None:
    file = tmp_path / "run.toml"
    file.write_text(
        f'fmu = "{of_version(made(TANK), version)}"\ntitle = "T"\ndescription = "D"\n'
        "tolerance = 1e-9\n[time]\nstart = 0.0\nstop = 30.0\nstep = 0.7\n"
    )
    said = rf"the FMU ends the simulation at t = (18\.0|17\.9)\d*: {re.escape(REASON)}$"
    with Fmu(of_version(made(TANK), version)) as fmu:
        with pytest.raises(StoppedError, match=f"^run: {said}") as stopped:
            simulation.simulate(fmu, load(file, fmu.model))
        result = stopped.value.result
        assert len(result.times) == 26 and result.times[-1] == pytest.approx(17.5)
        height = result.values[:, result.names.index("h")]
        np.testing.assert_allclose(height, (1 - result.times / 20) ** 2, rtol=0, atol=1e-7)
        with Master({"tank": fmu}, []) as master:
            master.initialize(0.0)
            with pytest.raises(UserError, match=f"^tank: {said}"):
                master.run(np.arange(0.0, 30.0, 0.7))
        assert master.time == pytest.approx(17.5)
