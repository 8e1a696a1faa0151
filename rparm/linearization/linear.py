"""A linear model in continuous time, with the names of what it describes."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np

from rparm.errors import UserError, hint
from rparm.linearization.matrices import eigenvalues

if TYPE_CHECKING:
    from control import StateSpace

TERMS = 13  # of Taylor's series of an exponential


@dataclass(frozen=True, eq=False)
class Linear:
    """Small deviations from a point: x' = A x + B u, y = C x + D u.

    Attributes
    ----------
    states, inputs, outputs : tuple of str
        Their names: n, m and p of them.
    A, B, C, D : ndarray, shapes (n, n), (n, m), (p, n), (p, m)
        In the units of the variables and s.
    x, u, y, rates : ndarray, shapes (n,), (m,), (p,), (n,)
        The point: values of states, inputs and outputs, and what x' is there.
    at : dict of str to float
        The point by names: all states and inputs, also those that are held or not chosen.
    held : tuple of str
        States that stand still whatever the inputs do, at least at first: friction or a stop holds
        them. They are left out.
    left_out : tuple of str
        Discrete outputs: they have no derivatives.
    intervals : dict of str to (float, float)
        Where dry friction lets what was trimmed lie anywhere in between.
    dropped : tuple of str
        States that are left out as they play no part between inputs and outputs.
    hidden : ndarray
        Poles that are left out with them, 1/s.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    x: np.ndarray
    u: np.ndarray
    y: np.ndarray
    rates: np.ndarray
    at: Mapping[str, float] = field(default_factory=dict)
    held: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    dropped: tuple[str, ...] = ()
    hidden: np.ndarray = field(default_factory=lambda: np.zeros(0, complex))

    @property
    def poles(self) -> np.ndarray:
        """Eigenvalues of A in 1/s, the slowest first, shape (n,)."""
        found = eigenvalues(self.A)
        return found[np.lexsort((found.imag, np.abs(found)))]

    @property
    def are_positions(self) -> np.ndarray:
        """Which states (n,) have another state as their derivative, by a gear or not."""
        one = (np.count_nonzero(self.A, axis=1) == 1) & ~self.B.any(axis=1)
        return one & (np.diag(self.A) == 0) & np.isclose(self.rates, self.A @ self.x, atol=0.0)

    def ss(self) -> "StateSpace":
        """The same for python-control, which must be installed; in its names dots become _."""
        return _state_space(self.A, self.B, self.C, self.D, **self._labels)

    def zoh(self, step: float) -> "StateSpace":
        """The model from one sample to the next, `step` s apart, for inputs held in between."""
        transition, forced = self.sampled(step)
        return _state_space(transition, forced, self.C, self.D, step, **self._labels)

    def sampled(self, step: float) -> tuple[np.ndarray, np.ndarray]:
        """A and B of `zoh`; UserError if deviations grow beyond what a double holds."""
        with np.errstate(over="ignore", invalid="ignore"):
            transition, forced, _ = hold(self.A, self.B, step)
        if not (np.isfinite(transition).all() and np.isfinite(forced).all()):
            raise UserError(f"step: deviations overflow in {step:g} s, expected a shorter one")
        return transition, forced

    @property
    def _labels(self) -> dict[str, list[str]]:
        names = {"inputs": self.inputs, "outputs": self.outputs, "states": self.states}
        return {
            kind: [name.replace(".", "_") for name in own] for kind, own in names.items() if own
        }

    def select(
        self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None
    ) -> "Linear":
        """Only some inputs and outputs, in the order given; UserError if one is unknown."""
        rows = _places(self.outputs, outputs, "outputs")
        columns = _places(self.inputs, inputs, "inputs")
        return replace(
            self,
            inputs=tuple(self.inputs[i] for i in columns),
            outputs=tuple(self.outputs[i] for i in rows),
            B=self.B[:, columns],
            C=self.C[rows],
            D=self.D[np.ix_(rows, columns)],
            u=self.u[columns],
            y=self.y[rows],
        )

    def without(self, states: Iterable[str]) -> "Linear":
        """Leave states out that stand still; their names join `held`."""
        held = set(states)
        kept = [i for i, name in enumerate(self.states) if name not in held]
        return replace(
            self,
            states=tuple(self.states[i] for i in kept),
            A=self.A[np.ix_(kept, kept)],
            B=self.B[kept],
            C=self.C[:, kept],
            x=self.x[kept],
            rates=self.rates[kept],
            held=(*self.held, *(name for name in self.states if name in held)),
        )


def hold(A: np.ndarray, B: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """State after `step` s by the state at its begin, by inputs, and by their slopes.

    Shapes (n, n), (n, m), (n, m): x(h) = F x + G u + S u', where u is the value at the beginning.
    """
    n, m = B.shape
    if not n:
        return np.zeros((0, 0)), np.zeros((0, m)), np.zeros((0, m))
    whole = np.zeros((n + 2 * m, n + 2 * m))
    whole[:n, :n], whole[:n, n : n + m] = A, B
    whole[n : n + m, n + m :] = np.eye(m)
    found = _exponential(whole * step)
    return found[:n, :n], found[:n, n : n + m], found[:n, n + m :]


def _exponential(matrix: np.ndarray) -> np.ndarray:
    """Of a matrix: Taylor's series of a part of it, squared. Within rounding for small ones."""
    halvings = max(0, 4 + math.frexp(np.abs(matrix).sum(axis=1).max(initial=0.0))[1])
    part = matrix / 2.0**halvings  # below 1/16: terms fall below rounding at once
    result = term = np.eye(len(matrix))
    for order in range(1, TERMS):
        term = term @ part / order
        result = result + term
    for _ in range(halvings):
        result = result @ result
    return result


def _state_space(*arguments: object, **names: object) -> "StateSpace":
    """A system of python-control, which nothing else here needs."""
    return import_module("control").ss(*arguments, **names)


def _places(known: Sequence[str], wanted: Sequence[str] | None, option: str) -> list[int]:
    for i, name in enumerate(wanted or ()):
        if name not in known:
            raise UserError(f"{option}: no {option[:-1]} {name!r} to linearize{hint(name, known)}")
        if name in wanted[:i]:
            raise UserError(f"{option}: {name} is given twice")
    return [known.index(name) for name in (known if wanted is None else wanted)]
