"""Promises of every FMU, over all FMUs and their scenarios: scenarios meet their references, fmpy
runs it, rollback leaves no trace, dependencies are found in values, names have one unit."""

import math
import random
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import product
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.model_description import ModelVariable

from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from rparm.project import model_folder
from rparm.runs.comparison import Runs
from rparm.runs.scenario import Scenario
from rparm.runs.simulation import initialize
from tests.support.instances import instantiated, restore, serialized
from tests.support.paths import EVERY
from tests.support.rparm_project import FILES, FMUS, NAMES, fmi3_fmu, load, names_of

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
    """At tolerances of 1e-5, 1e-8 and 1e-11."""
    model = model_folder(FILES[name]).name
    with Fmu(FMUS[model]) as opened:
        runs = Runs({model: opened})
        errors = [runs.run(load(name), tolerance).error for tolerance in (1e-5, 1e-8, 1e-11)]
    assert all(np.array(errors) <= ERRORS[model]), errors


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
        saved = run.instance.saved_state()
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


# ---- Dependencies --------------------------------------------------------------------------------

POINTS = 200
# The plant declares all that events may depend on; discrete modes hide some of it at single points.
CONSERVATIVE = ("RPPlant",)


class Points:
    """An instance in initialization mode whose knowns take random values."""

    def __init__(self, name: str, fmu: object, variables: list[ModelVariable]) -> None:
        self.fmu, self.chance = fmu, random.Random(name)
        states = {v.derivative.name for v in variables if v.derivative}
        self.knowns = [
            v
            for v in variables
            if (v.causality in ("input", "parameter") or v.name in states)
            and not v.name.startswith(("relative_tolerance", "max_", "solver_"))
        ]
        self.unknowns: list[ModelVariable] = []
        self._references = {v.name: v.valueReference for v in self.knowns}
        self._of_kind: dict[str, list[str]] = {}
        for known in self.knowns:
            self._of_kind.setdefault(known.type, []).append(known.name)

    def draw(self, known: ModelVariable) -> float:
        """Return a value in the variable's range: now and then 0, or one that limits nothing."""
        chance = self.chance
        low = -math.inf if known.min is None else float(known.min)
        high = math.inf if known.max is None else float(known.max)
        if known.type == "Boolean":
            return chance.random() < 0.5
        if known.type == "Enumeration":
            return chance.randint(1, len(known.declaredType.items))
        if known.type == "Integer":
            return chance.randint(int(max(low, 0)), int(min(high, 10)))
        if low == 0.0 and chance.random() < 0.2:
            return 0.0  # features that are off
        is_wide = known.name.rstrip("12").endswith("_max") and chance.random() < 0.5
        size = 10 ** (chance.uniform(-1, 1) + (6 if is_wide or chance.random() < 0.1 else 0))
        return min(max(size * (chance.choice((-1, 1)) if low < 0 else 1), low), high)

    def place(self) -> dict[str, float]:
        """Put the instance at a new point and return the values there."""
        self.fmu.reset()
        self.fmu.setupExperiment(startTime=self.chance.choice((0.0, 0.5, 1.5, 7.0)))
        self.fmu.enterInitializationMode()
        values = {known.name: self.draw(known) for known in self.knowns}
        self.give(values)
        return values

    def give(self, values: dict[str, float]) -> None:
        """Set all knowns."""
        for kind, names in self._of_kind.items():
            setter = getattr(self.fmu, f"set{'Integer' if kind == 'Enumeration' else kind}")
            setter([self._references[name] for name in names], [values[name] for name in names])

    def read(self) -> list[float]:
        return [getattr(self.fmu, f"get{v.type}")([v.valueReference])[0] for v in self.unknowns]


def found_dependencies(points: Points) -> dict[str, set[str]]:
    """Return the knowns whose change changes each unknown, at any of many points."""
    found: dict[str, set[str]] = {v.name: set() for v in points.unknowns}
    for _ in range(POINTS):
        try:
            values = points.place()
            before = points.read()
        except FMICallException:
            continue  # not finite there
        for known in points.knowns:
            points.give(values | {known.name: points.draw(known)})
            try:
                after = points.read()
            except FMICallException:
                continue
            for unknown, one, other in zip(points.unknowns, before, after, strict=True):
                if one != other:
                    found[unknown.name].add(known.name)
    return found


@pytest.mark.parametrize("name", EVERY)
def test_dependencies_are_those_of_the_values(fmu: Path, name: str) -> None:
    """Initial unknowns depend on the knowns that change them, outputs on no further ones."""
    with instantiated(fmu.with_name(f"{name}.fmu"), "CoSimulation") as (instance, description):
        points = Points(name, instance, description.modelVariables)
        points.unknowns = [u.variable for u in description.initialUnknowns]
        found = found_dependencies(points)
    initial = {
        u.variable.name: {v.name for v in u.dependencies} - {"time"}
        for u in description.initialUnknowns
    }
    for unknown, listed in initial.items():
        assert found[unknown] <= listed, unknown
        if name not in CONSERVATIVE:
            assert found[unknown] == listed, unknown
    parameters = {v.name for v in description.modelVariables if v.causality == "parameter"}
    for u in (*description.outputs, *description.derivatives):
        unknown, listed = u.variable.name, {v.name for v in u.dependencies} - {"time"}
        if unknown not in initial:  # a state, or what the plant counts
            assert listed == {unknown} or name in CONSERVATIVE
        elif u.variable.variability != "discrete":
            assert listed <= initial[unknown] - parameters, unknown
            if not description.numberOfEventIndicators:
                assert listed == initial[unknown] - parameters, unknown


# ---- Names ---------------------------------------------------------------------------------------


def test_a_name_has_one_unit_in_all_fmus(fmu: Path) -> None:
    units: dict[str, set[str | None]] = {}
    for name in EVERY:
        for v in fmpy.read_model_description(fmu.with_name(f"{name}.fmu")).modelVariables:
            units.setdefault(v.name, set()).add(v.unit)
    assert [name for name, found in units.items() if len(found) > 1] == []
