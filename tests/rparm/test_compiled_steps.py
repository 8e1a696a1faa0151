"""The compiled loop gives the bits of the plain one, and says the same of what fails."""

import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest

import rparm
from rparm.errors import StoppedError
from rparm.fmi.fmu_file import Fmu
from rparm.runs import simulation
from rparm.runs.scenario import Scenario
from rparm.runs.simulation import Result
from tests.support.rparm_project import FMUS, NAMES, edit, fmi3_fmu, load

both_versions = pytest.mark.parametrize("version", [2, 3])


def opened(folder: str, version: int) -> Fmu:
    return Fmu(FMUS[folder] if version == 2 else fmi3_fmu(FMUS[folder]))


@pytest.fixture(autouse=True)
def which_loop(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """Names of the loops that ran."""
    ran: list[str] = []
    for name in ("_step_through", "_step_compiled"):
        loop = getattr(simulation, name)

        def named(*arguments: object, loop: Callable = loop, name: str = name) -> object:
            ran.append(name)
            return loop(*arguments)

        monkeypatch.setattr(simulation, name, named)
    monkeypatch.setattr(simulation, "_steps_made", 0)
    return ran


def assert_same(fmu: Fmu, scenario: Scenario) -> Result:
    """Both loops make the same of a scenario; what it is."""
    plain, fast = (simulation.simulate(fmu, scenario, compiled=x) for x in (False, True))
    assert plain.names == fast.names and plain.messages == fast.messages
    for name in ("tolerance", "steps", "solver_steps", "solver_rhs_evaluations"):
        assert getattr(plain, name) == getattr(fast, name)
    assert plain.values.tobytes() == fast.values.tobytes()
    assert plain.times.tobytes() == fast.times.tobytes() and not fast.integers
    return fast


@both_versions
@pytest.mark.parametrize("name", NAMES)
def test_a_scenario_has_the_same_bits(name: str, version: int, which_loop: list[str]) -> None:
    scenario = replace(load(name), panels=())
    with opened(scenario.model, version) as fmu:
        result = assert_same(fmu, scenario)
    assert len(result.values) == len(scenario.reference_rows)
    assert which_loop == ["_step_through", "_step_compiled"]


@both_versions
def test_a_step_that_fails_keeps_the_rows_before_and_the_message(version: int) -> None:
    scenario = replace(load("constant_effort"), reference_every=3)
    force = np.where(np.arange(len(scenario.times)) < 100, 1.0, 1e308)
    scenario = replace(scenario, inputs={**scenario.inputs, "f2": force})
    with opened("rp_manipulator", version) as fmu:
        stopped = []
        for compiled in (False, True):
            with pytest.raises(StoppedError) as caught:
                simulation.simulate(fmu, scenario, compiled=compiled)
            stopped.append(caught.value)
    plain, fast = stopped
    assert str(plain) == str(fast) and "in the step from t = 1.0 s failed" in str(fast)
    assert len(fast.result.times) == 34 and fast.result.solver_steps is None
    assert plain.result.values.tobytes() == fast.result.values.tobytes()


@both_versions
def test_the_first_step_may_fail(project: Path, version: int) -> None:
    path = project / "models/rp_manipulator/scenarios/constant_effort_single_step.toml"
    edit(path, "[parameters]", "[parameters]\nmax_internal_steps = 3")
    with opened("rp_manipulator", version) as fmu:
        texts = set()
        for compiled in (False, True):
            with pytest.raises(StoppedError) as caught:
                simulation.simulate(
                    fmu, load("constant_effort_single_step", project), None, None, compiled
                )
            texts.add(str(caught.value))
            assert len(caught.value.result.times) == 1
    assert len(texts) == 1


def test_progress_counts_all_steps_and_may_interrupt() -> None:
    counted: list[int] = []

    def interrupt(_: int) -> NoReturn:
        raise KeyboardInterrupt

    with opened("rp_manipulator", 2) as fmu:
        scenario = load("sine_efforts")
        simulation.simulate(fmu, scenario, progress=counted.append, compiled=True)
        assert sum(counted) == len(scenario.times) - 1 and len(counted) > 3
        with pytest.raises(KeyboardInterrupt):
            simulation.simulate(fmu, scenario, progress=interrupt, compiled=True)
        assert_same(fmu, scenario)


def test_it_is_used_where_it_pays(monkeypatch: pytest.MonkeyPatch, which_loop: list[str]) -> None:
    """After enough steps of one process, by programs at once, and never for drawn Integers."""
    monkeypatch.setattr(simulation, "WORTH_COMPILING", 1200)
    with opened("rp_manipulator", 2) as fmu:
        for _ in range(4):
            simulation.simulate(fmu, load("constant_effort"))
    rparm.Scenario("constant_effort").run()
    rparm.simulate(FMUS["rp_manipulator"], stop_time=1.0, step=0.1)
    with opened("rp_plant", 2) as fmu:
        assert simulation.simulate(fmu, load("stick_slip")).integers
    plain, compiled = ["_step_through"], ["_step_compiled"]
    assert which_loop == plain * 2 + compiled * 4 + plain


def test_without_numba_the_plain_loop_runs(
    monkeypatch: pytest.MonkeyPatch, which_loop: list[str]
) -> None:
    monkeypatch.setitem(sys.modules, "rparm.fmi.compiled_loop", None)
    table = rparm.simulate(FMUS["rp_manipulator"], stop_time=1.0, step=0.1)
    assert len(table["time"]) == 11 and which_loop == ["_step_through"]
