"""Step doubling on a motion with a fast and a slow part, against fixed steps."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rparm.models.closed_loop.coupling.loop import (
    FINEST,
    REFERENCES,
    STATES,
    ClosedLoop,
    Method,
    read_reference,
)

from rparm.coupling import step_control

FAST_AND_SLOW = REFERENCES / "fast_and_slow" / "monolithic.csv"
RATES = ("arm.dq1", "arm.dq2", "arm.ddq1", "arm.ddq2")

CORNERS = (0.5, 0.8)  # s, begin and end of the fast part
FAST = {"trajectory": {"motion": "point_to_point", "start_time": 0.5, "duration": 0.3}}
FAST_STOP = 5.0  # s
TOLERANCES = (1e-4, 1e-5, 1e-6)
FIRST, SHORTEST, LONGEST = 1e-3, 1e-7, 0.2  # s
FINE = (2.5e-4, 1.25e-4)  # s, of the runs that replace the exact solution between its rows
PARTS_OF_A_STEP = 16  # that a step is redone in, at least, to measure its error
FEWER = 3.0  # times fewer steps than with a fixed step
LOCAL = 3.0  # times the tolerance that a local error may have, and the inverse its median


@dataclass(frozen=True, eq=False)
class Doubling:
    """A controlled run and the fixed steps that reach the same error."""

    tolerance: float  # of the error of a step, in the norm
    run: step_control.Controlled
    local: np.ndarray  # (accepted,) measured error of each step, in the norm
    error: float  # largest of the whole run, in the norm
    fixed_steps: int
    fixed_calls: int
    speed: np.ndarray  # (accepted + 1,) rad/s: dq1

    @property
    def passed(self) -> bool:
        """Whether the tolerance is held, not by waste, and steps are saved."""
        free = self.local[~self.run.limited] / self.tolerance
        return bool(
            self.local.max() <= LOCAL * self.tolerance
            and np.median(free) >= 1 / LOCAL
            and self.fixed_steps >= FEWER * self.run.accepted
            and self.fixed_calls >= FEWER * self.run.do_steps
        )


class FastAndSlow:
    """A motion with a fast part of 0.3 s in 5 s, and its exact solution."""

    def __init__(self, loop: ClosedLoop) -> None:
        self.loop = loop
        runs = [loop.run(FINEST, h, stop=FAST_STOP, changes=FAST)[0] for h in FINE]
        self.step = FINE[0]
        self.exact = {  # the leading term of the error removed
            name: (4 * runs[1][name][::2] - runs[0][name]) / 3 for name in (*STATES, *RATES[2:])
        }

    def check(self) -> float:
        """Error of this solution at the rows of the committed reference, in the norm."""
        reference = read_reference(FAST_AND_SLOW)
        found = self.states(reference["time"])
        return float(max(np.abs(found[:, i] - reference[n]).max() for i, n in enumerate(STATES)))

    def states(self, times: np.ndarray) -> np.ndarray:
        """States at any times, (times, 4), by cubic interpolation."""
        h = self.step
        i = np.clip((times / h).astype(int), 0, len(self.exact[STATES[0]]) - 2)
        s = times / h - i
        columns = []
        for name, rate in zip(STATES, RATES, strict=True):
            a, b = self.exact[name][i], self.exact[name][i + 1]
            da, db = h * self.exact[rate][i], h * self.exact[rate][i + 1]
            columns.append(
                (1 + 2 * s) * (1 - s) ** 2 * a
                + s * (1 - s) ** 2 * da
                + s**2 * (3 - 2 * s) * b
                + s**2 * (s - 1) * db
            )
        return np.array(columns).T

    def controlled(
        self, tolerance: float, method: Method = FINEST
    ) -> tuple[step_control.Controlled, np.ndarray, tuple[str, ...]]:
        """A controlled run, with the local error of every accepted step, measured by redoing it."""
        control = step_control.Control(
            tolerance, dict.fromkeys(STATES, 1.0), FIRST, SHORTEST, LONGEST, CORNERS
        )
        redone = []
        with self.loop.master(method) as master:
            places = [master.names.index(name) for name in STATES]

            def redo(length: float) -> None:
                start, parts = master.time, max(PARTS_OF_A_STEP, int(length / self.step))
                for part in range(1, parts + 1):
                    master.advance(start + length * part / parts)
                redone.append(master.values[places])

            master.initialize(0.0, FAST_STOP, self.loop.parameters("nominal", FAST))
            run = step_control.run(master, FAST_STOP, control, redo)
            names = master.names
        local = np.abs(run.values[1:, places] - np.array(redone)).max(axis=1)
        return run, local, names

    def fixed_error(self, per_tenth: int) -> float:
        """Largest error with that many fixed steps in 0.1 s, which all corners are multiples of."""
        columns = self.loop.run(FINEST, 0.1 / per_tenth, stop=FAST_STOP, changes=FAST)[0]
        states = np.array([columns[name] for name in STATES]).T
        return float(np.abs(states - self.states(columns["time"])).max())

    def fixed(self, error: float) -> int:
        """Fewest fixed steps in 0.1 s whose error is as small."""
        good = 8
        while self.fixed_error(good) > error:
            good *= 2
        bad = good // 2
        while good - bad > max(good // 50, 1):
            middle = (good + bad) // 2
            if self.fixed_error(middle) > error:
                bad = middle
            else:
                good = middle
        return good


def study_doubling(loop: ClosedLoop, tolerances: Sequence[float] = TOLERANCES) -> list[Doubling]:
    """Step doubling against fixed steps of the same accuracy and coupling."""
    motion = FastAndSlow(loop)
    found = []
    for tolerance in tolerances:
        run, local, names = motion.controlled(tolerance)
        places = [names.index(name) for name in STATES]
        error = float(np.abs(run.values[:, places] - motion.states(run.times)).max())
        steps = motion.fixed(error) * round(FAST_STOP / 0.1)
        calls = steps * len(loop.fmus)
        found.append(Doubling(tolerance, run, local, error, steps, calls, run.values[:, places[2]]))
    return found
