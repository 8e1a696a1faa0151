"""Promises of every FMU, over all FMUs and their scenarios: scenarios meet their references, both
versions have the same bits, fmpy runs it, rollback leaves no trace, names have one unit.
Dependencies: test_initialization.py."""

import random
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import product
from pathlib import Path

import fmpy
import numpy as np
import pytest

from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from rparm.project import model_folder
from rparm.runs.comparison import Runs, differing
from rparm.runs.scenario import Scenario
from rparm.runs.simulation import initialize
from tests.support.instances import restore, serialized
from tests.support.paths import EVERY
from tests.support.rparm_project import FILES, FMUS, NAMES, fmi3_fmu, load, names_of, staircase

each_version = pytest.mark.parametrize("version", ["fmi2", "fmi3"])


def of_version(path: Path, version: str) -> Path:
    return path if version == "fmi2" else fmi3_fmu(path)


# ---- References ----------------------------------------------------------------------------------

EXACT = (1e-14, 1e-14, 1e-14)
ERRORS = {
    "rp_manipulator": (1e-4, 1e-7, 1e-10), "rp_plant": (1e-4, 1e-7, 1e-10),
    "rp_controller": (1e-6, 1e-8, 1e-10), "rp_actuator": (1e-6, 1e-8, 1e-10),
    "rp_trajectory": EXACT, "rp_environment": EXACT, "rp_sensor": EXACT,
}  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_scenarios_meet_their_references(name: str) -> None:
    """At tolerances of 1e-5, 1e-8 and 1e-11; those of FMI 3.0 with the same bits."""
    model = model_folder(FILES[name]).name
    with Fmu(FMUS[model]) as opened, Fmu(fmi3_fmu(FMUS[model])) as of_fmi3:
        runs = Runs({model: opened})
        found = [runs.run(load(name), tolerance) for tolerance in (1e-5, 1e-8, 1e-11)]
        twin = Runs({model: of_fmi3}).run(load(name), 1e-8)
    assert all(np.array([run.error for run in found]) <= ERRORS[model]), found
    assert differing(found[1].result, twin.result) == ()


# ---- Another importer ----------------------------------------------------------------------------


@each_version
@pytest.mark.parametrize("name", EVERY)
def test_fmpy_gets_the_same_by_both_kinds(fmu: Path, name: str, version: str) -> None:
    """The trajectory of Co-Simulation, to the bit where there is nothing to integrate."""
    path = of_version(fmu.with_name(f"{name}.fmu"), version)
    variables = fmpy.read_model_description(path).modelVariables
    inputs = [v for v in variables if v.causality == "input" and v.type in ("Real", "Float64")]
    outputs = [v.name for v in variables if v.causality == "output"]
    by_kind = [
        fmpy.simulate_fmu(
            str(path),
            fmi_type=kind,
            stop_time=1.0,
            output_interval=1 / 64,
            relative_tolerance=1e-9,
            start_values={v.name: 0.5 + k / 8 for k, v in enumerate(inputs)},
            output=outputs,
            record_events=False,
        )
        for kind in ("CoSimulation", "ModelExchange")
    ]
    has_states = any(v.derivative for v in variables)
    for output in outputs:
        one, other = (found[output].astype(float) for found in by_kind)
        assert len(one) == len(other) == 65 and np.isfinite(one).all()
        scale = 1e-4 * (1 + np.abs(one).max()) if has_states else 0.0
        np.testing.assert_allclose(other, one, rtol=0, atol=scale, err_msg=output)


# ---- Rollback ------------------------------------------------------------------------------------

JUMPS, AFTER = 8, 12  # saved states of a scenario, steps that are made again from each


class Run:
    """An instance on a scenario, and all its values; inputs are lines over each step."""

    def __init__(self, instance: Instance, scenario: Scenario) -> None:
        self.instance, self.scenario = instance, scenario
        variables = instance.fmu.model.variables.values()
        self._reals = instance.reals([v.name for v in variables if v.type == "Real"])
        self._others = {
            kind: [v.name for v in variables if v.type == kind] for kind in ("Integer", "Boolean")
        }
        self._smooth = instance.input_polynomials(instance.smooth_inputs, 1)
        columns = [scenario.inputs[name] for name in instance.smooth_inputs]
        self._values = np.column_stack(columns) if columns else None
        self._switches = {n: v for n, v in scenario.inputs.items() if v.dtype == bool}

    def do(self, i: int) -> tuple[bytes, list[int | None], list[bool]]:
        """Make step i; return all values after it."""
        start, end = self.scenario.times[i : i + 2]
        if self._values is not None:
            here, there = self._values[i : i + 2]
            self._smooth.view[:] = [here, (there - here) / (end - start)]
            self._smooth.set()
        for name, values in self._switches.items():
            self.instance.set(name, bool(values[i]))
        self.instance.do_step(start, end - start, goes_back=True)
        self._reals.get()
        return (
            self._reals.view.tobytes(),
            [self.instance.integer(name) for name in self._others["Integer"]],
            [self.instance.discrete(name) for name in self._others["Boolean"]],
        )


@contextmanager
def running(fmu: Fmu, scenario: Scenario) -> Iterator[Run]:
    smooth = [name for name, values in scenario.inputs.items() if values.dtype != bool]
    with fmu.instance("rollback", smooth) as instance:
        initialize(instance, scenario, scenario.tolerance)
        yield Run(instance, scenario)


# across events, with each method in place of the scenario's
BY_METHOD = [("fmi2", name, i) for name in names_of("rp_plant") for i in (1, 2, 3, 4)]


@pytest.mark.parametrize(
    ("version", "name", "method"), [*product(("fmi2", "fmi3"), NAMES, (None,)), *BY_METHOD]
)
def test_rollback_leaves_no_trace(version: str, name: str, method: int | None) -> None:
    """From saved states the same bits follow again, also in another instance, read from bytes."""
    scenario = load(name)
    if method is not None:
        scenario.parameters["solver_method"] = method
    steps = len(scenario.times) - 1
    chance = random.Random(name)
    jumps = {chance.randrange(steps) for _ in range(JUMPS)}
    with (
        Fmu(of_version(FMUS[model_folder(FILES[name]).name], version)) as opened,
        running(opened, scenario) as run,
        running(opened, scenario) as other,
    ):
        saved = run.instance.snapshot()
        for i in range(min(steps, max(jumps) + AFTER)):
            if i in jumps:
                again = range(i, min(i + AFTER, steps))
                saved.take()
                content = serialized(run.instance)
                once = [run.do(k) for k in again]
                saved.restore()
                assert serialized(run.instance) == content
                assert [run.do(k) for k in again] == once
                saved.restore()
                restore(other.instance, content)
                assert [other.do(k) for k in again] == once
            run.do(i)
        saved.free()


# ---- Names ---------------------------------------------------------------------------------------


def test_a_name_has_one_unit_in_all_fmus(fmu: Path) -> None:
    units: dict[str, set[str | None]] = {}
    for name in EVERY:
        for v in fmpy.read_model_description(fmu.with_name(f"{name}.fmu")).modelVariables:
            units.setdefault(v.name, set()).add(v.unit)
    assert [name for name, found in units.items() if len(found) > 1] == []


# ---- Versions of FMI in Model Exchange -----------------------------------------------------------


def float_names(path: Path) -> list[str]:
    """All floating-point variables."""
    description = fmpy.read_model_description(path)
    return [v.name for v in description.modelVariables if v.type in ("Real", "Float64")]


@pytest.mark.parametrize("name", NAMES)
def test_model_exchange(name: str) -> None:
    """By fmpy's CVode, over the first steps; fmpy gives no tolerance to the FMU."""
    path = FMUS[model_folder(FILES[name]).name]
    scenario = load(name)
    if any(values.dtype == bool for values in scenario.inputs.values()):
        pytest.skip("fmpy's CVode sets Booleans in continuous-time mode")
    points = min(300, len(scenario.times) - 1)
    stop = float(scenario.times[points])
    outputs = [n for n in float_names(fmi3_fmu(path)) if n != "effective_relative_tolerance"]
    results = [
        fmpy.simulate_fmu(
            str(fmu),
            fmi_type="ModelExchange",
            start_time=scenario.start,
            stop_time=stop,
            output_interval=(stop - scenario.start) / 100,
            start_values=scenario.parameters | scenario.initial,
            input=staircase(scenario, points),
            output=outputs,
            relative_tolerance=scenario.tolerance,
        )
        for fmu in (path, fmi3_fmu(path))
    ]
    assert len(results[0]) > 100
    assert results[0].dtype.names == results[1].dtype.names
    for column in results[0].dtype.names:
        np.testing.assert_array_equal(results[1][column], results[0][column], err_msg=column)
