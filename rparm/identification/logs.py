"""Segments of logs: rows between gaps, cut into pieces of equal length."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rparm.errors import UserError
from rparm.runs import inputs
from rparm.units import Scale

LENGTH = 0.4  # s, of a segment
FEWEST_ROWS = 20  # of a segment
MISSING = 0.1  # steps: rows are missing in one that is a multiple, to this; others are irregular
GAP = 0.05  # of a segment: in a longer one the inputs are unknown
MOST_ROWS = 2_000_000


@dataclass(frozen=True)
class Column:
    """Column of a variable's values: its name in the log, and what a 1 in it means."""

    name: str
    scale: Scale = Scale()
    one: str = ""  # its value with a unit, where that is another one


@dataclass(frozen=True, eq=False)
class Recording:
    """Used part of a log, with rows put in where few are missing."""

    path: Path
    times: np.ndarray  # (rows,) s since the first row, increasing
    inputs: np.ndarray  # (rows, Real inputs), each held over the step from its row
    switches: np.ndarray  # (rows, Boolean inputs) int32, the same
    measured: np.ndarray  # (rows, outputs); NaN in rows that were put in
    step: float  # s, the usual one
    first: float = 0.0  # s, time of the first row by the clock of the log
    warnings: Sequence[str] = ()  # of seeming damages


@dataclass(frozen=True, eq=False)
class Segment:
    """Consecutive rows of a recording, simulated from their own start state."""

    times: np.ndarray  # (rows,)
    inputs: np.ndarray  # (rows, Real inputs)
    switches: np.ndarray  # (rows, Boolean inputs)
    measured: np.ndarray  # (rows, outputs)
    first: int  # row from which on measured values count: those before are only simulated

    @property
    def counts(self) -> np.ndarray:
        """Rows (rows,) whose measured values count."""
        rows = np.isfinite(self.measured).all(axis=1)
        rows[: self.first] = False
        return rows


def read(
    path: Path,
    reals: Mapping[str, Column],
    switches: Mapping[str, Column],
    outputs: Mapping[str, Column],
    time: str = "time",
) -> Recording:
    """Read a log's columns; UserError if one is missing, holds no number, or wrongly stays."""
    every = (*outputs.values(), *switches.values(), *reals.values())
    log = inputs.read_log(path).columns(time, [column.name for column in every])
    times, values = log.times, log.values * [column.scale for column in every]
    measured, on, efforts = np.split(values, np.cumsum([len(outputs), len(switches)]), axis=1)
    if len(times) < FEWEST_ROWS:
        raise UserError(f"{path}: has {len(times)} rows, a segment needs {FEWEST_ROWS}")
    if len(times) > MOST_ROWS:
        raise UserError(f"{path}: has {len(times)} rows, expected at most {MOST_ROWS}")
    for name, values in zip(outputs, measured.T, strict=True):
        if np.ptp(values) == 0:
            column = outputs[name].name
            raise UserError(
                f"{path}: column {column!r} is constant ({values[0]:g}), nothing follows from it"
            )
    for name, values in zip(switches, on.T, strict=True):
        if not np.isin(values, (0, 1)).all():
            raise UserError(f"{path}: column {switches[name].name!r}: expected 0 or 1")
    said = [f"{path}: {text}" for text in log.warnings()]
    step, on = float(np.median(np.diff(times))), on.astype(np.int32)
    return _filled(Recording(Path(path), times, efforts, on, measured, step, log.first, said))


def _filled(recording: Recording) -> Recording:
    """Put rows in where few are missing; inputs are linear there."""
    times, usual = recording.times, recording.step
    steps = np.diff(times)
    counts = np.maximum(np.rint(steps / usual), 1).astype(int)
    is_filled = steps <= max(GAP * LENGTH, (2 + MISSING) * usual)
    is_filled &= np.abs(steps / usual - counts) <= MISSING
    counts[~is_filled] = 1
    if (counts == 1).all():
        return recording
    # place of each new row, in old rows
    places = np.append(
        np.concatenate([i + np.arange(n) / n for i, n in enumerate(counts)]), len(steps)
    )
    old = np.arange(len(times))
    there = places == np.floor(places)
    filled = np.full((len(places), recording.measured.shape[1]), np.nan)
    filled[there] = recording.measured
    columns = [np.interp(places, old, values) for values in recording.inputs.T]
    return replace(
        recording,
        times=np.interp(places, old, times),
        inputs=np.column_stack(columns) if columns else np.empty((len(places), 0)),
        switches=recording.switches[np.floor(places).astype(int)],
        measured=filled,
    )


def segments(recording: Recording, length: float, lead: float = 0.0) -> list[Segment]:
    """Cut a recording at its gaps, and between them into pieces of about `length` s.

    A segment is simulated from `lead` s before its first measured value that counts. UserError if
    nothing is long enough.
    """
    times, least = recording.times, (FEWEST_ROWS - 1) * recording.step
    if length < least * (1 - 1e-9):
        raise UserError(
            f"segment: {recording.path} has {FEWEST_ROWS} rows in {least:.4g} s, "
            f"expected at least that, got {length:g} s"
        )
    gaps = np.flatnonzero(np.diff(times) > max(GAP * length, 2 * recording.step)) + 1
    found: list[Segment] = []
    for begin, end in zip([0, *gaps], [*gaps, len(times)], strict=True):
        span = times[end - 1] - times[begin] - lead
        pieces = int((span + 0.5 * recording.step) // length)
        if pieces < 1:
            continue
        cuts = times[begin] + lead + span * np.arange(pieces + 1) / pieces
        rows = np.searchsorted(times[begin:end], cuts - 1e-9 * span) + begin
        rows[-1] = end
        for first, last in zip(rows[:-1], rows[1:], strict=True):
            start = int(np.searchsorted(times, times[first] - lead - 1e-9 * span))
            segment = segment_of(recording, max(start, begin), int(first), int(last))
            if np.count_nonzero(segment.counts) >= FEWEST_ROWS:
                found.append(segment)
    if not found:
        longest = max(np.diff([times[0], *times[gaps - 1], *times[gaps], times[-1]]), default=0.0)
        raise UserError(
            f"{recording.path}: has {longest:.4g} s without a gap, a segment needs "
            f"{length + lead:.4g} s and {FEWEST_ROWS} rows"
        )
    return found


def segment_of(recording: Recording, start: int, first: int, last: int) -> Segment:
    """Return the rows from `start` up to `last`, of which those from `first` on are compared."""
    rows = slice(start, last)
    return Segment(
        np.ascontiguousarray(recording.times[rows]),
        np.ascontiguousarray(recording.inputs[rows]),
        np.ascontiguousarray(recording.switches[rows]),
        recording.measured[rows],
        first - start,
    )


def noise(recordings: Sequence[Recording]) -> np.ndarray:
    """Return the standard deviation (outputs,) of the measured values' noise, whatever they follow.

    Divided third differences of noise are as large as it is, others small; times may be irregular.
    A log in counts has at least the noise of rounding.
    """
    there = [np.isfinite(r.measured).all(axis=1) for r in recordings]
    measured = [r.measured[rows] for r, rows in zip(recordings, there, strict=True)]
    times = [r.times[rows] for r, rows in zip(recordings, there, strict=True)]
    third = np.vstack(list(map(_third_differences, times, measured)))
    found = np.sqrt(np.median(third**2, axis=0) / 0.4549)  # median of chi-squared, 1 d.o.f.
    every = np.vstack(measured)
    for i, values in enumerate(every.T):
        differences = np.abs(np.diff(np.unique(values)))
        found[i] = max(found[i], _count(differences) / np.sqrt(12), 1e-9 * np.ptp(values))
    return found


def _third_differences(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return differences of four rows, (rows - 3, outputs), of the noise's variance."""
    four = np.stack([times[i : len(times) - 3 + i] for i in range(4)], axis=1)
    apart = four[:, :, None] - four[:, None, :] + np.eye(4)
    weights = 1 / apart.prod(axis=2)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    return sum(weights[:, i, None] * values[i : len(times) - 3 + i] for i in range(4))


def _count(differences: np.ndarray) -> float:
    """Return the difference of which all others are multiples, or 0."""
    smallest = float(differences.min())
    ratio = differences / smallest
    is_grid = np.abs(ratio - np.rint(ratio)).max() < 1e-3 and len(np.unique(np.rint(ratio))) > 1
    return smallest if is_grid or len(differences) < 100 else 0.0
