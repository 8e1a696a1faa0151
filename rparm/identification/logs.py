"""Segments of logs: rows between gaps, cut into pieces of equal length.

A cell may be empty: a measured value counts where it is there, an input holds until its next one.
Where rows were lost, smooth inputs are better known as linear between their neighbours.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rparm.errors import UserError
from rparm.runs import inputs
from rparm.units import Scale

LENGTH = 0.4  # s, of a segment
FEWEST_ROWS = 20  # of a segment
FEWEST_VALUES = 4  # of an output, to see their noise
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
    """Used part of a log."""

    path: Path
    times: np.ndarray  # (rows,) s since the first row, increasing
    inputs: np.ndarray  # (rows, Real inputs), each held over the step from its row
    switches: np.ndarray  # (rows, Boolean inputs) int32, the same
    measured: np.ndarray  # (rows, outputs); NaN where nothing was measured
    step: float  # s, the usual one
    first: float = 0.0  # s, time of the first row by the clock of the log
    warnings: Sequence[str] = ()  # of seeming damages
    filled: "Recording | None" = None  # its missing inputs linear in between, if some are missing


@dataclass(frozen=True, eq=False)
class Segment:
    """Consecutive rows of a recording, simulated from their own start state."""

    times: np.ndarray  # (rows,)
    inputs: np.ndarray  # (rows, Real inputs)
    switches: np.ndarray  # (rows, Boolean inputs)
    measured: np.ndarray  # (rows, outputs)
    first: int  # row from which on measured values count: those before are only simulated
    cuts: Sequence[int] = ()  # rows at which it is cut into pieces, to look at their scatter

    @property
    def counts(self) -> np.ndarray:
        """Measured values (rows, outputs) that count."""
        there = np.isfinite(self.measured)
        there[: self.first] = False
        return there

    @property
    def rows(self) -> int:
        """Number of rows with a measured value that counts."""
        return int(np.count_nonzero(self.counts.any(axis=1)))


def read(
    path: Path,
    reals: Mapping[str, Column],
    switches: Mapping[str, Column],
    outputs: Mapping[str, Column],
    time: str,
    length: float,
) -> Recording:
    """Read a log's columns; UserError if one is missing, holds no number, or wrongly stays.

    In a gap that is short to segments of a `length` inputs may be linear.
    """
    every = (*outputs.values(), *switches.values(), *reals.values())
    log = inputs.read_log(path).columns(time, [column.name for column in every])
    columns = [c.scale.values(values) for c, values in zip(every, log.values.T, strict=True)]
    known = [np.argmax(np.isfinite(values)) for values in columns[len(outputs) :]]
    rows = slice(max(known, default=0), None)  # before, an input has no value yet
    times, values = log.times[rows], np.column_stack(columns)[rows]
    measured, on, efforts = np.split(values, np.cumsum([len(outputs), len(switches)]), axis=1)
    if len(times) < FEWEST_ROWS:
        raise UserError(f"{path}: has {len(times)} rows, a segment needs {FEWEST_ROWS}")
    if len(times) > MOST_ROWS:
        raise UserError(f"{path}: has {len(times)} rows, expected at most {MOST_ROWS}")
    for name, values in zip(outputs, measured.T, strict=True):
        seen, column = values[np.isfinite(values)], f"{path}: column {outputs[name].name!r}"
        if len(seen) < FEWEST_VALUES:
            raise UserError(f"{column} has {len(seen)} values, expected {FEWEST_VALUES} at least")
        if np.ptp(seen) == 0:
            raise UserError(f"{column} is constant ({seen[0]:g}), nothing follows from it")
    on = _held(on)
    for name, values in zip(switches, on.T, strict=True):
        if not np.isin(values, (0, 1)).all():
            raise UserError(f"{path}: column {switches[name].name!r}: expected 0 or 1")
    said = [f"{path}: {text}" for text in log.warnings()]
    step, on = float(np.median(np.diff(times))), on.astype(np.int32)
    found = Recording(Path(path), times, _held(efforts), on, measured, step, log.first, said)
    return replace(found, filled=_filled(found, efforts, length))


def _held(values: np.ndarray) -> np.ndarray:
    """Return values (rows, columns), each kept until the next one; the first ones are there."""
    rows = np.where(np.isfinite(values), np.arange(len(values))[:, None], 0)
    return np.take_along_axis(values, np.maximum.accumulate(rows, axis=0), axis=0)


def _longest(recording: Recording, length: float) -> float:
    """Return the longest step within segments of a `length`: more is a gap in the inputs."""
    return max(GAP * length, (2 + MISSING) * recording.step)


def _filled(recording: Recording, efforts: np.ndarray, length: float) -> Recording | None:
    """Return the inputs linear where few rows or `efforts` (rows, inputs) are missing, or None."""
    times, usual = recording.times, recording.step
    steps = np.diff(times)
    counts = np.maximum(np.rint(steps / usual), 1).astype(int)
    is_filled = steps <= _longest(recording, length)
    is_filled &= np.abs(steps / usual - counts) <= MISSING
    counts[~is_filled] = 1
    if not efforts.size or ((counts == 1).all() and np.isfinite(efforts).all()):
        return None
    # place of each new row, in old rows
    places = np.append(
        np.concatenate([i + np.arange(n) / n for i, n in enumerate(counts)]), len(steps)
    )
    old = np.arange(len(times))
    measured = np.full((len(places), recording.measured.shape[1]), np.nan)
    measured[places == np.floor(places)] = recording.measured
    there = np.isfinite(efforts)
    columns = [
        np.interp(places, old[rows], values[rows])
        for rows, values in zip(there.T, efforts.T, strict=True)
    ]
    return replace(
        recording,
        times=np.interp(places, old, times),
        inputs=np.column_stack(columns),
        switches=recording.switches[np.floor(places).astype(int)],
        measured=measured,
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
    gaps = np.flatnonzero(np.diff(times) > _longest(recording, length)) + 1
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
            if segment.rows >= FEWEST_ROWS:
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


def continued(segment: Segment, following: Segment) -> Segment | None:
    """Return a segment up to where the following one starts; None if there is a gap between."""
    end = following.times[0]
    rows = int(np.searchsorted(segment.times, end))
    if not rows or end > segment.times[-1] + 2 * (segment.times[-1] - segment.times[-2]):
        return None
    names = "times", "inputs", "switches", "measured"
    joint = [
        np.concatenate([getattr(segment, name)[:rows], getattr(following, name)[:1]])
        for name in names
    ]
    return Segment(*joint, 0)


def joined(recording: Recording, pieces: Sequence[Segment]) -> Segment:
    """Return segments of a recording as pieces of one, which lasts to its end: inputs hold."""
    rows = [int(np.searchsorted(recording.times, piece.times[piece.first])) for piece in pieces]
    start = rows[0] - pieces[0].first
    whole = segment_of(recording, start, rows[0], len(recording.times))
    return replace(whole, cuts=[row - start for row in rows[1:]])


def begin(segment: Segment, share: float) -> Segment:
    """Return a share of a segment, from its start."""
    rows = max(int(share * len(segment.times)), segment.first + FEWEST_ROWS)
    columns = segment.times, segment.inputs, segment.switches, segment.measured
    return Segment(*(column[:rows] for column in columns), segment.first)


def noise(recordings: Sequence[Recording]) -> np.ndarray:
    """Return the standard deviation (outputs,) of the measured values' noise, whatever they follow.

    Divided third differences of noise are as large as it is, others small; times may be irregular.
    A log in counts has at least the noise of rounding.
    """
    return np.array([_noise(recordings, i) for i in range(recordings[0].measured.shape[1])])


def _noise(recordings: Sequence[Recording], i: int) -> float:
    there = [np.isfinite(r.measured[:, i]) for r in recordings]
    measured = [r.measured[rows, i] for r, rows in zip(recordings, there, strict=True)]
    times = [r.times[rows] for r, rows in zip(recordings, there, strict=True)]
    third = np.concatenate(list(map(_third_differences, times, measured)))
    found = np.sqrt(np.median(third**2) / 0.4549)  # median of chi-squared, 1 d.o.f.
    every = np.concatenate(measured)
    differences = np.abs(np.diff(np.unique(every)))
    return max(found, _count(differences) / np.sqrt(12), 1e-9 * np.ptp(every))


def _third_differences(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return differences of four rows, (rows - 3,), of the noise's variance."""
    four = np.stack([times[i : len(times) - 3 + i] for i in range(4)], axis=1)
    apart = four[:, :, None] - four[:, None, :] + np.eye(4)
    weights = 1 / apart.prod(axis=2)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    return sum(weights[:, i] * values[i : len(times) - 3 + i] for i in range(4))


def _count(differences: np.ndarray) -> float:
    """Return the difference of which all others are multiples, or 0."""
    smallest = float(differences.min())
    ratio = differences / smallest
    is_grid = np.abs(ratio - np.rint(ratio)).max() < 1e-3 and len(np.unique(np.rint(ratio))) > 1
    return smallest if is_grid or len(differences) < 100 else 0.0
