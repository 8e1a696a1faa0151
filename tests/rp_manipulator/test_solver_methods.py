"""Every method of integration, on the built FMU, against solutions that share no code with it."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from rparm.models.rp_manipulator.references import make_references

from rparm.fmi.fmu_file import Fmu
from rparm.runs import comparison, simulation
from rparm.runs.comparison import TOLERANCES, Reference, Runs, sweep
from rparm.runs.scenario import Scenario
from tests.support.paths import ROOT
from tests.support.rparm_project import load as load_scenario
from tests.support.rparm_project import names_of

METHODS = {"cvode_adams": 1, "cvode_bdf": 2, "erk": 3, "taylor": 4}
SCENARIOS = names_of("rp_manipulator")
JUMPS = [10.0**exponent for exponent in range(-12, 4)]  # relative to the input
JUMP_TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)

each_method = pytest.mark.parametrize("method", METHODS)


def load(name: str, **parameters: float) -> Scenario:
    """A scenario with further parameters."""
    found = load_scenario(name)
    return dataclasses.replace(found, parameters=found.parameters | parameters)


# ---- References ------------------------------------------------------------------------------


@each_method
@pytest.mark.parametrize("name", SCENARIOS)
def test_errors_stay_within_their_bounds(opened: Fmu, name: str, method: str) -> None:
    """At every tolerance the bound of ./run.sh, and all its rules from one to the next."""
    runs = Runs({"rp_manipulator": opened})
    swept = sweep(runs, load(name, solver_method=METHODS[method]))
    assert swept.tolerances == TOLERANCES
    assert swept.violations == []


@each_method
def test_a_limit_of_the_step_keeps_the_bounds(opened: Fmu, method: str) -> None:
    runs = Runs({"rp_manipulator": opened})
    scenario = load("constant_effort", solver_method=METHODS[method], max_step=1e-3)
    for tolerance in TOLERANCES:
        run = runs.run(scenario, tolerance)
        assert run.passed, run.worst
        assert run.result.solver_steps >= 5000  # 5 s


# ---- Jumps -----------------------------------------------------------------------------------


def jumping(size: float, **parameters: float) -> Scenario:
    """100 steps of 10 ms; both inputs jump by up to `size` of themselves at every point."""
    base = load("constant_effort", **parameters)
    times = np.arange(101) * 0.01
    factors = 1 + size * np.random.default_rng(0).uniform(-1, 1, len(times))
    return dataclasses.replace(
        base,
        stop=1.0,
        times=times,
        inputs={name: values[0] * factors for name, values in base.inputs.items()},
        reference_every=1,
    )


@pytest.fixture(scope="module")
def exact() -> dict[float, Reference]:
    """Solutions of the independent equations, by the size of the jumps."""
    equations = make_references.Reference()
    summed = comparison.read_summed(ROOT / "models" / "rp_manipulator")
    found = {}
    for size in JUMPS:
        scenario = jumping(size)
        values = equations.simulate(scenario).astype(float)
        names = tuple(equations.outputs)
        found[size] = Reference(Path("none"), scenario.times, names, values, summed)
    return found


@each_method
@pytest.mark.parametrize("tolerance", JUMP_TOLERANCES)
def test_jumps_of_all_sizes_keep_the_accuracy(
    opened: Fmu, exact: dict[float, Reference], method: str, tolerance: float
) -> None:
    """Errors are near the tolerance or below; while the motion is alike, none stands out."""
    errors = {}
    for size in JUMPS:
        result = simulation.simulate(
            opened, jumping(size, solver_method=METHODS[method]), tolerance
        )
        errors[size] = max(comparison.errors_against(result, exact[size]).values())
    assert max(errors.values()) < 3 * tolerance
    usual = max(errors[JUMPS[0]], tolerance / 100)
    assert max(error for size, error in errors.items() if size <= 1) < 2 * usual
