"""Works of the arm, their exact runs by heyoka, and peers: heyoka, and whoever else does a work."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from operator import add, mul, neg, sub, truediv
from pathlib import Path
from statistics import median
from time import thread_time

import heyoka as hy
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT))
from rparm.fmu_tools.compiler.expressions.expression import in_order  # noqa: E402

from tests.equations.compiled import read  # noqa: E402

OPERATIONS = {"+": add, "-": sub, "*": mul, "/": truediv, "negative": neg, "pow": pow}
OPERATIONS |= {"number": float, "sin": hy.sin, "cos": hy.cos, "exp": hy.exp}
ARM = ROOT / "models/rp_manipulator/rp_manipulator.toml"
START = (0.3, 0.2, 0.0, 0.0)  # q1, q2, dq1, dq2
STATES = ("q1", "q2", "dq1", "dq2")

# s of a step, a mean; states at the end of each step, shape (steps, 4); other figures of a row
Run = tuple[float, np.ndarray, dict[str, float]]
EXACT = np.finfo(np.longdouble).eps


@dataclass(frozen=True)
class Work:
    """Communication steps of one size, with inputs held over each."""

    name: str
    step: float  # s
    steps: int
    # changing: sines sampled at the communication points; constant; zero: free motion; push: of f2
    kind: str
    start: tuple[float, ...] = START
    tolerance: float = 1e-8

    @cached_property
    def inputs(self) -> np.ndarray:
        """Values of tau1 (N.m) and f2 (N), shape (steps, 2)."""
        if self.kind == "push":
            return np.column_stack(
                (np.zeros(self.steps), 0.1 * np.sin(40.0 * np.arange(self.steps)))
            )
        t = self.step * np.arange(self.steps) * (self.kind == "changing")
        sines = np.column_stack((12.0 + 3.0 * np.sin(5.0 * t), 4.0 + 2.0 * np.cos(7.0 * t)))
        return sines * (self.kind != "zero")

    @cached_property
    def reference(self) -> np.ndarray:
        """States at the end of each step, shape (steps, 4), in extended precision."""
        taylor = compiled(ARM, self.start, EXACT, np.longdouble)
        states = np.empty((self.steps, 4), np.longdouble)
        taylor.time, taylor.state[:] = np.longdouble(0.0), self.start
        for i, u in enumerate(self.inputs):
            taylor.pars[:] = u.astype(np.longdouble)
            taylor.propagate_until(np.longdouble(self.step) * (i + 1))
            states[i] = taylor.state
        return states

    def error(self, states: np.ndarray) -> float:
        """Return the largest difference of a state to the reference, over its largest value."""
        largest = np.maximum(np.abs(self.reference).max(axis=0), 1e-3)
        return float((np.abs(states - self.reference).max(axis=0) / largest).max())


def equations_of(file: Path) -> list[tuple[hy.expression, hy.expression]]:
    """States and their rates, from the graph of a file with equations; inputs are parameters."""
    model = read(file)
    found = {x.leaf: x.start for x in model.of("parameters")}
    found |= {x.leaf: hy.par[i] for i, x in enumerate(model.of("inputs"))}
    found |= {x.leaf: hy.expression(f"x{i}") for i, x in enumerate(model.of("states"))}
    for value in in_order([x.value for x in model.of("states")], found):
        given = [found[argument] for argument in value.arguments] or [value.number]
        is_square = value.op == "*" and given[0] is given[1]
        found[value] = given[0] ** 2.0 if is_square else OPERATIONS[value.op](*given)
    return [(found[x.leaf], found[x.value]) for x in model.of("states")]


@cache
def compiled(file: Path, start: tuple, tolerance: float, real: type = float) -> hy.taylor_adaptive:
    """Compile the equations of a file."""
    begin, tol = np.array(start, real), real(tolerance)
    return hy.taylor_adaptive(equations_of(file), begin, tol=tol, fp_type=real)


def run_heyoka(work: Work, tolerance: float, passes: int = 1) -> Run:
    """Make all steps: set the parameters, propagate_until, read the state. Setup is not timed."""
    taylor = compiled(ARM, START, tolerance)
    pars, state, propagate, size = taylor.pars, taylor.state, taylor.propagate_until, work.step
    inputs = work.inputs.tolist()
    elapsed = 0.0
    for _ in range(passes):
        taylor.time = 0.0
        taylor.state[:] = START
        states = []
        begin = thread_time()  # the processor's for this thread, as in loops.c
        for i, u in enumerate(inputs):
            pars[0], pars[1] = u
            propagate(size * (i + 1))
            states.append(state.copy())
        elapsed += thread_time() - begin - clock_cost()
    return max(elapsed, 1e-9) / passes / work.steps, np.array(states), {}


@cache
def clock_cost() -> float:
    """Return the time in s between two readings of the clock in a row."""
    return median(-thread_time() + thread_time() for _ in range(1001))


@dataclass
class Peer:
    """A solver for a work, heyoka or another one, at a tolerance, with the name of its rows."""

    name: str
    work: Work
    tolerance: float
    solver: Callable[[Work, float, int], Run] = run_heyoka
    least: float = sys.float_info.epsilon  # tolerance that it takes

    def error(self) -> float:
        """Return the error of a run."""
        return self.work.error(self.solver(self.work, self.tolerance, 1)[1])

    def row(self) -> dict:
        """Return the row of one turn: time of a step, a mean over 2 ms or more, and figures."""
        work = self.work
        seconds, states, figures = self.solver(work, self.tolerance, 1)
        passes = min(200, round(2e-3 / (seconds * work.steps)))
        if passes > 1:
            seconds = self.solver(work, self.tolerance, passes)[0]
        return {
            "group": "steps", "work": work.name, "run": self.name, "step": work.step,
            "steps": work.steps, "error": work.error(states), "tolerance": self.tolerance,
            "us": 1e6 * seconds, **figures,
        }  # fmt: skip
