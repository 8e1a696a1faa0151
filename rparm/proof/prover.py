"""Programs that enclose the motions of a model: what they are asked, and what they answer.

The folder of a model that has one has a folder proof/. There, proof.toml names the parameters,
states, inputs and outputs of the program, in its order; README.md has the format of problems and
answers; check.py checks certificates, and check_operations.py single operations.
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
from rparm.errors import UserError
from rparm.files import is_file, read_toml
from rparm.runs import scenario as scenarios
from rparm.runs.scenario import Scenario

STOPPED = 1  # exit code: the proof could not go on
UNDERFLOW = 2.0**-800  # in SI units: above all that intervals around 0 allow for underflow
HALVINGS = 6  # of starts that are too broad to be proven at once

Start = Mapping[str, tuple[float, float]]  # value of each state, and by how much it may be off


@dataclass(frozen=True, eq=False)
class Enclosure:
    """Intervals that contain the exact motion: |exact - (high + low)| <= radius.

    Attributes
    ----------
    times : ndarray, shape (n + 1,)
        Communication points in s; fewer than asked for if the proof stopped.
    names : tuple of str
        States and outputs; outputs have the inputs of the step before, first ones those after.
    high, low, radius : ndarrays, shape (n + 1, names)
        In the units of the variables.
    stopped : float or None
        Time in s up to which the proof holds, if it does not to the end.
    starts : tuple of Start
        Pieces of the start that were proven one by one.
    """

    times: np.ndarray
    names: tuple[str, ...]
    high: np.ndarray
    low: np.ndarray
    radius: np.ndarray
    stopped: float | None
    starts: tuple[Start, ...]

    def of(self, names: Sequence[str]) -> "Enclosure":
        """Intervals of these variables."""
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
        """Intervals that contain all motions of a scenario at its communication points.

        A start that is too broad for one proof is halved, and so are its halves.

        Parameters
        ----------
        within : mapping of str to float, optional
            By how much the start of states may be off, in their units.
        progress : callable, optional
            Called with 1 after each communication step.
        seconds : float
            Time after which to give up a proof, with a UserError.
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
        """What the program is asked, in lines."""
        value = scenario.start_values
        yield _line("start", [scenario.times[0]])
        yield _line("states", (x for n in self.states for x in (start[n][0], 0.0, start[n][1])))
        yield _line("parameters", (x for n in self.parameters for x in (value[n], 0.0, 0.0)))
        inputs = [scenario.input(name) for name in self.inputs]
        for i, end in enumerate(scenario.times[1:]):
            held = (x for values in inputs for x in (values[i], 0.0, 0.0, 0.0))
            yield _line("to", [end, *held])

    def answer(self, lines: Iterable[str], start: Start) -> Enclosure:
        """What the program has answered."""
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
        """Prove again, with certificates, and check every claim of them, and single operations.

        How many steps and operations are confirmed. UserError if one is not, or if the intervals
        are not those of `enclosure`.
        """
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
            points = subprocess.run(
                [program, certificate],
                input="".join(problem),
                capture_output=True,
                encoding="utf-8",
            ).stdout.splitlines()
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


def of_scenario(path: Path) -> Prover:
    """The prover of the model of a scenario; UserError if it has none."""
    name = scenarios.name_of(scenarios.subject_of(path))
    known = provers()
    if name not in known:
        names = ", ".join(known) or "none"
        raise UserError(
            f"{path}: expected a model whose motion can be proven ({names}), got {name}"
        )
    return known[name]


def provers() -> dict[str, Prover]:
    """All provers by the folders of their models."""
    return {
        name: _load(folder)
        for name, folder in project.models().items()
        if is_file(project.proof_file(folder))
    }


def halves(start: Start) -> tuple[Start, Start]:
    """Two pieces that cover a start, which is cut across where it is widest."""
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
    """Intervals that contain those of both, which go to the end."""
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
    """Which values are proven to be the doubles nearest to the exact ones.

    0 is so up to `UNDERFLOW`, because intervals are no narrower there.

    Parameters
    ----------
    values : ndarray, shape (rows, names)
    rows : ndarray of int, shape (rows,)
        Communication points of the values.
    """
    distance = distances(values, enclosure, rows)
    side = (enclosure.high[rows] - values) + enclosure.low[rows]  # where the exact value is
    gap = np.abs(np.nextafter(values, np.copysign(math.inf, side)) - values)
    return (distance < gap / 2) | ((values == 0.0) & (distance < UNDERFLOW))


def distances(values: np.ndarray, enclosure: Enclosure, rows: np.ndarray) -> np.ndarray:
    """Bounds of |value - exact value|, shape (rows, names); arguments as in `is_nearest`."""
    # the factor covers the roundings of these operations, far fewer than 30 of 2^-53 each
    beside = np.abs((values - enclosure.high[rows]) - enclosure.low[rows])
    return (beside + enclosure.radius[rows]) * (1 + 2.0**-48)
