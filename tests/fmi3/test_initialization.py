"""Initialization mode in both versions, at random parameters, start values and start times: what is
calculated there is what holds after it, and depends on what the model structure lists."""

import math
import random
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fmpy
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.model_description import ModelDescription, ModelVariable
from fmpy.simulation import instantiate_fmu

from tests.equations.examples import FOLDER, example
from tests.support.instances import set_value
from tests.support.paths import EVERY

VERSIONS = ("fmi2", "fmi3")
# Of the plant many act at a limit only, which random points miss; of the ball one that is too slow
# ends no initialization. Of controller and sensor some act from the second sample on only: the
# graph lists what a value reads, whatever the numbers are.
SAMPLED = ("RPController", "RPSensor")
NEVER_ACTING = [n for n in EVERY if n not in ("RPPlant", "BouncingBall", *SAMPLED)]
KINDS = ("CoSimulation", "ModelExchange")
POINTS = 40
SOLVER = {"relative_tolerance", "max_internal_steps", "solver_method", "max_step", "max_events"}


class Point:
    """An FMU in initialization mode, again and again."""

    def __init__(self, path: Path, kind: str, folder: Path) -> None:
        self.description: ModelDescription = fmpy.read_model_description(path)
        fmpy.extract(path, folder)
        self.is_fmi2 = self.description.fmiVersion == "2.0"
        self.fmu: Any = instantiate_fmu(str(folder), self.description, kind)
        variables = self.description.modelVariables
        self.settable = [
            v
            for v in variables
            if (v.causality in ("input", "parameter") or v.initial == "exact")
            and v.variability != "constant"
            and v.name not in SOLVER
        ]
        exact = {v.valueReference for v in variables if v.initial == "exact"}
        calculated = [v for v in variables if v.initial == "calculated"]
        # an alias of a state has its value: what was set
        self.calculated = [v for v in calculated if v.valueReference not in exact]

    def begin(self, start: float) -> None:
        """Enter initialization mode from the start values."""
        self.fmu.reset()
        if self.is_fmi2:
            self.fmu.setupExperiment(startTime=start)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=start)

    def read(self, variables: list[ModelVariable]) -> list[float]:
        """Read variables of any type."""
        enumeration = "Integer" if self.is_fmi2 else "Int64"
        values: dict[int, float] = {}
        for kind in {v.type for v in variables}:
            rows = [i for i, v in enumerate(variables) if v.type == kind]
            get = getattr(self.fmu, f"get{kind if kind != 'Enumeration' else enumeration}")
            values |= zip(rows, get([variables[i].valueReference for i in rows]), strict=True)
        return [values[i] for i in range(len(variables))]

    def set(self, values: dict[ModelVariable, float]) -> None:
        """Set variables of any type."""
        for variable, value in values.items():
            set_value(self.fmu, variable, value)


@contextmanager
def opened(path: Path, kind: str, folder: Path) -> Iterator[Point]:
    """A Point that is freed at the end."""
    point = Point(path, kind, folder)
    try:
        yield point
    finally:
        point.fmu.freeInstance()


def random_value(chance: random.Random, variable: ModelVariable) -> float:
    """A value in the range: mostly near the start value, at times 0 or a bound."""
    low = -math.inf if variable.min is None else float(variable.min)
    high = math.inf if variable.max is None else float(variable.max)
    if variable.type == "Boolean":
        return chance.random() < 0.5
    if variable.type == "Enumeration":
        return chance.randint(1, len(variable.declaredType.items))
    if math.isfinite(low) and math.isfinite(high) and variable.type in ("Real", "Float64"):
        return chance.uniform(low, high)
    start = float(variable.start or 0.0)
    if variable.type in ("Integer", "Int32"):
        return chance.randint(int(max(low, -5)), int(min(high, 60)))
    value = start + chance.choice([0.1, 1.0, 10.0]) * chance.gauss(0.0, 0.3 + 0.5 * abs(start))
    if chance.random() < 0.2:
        value = chance.choice([0.0, low, high])
    return value if low <= value <= high and math.isfinite(value) else start


def random_values(chance: random.Random, point: Point) -> dict[ModelVariable, float]:
    """Some or all of the values that may be set; times that fit each other, states at limits."""
    share = chance.choice([0.3, 0.7, 1.0])
    values = {v: random_value(chance, v) for v in point.settable if chance.random() < share}
    names = {v.name: v for v in values}
    for i in (1, 2):
        limits = [names[n] for n in (f"lower{i}", f"upper{i}") if n in names]
        if f"q{i}" in names and limits:
            if len(limits) == 2 and values[limits[0]] > values[limits[1]]:
                values[limits[0]], values[limits[1]] = values[limits[1]], values[limits[0]]
            beyond = chance.choice([0.0, 0.0, 0.01, -0.01])
            values[names[f"q{i}"]] = values[chance.choice(limits)] + beyond
    if "delay" in names and "sample_time" in names:
        values[names["delay"]] = chance.random() * values[names["sample_time"]]
    return values


def fmu_of(fmu: Path, version: str, name: str) -> Path:
    if name in EVERY:
        return (fmu.parent if version == "fmi2" else fmu.parent / version) / f"{name}.fmu"
    built = example(name)
    return built if version == "fmi2" else built.parent / version / built.name


OTHERS = sorted(p.stem for p in FOLDER.glob("*.toml") if not p.stem.endswith(".lock"))
OTHERS = [n for n in OTHERS if n not in ("bouncing_ball", "rectifier")]


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("name", [*EVERY, *OTHERS])
def test_calculated_values_are_those_after_it(
    fmu: Path, name: str, version: str, tmp_path: Path
) -> None:
    chance = random.Random(f"{name} {version}")
    path = fmu_of(fmu, version, name)
    for kind in KINDS:
        compared = 0
        with opened(path, kind, tmp_path / kind) as point:
            for _ in range(POINTS):
                point.begin(chance.choice([0.0, 0.0, chance.uniform(-3.0, 3.0), 1e3]))
                for _ in range(2):  # what is read between two changes must not stay
                    point.set(random_values(chance, point))
                    try:
                        before = point.read(point.calculated)
                    except FMICallException:
                        break  # values are not finite there
                else:
                    try:
                        point.fmu.exitInitializationMode()
                    except FMICallException:
                        continue  # the parameters do not fit each other
                    after = point.read(point.calculated)
                    names = [v.name for v in point.calculated]
                    assert dict(zip(names, before, strict=True)) == dict(
                        zip(names, after, strict=True)
                    )
                    compared += 1
        assert compared > POINTS // 8


# ---- Dependencies --------------------------------------------------------------------------------


def changed(before: list[float], after: list[float]) -> set[int]:
    """Rows whose bits differ."""
    return {i for i, (a, b) in enumerate(zip(before, after, strict=True)) if a != b}


class Dependence:
    """Which unknowns change with which knowns, at one point after another."""

    def __init__(self, point: Point) -> None:
        self.point = point
        self.found: dict[str, dict[str, set[str]]] = {"initial": {}, "later": {}, "event": {}}

    def can_end(self) -> bool:
        """Whether initialization mode can end; it does not."""
        fmu = self.point.fmu
        saved = fmu.getFMUState()
        try:
            fmu.exitInitializationMode()
        except FMICallException:
            return False
        finally:
            fmu.setFMUState(saved)
            fmu.freeFMUState(saved)
        return True

    def note(self, when: str, known: str, unknowns: list[ModelVariable], rows: set[int]) -> None:
        for i in rows:
            self.found[when].setdefault(unknowns[i].name, set()).add(known)

    def initial(self, chance: random.Random, start: float) -> None:
        """Change one value after the other in initialization mode."""
        point = self.point
        unknowns = [u.variable for u in point.description.initialUnknowns]
        base = random_values(chance, point)

        def again(start: float) -> list[float]:
            point.begin(start)
            point.set(base)
            return point.read(unknowns)

        before = again(start)
        if not self.can_end():
            return
        for variable in point.settable:
            (kept,) = point.read([variable])
            point.set({variable: random_value(chance, variable)})
            try:
                after = point.read(unknowns)
            except FMICallException:
                before = again(start)
                continue
            rows = changed(before, after)
            if rows and self.can_end():
                self.note("initial", variable.name, unknowns, rows)
            point.set({variable: kept})
        self.note("initial", "time", unknowns, changed(before, again(start + chance.random())))

    def later(self, chance: random.Random) -> None:
        """Change one value after the other in continuous-time mode, and before an event."""
        point, fmu = self.point, self.point.fmu
        parts = [*point.description.outputs, *point.description.derivatives]
        unknowns = [u.variable for u in parts]
        unknowns += [u.variable for u in getattr(point.description, "eventIndicators", [])]
        update = fmu.newDiscreteStates if point.is_fmi2 else fmu.updateDiscreteStates
        fmu.exitInitializationMode()
        *_, is_defined, due = update()
        fmu.enterContinuousTimeMode()
        (now,) = point.read([v for v in point.description.modelVariables if v.name == "time"])
        time = due if is_defined and chance.random() < 0.7 else now
        saved = fmu.getFMUState()
        states = [d.variable.derivative for d in point.description.derivatives]
        knowns = [v for v in point.settable if v.causality == "input"] + states

        def run(known: ModelVariable | None) -> tuple[list[float], list[float]]:
            fmu.setFMUState(saved)
            fmu.setTime(time + (0.1 if known == "time" else 0.0))
            is_continuous = known not in (None, "time") and known.variability == "continuous"
            value = {known: random_value(chance, known)} if known not in (None, "time") else {}
            if is_continuous:
                point.set(value)
            flowing = point.read(unknowns)
            (fmu.enterEventMode)()
            if value and not is_continuous:
                point.set(value)
            update()
            return flowing, point.read(unknowns)

        before = run(None)
        for known in [*knowns, "time"]:
            name = known if known == "time" else known.name
            try:
                after = run(known)
            except FMICallException:
                continue
            self.note("later", name, unknowns, changed(before[0], after[0]))
            self.note("event", name, unknowns, changed(before[1], after[1]))
        fmu.freeFMUState(saved)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("name", [*EVERY, *OTHERS])
def test_the_model_structure_lists_what_acts_and_nothing_else(
    fmu: Path, name: str, version: str, tmp_path: Path
) -> None:
    chance = random.Random(f"structure {name}")
    path = fmu_of(fmu, version, name)
    with opened(path, "ModelExchange", tmp_path) as point:
        dependence = Dependence(point)
        for _ in range(5 * POINTS):
            try:
                dependence.initial(chance, chance.choice([0.0, 1.0]))
                dependence.later(chance)
            except FMICallException:
                continue  # the values do not fit each other
        found = dependence.found
        solver = {v.name for v in point.description.modelVariables if v.name in SOLVER}
        parameters = {v.name for v in point.settable if v.causality == "parameter"}
        problems = []
        sections = {"initial": point.description.initialUnknowns}
        sections["later"] = [*point.description.outputs, *point.description.derivatives]
        for when, unknowns in sections.items():
            for unknown in unknowns:
                known = unknown.variable.name
                listed = {v.name for v in unknown.dependencies or []} - solver
                acting = found[when].get(known, set())
                ever = set().union(*(found[w].get(known, set()) for w in found))
                for missing in sorted(acting - listed):
                    problems.append(f"{when}: {known} misses {missing}")
                if when == "later" and point.is_fmi2:
                    problems += [f"{when}: {known} lists {n}" for n in listed & parameters]
                if name not in NEVER_ACTING:
                    continue
                never = listed - (acting if when == "initial" else ever | parameters)
                problems += [f"{when}: {known} never depends on {n}" for n in sorted(never)]
        assert not problems, "\n".join(problems)
