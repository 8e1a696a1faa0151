"""A master that steps connected co-simulation units.

Every component is an instance of an FMU; connections lead from Real outputs to Real inputs. In
Jacobi order all components make a step, then all outputs are read; each step takes its inputs from
what was read at its beginning. In Gauss-Seidel order the components step one after the other, and
each takes the newest outputs: those of the end of the step from components before it, those of its
beginning from itself and the components behind it.

Inputs are held over a step, or are straight lines (fmi2SetRealInputDerivatives) through the value
of their source at the time at which it was read, with its slope there
(fmi2GetRealOutputDerivatives): in Jacobi order they extrapolate from the beginning of the step, in
Gauss-Seidel order those from components before it meet value and slope at the end of the step.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from ctypes import byref, c_double

import numpy as np
from fmpy import fmi2
from fmpy.fmi1 import FMICallException

from cosim.coupling.part import Part
from cosim.errors import UserError
from cosim.system.ssp import Connection
from cosim.unit import Fmu

ORDERS = ("jacobi", "gauss_seidel")
INPUTS = ("held", "extrapolated")


class Snapshot:
    """The state of a whole system at a communication point; a context manager that frees it."""

    def __init__(self, master: "Master") -> None:
        self._master = master
        self._states = [fmi2.fmi2FMUstate() for _ in master.parts]
        for part in master.parts.values():
            if not part.fmu.description.coSimulation.canGetAndSetFMUstate:
                raise UserError(f"{part.name}: {part.fmu.path} has no FMU state to go back to")

    def __enter__(self) -> "Snapshot":
        return self

    def __exit__(self, *_: object) -> None:
        for part, state in zip(self._master.parts.values(), self._states, strict=True):
            if state.value is not None:
                part.slave.fmi2FreeFMUstate(part.slave.component, byref(state))

    def take(self) -> None:
        """Keep the present state, in place of the one kept before."""
        master = self._master
        for part, state in zip(master.parts.values(), self._states, strict=True):
            with master.blame(part, "at the communication point"):
                part.slave.fmi2GetFMUstate(part.slave.component, byref(state))
        self._kept = master.time, master.values.copy(), master.slopes.copy()

    def restore(self) -> None:
        """Bring the system back to the state kept, as often as wanted."""
        master = self._master
        for part, state in zip(master.parts.values(), self._states, strict=True):
            with master.blame(part, "at the communication point"):
                part.slave.fmi2SetFMUstate(part.slave.component, state)
        master.time, master.values[:], master.slopes[:] = self._kept


class _Blame:
    """Turns a failing call of a component into the user's error."""

    def __init__(self, master: "Master", part: Part, when: str) -> None:
        self._master, self._part, self._when = master, part, when

    def __enter__(self) -> None:
        pass

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        if isinstance(error, FMICallException):
            when = f"{self._when}, t = {self._master.time!r} s,"
            raise self._part.failure(error, when) from error


class Master:
    """A system of connected components; a context manager that frees their instances.

    Parameters
    ----------
    fmus : mapping of str to Fmu
        By name of the component. Their order is that of stepping in Gauss-Seidel order.
    connections : iterable of Connection
    order : str
        One of ORDERS.
    inputs : str
        One of INPUTS.
    also : sequence of (component, variable), optional
        Real variables that are read besides all Real outputs.

    Attributes
    ----------
    names : tuple of str
        "component.variable" of all that is read, by component, outputs first.
    values : ndarray, shape (len(names),)
        As read right after the last step, before inputs are set for the next one.
    slopes : ndarray, shape (len(names),)
        Their derivatives with respect to time; only those that are connected, and only where
        `inputs` is "extrapolated".
    time : float
        s.
    do_steps : int
        Calls of fmi2DoStep so far, rolled back ones included.

    Raises
    ------
    UserError
        If names are unknown, an input is connected not once, or an FMU cannot do what is asked.
    """

    def __init__(
        self,
        fmus: Mapping[str, Fmu],
        connections: Iterable[Connection],
        order: str = "jacobi",
        inputs: str = "held",
        also: Sequence[tuple[str, str]] = (),
    ) -> None:
        if order not in ORDERS or inputs not in INPUTS:
            raise UserError(f"expected an order of {ORDERS} and inputs of {INPUTS}")
        self.extrapolates = inputs == "extrapolated"
        self.jacobi = order == "jacobi"
        self.time, self.do_steps = 0.0, 0
        connections = list(connections)
        _check(fmus, connections, self.extrapolates)
        for component, name in also:
            _find(fmus, component, name, None)
        self._stack = ExitStack()
        self.parts: dict[str, Part] = {}
        try:
            for name, fmu in fmus.items():
                self.parts[name] = self._stack.enter_context(Part(fmu, name))
        except BaseException:
            self._stack.close()
            raise
        self._connect(connections, also)

    def __enter__(self) -> "Master":
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.__exit__(*error)

    def _connect(self, connections: Sequence[Connection], also: Sequence[tuple[str, str]]) -> None:
        """Lay out the system's values, and where each input finds its source among them."""
        for part in self.parts.values():
            part.outputs = [variable.name for variable in part.fmu.real_outputs]
            extra = (name for component, name in also if component == part.name)
            part.outputs += [name for name in extra if name not in part.outputs]
        keys = [(part.name, name) for part in self.parts.values() for name in part.outputs]
        place = {key: i for i, key in enumerate(keys)}
        self.names = tuple(f"{component}.{name}" for component, name in keys)
        memory = (c_double * max(len(keys), 1))()
        self.values = np.frombuffer(memory)[: len(keys)]
        self.slopes = np.zeros(len(keys))
        first = 0
        for position, part in enumerate(self.parts.values()):
            incoming = [c for c in connections if c.end_component == part.name]
            part.inputs = [c.end_connector for c in incoming]
            part.sources = np.array(
                [place[c.start_component, c.start_connector] for c in incoming], dtype=int
            )
            before = list(self.parts)[:position]
            part.ahead = np.array(
                [c.start_component in before and not self.jacobi for c in incoming]
            )
            used = {c.start_connector for c in connections if c.start_component == part.name}
            part.sloped = [i for i, name in enumerate(part.outputs) if name in used]
            part.attach(memory, first, self.slopes)
            first += len(part.outputs)

    def blame(self, part: Part, when: str) -> _Blame:
        """Context in which a failing call of `part` becomes the user's error."""
        return _Blame(self, part, when)

    # ---- Initialization --------------------------------------------------------------------------

    def initialize(
        self,
        start: float,
        stop: float | None = None,
        parameters: Mapping[str, Mapping[str, float | str]] | None = None,
    ) -> None:
        """From instantiated to the first communication point, with consistent outputs there.

        Parameters
        ----------
        start, stop : float
            s.
        parameters : mapping, optional
            Parameters and start values of states by component and name.
        """
        parameters = parameters or {}
        for name in parameters:
            if name not in self.parts:
                raise UserError(f"{name}: no such component (there are: {', '.join(self.parts)})")
        self.time = start
        for part in self.parts.values():
            part.begin(start, stop, parameters.get(part.name, {}))
        self._propagate()
        for part in self.parts.values():
            part.end()
        if self.extrapolates:
            self._propagate_slopes()

    def _propagate(self) -> None:
        """Set inputs until no output follows any more: along direct feedthrough, once each."""
        before = np.full(len(self.names), np.nan)
        for _ in range(len(self.parts) + 2):
            for part in self.parts.values():
                self._read_early(part)
            changing = np.flatnonzero(before != self.values)
            if not len(changing):
                return
            before = self.values.copy()
            for part in self.parts.values():
                with self.blame(part, "in initialization"):
                    part.set_inputs(self.values[part.sources])
        names = ", ".join(self.names[i] for i in changing)
        raise UserError(f"the connections form an algebraic loop: {names}")

    def _read_early(self, part: Part) -> None:
        """Read in initialization mode; parameters that do not go together tell so at its end."""
        try:
            part.read()
        except FMICallException as error:
            part.end()
            raise part.failure(error, "in initialization") from error
        self._check_finite(part)

    def _propagate_slopes(self) -> None:
        """Slopes at the start, where inputs' slopes show in those of outputs: once each."""
        for _ in self.parts:
            for part in self.parts.values():
                with self.blame(part, "at the start"):
                    part.read_slopes()
            for part in self.parts.values():
                with self.blame(part, "at the start"):
                    part.set_inputs(self.values[part.sources])
                    part.set_slopes(self.slopes[part.sources])
        for part in self.parts.values():
            with self.blame(part, "at the start"):
                part.read_slopes()

    # ---- Steps -----------------------------------------------------------------------------------

    def advance(self, end: float) -> None:
        """One step to the time `end`, s."""
        length = end - self.time
        groups = [self.parts.values()] if self.jacobi else [[p] for p in self.parts.values()]
        for group in groups:
            for part in group:
                try:
                    self._set_inputs(part, length)
                    part.slave.fmi2DoStep(part.slave.component, self.time, length, fmi2.fmi2False)
                except FMICallException as error:
                    when = f"in the step from t = {self.time!r} s"
                    raise part.failure(error, when) from error
                self.do_steps += 1
            for part in group:
                self._read(part, end)
        self.time = end

    def _set_inputs(self, part: Part, length: float) -> None:
        """Inputs at the beginning of the step, of sources ahead and of others."""
        values = self.values[part.sources]
        if self.extrapolates:
            slopes = self.slopes[part.sources]
            part.set_inputs(values - length * part.ahead * slopes)
            part.set_slopes(slopes)
        else:
            part.set_inputs(values)

    def _read(self, part: Part, end: float) -> None:
        try:
            part.read()
            if self.extrapolates:
                part.read_slopes()
        except FMICallException as error:
            raise part.failure(error, f"at t = {end!r} s") from error
        self._check_finite(part, end)

    def _check_finite(self, part: Part, time: float | None = None) -> None:
        if not np.isfinite(part.out_view).all():
            name = part.outputs[int(np.flatnonzero(~np.isfinite(part.out_view))[0])]
            value = part.out_view[part.outputs.index(name)]
            when = "in initialization" if time is None else f"at t = {time!r} s"
            raise UserError(f"{part.name}.{name} is {value} {when}: a finite value is expected")

    def run(
        self, times: Sequence[float], progress: Callable[[int], object] = lambda _: None
    ) -> np.ndarray:
        """Steps from the present time, times[0], to each of `times`.

        Returns
        -------
        ndarray, shape (len(times), len(names))
            Row i is what is read right after the step to times[i]; row 0 the present values.
        """
        rows = np.empty((len(times), len(self.names)))
        rows[0] = self.values
        for i, end in enumerate(np.asarray(times)[1:].tolist(), start=1):
            self.advance(end)
            rows[i] = self.values
            if i % 100 == 0:
                progress(100)
        return rows


def _find(fmus: Mapping[str, Fmu], component: str, name: str, causality: str | None) -> None:
    if component not in fmus:
        raise UserError(f"{component}: no such component (there are: {', '.join(fmus)})")
    variable = fmus[component].variables.get(name)
    fits = variable is not None and variable.type == "Real"
    if not fits or causality not in (None, variable.causality):
        kind = f"Real {causality}" if causality else "Real variable"
        raise UserError(f"{component}: {fmus[component].path} has no {kind} {name!r}")


def _check(fmus: Mapping[str, Fmu], connections: Sequence[Connection], sloped: bool) -> None:
    """Every connection leads from an output to an input, and one to every input."""
    seen = set()
    for connection in connections:
        _find(fmus, connection.start_component, connection.start_connector, "output")
        _find(fmus, connection.end_component, connection.end_connector, "input")
        end = connection.end_component, connection.end_connector
        if end in seen:
            raise UserError(f"{'.'.join(end)}: is connected more than once")
        seen.add(end)
        source, target = fmus[connection.start_component], fmus[connection.end_component]
        if sloped and not (source.description.coSimulation.maxOutputDerivativeOrder or 0) >= 1:
            raise UserError(
                f"{connection.start_component}: {source.path} has no output derivatives"
            )
        if sloped and not target.description.coSimulation.canInterpolateInputs:
            raise UserError(
                f"{connection.end_component}: {target.path} does not interpolate inputs"
            )
    for component, fmu in fmus.items():
        for variable in fmu.variables.values():
            if variable.causality == "input" and (component, variable.name) not in seen:
                raise UserError(f"{component}.{variable.name}: the input is not connected")
