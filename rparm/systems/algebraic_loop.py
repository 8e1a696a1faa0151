"""Newton's method for an algebraic loop of FMUs at one communication point.

The unknowns u are the inputs on the loop, y(u) the outputs that feed them: u = y(u). Derivatives
are the FMUs' directional ones (FMI 2.0, section 2.1.9; FMI 3.0, section 2.2.11), else differences.
"""

from collections.abc import Sequence
from contextlib import suppress
from typing import NoReturn

import numpy as np
from fmpy.fmi1 import FMICallException

from rparm.errors import UserError, counted
from rparm.fmi.fmi_instance import DISCARD
from rparm.systems.connected_instance import ConnectedInstance
from rparm.units import short

ROUNDING = 4 * np.finfo(float).eps  # of the terms: u and y are equal
# where no step comes closer, of the terms and of the nominal value: rounding within the FMUs
STALLED, HIDDEN = 1e-10, 1e-12
MOST_INVERSE = 1e5  # then, of 1 - y'(u) divided by its terms: no touch of both sides
DIFFERENCE = 1e-7  # of the largest value of an input, for difference quotients
MOST_STEPS, MOST_HALVES = 50, 30


class AlgebraicLoop:
    """The connections of one loop; `ends` are (component, place among its inputs)."""

    def __init__(self, ends: Sequence[tuple[ConnectedInstance, int]], names: Sequence[str]) -> None:
        self.names = names  # of the connections, (n,)
        self._ends = ends
        self._sources = np.array([component.sources[i] for component, i in ends], dtype=int)
        self.components = list(dict.fromkeys(component for component, _ in ends))
        for component, i in ends:
            component.on_loop[i] = component.state.solves = True
        variables = [c.instance.fmu.model.variables[c.inputs.names[i]] for c, i in ends]
        self.nominals = np.array([variable.nominal or 1.0 for variable in variables])
        self.largest = np.zeros(len(ends))  # of each input so far
        self.solved: np.ndarray | None = None  # inputs and what feeds them, as solved last

    def solve(self, values: np.ndarray, now: Sequence[ConnectedInstance], when: str) -> None:
        """Set the inputs of the components that are at a communication point `now`, and read them.

        `values` are the system's, which outputs have been read into. The search begins at the
        inputs of before. UserError if it ends without a solution.
        """
        _Search(self, values, now, when).run()

    def place(self) -> tuple[np.ndarray, np.ndarray | None]:
        """Return what the next search depends on beside the inputs, for `go_to`."""
        return self.largest.copy(), self.solved

    def go_to(self, largest: np.ndarray, solved: np.ndarray | None) -> None:
        self.largest[:], self.solved = largest, solved


class _Search:
    def __init__(
        self, loop: AlgebraicLoop, values: np.ndarray, now: Sequence[ConnectedInstance], when: str
    ) -> None:
        self._values, self._when = values, when
        self._components = [c for c in loop.components if c in now]
        self._rows = [k for k, (component, _) in enumerate(loop._ends) if component in now]
        self._names = [loop.names[k] for k in self._rows]
        self._ends = [loop._ends[k] for k in self._rows]
        self._sources = loop._sources[self._rows]
        self._loop, self._nominals = loop, loop.nominals[self._rows]
        self._slopes = np.zeros((len(self._rows), len(self._rows)))

    def run(self) -> None:
        u = np.array([component.inputs.view[i] for component, i in self._ends])
        self._wanted = [self._values[component.sources] for component in self._components]
        others = False  # whether inputs from outside of the loop have changed
        for component, wanted in zip(self._components, self._wanted, strict=True):
            wanted[component.on_loop] = component.inputs.view[component.on_loop]
            others = others or not np.array_equal(wanted, component.inputs.view)
        apart = self._values[self._sources] - u
        if not others and np.array_equal(self._state(u), self._loop.solved):
            return
        if others:
            apart = self._apart(u)
        u = self._searched(u, apart)
        largest = self._loop.largest
        largest[self._rows] = np.maximum(largest[self._rows], np.abs(u))
        self._loop.solved = self._state(u)

    def _state(self, u: np.ndarray) -> np.ndarray:
        return np.concatenate([u, self._values[self._sources]])

    def _searched(self, u: np.ndarray, apart: np.ndarray) -> np.ndarray:
        """Return the solution, at which the FMUs are; UserError if none is found."""
        sizes = np.where(self._loop.largest > 0, self._loop.largest, self._loop.nominals)
        for changed in (sizes[self._rows], self._nominals):
            self._sizes = changed
            for _ in range(MOST_STEPS):
                if not self._is_off(u, apart, ROUNDING):
                    return u
                self._read_slopes(u)
                closer = self._step(u, apart)
                if closer is None:
                    break
                u, apart = closer
            apart = self._apart(u)
            if self._is_near(u, apart):
                return u
        self._fail(u, apart)

    def _is_near(self, u: np.ndarray, apart: np.ndarray) -> bool:
        """Whether only rounding within the FMUs may keep y(u) from u."""
        terms = self._terms(u, apart)
        scaled = self._slopes * terms / terms[:, None]
        if not np.isfinite(scaled).all() or self._is_off(u, apart, STALLED, HIDDEN):
            return False
        try:
            inverse = np.linalg.inv(np.eye(len(u)) - scaled)
        except np.linalg.LinAlgError:
            return False
        sizes = np.abs(inverse) @ (1 + np.abs(scaled).sum(axis=1))
        return bool((sizes < MOST_INVERSE).all())

    def _step(self, u: np.ndarray, apart: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Step as far as it comes closer; None if it never does."""
        terms = self._terms(u, apart)
        try:
            step = np.linalg.solve(np.eye(len(u)) - self._slopes, apart)
        except np.linalg.LinAlgError:
            return None
        if not np.isfinite(step).all():
            return None
        before = np.abs(apart / terms).max()
        for _ in range(MOST_HALVES):
            found = u + step
            there = self._apart(found)
            if np.isfinite(there).all() and np.abs(there / terms).max() < before:
                return found, there
            step = step / 2
        return None

    def _apart(self, u: np.ndarray) -> np.ndarray:
        """Set the inputs, and return y - u; infinite where an FMU gives no values."""
        try:
            for component, wanted in zip(self._components, self._wanted, strict=True):
                for (end, i), value in zip(self._ends, u, strict=True):
                    if end is component:
                        wanted[i] = value
                component.set_inputs(wanted)
            for component in self._components:
                component.read()
        except FMICallException as error:
            if error.status == DISCARD:
                return np.full(len(u), np.inf)
            raise component.instance.failure(error, self._when) from error
        return self._values[self._sources] - u

    def _terms(self, u: np.ndarray, apart: np.ndarray) -> np.ndarray:
        """Return the sizes of what is subtracted, (n,)."""
        found = np.abs(u) + np.abs(self._values[self._sources]) + np.abs(self._slopes) @ np.abs(u)
        return np.where(found > 0, found, 1.0)

    def _is_off(
        self, u: np.ndarray, apart: np.ndarray, relative: float, absolute: float = 0.0
    ) -> bool:
        bounds = relative * self._terms(u, apart) + absolute * self._nominals
        return not bool((np.abs(apart) <= bounds).all())

    def _read_slopes(self, u: np.ndarray) -> None:
        """Write the derivatives of the outputs that feed the loop by its inputs, (n, n)."""
        self._slopes[:] = 0.0
        for component in self._components:
            own = [k for k, (end, _) in enumerate(self._ends) if end is component]
            fed = [
                k
                for k, source in enumerate(self._sources)
                if component.first <= source < component.end
            ]
            if component.instance.fmu.model.gives_directional_derivatives:
                knowns = [component.inputs.names[self._ends[k][1]] for k in own]
                sources = [self._sources[k] - component.first for k in fed]
                unknowns = [component.outputs.names[source] for source in sources]
                with suppress(UserError):  # it may have none here
                    found = component.instance.partials(unknowns, knowns)
                    self._slopes[np.ix_(fed, own)] = found
                    continue
            for k in own:
                self._slopes[fed, k] = self._difference(k, u)[fed]

    def _difference(self, k: int, u: np.ndarray) -> np.ndarray:
        """Return the difference quotient of what feeds the loop by one input, (n,)."""
        here, moved = self._values[self._sources], u.copy()
        change = DIFFERENCE * max(abs(u[k]), self._sizes[k])
        for value in (u[k] + change, u[k] - change):
            moved[k] = value
            there = self._apart(moved) + moved
            if np.isfinite(there).all():
                break
        self._apart(u)
        return (there - here) / (moved[k] - u[k])

    def _fail(self, u: np.ndarray, apart: np.ndarray) -> NoReturn:
        worst = int(np.argmax(np.abs(apart) / self._terms(u, apart)))
        by = short(abs(float(apart[worst])))
        size = counted(self._names, "connection")
        raise UserError(
            f"no solution of the algebraic loop of {size} found {self._when}: "
            f"{self._names[worst]} is off by {by} (Newton's method from the values before)"
        )
