"""Compliant stops: which joint is in which, and what it gets from there.

With the penetration d and its rate d' a stop pushes with k d (1 + c d') and never pulls: where
1 + c d' falls below 0 it stops pushing.
"""

from collections.abc import Mapping

import numpy as np
import sympy as sp
from rparm.models.rp_plant.references.automaton import real

COMPLIANT = 3  # item of stops
PARAMETERS = tuple(f"stop_{what}{joint}" for what in ("stiffness", "damping") for joint in (1, 2))
PUSHES, LETS_GO = 1, 2  # times +1 at the lower stop, -1 at the upper one; 0: apart


def penetration(joint: int, contact: int) -> sp.Expr:
    """Penetration d of joint 1 or 2, in the FMU's names."""
    q = sp.Symbol(f"q{joint}")
    return sp.Symbol(f"lower{joint}") - q if contact > 0 else q - sp.Symbol(f"upper{joint}")


def push(joint: int, contact: int) -> sp.Expr:
    """1 + c d'."""
    side = 1 if contact > 0 else -1
    return 1 - side * sp.Symbol(f"stop_damping{joint}") * sp.Symbol(f"dq{joint}")


def force(joint: int, contact: int) -> sp.Expr:
    """Force on the joint (N.m, N)."""
    if abs(contact) != PUSHES:
        return sp.Integer(0)
    stiffness = sp.Symbol(f"stop_stiffness{joint}")
    return contact * stiffness * penetration(joint, contact) * push(joint, contact)


class Contacts:
    """The contacts of both joints; `values` are parameters by the FMU's names."""

    def __init__(self, values: Mapping[str, float]) -> None:
        self.possible = [values[f"stops{i}"] == COMPLIANT for i in (1, 2)]
        self.now = [0, 0]
        self._limits = [(real(values[f"lower{i}"]), real(values[f"upper{i}"])) for i in (1, 2)]
        self._stiffness = [real(values[f"stop_stiffness{i}"]) for i in (1, 2)]
        self._damping = [real(values[f"stop_damping{i}"]) for i in (1, 2)]

    def find(self, state: np.ndarray) -> None:
        """From a state (4,) in which no event is; a joint at rest on a limit is apart."""
        for i in (0, 1):
            (lower, upper), q, dq = self._limits[i], state[i], state[2 + i]
            side = int(q < lower or (q == lower and dq < 0))
            side -= int(q > upper or (q == upper and dq > 0))
            pushes = 1 - side * self._damping[i] * dq > 0
            self.now[i] = side * (PUSHES if pushes else LETS_GO) if self.possible[i] else 0

    def pass_limit(self, i: int, what: str) -> None:
        """Joint index i enters or leaves its stop `what`."""
        self.now[i] = (PUSHES if what == "lower" else -PUSHES) if self.now[i] == 0 else 0

    def pass_push(self, i: int) -> None:
        """The stop that joint index i is in begins or ends to push."""
        side = int(np.sign(self.now[i]))
        self.now[i] = side * (LETS_GO if abs(self.now[i]) == PUSHES else PUSHES)

    def _depth(self, i: int, state: np.ndarray) -> real:
        lower, upper = self._limits[i]
        return lower - state[i] if self.now[i] > 0 else state[i] - upper

    def forces(self, state: np.ndarray) -> np.ndarray:
        """On the joints in this state, (2,): N.m, N."""
        found = np.zeros(2, real)
        for i, contact in enumerate(self.now):
            if abs(contact) == PUSHES:
                pressed = contact * self._stiffness[i] * self._depth(i, state)
                found[i] = pressed * (1 - contact * self._damping[i] * state[2 + i])
        return found

    def energy(self, state: np.ndarray) -> real:
        """Of the springs, J."""
        inside = [i for i in (0, 1) if self.now[i] != 0]
        return sum((self._stiffness[i] * self._depth(i, state) ** 2 / 2 for i in inside), real(0))
