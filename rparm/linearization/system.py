"""Linear models of systems: their FMUs' models, joined by the connections."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from graphlib import CycleError, TopologicalSorter
from typing import Any

import numpy as np

from rparm.errors import UserError, hint, placed
from rparm.files import UnreadableError
from rparm.fmi.fmu_file import MODEL_EXCHANGE, Fmu
from rparm.fmi.model import Value, Variable
from rparm.linearization import linear
from rparm.linearization.sampling import Tick, by_steps, hold, samplers
from rparm.systems import master
from rparm.systems.connected_instance import ConnectedInstance, start_value
from rparm.systems.master import Master
from rparm.systems.python_component import PythonComponent, PythonInstance
from rparm.systems.structure import Connection, OpenedSystem

SAME = 1e-9  # of the largest entry: a model that is another one but for rounding
SINGULAR = 1e-6  # of 1: what rounding leaves of a matrix times its inverse
NEGLIGIBLE = 1e-14  # of the largest entries of row and column: rounding


class SystemSubject(ExitStack):
    """A variant of a system to linearize; a context manager, which keeps its FMUs unpacked.

    The SSP stays unpacked as long. `time` in s is the system's start by default. Components
    `without` are left out, as ideal sensors: what they feed is fed by outputs of the same names, of
    what feeds them. `cut` is an input whose connection is left out.
    """

    def __init__(
        self,
        ssp: OpenedSystem,
        variant: str,
        time: float | None = None,
        without: Sequence[str] = (),
        cut: str = "",
    ) -> None:
        super().__init__()
        system = ssp.system
        names = [component.name for component in system.components]
        for name in without:
            if name not in names:
                raise UserError(f"{ssp.path}: no component {name!r}{hint(name, names)}")
        self.ssp, self.without = ssp, without
        self.time = system.start if time is None else time
        self.names = [name for name in names if name not in without]
        self.connections = list(system.connections)
        for name in without:
            self.connections = bypassed(ssp, self.connections, name)
        self.cut = self._found(cut) if cut else None
        self._parameters = system.parameter_sets[ssp.variant(variant)]
        with ExitStack() as stack:  # closes what is open if one of them is refused
            self.fmus = {name: stack.enter_context(ssp.unpacked_fmu(name)) for name in self.names}
            for fmu in self.fmus.values():
                linear.require_derivatives(fmu)
            self.push(stack.pop_all())
        self.python = [name for name, fmu in self.fmus.items() if isinstance(fmu, PythonComponent)]
        self._laws: dict[str, tuple[PythonInstance, np.ndarray]] = {}  # with inputs of the point

    def _found(self, name: str) -> Connection:
        """Return the connection to an input."""
        ends = {c.end: c for c in self.connections}
        if name not in ends:
            raise UserError(f"--break: {name}: no connection ends there{hint(name, ends)}")
        return ends[name]

    def variable(self, name: str) -> Variable:
        """Return the variable ``component.variable``; UserError if there is none of that name."""
        component, variable = self.ssp.split(name)
        if not variable or component not in self.names:
            where = f"{self.ssp.path}: {name}: expected COMPONENT.VARIABLE"
            raise UserError(f"{where}{hint(component, self.names, 'components')}")
        where = f"{self.ssp.path}: component {component!r}"
        return linear.known_variable(self.ssp.models[component], variable, where)

    def parts(self, values: Mapping[str, Value]) -> dict[str, linear.Linear]:
        """Linearize components, without held states; UserError if one is sampled, or a loop."""
        parameters = self.merged(values)
        found = {}
        with Master(self.fmus, self.connections) as whole:
            whole.initialize(self.time, None, parameters)
            for name, component in whole.components.items():
                instance = component.instance
                if isinstance(instance, PythonInstance):
                    self._laws[name] = instance, instance.memory[: len(instance.made.inputs)]
                    found[name] = self.law(name, self.ssp.system.step)
                    continue
                given = parameters.get(name, {})
                if not samplers(instance.fmu.model):
                    found[name] = linear.linear_model(instance)
                    self._refuse_sampled(component, found[name], given)
                    continue
                found[name], _ = self._exchanged(component, given)
        return found

    def _exchanged(
        self, component: ConnectedInstance, given: Mapping[str, Value]
    ) -> tuple[linear.Linear, float | None]:
        """Linearize a component by model exchange, before samplers tick; with its time event."""
        name, instance = component.name, component.instance
        values = {n: start_value(instance.fmu, name, n, v) for n, v in given.items()}
        component.inputs.get()
        values |= zip(component.inputs.names, component.inputs.view.tolist(), strict=True)
        for c in self.connections:
            if c.end_component == name and c.end_connector not in values:
                values[c.end_connector] = instance.discrete(c.end_connector)
        with (
            Fmu(self.ssp.fmu(name), kind=MODEL_EXCHANGE) as fmu,
            linear.FmuSubject(fmu, self.time) as subject,
        ):
            return subject.at(values), subject.next_event()

    def law(self, name: str, step: float) -> linear.Linear:
        """Linearize a component in Python at the point of `parts`, called every `step` s."""
        instance, inputs = self._laws[name]
        feeding = [c for c in self.connections if c.end_component == name]
        sizes = {c.end_connector: self.variable(c.start).nominal or 0.0 for c in feeding}
        return linear.law_model(instance, self.time, step, inputs, sizes)

    def joined(self, parts: Mapping[str, linear.Linear]) -> linear.Linear:
        """Join parts, without the connection that is cut: as a discrete model if some are sampled.

        UserError if what is cut is not seen once a period.
        """
        if not self.python and not any(part.ticks for part in parts.values()):
            return connected(parts, self.kept)
        if self.python and (more := master.beyond_steps(self.ssp.system, self.ssp.models)):
            expected = "with components in Python a linear model expects steps side by side"
            raise UserError(f"{self.ssp.path}: {more}: {expected}")
        step, feeding = self.ssp.system.step, [c.start for c in self.connections]
        with placed(self.ssp.path):
            found, whole = (
                sampled(parts, connections, step, feeding)
                if self.python
                else connected(parts, connections).discretized()
                for connections in (self.kept, self.connections)
            )
        if self.cut is not None:
            one, size = found.select([self.cut.end], [self.cut.start]), np.abs(whole.A).max()
            back = (1 - one.D) * (whole.A - found.A)
            if not np.allclose(back, one.B @ one.C, rtol=0, atol=SAME * size):
                wrong = f"{self.cut.end} does not see {self.cut.start} once a period, just after"
                raise UserError(f"--break: {wrong} the first tick: break at what that sets")
        return found

    def at(self, values: Mapping[str, Value]) -> linear.Linear:
        """Linearize at values of parameters and states, held ones too, with all loops closed."""
        if self.python:
            raise UserError(f"--trim: component {self.python[0]!r} is in Python: give its point")
        return connected(self.parts(values), self.connections)

    @property
    def kept(self) -> list[Connection]:
        """The connections but the one that is cut."""
        return [c for c in self.connections if c != self.cut]

    @property
    def ways(self) -> list[tuple[str, str]]:
        """Orders and inputs in which a master can step the system."""
        return master.ways({n: fmu.model for n, fmu in self.fmus.items()}, self.connections)

    def held(self, parts: Mapping[str, linear.Linear]) -> dict[str, list[str]]:
        """Return held states by component."""
        models = self.ssp.models
        return {name: linear.held_states(part, models[name]) for name, part in parts.items()}

    def merged(self, values: Mapping[str, Value]) -> dict[str, dict[str, Value]]:
        """Join all that is set, by component."""
        merged = {name: dict(self._parameters.get(name, {})) for name in self.names}
        elapsed = np.array([self.time - self.ssp.system.start])
        for name, signal in self.ssp.system.inputs.items():
            component, variable = self.ssp.split(name)
            if component in merged:
                merged[component][variable] = signal.values(elapsed)[0].item()
        for name, value in values.items():
            component, variable = self.ssp.split(name)
            fed = {c.end for c in self.connections}
            if name in fed and self.variable(name).type == "Real":
                raise UserError(f"{name}: is connected and cannot be set")
            merged[component][variable] = value
        return merged

    def _refuse_sampled(
        self, component: ConnectedInstance, part: linear.Linear, given: Mapping[str, Value]
    ) -> None:
        name, model = component.name, component.instance.fmu.model
        feeding = [c.start_connector for c in self.connections if c.start_component == name]
        outputs = [output for output in feeding if model.variables[output].type == "Real"]

        def announced() -> float | None:
            with suppress(UserError, UnreadableError):  # it may be for co-simulation alone
                return self._exchanged(component, given)[1]
            return None

        if linear.is_sampled(part, model, outputs, announced):
            wrong = linear.why_sampled(model, self._way_out(name))
            raise UserError(f"{self.ssp.path}: component {name!r} {wrong}")

    def _way_out(self, name: str) -> str:
        with suppress(UserError):
            bypassed(self.ssp, self.connections, name)
            return f"take it as ideal by --without {name}"
        return ""


def bypassed(ssp: OpenedSystem, connections: Sequence[Connection], name: str) -> list[Connection]:
    """Remove a component: its source feeds what it fed, by the same names."""
    sources = dict.fromkeys(c.start_component for c in connections if c.end_component == name)
    result = []
    for c in connections:
        if c.start_component == name:
            found = [s for s in sources if c.end_connector in ssp.models[s].real_outputs]
            if len(found) != 1:
                raise UserError(
                    f"--without {name}: {c.end} has nothing to be fed by: expected one component "
                    f"that feeds {name} and has a Real output {c.end_connector!r}"
                )
            result.append(replace(c, start_component=found[0], start_connector=c.end_connector))
        elif c.end_component != name:
            result.append(c)
    return result


# ---- Connections ---------------------------------------------------------------------------------
def connected(
    parts: Mapping[str, linear.Linear], connections: Iterable[Connection]
) -> linear.Linear:
    """Join the linear models of components whose outputs feed inputs.

    Inputs are all components' "component.variable", added to what connections bring. UserError with
    the path of an algebraic loop that has no solution, or many.
    """
    inputs = [f"{name}.{u}" for name, part in parts.items() for u in part.inputs]
    outputs = [f"{name}.{y}" for name, part in parts.items() for y in part.outputs]
    fed = _feeding(inputs, outputs, connections)
    A, B, C, D = map(_diagonal, zip(*map(_clear, parts.values()), strict=True))
    solved, terms = _solved(D @ fed, outputs)
    into = fed @ solved
    back, back_terms = B @ into, np.abs(B) @ fed @ terms
    return linear.Linear(
        A=linear.cleared(A + back @ C, np.abs(A) + back_terms @ np.abs(C)),
        B=linear.cleared(B + back @ D, np.abs(B) + back_terms @ np.abs(D)),
        C=linear.cleared(solved @ C, terms @ np.abs(C)),
        D=linear.cleared(solved @ D, terms @ np.abs(D)),
        **_joined(parts),
        ticks=_ticks(parts, np.hstack([into @ C, np.eye(len(inputs)) + into @ D])),
    )


def _joined(parts: Mapping[str, linear.Linear]) -> dict[str, Any]:
    """Return what linear models have side by side."""
    numbers = {
        key: np.concatenate([getattr(part, key) for part in parts.values()])
        for key in ("x", "u", "y", "rates")
    }
    at = {f"{name}.{v}": value for name, part in parts.items() for v, value in part.at.items()}
    nominals = {f"{name}.{v}": x for name, part in parts.items() for v, x in part.nominals.items()}
    flat = [f.replace(" in ", f" in {name}.") for name, part in parts.items() for f in part.flat]
    listed = {
        kind: tuple(f"{name}.{v}" for name, part in parts.items() for v in getattr(part, kind))
        for kind in ("states", "inputs", "outputs", "held", "left_out", "uneven")
    }
    return numbers | listed | {"at": at, "flat": tuple(flat), "nominals": nominals}


def _ticks(parts: Mapping[str, linear.Linear], fed: np.ndarray) -> tuple[Tick, ...]:
    """Return the ticks of all; `fed`: inputs by all states and inputs, (m, n + m).

    A tick sees other components as they were before all ticks of its instant.
    """
    found, n, m = [], 0, 0
    for name, part in parts.items():
        own, ends = len(part.states), len(part.inputs)
        for tick in part.ticks:
            late = tick.partials[:, own:] @ fed[m : m + ends]
            partials = late.copy()
            partials[:, n : n + own] += tick.partials[:, :own]
            rows, label = [n + row for row in tick.rows], f"{name}.{tick.name}"
            changes = {f"{name}.{x}": change for x, change in tick.changes.items()}
            modes = [f"{name}.{mode}" for mode in tick.modes]
            made = Tick(label, tick.every, tick.offset, rows, partials, late, changes, modes)
            found.append(made)
        n, m = n + own, m + ends
    return tuple(found)


def sampled(
    parts: Mapping[str, linear.Linear],
    connections: Iterable[Connection],
    step: float,
    feeding: Iterable[str],
) -> linear.Linear:
    """Join linear models as a master steps them in Jacobi order, every `step` s, inputs held.

    It is from period to period of samplers and steps, just after their ticks. Outputs that follow
    inputs at once and are `feeding` others are states, too: they are read before the next inputs
    are set. Inputs are as in `connected`.
    """
    inputs = [f"{name}.{u}" for name, part in parts.items() for u in part.inputs]
    outputs = [f"{name}.{y}" for name, part in parts.items() for y in part.outputs]
    clear = {name: _clear(part) for name, part in parts.items()}
    C, D = (_diagonal([blocks[i] for blocks in clear.values()]) for i in (2, 3))
    late = D.any(axis=1) & np.isin(outputs, list(feeding))  # outputs that are states
    n, k, m = C.shape[1], int(late.sum()), len(inputs)
    y = np.zeros((len(outputs), n + k))  # of all states
    y[~late, :n], y[late, n:] = C[~late], np.eye(k)
    u = _feeding(inputs, outputs, connections) @ y
    at_once = np.where(late[:, None], 0.0, D)
    length, steps = by_steps({name: part.ticks for name, part in parts.items()}, step)
    over = np.eye(n + k + m)
    for here in steps:
        one = [
            clear[name][:2] if part.dt else hold(*clear[name][:2], step, here[name])[:2]
            for name, part in parts.items()
        ]
        A, B = map(_diagonal, zip(*one, strict=True))
        x = np.hstack([A, np.zeros((n, k))]) + B @ u
        whole = np.vstack([x, C[late] @ x + D[late] @ u])
        terms = np.abs(np.vstack([x, C[late] @ x]))
        forced = np.vstack([B, C[late] @ B + D[late]])
        over[: n + k] = np.hstack([linear.cleared(whole, terms), forced]) @ over
    joined = _joined(parts)
    return linear.Linear(
        A=over[: n + k, : n + k],
        B=over[: n + k, n + k :],
        C=y + at_once @ u,
        D=at_once,
        **joined
        | {
            "states": (*joined["states"], *np.array(outputs, object)[late]),
            "x": np.append(joined["x"], joined["y"][late]),
            "rates": np.append(joined["rates"], np.zeros(k)),
        },
        dt=length,
    )


def _feeding(
    inputs: Sequence[str], outputs: Sequence[str], connections: Iterable[Connection]
) -> np.ndarray:
    """Return 1 where an output feeds an input, (inputs, outputs); others are constant."""
    fed = np.zeros((len(inputs), len(outputs)))
    for c in connections:
        if c.start in outputs and c.end in inputs:
            fed[inputs.index(c.end), outputs.index(c.start)] = 1.0
    return fed


def _clear(part: linear.Linear) -> tuple[np.ndarray, ...]:
    """Set entries of A, B, C and D to 0 that are rounding, compared with their row and column.

    Units of states, inputs and outputs are chosen first: small ones are no rounding.
    """
    n, m, p = len(part.A), part.B.shape[1], len(part.C)
    whole = np.block([[part.A, part.B], [part.C, part.D]])
    size = np.abs(whole)
    square = np.zeros((n + m + p, n + m + p))
    square[:n, : n + m], square[n + m :, : n + m] = size[:n], size[n:]
    units = linear.scales(square)
    size = size * units[: n + m] / np.append(units[:n], units[n + m :])[:, None]
    largest = [size.max(axis=i, keepdims=True, initial=0.0) for i in (0, 1)]
    whole = np.where(size > NEGLIGIBLE * np.minimum(*largest), whole, 0.0)
    return whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:]


def _solved(direct: np.ndarray, outputs: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return the inverse of 1 - direct, and the terms that it sums: 1 + direct + direct^2 + ...

    Loops are solved: their sums do not end. `direct[i, j]`: output i follows output j at once.
    """
    one = np.eye(len(direct))
    solved, terms, power, size = one, one, one, one
    for _ in range(len(outputs) + 1):
        power, size = power @ direct, size @ np.abs(direct)
        if not size.any():
            return solved, terms
        solved, terms = solved + power, terms + size
    with suppress(np.linalg.LinAlgError):
        solved = np.linalg.solve(one - direct, one)
        if np.abs(solved @ (one - direct) - one).max(initial=0.0) < SINGULAR:
            return solved, np.abs(solved)
    raise UserError(f"the algebraic loop {_circle(outputs, direct)} has no single solution")


def _diagonal(blocks: Sequence[np.ndarray]) -> np.ndarray:
    whole = np.zeros(np.sum([block.shape for block in blocks], axis=0))
    row, column = 0, 0
    for block in blocks:
        rows, columns = block.shape
        whole[row : row + rows, column : column + columns] = block
        row, column = row + rows, column + columns
    return whole


def _circle(names: Sequence[str], direct: np.ndarray) -> str:
    """Return the path of an algebraic loop."""
    rows = zip(names, direct, strict=True)
    causes = {name: [names[j] for j in np.flatnonzero(row)] for name, row in rows}
    try:
        TopologicalSorter(causes).prepare()
    except CycleError as error:
        return " -> ".join(error.args[1])
    return ""


# ---- Loops ---------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Looped:
    """Part of a system on loops through its connections, which alone may make it unstable."""

    parts: Mapping[str, linear.Linear]
    connections: Sequence[Connection]


def looped(parts: Mapping[str, linear.Linear], connections: Iterable[Connection]) -> Looped:
    """Return the part of a system that signals come back to through a connection."""
    nodes = [
        (name, kind, variable)
        for name, part in parts.items()
        for kind in ("inputs", "states", "outputs")
        for variable in getattr(part, kind)
    ]
    index = {node: i for i, node in enumerate(nodes)}
    arrows = np.zeros((len(nodes), len(nodes)), bool)
    for name, part in parts.items():
        A, B, C, D = _clear(part)
        for tick in part.ticks:
            A[tick.rows] += np.abs(tick.partials[:, : len(A)])
            B[tick.rows] += np.abs(tick.partials[:, len(A) :])
        for cause, effect, matrix in (
            ("states", "states", A), ("inputs", "states", B),
            ("states", "outputs", C), ("inputs", "outputs", D),
        ):  # fmt: skip
            for i, j in np.argwhere(matrix).tolist():
                start = index[name, cause, getattr(part, cause)[j]]
                arrows[start, index[name, effect, getattr(part, effect)[i]]] = True
    kept = []
    for c in connections:
        start = index.get((c.start_component, "outputs", c.start_connector))
        end = index.get((c.end_component, "inputs", c.end_connector))
        if start is not None and end is not None:
            arrows[start, end] = True
            kept.append((c, start, end))
    reached = linear.closure(arrows)
    on_loop = [(c, start) for c, start, end in kept if reached[end, start]]
    on_some = [start for _, start in on_loop]
    both = reached & reached.T
    inside = {node for node, ways in zip(nodes, both, strict=True) if ways[on_some].any()}
    reduced = {}
    for name, part in parts.items():
        chosen = {
            kind: [v for v in getattr(part, kind) if (name, kind, v) in inside]
            for kind in ("states", "inputs", "outputs")
        }
        if chosen["outputs"]:
            others = [state for state in part.states if state not in chosen["states"]]
            found = part.without(others).select(chosen["inputs"], chosen["outputs"])
            reduced[name] = replace(found, ticks=tuple(t for t in found.ticks if t.rows))
    return Looped(reduced, [c for c, _ in on_loop])
