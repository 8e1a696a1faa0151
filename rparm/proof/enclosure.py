"""Intervals that contain the exact motion of a scenario, from the program that proves them.

README.md has the theorems, and what the program reads and writes.
"""

import json
import math
import subprocess
import sys
import tempfile
import threading
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np

from rparm import building, project
from rparm.errors import UserError, one_line
from rparm.files import is_file
from rparm.interruption import temporary_folder
from rparm.proof.problem import Problem, Start
from rparm.runs import scenario as scenarios
from rparm.runs.scenario import Scenario

STOPPED = 1  # exit code: the proof could not go on
HALVINGS = 6  # of starts that are too broad to be proven at once
ASSUMED = "the equations of motion, exact parameters and inputs as given, and IEEE doubles"
Progress = Callable[[int], object]  # is called with 1 after each communication step


@dataclass(frozen=True)
class Stop:
    """Where a proof ends before the scenario."""

    time: float  # s, up to which it holds
    reason: str
    is_event: bool  # the model's first event comes next

    def __str__(self) -> str:
        if self.is_event:
            return f"proven up to the first event, at {self.time!r} s: {self.reason}"
        return f"the proof holds up to {self.time!r} s, no further: {self.reason}"


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

    def of(self, names: Sequence[str]) -> "Enclosure":
        """Return the intervals of these variables."""
        places = [self.names.index(name) for name in names]
        parts = {part: getattr(self, part)[:, places] for part in ("high", "low", "radius")}
        return replace(self, names=tuple(names), **parts)


@dataclass(frozen=True)
class Prover:
    """Proves what a model does."""

    model: Mapping[str, Any]  # as `fmu/compiler/write/motion.py` has it
    with_outputs: bool = False  # else only states are enclosed

    @property
    def states(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(self.model["rates"])

    def enclose(
        self,
        scenario: Scenario,
        within: Mapping[str, float] | None = None,
        progress: Progress | None = None,
        seconds: float = threading.TIMEOUT_MAX,
    ) -> Enclosure:
        """Enclose all motions of a scenario at its communication points, up to the first event.

        The start of states may be off by `within`; if too broad for a proof, it is halved, and its
        halves, too. UserError if a proof takes over `seconds`.
        """
        off, problem = within or {}, Problem(self.model, scenario, self.with_outputs)
        start = {n: (float(problem.known[n]), off.get(n, 0.0)) for n in self.states}

        def pieces(start: Start, halvings: int) -> list[Enclosure]:
            found = _proven(problem, start, progress, seconds)
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

    def check(
        self, scenario: Scenario, enclosure: Enclosure, progress: Progress | None = None
    ) -> int:
        """Prove again and check all claims; count the steps. UserError for a wrong claim."""
        try:
            from rparm.proof import checker
        except ModuleNotFoundError as error:
            if error.name != "flint":
                raise
            way_out = project.how_to_install("control")
            raise UserError(f"--check needs python-flint, {way_out} installs it") from error
        problem, steps, found = Problem(self.model, scenario, self.with_outputs), 0, []
        for start in enclosure.starts:
            with temporary_folder() as folder:
                certificate = folder / "certificate"
                asked = [*problem.text(start)]
                question = {"input": "".join(asked), "capture_output": True, "encoding": "utf-8"}
                command = [project.proof_program(), certificate]
                points = subprocess.run(command, **question).stdout.splitlines()
                try:
                    with certificate.open(encoding="utf-8") as claims:
                        steps += checker.check(asked, points, claims, progress)
                except checker.WrongClaim as error:
                    raise UserError(f"{scenario.path}: not confirmed: {error}") from error
            found.append(_answer(problem, points, start))
        again = reduce(hull, found)
        for name in ("times", "high", "low", "radius"):
            if not np.array_equal(getattr(again, name), getattr(enclosure, name)):
                raise UserError(f"{scenario.path}: the proof is not confirmed: {name} differ")
        return steps


# ---- The program ---------------------------------------------------------------------------------
def _proven(problem: Problem, start: Start, progress: Progress | None, seconds: float) -> Enclosure:
    program = project.proof_program()
    with tempfile.TemporaryFile("w+") as asked, tempfile.TemporaryFile("w+") as errors:
        asked.writelines(problem.text(start))
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
            raise UserError(f"{problem.scenario.path}: nothing can be proven: {text}")
    return _answer(problem, lines, start)


def _answer(problem: Problem, lines: Iterable[str], start: Start) -> Enclosure:
    rows, times, stopped = [], [], None
    for line in lines:
        name, time, *words = line.split()
        if name == "stopped":
            obstacle, where = words
            reason = problem.reason(obstacle, int(where))
            stopped = Stop(float.fromhex(time), reason, obstacle == "event")
        else:
            times.append(float.fromhex(time))
            rows.append([float.fromhex(number) for number in words])
    parts = np.array(rows).reshape(len(rows), len(problem.names), 3)
    high, low, radius = np.moveaxis(parts, 2, 0)
    return Enclosure(np.array(times), problem.names, high, low, radius, stopped, (start,))


def _watched(lines: Iterable[str], progress: Progress | None) -> Iterator[str]:
    for number, line in enumerate(lines):
        if number and progress is not None:
            progress(1)
        yield line


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
    starts = one.starts + other.starts
    return Enclosure(one.times, one.names, middle, 0 * middle, radius, None, starts)


# ---- Models --------------------------------------------------------------------------------------
def prover_of(path: Path) -> Prover:
    """Load the prover of a file with equations, or of the model of a scenario.

    UserError for another file, or a model that has no such file.
    """
    if building.is_equations(path):
        return Prover(_motion(path))
    subject = scenarios.subject_of(path)
    if subject.is_dir():
        return _of_folder(subject, path)
    if subject.suffix.lower() == building.EQUATIONS:
        return Prover(_motion(subject))
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
            return Prover(_motion(file))
        except UserError as error:  # C or tables are files beside it
            way_out = f"the key fmu may name the file with equations instead of {subject.name}"
            raise UserError(f"{path}: {way_out}: {error}") from error


def _of_folder(folder: Path, asking: Path) -> Prover:
    """Load the prover of one of the project's models, for a scenario; UserError if it has none."""
    known, file = provers(), folder / f"{folder.name}{building.EQUATIONS}"
    if folder.name in known:
        return known[folder.name]
    if not is_file(file):
        expected = f"expected a model whose motion can be proven ({', '.join(known) or 'none'})"
        raise UserError(f"{asking}: {expected}, got {folder.name}")
    return Prover(_motion(file))


def provers() -> dict[str, Prover]:
    """Load the provers of models that the build has made, by the names of their folders."""
    files = {name: project.motion_file(name) for name in project.models()}
    return {
        name: Prover(json.loads(file.read_bytes()), with_outputs=True)
        for name, file in files.items()
        if is_file(file)
    }


def _motion(file: Path) -> dict[str, Any]:
    """Read a file with equations, in a separate process."""
    project.check_installed(building.NEEDED, "build")
    command = [sys.executable, project.motion_reader(), file]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "encoding": "utf-8"}
    ended = subprocess.run(command, env=project.child_environment(), **pipes, check=False)
    if ended.returncode:
        lines = ended.stderr.strip().splitlines() or [f"ended with {ended.returncode}"]
        raise UserError(one_line(lines[-1]))
    return json.loads(ended.stdout)
