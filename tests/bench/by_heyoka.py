"""The problem of problem.c in heyoka: timed runs, and errors against an exact run."""

from dataclasses import dataclass
from functools import cache, cached_property
from statistics import median
from time import thread_time

import heyoka as hy
import numpy as np

PARAMETERS = {
    "m1": 2.0, "m2": 1.0, "I1z": 0.1, "I2z": 0.05, "l1": 0.5, "lc1": 0.25, "a": 0.1, "g": 9.81
}  # fmt: skip
START = (0.3, 0.2, 0.0, 0.0)  # q1, q2, dq1, dq2
STATES = ("q1", "q2", "dq1", "dq2")

Run = tuple[float, np.ndarray]  # s of the stepping; states at the end of each step, (steps, 4)


@dataclass(frozen=True)
class Work:
    """Communication steps of one size, with inputs held over each."""

    name: str
    step: float  # s
    steps: int
    kind: str  # changing: sines sampled at the communication points; constant; zero: free motion

    @cached_property
    def inputs(self) -> np.ndarray:
        """Values of tau1 (N.m) and f2 (N), shape (steps, 2)."""
        t = self.step * np.arange(self.steps) * (self.kind == "changing")
        sines = np.column_stack((12.0 + 3.0 * np.sin(5.0 * t), 4.0 + 2.0 * np.cos(7.0 * t)))
        return sines * (self.kind != "zero")

    @cached_property
    def reference(self) -> np.ndarray:
        """States at the end of each step, shape (steps, 4), in extended precision."""
        taylor = compiled(np.finfo(np.longdouble).eps, np.longdouble)
        states = np.empty((self.steps, 4), np.longdouble)
        taylor.time, taylor.state[:] = np.longdouble(0.0), START
        for i, u in enumerate(self.inputs):
            taylor.pars[:] = u.astype(np.longdouble)
            taylor.propagate_until(np.longdouble(self.step) * (i + 1))
            states[i] = taylor.state
        return states

    def error(self, states: np.ndarray) -> float:
        """Return the largest difference of a state to the reference, over its largest value."""
        largest = np.maximum(np.abs(self.reference).max(axis=0), 1e-3)
        return float((np.abs(states - self.reference).max(axis=0) / largest).max())


@cache
def compiled(tolerance: float, real: type = float) -> hy.taylor_adaptive:
    """Compile equations (14) and (15) of the notes; the parameters are the inputs."""
    m1, m2, I1z, I2z, l1, lc1, a, g = PARAMETERS.values()
    q1, q2, dq1, dq2 = hy.make_vars(*STATES)
    tau1, f2 = hy.par[0], hy.par[1]
    length = l1 + q2
    inertia = m1 * lc1 * lc1 + I1z + I2z + m2 * length * length
    c, s = hy.cos(q1), hy.sin(q1)
    torque = tau1 - 2.0 * m2 * length * dq1 * dq2 - g * (m1 * lc1 * c + m2 * (length * c - a * s))
    force = f2 + m2 * length * dq1 * dq1 - m2 * g * s
    ddq1 = (torque + a * force) / inertia
    return hy.taylor_adaptive(
        [(q1, dq1), (q2, dq2), (dq1, ddq1), (dq2, force / m2 + a * ddq1)],
        np.array(START, real),
        pars=np.zeros(2, real),
        tol=real(tolerance),
        fp_type=real,
    )


def run_heyoka(work: Work, tolerance: float) -> Run:
    """Make all steps: set the parameters, propagate_until, read the state. Setup is not timed."""
    taylor = compiled(tolerance)
    taylor.time = 0.0
    taylor.state[:] = START
    pars, state, propagate, size = taylor.pars, taylor.state, taylor.propagate_until, work.step
    inputs = work.inputs.tolist()
    states = []
    begin = thread_time()  # the processor's for this thread, as in bench
    for i, u in enumerate(inputs):
        pars[0], pars[1] = u
        propagate(size * (i + 1))
        states.append(state.copy())
    elapsed = thread_time() - begin
    return max(elapsed - clock_cost(), 1e-9), np.array(states)


@cache
def clock_cost() -> float:
    """Return the time in s between two readings of the clock in a row."""
    return median(-thread_time() + thread_time() for _ in range(1001))


@dataclass
class Peer:
    """heyoka at a tolerance for a work, with the name of its rows."""

    name: str
    work: Work
    tolerance: float

    def error(self) -> float:
        """Return the error of a run."""
        return self.work.error(run_heyoka(self.work, self.tolerance)[1])

    def row(self) -> dict:
        """Return the row of one turn: time of a step, a mean over 2 ms or more, and error."""
        work = self.work
        seconds, states = run_heyoka(work, self.tolerance)
        passes = max(1, min(200, round(2e-3 / seconds)))
        for _ in range(passes - 1):
            seconds += run_heyoka(work, self.tolerance)[0]
        return {
            "group": "steps", "work": work.name, "run": self.name, "step": work.step,
            "steps": work.steps, "error": work.error(states), "tolerance": self.tolerance,
            "us": 1e6 * seconds / passes / work.steps,
        }  # fmt: skip
