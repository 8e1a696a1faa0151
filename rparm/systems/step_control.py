"""Step-size control by step doubling, for any master of rparm.systems.master.

A step H is made whole and, after a rollback by FMU states, again as two steps H/2. A coupling of
order p makes an error of C H^(p+1) in a step. Then the two results are C H^(p+1) (1 - 2^-p) apart,
and the second one, which is kept, is off by 1/(2^p - 1) of that. The step is accepted if this
estimate is within the tolerance; the next one aims at a little less.

The estimate takes the step for a function of the state at its beginning, a one-step method. That
holds in Gauss-Seidel order with a controller in front of its plant: its efforts are those of the
measurements at the beginning of the step. In Jacobi order the plant moves by efforts that are one
step old: the outputs kept from the step before are part of the state, and a change of the step
changes their age.

Corners of what drives the system are hidden from the estimate: if a reference's slope jumps within
the first half of the step, both results may meet it with the same line, and after a rest neither
knows of it. Known corners are given to the control: steps end at them, and the first length is
taken again.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rparm.errors import UserError
from rparm.systems.master import Master, SystemSnapshot

SAFETY = 0.9  # of the step that would just reach the tolerance
SMALLEST_FACTOR, LARGEST_FACTOR = 0.2, 2.5  # from one step to the next


@dataclass(frozen=True)
class Control:
    """Tolerance of steps; the norm is the largest signal, each divided by its own of `scales`."""

    tolerance: float  # of the error that one accepted step makes, in the norm
    scales: Mapping[str, float]  # value that counts as 1, in its unit, by "component.variable"
    first: float  # s
    shortest: float  # s
    longest: float  # s
    corners: Sequence[float] = ()  # s, where inputs of the system are not smooth: steps end there


@dataclass(frozen=True, eq=False)
class Controlled:
    """A run with controlled steps; row i of `values` is what is read at times[i]."""

    times: np.ndarray  # (accepted + 1,) s
    values: np.ndarray  # (accepted + 1, names)
    estimates: np.ndarray  # (accepted,) error of each step, in the norm
    limited: np.ndarray  # (accepted,) whether something else than the tolerance chose the step
    rejected: int  # attempts that were rolled back for good
    do_steps: int  # of components, those rolled back included

    @property
    def accepted(self) -> int:
        """Steps that count."""
        return len(self.estimates)


def run(
    master: Master,
    stop: float,
    control: Control,
    before: Callable[[float], object] = lambda _: None,
) -> Controlled:
    """Step the initialized `master` to end exactly at the time `stop`, s.

    The order is 1 with zero-order hold of the inputs, with extrapolated ones 2. `before`, which may
    step the system, is called with each accepted step's length, back at its beginning. UserError if
    a step gets too short, or an FMU fails or has no state to go back to.
    """
    steps = _Steps(master, control)
    times, rows, estimates, limited = [master.time], [master.values.copy()], [], []
    ends = deque(sorted(t for t in {*control.corners, stop} if master.time < t <= stop))
    with SystemSnapshot(master) as begin, SystemSnapshot(master) as end:
        begin.take()
        while ends:
            start = times[-1]
            target, cut = _fit(start, ends[0], steps.wanted)
            estimate = steps.attempt(begin, start, target)
            if estimate > control.tolerance:
                steps.reject(start, target - start, estimate)
                begin.restore()
                continue
            times.append(target)
            rows.append(master.values.copy())
            estimates.append(estimate)
            limited.append(cut or target - start >= control.longest or steps.was_rejected)

            # to the beginning and back, for `before`
            end.take()
            begin.restore()
            before(target - start)
            end.restore()
            begin.take()

            steps.accept(target - start, estimate, cut)
            if target == ends[0]:
                ends.popleft()
                steps.wanted = control.first
    found = map(np.array, (times, rows, estimates, limited))
    return Controlled(*found, steps.rejected, steps.do_steps)


class _Steps:
    """Makes each step whole and in two halves, and chooses the length of the next one."""

    def __init__(self, master: Master, control: Control) -> None:
        self._master, self._control = master, control
        self._order = 2 if master.extrapolates else 1
        self._columns, self._scales = _norm(master, control)
        self.wanted, self.was_rejected = control.first, True  # s; whether the last attempt was
        self.rejected, self.do_steps = 0, 0

    def attempt(self, begin: SystemSnapshot, start: float, target: float) -> float:
        """Make a step whole, then in two halves, which are kept; the estimate of its error."""
        master, calls = self._master, self._master.do_steps
        master.advance(target)
        coarse = master.values[self._columns]
        begin.restore()
        master.advance(start + (target - start) / 2)
        master.advance(target)
        self.do_steps += master.do_steps - calls
        difference = np.abs(master.values[self._columns] - coarse) / self._scales
        return float(difference.max()) / (2**self._order - 1)

    def reject(self, start: float, length: float, estimate: float) -> None:
        """Request a shorter step from `start`."""
        control = self._control
        self.rejected, self.was_rejected = self.rejected + 1, True
        self.wanted = length * min(self._factor(estimate), SAFETY)
        if self.wanted < control.shortest:
            raise UserError(
                f"the step from t = {start!r} s would have to be below {control.shortest:g} s for "
                f"an error of {control.tolerance:g}"
            )

    def accept(self, length: float, estimate: float, cut: bool) -> None:
        """Request the next step, after one of this length that the end may have `cut`."""
        factor, control = self._factor(estimate), self._control
        limits = control.longest, LARGEST_FACTOR * length
        grown = length * factor if not self.was_rejected else length * min(factor, 1.0)
        grown = grown if not cut else max(grown, self.wanted)
        self.wanted, self.was_rejected = max(min(grown, *limits), control.shortest), False

    def _factor(self, estimate: float) -> float:
        """Return the factor of the step whose error is expected a little below the tolerance."""
        if estimate == 0.0:
            return LARGEST_FACTOR
        factor = SAFETY * (self._control.tolerance / estimate) ** (1 / (self._order + 1))
        return min(max(factor, SMALLEST_FACTOR), LARGEST_FACTOR)


def _norm(master: Master, control: Control) -> tuple[np.ndarray, np.ndarray]:
    """Return the signals' columns among the values, and their scales."""
    for name in control.scales:
        if name not in master.names:
            raise UserError(f"{name}: the system has no such value to control the step by")
    columns = [master.names.index(name) for name in control.scales]
    return np.array(columns, dtype=int), np.array([*control.scales.values()])


def _fit(start: float, stop: float, wanted: float) -> tuple[float, bool]:
    """End of the next step, and whether `stop` shortens it."""
    left = stop - start
    if left <= wanted * (1 + 1e-9):
        return stop, left < wanted
    if left < 2 * wanted:
        return start + left / 2, True
    return start + wanted, False
