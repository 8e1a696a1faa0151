"""Newton's method for an algebraic loop of FMUs at one communication point.

The unknowns u are the inputs on the loop, y(u) the outputs that feed them: u = y(u). Derivatives
are the FMUs' directional ones (FMI 2.0, section 2.1.9; FMI 3.0, section 2.2.11), else differences.
"""

from collections.abc import Sequence

import numpy as np
from fmpy.fmi1 import FMICallException

from rparm.errors import UserError, counted
from rparm.fmi.fmi_instance import DISCARD
from rparm.systems.connected_instance import ConnectedInstance
from rparm.units import short

ROUNDING = 4 * np.finfo(float).eps  # of the terms: u and y are equal
STALLED = 1e-10  # of the terms: good enough where no step comes closer
HIDDEN = 1e-12  # of the nominal value, likewise: rounding of terms that nobody sees
DIFFERENCE = 1e-7  # of an input, for difference quotients
MOST_STEPS, MOST_HALVES = 50, 30


class AlgebraicLoop:
    """The connections of one loop; `ends` are (component, place among its inputs)."""

    def __init__(self, ends: Sequence[tuple[ConnectedInstance, int]], names: Sequence[str]) -> None:
        self.names = names  # of the connections, (n,)
        self._ends = ends
        self._sources = np.array([component.sources[i] for component, i in ends], dtype=int)
        self.components = list(dict.fromkeys(component for component, _ in ends))
        for component, i in ends:
            component.on_loop[i] = True
        variables = [c.instance.fmu.model.variables[c.inputs.names[i]] for c, i in ends]
        self.nominals = np.array([variable.nominal or 1.0 for variable in variables])
        self.solved: np.ndarray | None = None  # inputs and what feeds them, as solved last

    def solve(self, values: np.ndarray, now: Sequence[ConnectedInstance], when: str) -> None:
        """Set the inputs of the components that are at a communication point `now`, and read them.

        `values` are the system's, which outputs have been read into. The search begins at the
        inputs of before. UserError if it ends without a solution.
        """
        _Search(self, values, now, when).run()


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
        self._loop.solved = self._state(u)

    def _state(self, u: np.ndarray) -> np.ndarray:
        return np.concatenate([u, self._values[self._sources]])

    def _searched(self, u: np.ndarray, apart: np.ndarray) -> np.ndarray:
        """Return the solution, at which the FMUs are; UserError if none is found."""
        for _ in range(MOST_STEPS):
            if not self._is_off(u, apart, ROUNDING):
                return u
            self._read_slopes(u)
            closer = self._step(u, apart)
            if closer is None:
                break
            u, apart = closer
        apart = self._apart(u)
        if self._is_off(u, apart, STALLED, HIDDEN):
            self._fail(u, apart)
        return u

    def _step(self, u: np.ndarray, apart: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Step as far as it comes closer; None if it never does."""
        matrix = np.eye(len(u)) - self._slopes
        terms = self._terms(u, apart)
        try:
            step = np.linalg.solve(matrix, apart)
        except np.linalg.LinAlgError:
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
            model = component.instance.fmu.model
            if model.gives_directional_derivatives:
                knowns = [component.inputs.names[self._ends[k][1]] for k in own]
                unknowns = [
                    component.outputs.names[self._sources[k] - component.first] for k in fed
                ]
                found = component.instance.partials(unknowns, knowns)
                self._slopes[np.ix_(fed, own)] = found
            else:
                for k in own:
                    self._difference(component, k, fed, u)

    def _difference(
        self, component: ConnectedInstance, k: int, fed: Sequence[int], u: np.ndarray
    ) -> None:
        moved = u.copy()
        moved[k] += DIFFERENCE * (abs(u[k]) or self._nominals[k])
        here = self._values[self._sources]
        there = self._apart(moved) + moved
        self._slopes[fed, k] = (there - here)[fed] / (moved[k] - u[k])
        self._apart(u)

    def _fail(self, u: np.ndarray, apart: np.ndarray) -> None:
        worst = int(np.argmax(np.abs(apart) / self._terms(u, apart)))
        by = short(float(apart[worst]))
        size = counted(self._names, "connection")
        raise UserError(
            f"no solution of the algebraic loop of {size} found {self._when}: "
            f"{self._names[worst]} is off by {by} (Newton's method from the values before)"
        )
