"""Studies of the coupling: errors against step, step doubling."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rparm.models.closed_loop.coupling.loop import (
    FINEST,
    METHODS,
    REFERENCES,
    STATES,
    ClosedLoop,
    Columns,
    Method,
    read_reference,
)

from rparm.runs.convergence import slope
from rparm.systems import step_control

# ---- Error against step: how errors fall with the communication step -----------------------------
STEPS = (8e-3, 4e-3, 2e-3, 1e-3, 5e-4)  # s
COMMON = 0.04  # s, all steps and the reference's rows divide it


@dataclass(frozen=True, eq=False)
class StepErrors:
    """Runs of all methods with all steps; arrays are (methods, steps)."""

    methods: Sequence[Method]
    steps: np.ndarray  # s
    errors: np.ndarray  # of the arm's states, relative to the largest value of each
    energies: np.ndarray  # J, that the coupling adds to the arm
    calls: np.ndarray  # of DoStep

    def slopes(self, values: np.ndarray) -> list[float]:
        """Of log |values| over log steps, by method."""
        return [slope(self.steps, np.abs(row)) for row in values]

    def holds(self, i: int) -> bool:
        """Return whether error and energy of a method fall as expected."""
        slopes = self.slopes(self.errors)[i], self.slopes(self.energies)[i]
        return all(map(self.methods[i].expects, slopes))

    @property
    def passed(self) -> bool:
        """Whether all methods are as expected."""
        return all(self.holds(i) for i in range(len(self.methods)))


def study_step_errors(
    loop: ClosedLoop, steps: Sequence[float] = STEPS, methods: Sequence[Method] = METHODS
) -> StepErrors:
    """Return the error against step on the nominal motion, which does not saturate."""
    exact = read_reference(REFERENCES / "nominal" / "monolithic.csv")
    shape = len(methods), len(steps)
    errors, energies, calls = np.empty(shape), np.empty(shape), np.empty(shape, int)
    for i, method in enumerate(methods):
        for j, step in enumerate(steps):
            columns, calls[i, j] = loop.run(method, step)
            errors[i, j] = state_error(columns, exact)
            energies[i, j] = created_energy(loop, columns)
    return StepErrors(methods, np.array(steps), errors, energies, calls)


def state_error(columns: Columns, exact: Columns) -> float:
    """Largest error of the arm's states at the times that both have, multiples of COMMON."""
    rows = [np.round(c["time"][1] / COMMON, 12) for c in (columns, exact)]
    every = [round(1 / row) for row in rows]
    found = 0.0
    for name in STATES:
        wanted = exact[name][:: every[1]]
        got = columns[name][:: every[0]]
        found = max(found, np.abs(got - wanted).max() / np.abs(exact[name]).max())
    return float(found)


def created_energy(loop: ClosedLoop, columns: Columns) -> float:
    """Return the energy (J) that the arm gained beyond the efforts of the law at its motion."""
    efforts = law(loop, columns)
    power = efforts[0] * columns["arm.dq1"] + efforts[1] * columns["arm.dq2"]
    gained = columns["arm.total_energy"][-1] - columns["arm.total_energy"][0]
    return float(gained - simpson(power, columns["time"][1] - columns["time"][0]))


def law(loop: ClosedLoop, columns: Columns) -> np.ndarray:
    """Return efforts of the nominal controller for given references and measurements, (2, rows)."""
    fed = (c for c in loop.connections if c.end_component == "controller")
    sources = {c.end_connector: c.start for c in fed}
    with loop.fmus["controller"].instance("controller") as controller:
        efforts, inputs = controller.reals(["tau1", "f2"]), controller.reals(list(sources))
        controller.set_up(0.0, None)
        for name, value in loop.parameters("nominal")["controller"].items():
            controller.set(name, value)
        controller.enter_initialization()
        controller.exit_initialization()
        rows = np.array([columns[source] for source in sources.values()]).T
        found = np.empty((2, len(rows)))
        for i, row in enumerate(rows):
            inputs.view[:] = row
            inputs.set()
            efforts.get()
            found[:, i] = efforts.view
    return found


def simpson(values: np.ndarray, step: float) -> float:
    """Return the integral over an even number of equal steps."""
    inner = 4 * values[1:-1:2].sum() + 2 * values[2:-1:2].sum()
    return float((values[0] + inner + values[-1]) * step / 3)


# ---- Step doubling on a motion with a fast and a slow part, against fixed steps ------------------
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
        """Return the error of this solution at the rows of the committed reference, in the norm."""
        reference = read_reference(FAST_AND_SLOW)
        found = self.states(reference["time"])
        return float(max(np.abs(found[:, i] - reference[n]).max() for i, n in enumerate(STATES)))

    def states(self, times: np.ndarray) -> np.ndarray:
        """Return states at any times, (times, 4), by cubic interpolation."""
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
        norm, lengths = dict.fromkeys(STATES, 1.0), (FIRST, SHORTEST, LONGEST)
        control = step_control.Control(tolerance, norm, *lengths, CORNERS)
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
