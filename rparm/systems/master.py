"""A master that steps connected FMUs.

Every component is an instance of an FMU; connections lead from outputs to inputs of the same type,
no String. Inputs may follow signals from outside, each held over a step; others keep their values
from before initialization. In Jacobi order all components make a step, then all outputs are read;
each step takes its inputs from what was read at its beginning. In Gauss-Seidel order the components
step one after the other, and each takes the newest outputs: those of the end of the step from
components before it, those of its beginning from itself and the components behind it.

Inputs keep their values over a step, a zero-order hold ("held"), or are straight lines through the
value of their source at the time at which it was read, with its slope there: in Jacobi order they
extrapolate from the beginning of the step, in Gauss-Seidel order those from components before it
meet value and slope at the end of the step. Where an FMU gives no slopes of outputs, or they are on
an algebraic loop, the line goes through the last two values, and is level at the start and after a
switch. In FMI 3.0 inputs get slopes only within a step: at the start, the slopes of outputs lack
the part due to the slopes of inputs.

Components may have rates of their own: each makes its step when the system comes to the end of it,
with inputs of the time at which it began. The inputs on algebraic loops are solved for whenever
components on them are at a communication point; in Gauss-Seidel order these step together.

A Boolean, Integer or Enumeration that has changed in a step is passed on at the end of the step, in
both orders. Then all outputs are computed again at this time, as at the start.

`rparm.fmi.loop` makes the steps, in C; initialization and algebraic loops are here.
"""

import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack

import numpy as np

from rparm.errors import UserError
from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.loop import Loop, check_finite, side_by_side
from rparm.fmi.model import Model, Value
from rparm.runs.inputs import Signal
from rparm.systems.algebraic_loop import AlgebraicLoop
from rparm.systems.connected_instance import ConnectedInstance
from rparm.systems.ecos import Run, said_at_end
from rparm.systems.feedthrough import loops, on_loops, sequence
from rparm.systems.python_component import is_python
from rparm.systems.structure import WAYS, Connection, OpenedSystem, System, split

ORDERS = ("jacobi", "gauss_seidel")
INPUT_MODES = ("held", "extrapolated")
DISCRETE = ("Boolean", "Integer", "Enumeration")  # types of what switches


# ---- The master ----------------------------------------------------------------------------------
class SystemSnapshot(AbstractContextManager["SystemSnapshot"]):
    """The state of a whole system at a communication point; a context manager that frees it."""

    def __init__(self, master: "Master") -> None:
        self._master = master
        for component in master.components.values():
            fmu = component.instance.fmu
            if not fmu.model.saves_states:
                has = "save() and restore(state)" if is_python(fmu.path.name) else "FMU state"
                raise UserError(f"{component.name}: {fmu.path} has no {has} to go back")
        self._states = [c.instance.snapshot() for c in master.components.values()]

    def __exit__(self, *_: object) -> None:
        for state in self._states:
            state.free()

    def take(self) -> None:
        """Keep the present state, in place of the one kept before."""
        master = self._master
        for component, state in zip(master.components.values(), self._states, strict=True):
            with component.instance.explained(self._when()):
                state.take()
        places = [c.place() for c in master.components.values()]
        solved = [loop.place() for loop in master.loops]
        self._kept = master.time, master.values.copy(), master.slopes.copy(), places, solved

    def restore(self) -> None:
        """Bring the system back to the state kept, as often as wanted."""
        master = self._master
        for component, state in zip(master.components.values(), self._states, strict=True):
            with component.instance.explained(self._when()):
                state.restore()
        time, master.values[:], master.slopes[:], places, solved = self._kept
        master.loop.state.time = time
        for component, place in zip(master.components.values(), places, strict=True):
            component.go_to(*place)
        for loop, place in zip(master.loops, solved, strict=True):
            loop.go_to(*place)

    def _when(self) -> str:
        return f"at the communication point t = {self._master.time!r} s"


class Master(AbstractContextManager["Master"]):
    """A system of connected components; a context manager that frees their instances.

    In Gauss-Seidel order components step in the order of `fmus`. After each step all Real outputs
    are read, and Real variables `also` (component, variable). Inputs of `signals`, by
    "component.variable", take over each step the signal's value at its beginning. Components of
    `rates` step every so many s. UserError if names are unknown or an input has several sources.

    Attributes
    ----------
    names : tuple of str
        "component.variable" of all that is read, by component, outputs first; at the end Real
        inputs of signals.
    values : ndarray, shape (len(names),)
        As read right after the last step, and all that follows from what switched.
    slopes : ndarray, shape (len(names),)
        Derivatives by time of what is connected, if `inputs` is "extrapolated".
    time : float
        s.
    do_steps : int
        Steps of components so far, rolled back ones included.
    """

    def __init__(
        self,
        fmus: Mapping[str, Fmu],
        connections: Iterable[Connection],
        order: str = "jacobi",
        inputs: str = "held",
        also: Sequence[tuple[str, str]] = (),
        signals: Mapping[str, Signal] | None = None,
        rates: Mapping[str, float] | None = None,
    ) -> None:
        if order not in ORDERS or inputs not in INPUT_MODES:
            raise UserError(f"expected an order of {ORDERS} and inputs of {INPUT_MODES}")
        self.extrapolates = inputs == "extrapolated"
        self.jacobi = order == "jacobi"
        connections, signals = list(connections), signals or {}
        self._switches, real = _split(fmus, connections)
        self._links = len(connections) + len(signals)  # values pass each once
        for name in signals:
            if name in {c.end for c in connections}:
                raise UserError(f"{name}: is connected, and cannot follow a signal, too")
        models = {name: fmu.model for name, fmu in fmus.items()}
        driven = {split(name, models): signal for name, signal in signals.items()}
        kinds = {end: _driven(fmus, *end) for end in driven}
        self._moved = {end: driven[end] for end, kind in kinds.items() if kind == "Real"}
        self._switched = {end: driven[end] for end, kind in kinds.items() if kind in DISCRETE}
        for component, name in also:
            _find(fmus, component, name, None)
        self._stack = ExitStack()
        try:
            instances = {}
            for name, fmu in fmus.items():
                fed = [c.end_connector for c in real if c.end_component == name]
                fed += [variable for component, variable in self._moved if component == name]
                is_smooth = self.extrapolates and fmu.model.interpolates_inputs
                instance = fmu.instance(name, fed if is_smooth else ())
                instances[name] = self._stack.enter_context(instance)
        except BaseException:
            self._stack.close()
            raise
        self._connect(instances, real, also, loops(real, models), rates or {})

    def __exit__(self, *error: object) -> None:
        self._stack.__exit__(*error)

    def _connect(
        self,
        instances: Mapping[str, Instance],
        connections: Sequence[Connection],
        also: Sequence[tuple[str, str]],
        circles: Sequence[Sequence[Connection]],
        rates: Mapping[str, float],
    ) -> None:
        """Lay out the system's values, and find the source of each input among them."""
        groups = together(list(instances), circles, self.jacobi)
        rank = {name: i for i, group in enumerate(groups) for name in group}
        # variables to read, by component
        outputs = {}
        for name, instance in instances.items():
            further = [variable for component, variable in also if component == name]
            outputs[name] = list(dict.fromkeys([*instance.fmu.model.real_outputs, *further]))

        # where it is among the system's values
        keys = [(name, output) for name, read in outputs.items() for output in read]
        self._first_driven = len(keys)
        driven = list(self._moved)
        keys += driven
        index = {key: i for i, key in enumerate(keys)}
        self.names = tuple(f"{component}.{name}" for component, name in keys)
        memory = np.zeros(len(keys) + 1)  # never empty
        self.values = memory[: len(keys)]
        self.slopes = np.zeros(len(keys))

        # the components with their sources
        self.components: dict[str, ConnectedInstance] = {}
        first = 0
        for name, instance in instances.items():
            incoming = [c for c in connections if c.end_component == name]
            feeding = {c.start_connector for c in connections if c.start_component == name}
            own = [key for key in driven if key[0] == name]
            sources = [(c.start_component, c.start_connector) for c in incoming] + own
            self.components[name] = ConnectedInstance(
                instance,
                inputs=[*(c.end_connector for c in incoming), *(variable for _, variable in own)],
                outputs=outputs[name],
                first=first,
                feeding=feeding,
                solved={c.start_connector for circle in circles for c in circle
                        if c.start_component == name},
                sources=[index[source] for source in sources],
                ahead=[rank[x] < rank[name] for x, _ in sources],
                values=memory,
                every=rates.get(name),
            )  # fmt: skip
            first += len(outputs[name])
        self.loops = [self._loop(circle) for circle in circles]
        all_ = list(self.components.values())
        place = {name: i for i, name in enumerate(self.components)}
        stepping = [[place[name] for name in group] for group in groups]
        loop = Loop(all_, self.values, len(driven), stepping, self.slopes)
        loop.switch(
            [(k, place[name], variable) for k, (name, variable) in enumerate(self._switched)]
            + [((place[c.start_component], c.start_connector),
                place[c.end_component], c.end_connector) for c in self._switches],
            len(self._switched),
        )  # fmt: skip
        self._groups = [[all_[i] for i in group] for group in stepping]
        loop.call(self._solve_group if circles else None, self._follow)
        loop.state.extrapolates, loop.state.checks_finite = self.extrapolates, True
        loop.state.has_rates = any(component.state.every for component in all_)
        self.loop = loop

    @property
    def time(self) -> float:
        return self.loop.state.time

    @property
    def do_steps(self) -> int:
        return self.loop.state.step_count

    @property
    def due(self) -> list[ConnectedInstance]:
        """Components that the last step has brought to the end of their own."""
        return [component for component in self.components.values() if component.is_due]

    def _loop(self, circle: Sequence[Connection]) -> AlgebraicLoop:
        rank = {name: i for i, name in enumerate(self.components)}
        # the order of connections does not change the rounding
        circle = sorted(circle, key=lambda c: (rank[c.end_component], c.end_connector))
        ends = [self.components[c.end_component] for c in circle]
        places = [
            component.inputs.names.index(c.end_connector)
            for component, c in zip(ends, circle, strict=True)
        ]
        return AlgebraicLoop(list(zip(ends, places, strict=True)), [str(c) for c in circle])

    # ---- Initialization --------------------------------------------------------------------------

    def reset(self) -> None:
        """Reset all instances, to initialize them again."""
        for component in self.components.values():
            component.instance.reset()
            component.kept[:] = 0.0
        self.values[:], self.slopes[:] = 0.0, 0.0
        for loop in self.loops:
            loop.go_to(np.zeros_like(loop.largest), None)

    def initialize(
        self,
        start: float,
        stop: float | None = None,
        parameters: Mapping[str, Mapping[str, Value]] | None = None,
    ) -> None:
        """Initialize up to the first communication point, outputs consistent; times in s."""
        parameters = parameters or {}
        for name in parameters:
            if name not in self.components:
                known = ", ".join(self.components)
                raise UserError(f"{name}: no such component (there are: {known})")
        self.loop.start(start)
        self._drive()
        for component in self.components.values():
            component.begin(start, stop, parameters.get(component.name, {}))
        self._propagate(self._read_early, "in initialization")
        for component in self.components.values():
            component.instance.exit_initialization()
        self._follow()  # samplers that tick at the start have ticked

    def _drive(self) -> None:
        """Take the values that signals have now."""
        self.values[self._first_driven :] = self._driven(np.array([self.time]))[0]

    def _driven(self, times: np.ndarray) -> np.ndarray:
        """Return what drives Real inputs at times, (times, inputs)."""
        return self._sampled(self._moved.values(), times, np.float64)

    def _scheduled(self, times: np.ndarray) -> np.ndarray:
        """Return what drives discrete inputs at times, (times, inputs)."""
        return self._sampled(self._switched.values(), times, np.int64)

    def _sampled(self, signals: Collection[Signal], times: np.ndarray, kind: type) -> np.ndarray:
        elapsed = times - self.loop.state.start
        return side_by_side((signal.values(elapsed) for signal in signals), len(times), kind)

    def _propagate(self, read: Callable[[ConnectedInstance], object], when: str) -> None:
        """Set inputs until no output follows any more: along direct feedthrough, once each."""
        before = np.full(len(self.names), np.nan)
        for _ in range(self._links + 2):
            switched = self.loop.transfer(self._scheduled(np.array([self.time])))
            for component in self.due:
                read(component)
            self._solve(self.due, when)
            changing = np.flatnonzero(before != self.values)
            if not (len(changing) or switched):
                return
            before = self.values.copy()
            for component in self.due:
                if not component.solves:
                    with component.instance.explained(when):
                        component.set_inputs(self.values[component.sources])
        names = ", ".join([*(self.names[i] for i in changing), *switched])
        if switched:
            way_out = "a loop through Booleans or Integers has to settle by itself"
            raise UserError(f"{names}: no end of changes {when}: {way_out}")
        raise UserError(f"the connections form an algebraic loop {when}: {names}")

    def _solve(self, components: Sequence[ConnectedInstance], when: str) -> None:
        """Solve the algebraic loops of components at this time."""
        for loop in self.loops:
            loop.solve(self.values, components, when)

    def _solve_group(self, group: int) -> None:
        """Solve, where components of a group have come to their end within a step."""
        stepping = [component for component in self._groups[group] if component.is_due]
        self._solve(stepping, f"at t = {self.loop.state.end!r} s")

    def _follow(self) -> None:
        """Compute all outputs at this time from inputs that follow them at once."""
        when = f"at t = {self.time!r} s"
        self._propagate(self._read, when)
        if self.extrapolates:
            self.loop.follow_slopes()

    def _read_early(self, component: ConnectedInstance) -> None:
        with component.instance.explained_early():
            component.read()
        check_finite(component.name, component.outputs, "in initialization")

    def _read(self, component: ConnectedInstance) -> None:
        when = f"at t = {self.time!r} s"
        with component.instance.explained(when):
            component.read()
        check_finite(component.name, component.outputs, when)

    # ---- Steps -----------------------------------------------------------------------------------

    def advance(self, end: float) -> None:
        """Make one step to the time `end`, s; components of other rates do when theirs ends."""
        self.run_to(np.array([end]))

    def run_to(
        self,
        ends: np.ndarray,
        rows: np.ndarray | None = None,
        has_row: np.ndarray | None = None,
        progress: Callable[[int], object] | None = None,
    ) -> None:
        """Make steps to their ends, s; `rows` and `has_row` as `Loop.run` explains."""
        given = self._driven(ends), self._scheduled(ends)
        self.loop.run(ends, *given, rows=rows, has_row=has_row, progress=progress)

    def run(
        self, times: Sequence[float] | np.ndarray, progress: Callable[[int], object] | None = None
    ) -> np.ndarray:
        """Step from times[0]; return rows (times, names) of the values after each step."""
        return self.watch(times, range(len(self.names)), progress=progress)

    def watch(
        self,
        times: Sequence[float] | np.ndarray,
        columns: Sequence[int],
        has_row: np.ndarray | None = None,
        progress: Callable[[int], object] | None = None,
        rows: np.ndarray | None = None,
    ) -> np.ndarray:
        """Step from times[0]; return rows of some values there and after each step.

        `has_row` (steps,) tells the steps that end in a row; default: all. `rows` is filled if it
        is given.
        """
        ends = np.asarray(times, float)[1:]
        if rows is None:
            rows = np.empty((1 + (len(ends) if has_row is None else has_row.sum()), len(columns)))
        rows[0] = self.values[list(columns)]
        self.loop.record(columns)
        self.run_to(ends, rows, has_row, progress)
        return rows


def _find(fmus: Mapping[str, Fmu], component: str, name: str, causality: str | None) -> None:
    if component not in fmus:
        raise UserError(f"{component}: no such component (there are: {', '.join(fmus)})")
    variable = fmus[component].model.variables.get(name)
    fits = variable is not None and variable.type == "Real"
    if not fits or causality not in (None, variable.causality):
        kind = f"Real {causality}" if causality else "Real variable"
        raise UserError(f"{component}: {fmus[component].path} has no {kind} {name!r}")


def _driven(fmus: Mapping[str, Fmu], component: str, variable: str) -> str:
    """Return the type of an input that follows a signal."""
    kind = _type(fmus, component, variable, "input")
    if kind not in DISCRETE:
        _find(fmus, component, variable, "input")
    return str(kind)


def together(
    names: Sequence[str], circles: Iterable[Iterable[Connection]], is_jacobi: bool
) -> list[list[str]]:
    """Return the components that step together, in order."""
    if is_jacobi:
        return [list(names)]
    found = {name: [name] for name in names}
    for circle in circles:
        whole = {x for c in circle for x in found[c.end_component]}
        found |= dict.fromkeys(whole, [name for name in names if name in whole])
    return [group for name, group in found.items() if name == group[0]]


def _split(
    fmus: Mapping[str, Fmu], connections: Iterable[Connection]
) -> tuple[list[Connection], list[Connection]]:
    """Split connections into discrete ones and Reals; no input has two."""
    switches: list[Connection] = []
    reals: list[Connection] = []
    seen = set()
    for c in connections:
        end = c.end_component, c.end_connector
        kind = _type(fmus, c.start_component, c.start_connector, "output")
        if kind in DISCRETE:
            switches.append(c)
            if _type(fmus, *end, "input") != kind:
                raise UserError(f"{c}: a {kind} feeds a {kind} input only")
        else:
            reals.append(c)
            _find(fmus, c.start_component, c.start_connector, "output")
            _find(fmus, *end, "input")
        if end in seen:
            raise UserError(f"{'.'.join(end)}: is connected more than once")
        seen.add(end)
    return switches, reals


def _type(fmus: Mapping[str, Fmu], component: str, name: str, causality: str) -> str | None:
    variable = fmus[component].model.variables.get(name) if component in fmus else None
    return variable.type if variable is not None and variable.causality == causality else None


def ways(models: Mapping[str, Model], connections: Iterable[Connection]) -> list[tuple[str, str]]:
    """Return the orders and inputs in which a master can step connected components."""
    can = all(
        models[c.start_component].gives_output_derivatives
        and models[c.end_component].interpolates_inputs
        for c in connections
        if models[c.start_component].variables[c.start_connector].type == "Real"
    )
    return [(order, inputs) for inputs in INPUT_MODES[: 1 + can] for order in ORDERS]


def in_order(
    fmus: Mapping[str, Fmu], connections: Iterable[Connection], order: str
) -> Mapping[str, Fmu]:
    """Return components as they step: in Gauss-Seidel order sorted by direct feedthrough."""
    if order == "jacobi":
        return fmus
    models = {name: fmu.model for name, fmu in fmus.items()}
    return {name: fmus[name] for name in sequence(fmus, connections, models)}


def beyond_steps(system: System, models: Mapping[str, Model]) -> str:
    """Say what a system has more than steps side by side, or nothing."""
    if system.order != "jacobi":
        return f"its order is {system.order}"
    for name in system.rates:
        return f"{name} has its own rate"
    for name in sorted(on_loops(system.connections, models)):
        return f"{name} is on an algebraic loop"
    return ""


# ---- Of a file -----------------------------------------------------------------------------------
def master_of(
    ssp: OpenedSystem, fmus: Mapping[str, Fmu], way: tuple[str, str] | None = None
) -> Master:
    """Return the master of a system, as its file orders or in a `way`: its order and inputs."""
    system = ssp.system
    order, inputs = way or WAYS[system.order]
    return Master(
        in_order(fmus, system.connections, order), system.connections, order, inputs,
        signals=system.inputs, rates=system.rates,
    )  # fmt: skip


def run_in_master(
    ssp: OpenedSystem,
    variant: str,
    names: Sequence[str],
    progress: Callable[[int], object] | None = None,
) -> Run:
    """Run a variant; read ``component.variable`` as Ecos would, all finite.

    In Jacobi order rows are read after the inputs of the next step have been set, in others at the
    end of each step. `progress` gets the number of steps since its last call.
    """
    system = ssp.system
    times = system.times
    rows = np.empty((len(times), len(names)))
    with ssp.unpacked_fmus() as fmus, master_of(ssp, fmus) as master:
        master.initialize(system.start, float(times[-1]), system.parameter_sets[variant])
        own: dict[str, dict[str, int]] = {name: {} for name in master.components}
        for column, (owner, variable) in enumerate(map(ssp.split, names)):
            own[owner][variable] = column
        for name, columns in own.items():
            master.components[name].read_for_rows(columns)
        loop = master.loop
        loop.record([], len(names))
        loop.state.sets_for_rows = WAYS[system.order] == WAYS["jacobi"]
        begin = time.perf_counter()
        try:
            loop.read_row(rows[0])
            master.run_to(times[1:], rows, progress=progress)
        except UserError as error:
            if loop.done:
                made = 1 + loop.done
                error.result = Run(tuple(names), times[:made], rows[:made], 0.0, ())
            raise
        wall_time = time.perf_counter() - begin
        known = master.components.values()
        messages = [f"{c.name!r}: {text}" for c in known for text in c.instance.messages]
        said = {}
        for name in said_at_end(ssp):
            owner, variable = ssp.split(name)
            said[name] = master.components[owner].instance.value(variable)
    return Run(tuple(names), times, rows, wall_time, tuple(dict.fromkeys(messages)), said)
