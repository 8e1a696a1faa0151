"""Intervals that contain the exact motion of a scenario; README.md has the theorems."""

import math
import time
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from pathlib import Path

import numpy as np
from flint import arb

from rparm import building, project
from rparm.errors import UserError, one_line
from rparm.files import is_file
from rparm.fmu_tools.compiler.read.content import ModelFile
from rparm.interruption import temporary_folder
from rparm.proof.checker import Checker, WrongClaim
from rparm.proof.problem import Problem, Start
from rparm.proof.prover import BITS, Obstacle, Stepper, precision, start_of, upper
from rparm.runs import scenario as scenarios
from rparm.runs.scenario import Scenario

HALVINGS = 6  # of starts that are too broad to be proven at once
ROUNDED_RADII = arb(2) ** -28  # sums of radii, which have 30 bits, differ by less
ASSUMED = "the equations of motion, exact parameters and inputs as given, and IEEE doubles"
Progress = Callable[[int], object]  # is called with 1 after each communication step
Ball = tuple[float, float, float]  # |exact - (high + low)| <= radius


@dataclass(frozen=True)
class Stop:
    """Where a proof ends before the scenario."""

    time: float  # s, up to which it holds
    reason: str
    is_event: bool  # the model's first event may come next
    by: float | None = None  # s, when the event has come, if that is proven

    def __str__(self) -> str:
        if not self.is_event:
            return f"the proof holds up to {self.time!r} s, no further: {self.reason}"
        if self.by is None:
            return f"proven up to {self.time!r} s, where the first event may be: {self.reason}"
        return f"proven up to the first event, from {self.time!r} to {self.by!r} s: {self.reason}"


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
    stopped: Stop | None
    starts: tuple[Start, ...]  # pieces of the start that were proven one by one
    checked: int = 0  # steps that the checker has confirmed

    def of(self, names: Sequence[str]) -> "Enclosure":
        """Return the intervals of these variables."""
        places = [self.names.index(name) for name in names]
        parts = {part: getattr(self, part)[:, places] for part in ("high", "low", "radius")}
        return replace(self, names=tuple(names), **parts)


@dataclass(frozen=True)
class Prover:
    """Proves what a model does."""

    model: ModelFile
    with_outputs: bool = False  # else only states are enclosed

    @property
    def states(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(v.name for v in self.model.of("states"))

    def enclose(
        self,
        scenario: Scenario,
        within: Mapping[str, float] | None = None,
        progress: Progress | None = None,
        seconds: float = math.inf,
        check: bool = False,
    ) -> Enclosure:
        """Enclose all motions of a scenario at its communication points, up to the first event.

        The start of states may be off by `within`; if too broad for a proof, it is halved, and its
        halves, too. UserError if a proof takes over `seconds` of the processor, or if a step is not
        confirmed, with `check`.
        """
        off, problem = within or {}, Problem(self.model, scenario, self.with_outputs)
        start = {n: (float(problem.known[n]), off.get(n, 0.0)) for n in self.states}

        def pieces(start: Start, halvings: int) -> list[Enclosure]:
            proof = Proof(problem, start, progress, time.thread_time() + seconds)
            try:
                found = proof.enclosure(check)
            except WrongClaim as error:
                raise UserError(f"{scenario.path}: not confirmed: {error}") from error
            is_too_broad = found.stopped is not None and not found.stopped.is_event
            if not (is_too_broad and halvings and any(r for _, r in start.values())):
                return [found]
            parts = []
            for half in halves(start):
                more = pieces(half, halvings - 1)
                if more[0].stopped is not None:
                    return [found]
                parts += more
            return parts

        return reduce(hull, pieces(start, HALVINGS))


@dataclass
class Proof:
    """The proof from one start."""

    problem: Problem
    start: Start
    progress: Progress | None = None
    deadline: float = math.inf  # of time.thread_time()

    def enclosure(self, check: bool = False) -> Enclosure:
        """Return it; WrongClaim if a step should be checked and is not confirmed."""
        with precision(BITS):
            return self._enclosure(check)

    def _enclosure(self, check: bool) -> Enclosure:
        problem, times = self.problem, [float(t) for t in self.problem.scenario.times]
        held = problem.held()
        self.resting = problem.resting_balls(held[0])
        start = problem.start_balls(self.start, self.resting)
        states = start_of(start, [r for _, r in self.start.values()])
        self.stepper = Stepper(problem, states, arb(times[0]))
        self.checker = Checker(problem, self.start) if check else None
        rows, stopped = [self._point(held[0], times[0])], None
        for end, inputs in zip(times[1:], held, strict=True):
            self.resting = problem.resting_balls(inputs)
            if time.thread_time() > self.deadline:
                raise UserError(f"{problem.scenario.path}: the proof takes too long")
            try:
                self._to(end, inputs)
            except Obstacle as obstacle:
                stopped = self._stop(obstacle, end, inputs)
                break
            rows.append(self._point(inputs, end))
            if self.progress is not None:
                self.progress(1)
        parts = np.moveaxis(np.array(rows), 2, 0)
        checked = self.checker.steps if self.checker else 0
        done = np.array(times[: len(rows)])
        return Enclosure(done, problem.names, *parts, stopped, (self.start,), checked)

    def _to(self, end: float, inputs: Sequence[arb]) -> None:
        """Take, and check, all steps to a communication point."""
        at = self.stepper.at
        for step in self.stepper.advance(end, self.resting):
            if self.checker:
                self.checker.step(step, at, step.length, inputs)
                at += step.length
        if self.checker and not at.contains(end):
            raise WrongClaim(f"steps to {end!r} s")

    def _point(self, inputs: Sequence[arb], at: float) -> list[Ball]:
        """Return the states and outputs, with these inputs."""
        problem, hull = self.problem, self.stepper.states.hull().entries()
        values = problem.balls(hull, self.resting, arb(at), len(problem.nodes))
        found = [ball_of(values[node]) for node in problem.outputs]
        if self.checker:
            self.checker.point(found, inputs, at)
        return found

    def _stop(self, obstacle: Obstacle, end: float, inputs: Sequence[arb]) -> Stop:
        """Return where the proof ends, and until when an event has come."""
        at, by = self.stepper.at, None
        is_event = obstacle.kind == "event"
        step = self.stepper.crossing(obstacle.where, end, self.resting) if is_event else None
        if step is not None:
            if self.checker:
                self.checker.crossing(step, at, step.length, inputs, obstacle.where)
            by = math.nextafter(float((at + step.length).upper()), math.inf)
        holds = math.nextafter(float(at.lower()), -math.inf)
        start = float(self.problem.scenario.times[0])
        reason = self.problem.reason(obstacle.kind, obstacle.where)
        return Stop(max(holds, start), reason, is_event, by)


def ball_of(x: arb) -> Ball:
    """Return the midpoint as a sum of doubles, and a radius that is large enough."""
    high = float(x.mid())
    low = float(x.mid() - arb(high))
    off = (x - arb(high) - arb(low)) * (1 + ROUNDED_RADII)
    return high, low, upper(off) if x.is_finite() else math.inf


# ---- Pieces of starts ----------------------------------------------------------------------------
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
    starts, checked = one.starts + other.starts, one.checked + other.checked
    return Enclosure(one.times, one.names, middle, 0 * middle, radius, None, starts, checked)


# ---- Models --------------------------------------------------------------------------------------
def prover_of(path: Path) -> Prover:
    """Return the prover of a file with equations, or of the model of a scenario.

    UserError for another file, or a model that has no such file.
    """
    subject = path if building.is_equations(path) else scenarios.subject_of(path)
    if subject.suffix.lower() == building.EQUATIONS:
        return Prover(_read(subject))
    if subject.is_dir():
        file = subject / f"{subject.name}{building.EQUATIONS}"
        if not is_file(file):
            expected = "expected a model whose motion can be proven"
            raise UserError(f"{path}: {expected}, got {subject.name}")
        return Prover(_read(file), subject.name in project.proven())
    with zipfile.ZipFile(subject) as archive, temporary_folder() as folder:
        names = [
            n for n in archive.namelist() if n.startswith("resources/") and n.endswith(".toml")
        ]
        if len(names) != 1:
            expected = "expected a model of equations, whose motion can be proven"
            raise UserError(f"{path}: {expected}, got {subject.name}")
        file = folder / Path(names[0]).name
        file.write_bytes(archive.read(names[0]))
        try:
            return Prover(_read(file))
        except UserError as error:  # C or tables are files beside it
            way_out = f"the key fmu may name the file with equations instead of {subject.name}"
            raise UserError(f"{path}: {way_out}: {error}") from error


def _read(file: Path) -> ModelFile:
    """Read a file with equations; UserError."""
    # slow to load
    from rparm.fmu_tools.compiler.read.model_file import ModelFileError, read

    try:
        model = read(file)
    except (ModelFileError, OSError) as error:
        raise UserError(one_line(str(error))) from None
    if model.hook:  # its C decides when events are
        expected = "expected a model whose motion can be proven, got one with events in C"
        raise UserError(f"{file}: [hook]: {expected}")
    return model
