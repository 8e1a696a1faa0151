"""Proven errors of runs and references, by programs that enclose the motions of a model.

The folder of a model that has such a program has a folder proof/. There, proof.toml names the
parameters, states, inputs and outputs of the program, in its order; README.md has the format of
problems and answers; check.py checks certificates, and check_operations.py single operations.
"""

import math
import subprocess
import tempfile
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np

from rparm import project
from rparm.errors import UserError, hint
from rparm.files import from_here, is_file, read_toml
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import METHOD, SMALLEST_TOLERANCES
from rparm.runs import comparison, simulation
from rparm.runs import scenario as scenarios
from rparm.runs.scenario import Scenario
from rparm.runs.simulation import Result
from rparm.units import rounded_up

STOPPED = 1  # exit code: the proof could not go on
UNDERFLOW = 2.0**-800  # in SI units: above all that intervals around 0 allow for underflow
HALVINGS = 6  # of starts that are too broad to be proven at once
Start = Mapping[str, tuple[float, float]]  # value of each state, and by how much it may be off
# of a scenario that is proven where nobody asks for it: communication steps, time that it takes
MOST_STEPS = 20_000
LONGEST_RUN = 10.0
SHOWN = 5  # wrong values of a reference
ASSUMED = "the equations of motion, exact parameters and inputs as given, and IEEE doubles"


# ---- Enclosures ----------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Enclosure:
    """Intervals that contain the exact motion: |exact - (high + low)| <= radius."""

    # (n + 1,), communication points in s; fewer than asked for if the proof stopped
    times: np.ndarray
    # states and outputs, which have the inputs of the step before, at the start of that after
    names: tuple[str, ...]
    high: np.ndarray  # (n + 1, names), in the variables' units, as `low` and `radius`
    low: np.ndarray
    radius: np.ndarray
    stopped: float | None  # s, the time up to which the proof holds, if it does not to the end
    starts: tuple[Start, ...]  # pieces of the start that were proven one by one

    def of(self, names: Sequence[str]) -> "Enclosure":
        """Return the intervals of these variables."""
        places = [self.names.index(name) for name in names]
        parts = {part: getattr(self, part)[:, places] for part in ("high", "low", "radius")}
        return replace(self, names=tuple(names), **parts)


@dataclass(frozen=True)
class Prover:
    """The program of a model."""

    folder: Path  # of the model
    parameters: tuple[str, ...]
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]  # besides the states

    def enclose(
        self,
        scenario: Scenario,
        within: Mapping[str, float] | None = None,
        progress: Callable[[int], object] | None = None,
        seconds: float = threading.TIMEOUT_MAX,
    ) -> Enclosure:
        """Enclose all motions of a scenario at its communication points.

        The start of states may be off by `within`; if too broad for a proof, it is halved, and its
        halves, too. `progress` gets 1 after each step. UserError if a proof takes over `seconds`.
        """
        off = within or {}
        start = {n: (float(scenario.start_values[n]), off.get(n, 0.0)) for n in self.states}
        return reduce(hull, self._in_pieces(scenario, start, HALVINGS, progress, seconds))

    def _in_pieces(
        self,
        scenario: Scenario,
        start: Start,
        halvings: int,
        progress: Callable[[int], object] | None,
        seconds: float,
    ) -> list[Enclosure]:
        found = self._from_start(scenario, start, progress, seconds)
        if found.stopped is None or not halvings or not any(r for _, r in start.values()):
            return [found]
        parts = []
        for half in halves(start):
            more = self._in_pieces(scenario, half, halvings - 1, progress, seconds)
            if more[0].stopped is not None:
                return [found]
            parts += more
        return parts

    def _from_start(
        self,
        scenario: Scenario,
        start: Start,
        progress: Callable[[int], object] | None,
        seconds: float,
    ) -> Enclosure:
        program = project.proof_program(self.folder)
        with tempfile.TemporaryFile("w+") as asked, tempfile.TemporaryFile("w+") as errors:
            asked.writelines(self.problem(scenario, start))
            asked.seek(0)
            with subprocess.Popen(
                [program], stdin=asked, stdout=subprocess.PIPE, stderr=errors, encoding="utf-8"
            ) as process:
                assert process.stdout is not None
                watch = threading.Timer(seconds, process.kill)
                watch.daemon = True
                watch.start()
                lines = list(_watched(process.stdout, progress))
                watch.cancel()
            if process.returncode not in (0, STOPPED):
                errors.seek(0)
                text = errors.read().strip() or f"exit code {process.returncode}"
                raise UserError(f"{scenario.path}: nothing can be proven: {text}")
        return self.answer(lines, start)

    def problem(self, scenario: Scenario, start: Start) -> Iterable[str]:
        """Write the question to the program, in lines."""
        value = scenario.start_values
        yield _line("start", [scenario.times[0]])
        yield _line("states", (x for n in self.states for x in (start[n][0], 0.0, start[n][1])))
        yield _line("parameters", (x for n in self.parameters for x in (value[n], 0.0, 0.0)))
        inputs = [scenario.input(name) for name in self.inputs]
        for i, end in enumerate(scenario.times[1:]):
            held = (x for values in inputs for x in (values[i], 0.0, 0.0, 0.0))
            yield _line("to", [end, *held])

    def answer(self, lines: Iterable[str], start: Start) -> Enclosure:
        """Read the answer of the program."""
        rows, times, stopped = [], [], None
        for line in lines:
            name, time, *numbers = line.split()
            if name == "stopped":
                stopped = float.fromhex(time)
            else:
                times.append(float.fromhex(time))
                rows.append([float.fromhex(number) for number in numbers])
        names = self.states + self.outputs
        parts = np.array(rows).reshape(len(rows), len(names), 3)
        high, low, radius = np.moveaxis(parts, 2, 0)
        return Enclosure(np.array(times), names, high, low, radius, stopped, (start,))

    def check(
        self,
        scenario: Scenario,
        enclosure: Enclosure,
        progress: Callable[[int], object] | None = None,
    ) -> tuple[int, int]:
        """Prove again, check all claims and operations, count both; UserError for a wrong one."""
        checked = [self._check(scenario, start, progress) for start in enclosure.starts]
        steps = sum(count for count, _ in checked)
        again = reduce(hull, (answer for _, answer in checked))
        for name in ("times", "high", "low", "radius"):
            if not np.array_equal(getattr(again, name), getattr(enclosure, name)):
                raise UserError(f"{scenario.path}: the proof is not confirmed: {name} differ")
        operations = self._checker("check_operations")
        try:
            return steps, operations.check(project.proof_program(self.folder))
        except operations.WrongAnswer as error:
            raise UserError(f"{scenario.path}: the proof is not confirmed: {error}") from error

    def _check(
        self, scenario: Scenario, start: Start, progress: Callable[[int], object] | None
    ) -> tuple[int, Enclosure]:
        checker = self._checker("check")
        program = project.proof_program(self.folder)
        with tempfile.TemporaryDirectory() as folder:
            certificate = Path(folder) / "certificate"
            problem = list(self.problem(scenario, start))
            question = {"input": "".join(problem), "capture_output": True, "encoding": "utf-8"}
            points = subprocess.run([program, certificate], **question).stdout.splitlines()
            try:
                with certificate.open(encoding="utf-8") as claims:
                    count = checker.check(problem, points, claims, progress)
            except checker.WrongClaim as error:
                raise UserError(f"{scenario.path}: the proof is not confirmed: {error}") from error
        return count, self.answer(points, start)

    def _checker(self, name: str) -> ModuleType:
        try:
            return import_module(f"rparm.models.{self.folder.name}.{project.PROOF}.{name}")
        except ModuleNotFoundError as error:
            if error.name != "flint":
                raise
            way_out = project.how_to_install("control")
            raise UserError(f"--check needs python-flint, {way_out} installs it") from error


def prover_of(path: Path) -> Prover:
    """Load the prover of the model of a scenario; UserError if it has none."""
    name = scenarios.name_of(scenarios.subject_of(path))
    known = provers()
    if name not in known:
        names = ", ".join(known) or "none"
        expected = f"expected a model whose motion can be proven ({names})"
        raise UserError(f"{path}: {expected}, got {name}")
    return known[name]


def provers() -> dict[str, Prover]:
    """Load all provers by the folders of their models."""
    return {
        name: _load(folder)
        for name, folder in project.models().items()
        if is_file(project.proof_file(folder))
    }


def halves(start: Start) -> tuple[Start, Start]:
    """Cut a start into two pieces where it is widest."""
    name = max(start, key=lambda each: start[each][1])
    value, radius = start[name]
    least, greatest = value - radius, value + radius
    middle = value
    # roundings of these sums are far below the last term
    room = 4 * math.ulp(max(abs(least), abs(greatest)))
    return tuple(
        {**start, name: ((low + high) / 2, (high - low) / 2 + room)}
        for low, high in ((least, middle), (middle, greatest))
    )


def hull(one: Enclosure, other: Enclosure) -> Enclosure:
    """Join intervals of two enclosures that go to the end."""
    ends = [sign * (x.high + x.low) + x.radius for sign in (-1, 1) for x in (one, other)]
    least, greatest = -np.maximum(*ends[:2]), np.maximum(*ends[2:])
    middle = (least + greatest) / 2
    # roundings of these sums are far below the last term
    room = 8 * np.spacing(np.maximum(np.abs(least), np.abs(greatest)))
    radius = (greatest - least) / 2 + room
    starts = one.starts + other.starts
    return Enclosure(one.times, one.names, middle, 0 * middle, radius, None, starts)


def _load(folder: Path) -> Prover:
    content = read_toml(project.proof_file(folder))
    keys = ("parameters", "states", "inputs", "outputs")
    return Prover(folder, *(tuple(content[key]) for key in keys))


def _line(name: str, numbers: Iterable[float]) -> str:
    return f"{name} {' '.join(float(number).hex() for number in numbers)}\n"


def _watched(lines: Iterable[str], progress: Callable[[int], object] | None) -> Iterable[str]:
    for number, line in enumerate(lines):
        if number and progress is not None:
            progress(1)
        yield line


def is_nearest(values: np.ndarray, enclosure: Enclosure, rows: np.ndarray) -> np.ndarray:
    """Return which values (rows, names) are proven to be the doubles nearest to the exact ones.

    `rows` are their communication points. 0 is so up to `UNDERFLOW`: intervals are no narrower.
    """
    distance = distances(values, enclosure, rows)
    side = (enclosure.high[rows] - values) + enclosure.low[rows]  # where the exact value is
    gap = np.abs(np.nextafter(values, np.copysign(math.inf, side)) - values)
    return (distance < gap / 2) | ((values == 0.0) & (distance < UNDERFLOW))


def distances(values: np.ndarray, enclosure: Enclosure, rows: np.ndarray) -> np.ndarray:
    """Bound |value - exact value|, shape (rows, names); arguments as in `is_nearest`."""
    # the factor covers the roundings of these operations, far fewer than 30 of 2^-53 each
    beside = np.abs((values - enclosure.high[rows]) - enclosure.low[rows])
    return (beside + enclosure.radius[rows]) * (1 + 2.0**-48)


# ---- Proven errors -------------------------------------------------------------------------------
@dataclass(frozen=True)
class ProvenError:
    """Of one variable in one run."""

    error: float  # largest |run - exact motion| at communication points, in its unit
    at: float  # s, where
    radius: float  # of the widest interval that contains the exact value


@dataclass(frozen=True)
class WrongValue:
    """A value of a reference that is not proven to be the double nearest to the exact one."""

    file: Path
    line: int
    column: str
    value: float
    exact: float  # rounded to a double
    within: float  # how far the exact value is from that at most

    def __str__(self) -> str:
        where = f"{from_here(self.file)}, line {self.line}, column {self.column}"
        exact = f"the exact value is within {rounded_up(self.within, 1)} of {self.exact!r}"
        return f"{where}: found {self.value!r}, {exact}"


@dataclass(frozen=True)
class ProvenReference:
    """Proven error of a scenario's reference."""

    values: int  # of all columns
    nearest: int  # those that are proven to be the doubles nearest to the exact ones
    radius: float  # of the widest interval
    wrong: tuple[WrongValue, ...]  # the first ones of the others, at most `SHOWN`

    @property
    def passed(self) -> bool:
        return self.nearest == self.values


def methods_of(fmu: Fmu, chosen: str | None = None) -> list[str]:
    """List the methods of integration of an FMU, or the chosen one; UserError if it has none."""
    variable = fmu.model.variables.get(METHOD)
    known = list(variable.items) if variable is not None else []
    if chosen is not None and chosen not in known:
        raise UserError(f"--method: no method {chosen!r}{hint(chosen, known)}")
    return [chosen] if chosen is not None else known


def tolerance_of(method: str, tolerance: float) -> float:
    """Return the relative tolerance that a method integrates at if asked for one."""
    return max(tolerance, SMALLEST_TOLERANCES.get(method, 0.0))


def error_bounds(
    fmu: Fmu,
    scenario: Scenario,
    enclosure: Enclosure,
    method: str,
    tolerance: float,
    progress: Callable[[int], object] | None = None,
) -> np.ndarray:
    """Bound the errors in a run, (communication points, names), in the names' units."""
    parameters = scenario.parameters | {METHOD: fmu.model.variables[METHOD].items[method]}
    run = replace(scenario, parameters=parameters, reference_every=1)
    result = simulation.simulate(fmu, run, tolerance_of(method, tolerance), progress)
    values = _columns(result.names, result.values, enclosure.names)
    return distances(values, enclosure, np.arange(len(enclosure.times)))


def errors_of_run(
    scenario: Scenario, result: Result, most_steps: int = MOST_STEPS
) -> Mapping[str, ProvenError] | None:
    """Bound the errors of a run at the points that were recorded; None: nothing is proven.

    So it is without a prover, where a proof does not come to the end or takes more than
    `LONGEST_RUN` s, and for more than `most_steps` communication steps.
    """
    program = provers().get(scenario.model)
    if program is None or len(scenario.times) > most_steps + 1:
        return None
    try:
        enclosure = program.enclose(scenario, seconds=LONGEST_RUN)
    except UserError:  # takes too long, or is not there, as in an installed package
        return None
    if enclosure.stopped is not None:
        return None
    enclosure = enclosure.of(program.states)
    rows = scenario.reference_rows
    values = _columns(result.names, result.values, enclosure.names)
    rows = rows[: len(values)]
    return largest_errors(distances(values[: len(rows)], enclosure, rows), enclosure, rows)


def largest_errors(
    errors: np.ndarray, enclosure: Enclosure, rows: np.ndarray | None = None
) -> dict[str, ProvenError]:
    """Return the largest of errors (points, names) by name; `rows`: their communication points."""
    times = enclosure.times if rows is None else enclosure.times[rows]
    worst = np.argmax(errors, axis=0)
    radius = enclosure.radius.max(axis=0)
    return {
        name: ProvenError(float(errors[at, i]), float(times[at]), float(radius[i]))
        for i, (name, at) in enumerate(zip(enclosure.names, worst, strict=True))
    }


def proven_reference(fmu: Fmu, scenario: Scenario, enclosure: Enclosure) -> ProvenReference:
    """Prove the error of a scenario's reference, in all columns; UserError if it has none."""
    expected = comparison.load_reference(scenario, fmu.model)
    rows = scenario.reference_rows
    around = enclosure.of(expected.names)
    nearest = is_nearest(expected.values, around, rows)
    within = distances(around.high[rows], around, rows)
    wrong = []
    for row, i in np.argwhere(~nearest)[:SHOWN]:
        numbers = expected.values[row, i], around.high[rows[row], i], within[row, i]
        place = expected.path, int(row) + 2, expected.names[i]
        wrong.append(WrongValue(*place, *map(float, numbers)))
    radius = float(around.radius[rows].max())
    return ProvenReference(nearest.size, int(nearest.sum()), radius, tuple(wrong))


def _columns(names: Sequence[str], values: np.ndarray, wanted: Sequence[str]) -> np.ndarray:
    return values[:, [list(names).index(name) for name in wanted]]
