"""Checks a campaign against its scenario or system, turns it into a job, and draws its points.

Parameters of each run are points of the unit cube, by scipy and SALib, through distributions. They
depend only on the campaign's text, so that each block can be made by itself.
"""

import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from functools import cached_property
from typing import NoReturn

import numpy as np
from SALib.sample import sobol as saltelli
from scipy import special
from scipy.stats import qmc

from rparm.campaign.bases import Base, ScenarioBase
from rparm.campaign.campaign_file import WHOLE, Campaign, Distribution, grid_value
from rparm.campaign.job import (
    FINAL_INTEGER,
    LYAPUNOV,
    PLAIN,
    Component,
    Job,
    Measure,
    Target,
    final_integer,
    plain,
)
from rparm.errors import UserError, WrongValueError, did_you_mean, hint, one_line, placed
from rparm.fmi.model import INPUTS, TOLERANCE, Value, Variable
from rparm.fmu_tools.compiler.expressions.parser import Expression
from rparm.units import unit

RUN, FAILURE = "run", "failure"  # columns of every table
MAX_RECORDED = 100_000_000  # numbers that a run records
SMALLEST = 2.0**-54  # a normal distribution is cut there, where its values are still finite


# ---- The job -------------------------------------------------------------------------------------
def plan(campaign: Campaign, base: Base, where: object, also: Sequence[str] = ()) -> Job:
    """Return the job, which records `also`, too; UserError, at `where`, for a mistake."""
    return _Planner(campaign, base, where).job(also)


class _Planner:
    def __init__(self, campaign: Campaign, base: Base, where: object) -> None:
        self.campaign, self.base, self.where = campaign, base, where

    def fail(self, place: str, message: object) -> NoReturn:
        raise UserError(f"{self.where}: {place}: {message}")

    def placed(self, place: str) -> AbstractContextManager[None]:
        return placed(f"{self.where}: {place}")

    def job(self, also: Sequence[str]) -> Job:
        campaign, base = self.campaign, self.base
        targets = self.targets()
        fixed = self.fixed()
        measures = self.measures()
        integers = {m.variables[0]: None for m in measures if m.kind == FINAL_INTEGER}
        measured = (v for measure in measures for v in measure.variables if v not in integers)
        watched = tuple(dict.fromkeys([*measured, *also]))
        tangent = self.tangent()
        if len(watched) * len(base.times) > MAX_RECORDED:
            self.fail("keep", f"{len(watched)} variables at {len(base.times)} times are too many")
        read = self.read(watched)
        components = tuple(base.components(list(read), fixed))
        self.check_tolerances(components, targets)
        reals, switches = base.held
        self.check_columns(measures)
        return Job(
            components=components,
            start=float(base.times[0]),
            stop=float(base.times[-1]),
            tolerance=base.tolerance,
            times=base.times,
            reals=reals,
            switches=switches,
            watched=watched,
            integers=dict(zip(integers, self.read(integers), strict=True)),
            tangent=tangent,
            targets=tuple(targets.items()),
            measures=tuple(measures),
            trajectories=frozenset(campaign.keep.trajectories),
            hashes=base.hashes,
            wiring=base.wiring,
        )

    # ---- Values that are set -----------------------------------------------------------------

    def targets(self) -> dict[str, Target]:
        """Return the variables that parameters and derived values go to."""
        campaign = self.campaign
        used = set().union(*(e.names for e in campaign.expressions.values()))
        targets = {}
        for name, distribution in campaign.parameters.items():
            place = f"[parameters.{name}]"
            found = self.settable(name, place, name in used)
            if found is not None:
                self.check_distribution(distribution, found[1], place)
                targets[name] = self.target(name, *found)
        known_numbers, varying = constants(self.campaign, self.base), set(campaign.parameters)
        for name, expression in campaign.expressions.items():
            place = f"[derived] {name}"
            known = varying | set(known_numbers)
            for other in expression.names - known:
                self.fail(place, f"unknown name {other!r}{did_you_mean(other, known)}")
            if expression.names & varying:
                varying.add(name)
            else:
                known_numbers[name] = self.constant(expression, known_numbers, place)
            found = self.settable(name, place, name in used)
            if found is not None:
                if found[1].type != "Real":
                    self.fail(place, f"is of type {found[1].type}, expected Real")
                targets[name] = self.target(name, *found)
        return targets

    def constant(self, expression: Expression, constants: Mapping[str, float], place: str) -> float:
        """Return the value of an expression that is the same in all runs."""
        try:
            return expression.value(constants)
        except (ArithmeticError, ValueError) as error:
            self.fail(place, f"has no value: {one_line(error)}")

    def settable(self, name: str, place: str, used: bool) -> tuple[int, Variable] | None:
        """Return the variable; None for a name that is no variable, but `used` by an expression."""
        try:
            self.base.variable(name)
        except WrongValueError as error:
            if used:
                return None
            self.fail(place, f"{error}, and no derived value uses it")
        with self.placed(place):
            return self.base.settable(name)

    def target(self, name: str, component: int, variable: Variable) -> Target:
        held = None
        if variable.is_a(INPUTS) and isinstance(self.base, ScenarioBase):
            held = self.base.hold(name, 0.0)
        return Target(component, variable.name, held)

    def check_distribution(
        self, distribution: Distribution, variable: Variable, place: str
    ) -> None:
        numbers = distribution.numbers
        with self.placed(f"{place} {distribution.kind}"):
            if variable.type == "Integer" and distribution.kind == "values":
                for number in numbers:
                    variable.checked(number)
            elif variable.type != "Real":
                self.fail(place, f"is of type {variable.type}, expected Real, or Integer by values")
            elif distribution.kind != "normal":
                variable.check_range(min(numbers), max(numbers))

    def check_tolerances(
        self, components: Sequence[Component], targets: Mapping[str, Target]
    ) -> None:
        """Refuse tolerances that methods cannot reach, as far as they are known before the runs."""
        varied = {
            (target.component, target.variable): name
            for name, target in targets.items()
            if name in self.campaign.parameters
        }
        for i, (model, component) in enumerate(zip(self.base.models, components, strict=True)):
            name = varied.get((i, TOLERANCE))
            if name is None:
                place = f"{component.name}: {TOLERANCE}"
                numbers = [component.values.get(TOLERANCE) or self.base.tolerance]
            else:
                place, distribution = f"[parameters.{name}]", self.campaign.parameters[name]
                numbers = [] if distribution.kind == "normal" else distribution.numbers
            for number in filter(None, numbers):  # 0: the scenario's
                with self.placed(place):
                    model.check_tolerance(number, component.values)

    def fixed(self) -> dict[tuple[int, str], Value]:
        """Check section [set]."""
        result: dict[tuple[int, str], Value] = {}
        for name, given in self.campaign.set.items():
            with self.placed(f"[set] {name}"):
                component, variable = self.base.settable(name)
                value = variable.checked(given)
            if variable.is_a(INPUTS) and isinstance(self.base, ScenarioBase):
                self.base.hold(name, float(value))
            else:
                result[component, variable.name] = value
        return result

    # ---- Measures ------------------------------------------------------------------------------

    def measures(self) -> list[Measure]:
        keep = self.campaign.keep
        found = []
        for kind in PLAIN:
            types = ("Real", "Integer") if kind == "final" else ("Real",)
            for name in getattr(keep, kind):
                variable = self.readable(name, f"[keep] {kind}", types)
                is_integer = variable.type == "Integer"
                found.append(final_integer(name) if is_integer else plain(kind, name))
        for name, settling in keep.settling.items():
            self.readable(settling.variable, f"[keep.settling.{name}]")
            options = (settling.target, settling.band)
            found.append(Measure(f"settling({name})", (settling.variable,), "settling", options))
        for name, crossings in keep.crossings.items():
            self.readable(crossings.variable, f"[keep.crossings.{name}]")
            variables, options = (crossings.variable,), (crossings.level,)
            found.append(Measure(f"crossings({name})", variables, "crossings", options))
        for name, tracking in keep.tracking.items():
            variables = tuple(variable for pair in tracking.of for variable in pair)
            for variable in variables:
                self.readable(variable, f"[keep.tracking.{name}]")
            for kind in ("largest_distance", "rms_distance"):
                found.append(Measure(f"{kind}({name})", variables, kind))
        if keep.lyapunov:
            found.append(Measure(LYAPUNOV, (), LYAPUNOV))
        if not found:
            self.fail("[keep]", "keeps nothing of a run")
        return found

    def readable(self, name: str, place: str, types: Sequence[str] = ("Real",)) -> Variable:
        with self.placed(place):
            _, variable = self.base.variable(name)
        if variable.type not in types or variable.causality == "independent":
            self.fail(place, f"{name!r} is not a {' or '.join(types)} variable")
        return variable

    def read(self, names: Iterable[str]) -> dict[tuple[int, str], None]:
        """Return component and name of each variable."""
        found = (self.base.variable(name) for name in names)
        return {(component, variable.name): None for component, variable in found}

    def tangent(self) -> tuple[np.ndarray, ...] | None:
        if not self.campaign.keep.lyapunov:
            return None
        if not isinstance(self.base, ScenarioBase):
            self.fail("[keep] lyapunov", "goes with a scenario only")
        with self.placed("[keep] lyapunov"):
            pairs = self.base.derivatives()
        if not pairs:
            self.fail("[keep] lyapunov", "the model has no continuous states")
        found = (*zip(*pairs, strict=True), *map(self.base.discrete_outputs, ("Real", "Integer")))
        return tuple(np.array(references, np.uint32) for references in found)

    def check_columns(self, measures: Sequence[Measure]) -> None:
        """Refuse columns that the page needs and does not find, and names of two columns."""
        places = {name: f"[parameters.{name}]" for name in self.campaign.parameters}
        places |= {name: f"[derived] {name}" for name in self.campaign.derived}
        for name in (RUN, FAILURE):
            if name in places:
                self.fail(places[name], "every table has a column of that name")
        columns = columns_of(self.campaign, measures)
        for column in columns:
            if columns.count(column) > 1:
                self.fail("[keep]", f"column {column!r} is there twice")
        asked = [("worst", name) for name in self.campaign.worst]
        for i, drawn in enumerate(self.campaign.maps):
            asked += [(f"maps[{i}]", name) for name in (drawn.x, drawn.y, drawn.colour)]
        for place, name in asked:
            if name not in columns:
                self.fail(place, f"no column {name!r}{hint(name, columns, 'there are')}")


def columns_of(campaign: Campaign, measures: Sequence[Measure]) -> list[str]:
    """Return the columns of the table that hold numbers."""
    return [*campaign.parameters, *campaign.derived, *(measure.column for measure in measures)]


def units(campaign: Campaign, base: Base, measures: Iterable[Measure]) -> dict[str, str]:
    """Return the units of the columns of numbers; empty if a column has none, or it is unknown."""

    def of(name: str) -> str:
        try:
            found = base.variable(name)[1].unit
        except WrongValueError:  # only derived values use it
            return ""
        return "" if found == "1" else unit(found)

    found = {name: of(name) for name in (*campaign.parameters, *campaign.derived)}
    for measure in measures:
        match measure.kind:
            case "settling":
                text = "s"
            case "crossings":
                text = ""
            case "integral":
                text = of(measure.variables[0])
                text = f"({text})·s" if "/" in text else f"{text}·s".strip("·")
            case _:
                text = "1/s" if measure.kind == LYAPUNOV else of(measure.variables[0])
        found[measure.column] = text
    return found


def constants(campaign: Campaign, base: Base) -> dict[str, float]:
    """Return the start values of all variables, which a campaign's expressions may name."""
    known = base.start_values() | campaign.set
    return {
        name: float(value)
        for name, value in known.items()
        if isinstance(value, int | float) and math.isfinite(value)
    }


# ---- Points --------------------------------------------------------------------------------------
class Sampler:
    def __init__(self, campaign: Campaign) -> None:
        self._campaign = campaign
        self._distributions = list(campaign.parameters.values())

    def points(self, runs: range) -> np.ndarray:
        """Return the values of the parameters of consecutive runs, (runs, parameters)."""
        if self._campaign.sampling == "grid":
            return self._grid(runs)
        cube = self._cube(runs)
        columns = [sampled_values(d, cube[:, i]) for i, d in enumerate(self._distributions)]
        return np.column_stack(columns)

    def _grid(self, runs: range) -> np.ndarray:
        """Return points of a grid: the last parameter changes fastest."""
        sizes = [d.size for d in self._distributions]
        indices = np.unravel_index(np.arange(runs.start, runs.stop), sizes)
        axes = zip(self._distributions, indices, strict=True)
        return np.column_stack([[grid_value(d, i) for i in axis.tolist()] for d, axis in axes])

    def _cube(self, runs: range) -> np.ndarray:
        """Draw points of the unit cube, (runs, parameters)."""
        sampling, seed = self._campaign.sampling, self._campaign.seed
        size = len(self._distributions)
        if sampling in WHOLE:
            return self._whole[runs.start : runs.stop]
        if sampling == "random":
            generator = np.random.PCG64(seed).advance(runs.start * size)
            return np.random.Generator(generator).random((len(runs), size))
        sequence = self._sobol
        if sequence.num_generated > runs.start:
            sequence.reset()
        if sequence.num_generated < runs.start:
            sequence.fast_forward(runs.start - sequence.num_generated)
        with warnings.catch_warnings():  # that their number should be a power of 2
            warnings.simplefilter("ignore", UserWarning)
            return sequence.random(len(runs))

    @cached_property
    def _sobol(self) -> qmc.Sobol:
        """The next points of the sequence: blocks are asked for in their order."""
        size = len(self._distributions)
        return qmc.Sobol(size, scramble=True, rng=self._campaign.seed)

    @cached_property
    def _whole(self) -> np.ndarray:
        """All points of the unit cube, (runs, parameters)."""
        campaign, size = self._campaign, len(self._distributions)
        if campaign.sampling == "latin":
            return qmc.LatinHypercube(size, rng=campaign.seed).random(campaign.runs)
        return saltelli.sample(
            sampling_problem(campaign), campaign.runs, calc_second_order=False, seed=campaign.seed
        )


def sampling_problem(campaign: Campaign) -> dict[str, object]:
    """Return the campaign's parameters as SALib wants them: each between 0 and 1."""
    names = list(campaign.parameters)
    return {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}


def sampled_values(distribution: Distribution, probabilities: np.ndarray) -> np.ndarray:
    """Return the values of a distribution at `probabilities`, (n,)."""
    numbers = distribution.numbers
    match distribution.kind:
        case "uniform":
            return numbers[0] + (numbers[1] - numbers[0]) * probabilities
        case "log_uniform":
            low, high = np.log(numbers)
            return np.exp(low + (high - low) * probabilities)
        case "normal":
            inside = np.clip(probabilities, SMALLEST, 1 - SMALLEST / 2)
            return numbers[0] + numbers[1] * special.ndtri(inside)
    indices = np.minimum((probabilities * len(numbers)).astype(int), len(numbers) - 1)
    return np.array(numbers)[indices]


class Points:
    """Parameters and derived values of the runs; expressions may name `constants`."""

    def __init__(self, campaign: Campaign, constants: dict[str, float]) -> None:
        self._sampler, self._constants = Sampler(campaign), constants
        self._parameters = list(campaign.parameters)
        self._expressions = campaign.expressions
        self.names = [*self._parameters, *self._expressions]

    def of(self, runs: range) -> np.ndarray:
        """Return values (runs, names); NaN where an expression is not defined."""
        given = self._sampler.points(runs)
        if not self._expressions:
            return given
        return np.array([self._with_derived(row) for row in given.tolist()])

    def _with_derived(self, row: list[float]) -> list[float]:
        known = self._constants | dict(zip(self._parameters, row, strict=True))
        result = list(row)
        for name, expression in self._expressions.items():
            try:
                known[name] = expression.value(known)
            except (ArithmeticError, ValueError):
                known[name] = np.nan
            result.append(known[name])
        return result

    def targets(self, points: np.ndarray, job: Job) -> np.ndarray:
        """Return the columns of `points` that go to the job's targets, in their order."""
        return points[:, [self.names.index(name) for name, _ in job.targets]]
