"""The problem that the Python peers of the benchmark integrate, as in problem.c, and the error."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import cos, sin

import heyoka as hy
import numpy as np

PARAMETERS = {
    "m1": 2.0, "m2": 1.0, "I1z": 0.1, "I2z": 0.05, "l1": 0.5, "lc1": 0.25, "a": 0.1, "g": 9.81
}  # fmt: skip
START = (0.3, 0.2, 0.0, 0.0)  # q1, q2, dq1, dq2
STATES = ("q1", "q2", "dq1", "dq2")
INPUTS = ("tau1", "f2")


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
        """States at the end of each step, shape (steps, 4): heyoka in extended precision."""
        taylor = taylor_adaptive(np.finfo(np.longdouble).eps, np.longdouble)
        states = np.empty((self.steps, 4), np.longdouble)
        for i, u in enumerate(self.inputs):
            taylor.pars[:] = u.astype(np.longdouble)
            taylor.propagate_until(np.longdouble(self.step) * (i + 1))
            states[i] = taylor.state
        return states

    def error(self, states: np.ndarray) -> float:
        """Largest difference of a state to the reference, over the largest value of that state."""
        largest = np.maximum(np.abs(self.reference).max(axis=0), 1e-3)
        return float((np.abs(states - self.reference).max(axis=0) / largest).max())


def accelerations(q1, q2, dq1, dq2, tau1, f2, cosine=cos, sine=sin):
    """Equations (14) and (15) of the notes, solved for ddq1 and ddq2; floats or expressions."""
    m1, m2, I1z, I2z, l1, lc1, a, g = PARAMETERS.values()
    length = l1 + q2
    inertia = m1 * lc1 * lc1 + I1z + I2z + m2 * length * length
    c, s = cosine(q1), sine(q1)
    torque = tau1 - 2.0 * m2 * length * dq1 * dq2 - g * (m1 * lc1 * c + m2 * (length * c - a * s))
    force = f2 + m2 * length * dq1 * dq1 - m2 * g * s
    ddq1 = (torque + a * force) / inertia
    return ddq1, force / m2 + a * ddq1


def taylor_adaptive(tolerance: float, real: type = float) -> hy.taylor_adaptive:
    """Compile heyoka's integrator, at START and t = 0; its parameters are the inputs."""
    q1, q2, dq1, dq2 = hy.make_vars(*STATES)
    ddq1, ddq2 = accelerations(q1, q2, dq1, dq2, hy.par[0], hy.par[1], hy.cos, hy.sin)
    return hy.taylor_adaptive(
        [(q1, dq1), (q2, dq2), (dq1, ddq1), (dq2, ddq2)],
        np.array(START, real),
        pars=np.zeros(2, real),
        tol=real(tolerance),
        fp_type=real,
    )
