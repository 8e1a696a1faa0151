"""Linear models: A, B, C and D of an FMU at a point, by its directional derivatives."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from rparm.errors import UnplacedError, UserError, WrongValueError, did_you_mean, hint, placed
from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import PARAMETERS, Model, Value, Variable
from rparm.linearization import sampling
from rparm.linearization.sampling import Tick, held_numbers, hold, law, samplers, ticking, ticks
from rparm.systems.python_component import PythonComponent, PythonInstance
from rparm.units import typed_quantity

if TYPE_CHECKING:
    from control import StateSpace

    from rparm.linearization.margins import Margins

CANCELLED = 1e-13  # of the terms of a sum: rounding of a sum that is 0
EQUAL = 1e-4  # relative, of poles that are equal but for rounding
ROUNDING = 1e-15  # relative, for each row and column: of singular values that are 0
MOVING = 1e-8  # of the terms of a rate: a smaller one is 0, as of values typed with nine digits
UNKNOWN = 1e-15  # rounding of numbers that are 0 and have no nominal values


@dataclass(frozen=True, eq=False)
class Linear:
    """Small deviations from a point: x' = A x + B u, y = C x + D u; or, sampled, x+ = A x + B u.

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
    flat : tuple of str
        Functions without slope, with the variables that call them.
    uneven : tuple of str
        Components in Python that do not do the same in every step.
    intervals : dict of str to (float, float)
        Where dry friction lets what was trimmed lie anywhere in between.
    dropped : tuple of str
        States that are left out as they play no part between inputs and outputs.
    hidden, cancelled : ndarray
        Poles that are left out with them, as A has them, and those that zeros cancel.
    dt : float
        Time between samples, s; 0: continuous. x is just before the first tick of a period, y just
        after it.
    nominals : dict of str to float
        Usual sizes, of states and inputs that declare one.
    ticks : tuple of Tick
        Ticks of samplers at the point. Until `discretized`, x' holds between them.
    between : Linear or None
        The model between ticks that has been discretized.
    loop, margins : Linear and Margins, or None
        What a signal sent in at the break brings back, its sign changed, and by how much it may
        change. Of systems that are broken.
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
    flat: tuple[str, ...] = ()
    uneven: tuple[str, ...] = ()
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    dropped: tuple[str, ...] = ()
    hidden: np.ndarray = field(default_factory=lambda: np.zeros(0, complex))
    cancelled: np.ndarray = field(default_factory=lambda: np.zeros(0, complex))
    dt: float = 0.0
    nominals: Mapping[str, float] = field(default_factory=dict)
    ticks: tuple[Tick, ...] = ()
    between: "Linear | None" = None
    loop: "Linear | None" = None
    margins: "Margins | None" = None

    @property
    def poles(self) -> np.ndarray:
        """Eigenvalues of A, in 1/s unless it is sampled, the slowest first, shape (n,)."""
        found = eigenvalues(self.A)
        return found[np.lexsort((found.imag, np.abs(self.rates_of(found))))]

    def rates_of(self, poles: np.ndarray) -> np.ndarray:
        """Return poles or zeros in 1/s, also of a sampled model: -inf for 0."""
        if not self.dt:
            return poles
        with np.errstate(divide="ignore"):
            return np.log(np.abs(poles)) / self.dt + 1j * (np.angle(poles) / self.dt)

    def points(self, w: np.ndarray) -> np.ndarray:
        """Return where frequencies w in rad/s lie in the plane of s, or z."""
        return np.exp(1j * self.dt * np.asarray(w)) if self.dt else 1j * np.asarray(w)

    @property
    def balance(self) -> tuple[list[str], np.ndarray, np.ndarray]:
        """Return all k numbers that are 0 at an equilibrium: texts, (k,), derivatives (k, n + m).

        First the derivatives of all states, then the changes by ticks.
        """
        texts = [f"the derivative of {name} stays at" for name in self.states]
        texts += [f"sampler {t.name} changes {name} by" for t in self.ticks for name in t.changes]
        one = np.eye(len(self.states), len(self.states) + len(self.inputs))
        values = [self.rates, *(list(tick.changes.values()) for tick in self.ticks)]
        rates = np.hstack([self.A, self.B])
        rates = (rates - one) / self.dt if self.dt else rates
        rows = [rates, *(t.partials - one[t.rows] for t in self.ticks)]
        return texts, np.concatenate(values), np.vstack(rows)

    @property
    def sizes(self) -> np.ndarray:
        """Sizes of states and inputs (n + m,): their values, or nominal values if larger."""
        nominals = [self.nominals.get(name, 0.0) for name in (*self.states, *self.inputs)]
        return np.maximum(np.abs([*self.x, *self.u]), nominals)

    def moving(self, place: str = "") -> list[str]:
        """Say what moves at the point, or would move at a tick; `place` stands before names."""
        _, values, rows = self.balance
        texts = [f"{place}{name}' = " for name in self.states]
        texts += [f"{place}{t.name} changes {place}{x} by " for t in self.ticks for x in t.changes]
        is_moving = np.abs(values) > negligible(rows, self.sizes, MOVING)
        return [f"{texts[i]}{values[i]:.6g}" for i in np.flatnonzero(is_moving)]

    @property
    def are_positions(self) -> np.ndarray:
        """Which states (n,) have another state as their derivative, by a gear or not."""
        one = (np.count_nonzero(self.A, axis=1) == 1) & ~self.B.any(axis=1)
        return one & (np.diag(self.A) == 0) & np.isclose(self.rates, self.A @ self.x, atol=0.0)

    def ss(self) -> "StateSpace":
        """Return the model for python-control, if installed; in its names dots become _."""
        matrices = self.A, self.B, self.C, self.D, self.dt
        return import_module("control").ss(*matrices, **self._labels)

    def zoh(self, step: float) -> "StateSpace":
        """Return the model from one sample to the next, `step` s apart, for held inputs."""
        return self.sampled(step).ss()

    def sampled(self, step: float) -> "Linear":
        """Return the model of `zoh`; UserError if deviations grow beyond what a double holds."""
        if self.dt:
            raise UserError(f"step: the model is sampled already, every {self.dt:g} s")
        with np.errstate(over="ignore", invalid="ignore"):
            transition, forced, _ = hold(self.A, self.B, step)
        if not (np.isfinite(transition).all() and np.isfinite(forced).all()):
            raise UserError(f"step: deviations overflow in {step:g} s, expected a shorter one")
        return replace(self, A=transition, B=forced, dt=step)

    @property
    def _labels(self) -> dict[str, list[str]]:
        names = {"inputs": self.inputs, "outputs": self.outputs, "states": self.states}
        return {k: [name.replace(".", "_") for name in own] for k, own in names.items() if own}

    def select(
        self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None
    ) -> "Linear":
        """Select inputs and outputs, in the order given; UserError if one is unknown."""
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
            ticks=self._ticks(range(len(self.states)), columns),
        )

    def _ticks(self, states: Sequence[int], inputs: Sequence[int]) -> tuple[Tick, ...]:
        """Return the ticks as they are with some states and inputs."""
        columns = [*states, *(len(self.states) + i for i in inputs)]
        return tuple(tick.reduced(list(states), columns) for tick in self.ticks)

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
            ticks=self._ticks(kept, range(len(self.inputs))),
            held=(*self.held, *(name for name in self.states if name in held)),
        )

    def discretized(self) -> "Linear":
        """Return the model from period to period of its samplers; UnplacedError."""
        length, begin = sampling.period(self.ticks), sampling.slowest(self.ticks)
        every = sampling.instants(self.ticks, length, begin)
        with np.errstate(over="ignore", invalid="ignore"):
            A, B, _ = hold(self.A, self.B, length, every)
        if not (np.isfinite(A).all() and np.isfinite(B).all()):
            raise UnplacedError("deviations overflow within a period of its samplers")
        F, G, _ = hold(self.A, self.B, 0.0, every[:1])  # over the first ticks
        C, D = self.C @ F, self.C @ G + self.D
        return replace(self, A=A, B=B, C=C, D=D, dt=length, between=self)


def _places(known: Sequence[str], wanted: Sequence[str] | None, option: str) -> list[int]:
    for i, name in enumerate(wanted or ()):
        if name not in known:
            raise UserError(f"{option}: no {option[:-1]} {name!r} to linearize{hint(name, known)}")
        if name in wanted[:i]:
            raise UserError(f"{option}: {name} is given twice")
    return [known.index(name) for name in (known if wanted is None else wanted)]


# ---- Matrices ------------------------------------------------------------------------------------
def eigenvalues(A: np.ndarray) -> np.ndarray:
    """Return eigenvalues of A, shape (n,): those that are 0 exactly so, also if they are multiple.

    States that influence each other form a block, taken by itself in units that suit it: neither
    units nor fast poles of other blocks cost accuracy.
    """
    both = closure(A.T != 0)
    both &= both.T
    found = [
        _of_block(A[np.ix_(block, block)])
        for i in range(len(A))
        if not (block := np.flatnonzero(both[i]))[0] < i
    ]
    return np.concatenate([np.zeros(0, complex), *found])


def _of_block(A: np.ndarray) -> np.ndarray:
    """Return the eigenvalues of states that all influence each other."""
    if len(A) == 1:
        return A[0].astype(complex)
    scale = scales(A)
    A = A * scale / scale[:, None]
    size, zeros = np.linalg.norm(A, 2), 0
    while len(A):  # take poles at 0 out, which rounding would spread if they are multiple
        _, values, rows = np.linalg.svd(A)
        if values[-1] > len(A) * ROUNDING * size:
            break
        v = rows[-1]
        k = int(np.abs(v).argmax())
        rest = np.arange(len(A)) != k
        A = A[np.ix_(rest, rest)] - np.outer(v[rest] / v[k], A[k, rest])
        zeros += 1
    return np.concatenate([np.zeros(zeros, complex), np.linalg.eigvals(A)])


def participations(A: np.ndarray, poles: np.ndarray) -> np.ndarray:
    """Return the parts of states (n,) in each of all poles of A: shape (n, n), each row's sum is 1.

    They are |left| |right| of its eigenvectors: no units change them. Equal poles share one row:
    the sum over their eigenvectors exists where those are parallel.
    """
    from scipy.linalg import schur, solve_sylvester

    n, scale = len(A), scales(A)
    A = A * scale / scale[:, None]
    every = schur(A, output="complex")[0].diagonal()
    rows = np.full((n, n), 1 / max(n, 1))
    for row, pole in zip(rows, poles, strict=True):
        count = np.count_nonzero(np.abs(poles - pole) <= EQUAL * abs(pole))
        distances = np.sort(np.abs(every - pole))
        if count < n:
            reach = distances[count - 1 : count + 1].mean()
            T, Z, k = schur(A, output="complex", sort=lambda p, c=pole, r=reach: abs(p - c) <= r)
            other = solve_sylvester(T[:k, :k], -T[k:, k:], T[:k, k:])
            projection = Z[:, :k] @ np.hstack([np.eye(k), other]) @ Z.conj().T
            row[:] = np.abs(projection.diagonal()) / np.abs(projection.diagonal()).sum()
    return rows


def zeros(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray) -> np.ndarray:
    """Return the finite zeros of C (s - A)^-1 B + D, which has one input and one output."""
    from scipy.linalg import eigvals

    n = len(A)
    found = eigvals(np.block([[A, B], [C, D]]), np.diag([1.0] * n + [0.0]))
    return found[np.isfinite(found)]


def cleared(entries: np.ndarray, terms: np.ndarray) -> np.ndarray:
    """Replace entries by 0 whose terms, of total size `terms`, cancel but for rounding."""
    return np.where(np.abs(entries) > CANCELLED * terms, entries, 0.0)


def negligible(rows: np.ndarray, sizes: np.ndarray, relative: float) -> np.ndarray:
    """Return what counts as 0 in sums (k,) of `rows` (k, n) by n numbers of these sizes."""
    terms = np.abs(rows) @ sizes
    return np.where(terms > 0, relative * terms, UNKNOWN * np.abs(rows).sum(axis=1))


def closure(arrows: np.ndarray) -> np.ndarray:
    """Return which nodes can be reached from which, (nodes, nodes), in no step or more."""
    reached = arrows | np.eye(len(arrows), dtype=bool)
    while True:
        further = reached @ reached
        if np.array_equal(further, reached):
            return reached
        reached = further


def scales(A: np.ndarray) -> np.ndarray:
    """Return units of states, powers of 2, that make rows and columns of about the same size."""
    from scipy.linalg import matrix_balance

    with np.errstate(invalid="ignore"):  # of places, which units beyond 2**63 are taken for
        return matrix_balance(A, permute=False, separate=True)[1][0] if len(A) else np.ones(0)


# ---- Of an FMU -----------------------------------------------------------------------------------
def linear_model(instance: Instance) -> Linear:
    """Linearize an initialized instance, with all states; UserError if a value is not finite.

    Discrete variables that samplers set are states, too, which rest between ticks.
    """
    model = instance.fmu.model
    if modulated := instance.fmu.notes("modulated"):
        why = "when it switches depends on inputs or states, which no linear model shows"
        raise UserError(f"{instance.name}: {modulated[0]}: {why}: give it the mean over a period")
    known, declared = model.variables, ticking(instance)
    inputs = [n for n, v in known.items() if v.causality == "input" and v.type == "Real"]
    kept = held_numbers(model, declared)
    states = (*model.states, *kept)
    outputs = [n for n in model.real_outputs if n in kept or known[n].variability != "discrete"]
    unknowns, knowns = [*model.derivatives, *outputs], [*states, *inputs]
    values = instance.reals([*knowns, *unknowns])
    with instance.explained("at the point"):
        values.get()
    partials = instance.partials(unknowns, knowns)
    _check_finite(instance, values.names, values.view)
    _check_finite(instance, unknowns, partials.sum(axis=1))
    n, m, resting = len(states), len(inputs), np.zeros((len(kept), len(knowns)))
    partials = np.insert(partials, len(model.states), resting, axis=0)
    x, u, rates, y = np.split(values.view, np.cumsum([n, m, n - len(kept)]))
    return Linear(
        states=states,
        inputs=tuple(inputs),
        outputs=tuple(outputs),
        A=partials[:n, :n],
        B=partials[:n, n:],
        C=partials[n:, :n],
        D=partials[n:, n:],
        x=x,
        u=u,
        y=y,
        rates=np.append(rates, resting[:, :1]),
        at=dict(zip(knowns, [*x.tolist(), *u.tolist()], strict=True)),
        nominals={name: size for name in knowns if (size := known[name].nominal)},
        ticks=ticks(instance, declared, states, inputs),
        flat=tuple(instance.fmu.notes("flat")),
        left_out=(
            *(name for name in model.real_outputs if name not in outputs),
            *dict.fromkeys(name for sampler in declared for name in sampler.counts),
        ),
    )


def _check_finite(instance: Instance, names: list[str], numbers: np.ndarray) -> None:
    bad = np.flatnonzero(~np.isfinite(numbers))
    if len(bad):
        raise UserError(f"{instance.name}: {names[bad[0]]} or a derivative of it is not finite")


def law_model(
    instance: PythonInstance,
    time: float,
    step: float,
    u: np.ndarray,
    nominals: Mapping[str, float] | None = None,
) -> Linear:
    """Linearize a component in Python at a time, s, with inputs u (m,), as sampled every `step`."""
    found, inputs = law(instance, time, step, u, nominals), tuple(instance.made.inputs)
    outputs = tuple(instance.made.outputs)
    n, p = len(found.states), len(outputs)
    ways = (found.partials[:, n:].T != 0) @ closure(found.partials[:, :n].T != 0)
    unseen = [name for name, way in zip(inputs, ways[:, n - p :], strict=True) if not way.any()]
    return Linear(
        states=found.states,
        inputs=inputs,
        outputs=outputs,
        A=found.partials[:, :n],
        B=found.partials[:, n:],
        C=np.eye(p, n, n - p),
        D=np.zeros((p, len(inputs))),
        x=found.x,
        u=u,
        y=found.x[n - p :],
        rates=(found.after - found.x) / step,
        at=dict(zip((*found.states, *inputs), [*found.x.tolist(), *u.tolist()], strict=True)),
        flat=(
            *(f"a stair or flat part in {text}" for text in found.flat),
            *(f"step in {name}" for name in unseen),
        ),
        uneven=("step",) if found.is_uneven else (),
        dt=step,
    )


def require_derivatives(fmu: Fmu) -> None:
    """Refuse an FMU that gives no directional derivatives, or Python that has no save()."""
    if isinstance(fmu, PythonComponent):
        if not fmu.model.saves_states:
            why = "has no save() and restore(state), which a linear model needs"
            raise UserError(f"{fmu.path}: {why}")
        return
    if not fmu.model.gives_directional_derivatives:
        raise UserError(f"{fmu.path}: gives no directional derivatives, which A, B, C, D are from")


class FmuSubject(ExitStack):
    """Open FMU of either kind to linearize at a time (s); a context manager with an instance."""

    def __init__(self, fmu: Fmu, time: float = 0.0) -> None:
        super().__init__()
        require_derivatives(fmu)
        self.fmu, self.time = fmu, time
        self._is_new = True
        self._instance = self.enter_context(fmu.instance(fmu.path.stem))

    def variable(self, name: str) -> Variable:
        """Return the variable as the FMU declares it; UserError if it has none of that name."""
        return known_variable(self.fmu.model, name, str(self.fmu.path))

    def at(self, values: Mapping[str, Value]) -> Linear:
        """Linearize where parameters, states and inputs have these values."""
        instance = self._instance
        if not self._is_new:
            instance.reset()
        self._is_new = False
        instance.set_up(self.time, None)
        later = {name: v for name, v in values.items() if self.variable(name).follows}
        for name in values.keys() - later.keys():
            instance.set(name, values[name])
        instance.enter_initialization()
        moved = self._before_ticks() | later
        instance.exit_initialization()
        if moved:
            self._move(moved)
        return linear_model(instance)

    def _before_ticks(self) -> dict[str, float]:
        """Return the start values that samplers change if they tick at the start."""
        given = {target for sampler in samplers(self.fmu.model) for target in sampler.new}
        variables = self.fmu.model.variables
        names = [name for name in variables if name in given and variables[name].initial == "exact"]
        values = self._instance.reals(names)
        with self._instance.explained("at the start"):
            values.get()
        return dict(zip(names, values.view.tolist(), strict=True))

    def _move(self, states: Mapping[str, float]) -> None:
        """Set states that the initialization gives other values."""
        move = getattr(self._instance, "set_states", None)
        if move is None:
            follow = [v for v in map(self.variable, states) if v.follows]
            why = f"{follow[0].why_it_follows}, or" if follow else "has samplers:"
            raise UserError(f"{self.fmu.path}: {why} linearize it in model exchange")
        move(states)

    def next_event(self) -> float | None:
        """Return the time of the next time event in s; None for co-simulation."""
        return getattr(self._instance, "next_event", None)

    def held(self, found: Linear) -> list[str]:
        """Return the states of `found` that are held."""
        return held_states(found, self.fmu.model)

    def finished(self, found: Linear) -> Linear:
        """Return the model of a point without states that are held, sampled if it has samplers.

        UserError if it is sampled and does not say how.
        """
        model = self.fmu.model
        with placed(str(self.fmu.path)):
            if found.ticks:
                return found.discretized().without(self.held(found))
        if is_sampled(found, model, model.real_outputs, self.next_event):
            raise UserError(f"{self.fmu.path}: {why_sampled(model)}")
        return found.without(self.held(found))


def known_variable(model: Model, name: str, where: str) -> Variable:
    """Return a variable of a model; UserError if there is none of that name."""
    if name not in model.variables:
        known = [v.name for v in model.variables.values() if v.causality == "input"]
        guess = did_you_mean(name, model.variables)
        label = f" (states and inputs: {', '.join([*model.states, *known])})"
        raise UserError(f"{where}: has no variable {name!r}{guess or label}")
    return model.variables[name]


def is_settable(variable: Variable) -> bool:
    """Return whether a point may say its value: a state, an input or a parameter."""
    may_start = variable.initial == "exact" or bool(variable.follows)
    is_state = variable.causality in ("output", "local") and may_start
    return is_state or variable.causality == "input" or variable.is_a(PARAMETERS)


# ---- States without rates ------------------------------------------------------------------------
def held_states(found: Linear, model: Model) -> list[str]:
    """Return states that stand still whatever inputs and states do: velocities, and what they move.

    A velocity is held if it and its derivative are 0 and nothing changes its derivative, though the
    FMU declares that something does; a position, if only held velocities move it.
    """
    responses = np.hstack([found.A, found.B]) != 0
    is_still = (found.rates == 0) & (found.x == 0) & ~responses.any(axis=1)
    causes = [model.dependencies.get(name, ("anything",)) for name in model.derivatives]
    causes += [()] * (len(found.states) - len(causes))
    ticking = {row for tick in found.ticks for row in tick.rows}
    held = is_still & np.array([bool(some) for some in causes], bool)
    moved_by_held = np.zeros(len(held), bool)
    n = len(found.states)
    if held.any():
        by_others = responses[:, :n][:, ~held].any(axis=1) | responses[:, n:].any(axis=1)
        moved_by_held = responses.any(axis=1) & ~by_others & (found.rates == 0)
    every = zip(found.states, held | moved_by_held, strict=True)
    return [name for i, (name, out) in enumerate(every) if out and i not in ticking]


def why_sampled(model: Model, way_out: str = "") -> str:
    """Say that an FMU is sampled, which needs a discrete model, and what to do."""
    every = (n for n, v in model.variables.items() if "sample" in n and v.is_a(PARAMETERS))
    switch = next(every, "")
    ways = ", or ".join(filter(None, [switch and f"set {switch} to 0", way_out]))
    why = "which no linear model in continuous time can be"
    return f"is sampled, {why}{ways and f': {ways}'}"


def is_sampled(
    found: Linear, model: Model, outputs: Sequence[str], next_event: Callable[[], float | None]
) -> bool:
    """Return whether `outputs` follow inputs only at ticks.

    It is so if all that depend on inputs are discrete, or do not change with them now while the
    FMU announces a time event.
    """
    following = [name for name in outputs if _depends_on_inputs(model, name)]
    rows = [found.outputs.index(name) for name in following if name in found.outputs]
    if not following or not rows:
        return bool(following)
    responds = np.hstack([found.C, found.D])[rows].any(axis=1)
    return not responds.all() and next_event() is not None


def _depends_on_inputs(model: Model, name: str) -> bool:
    causes = model.dependencies.get(name, tuple(model.variables))
    return any(model.variables[cause].causality == "input" for cause in causes)


# ---- The point -----------------------------------------------------------------------------------
class Subject(Protocol):
    """Subject to linearize: an FMU or a system."""

    def variable(self, name: str) -> Variable:
        """Return the variable as it is declared; UserError if there is none of that name."""
        ...

    def at(self, values: Mapping[str, Value]) -> Linear:
        """Linearize where parameters, states and inputs have these values."""
        ...


def checked_point(
    subject: Subject, given: Mapping[str, Any], with_outputs: bool = False
) -> tuple[dict[str, Value], dict[str, float]]:
    """Return values to set, and values of outputs (`with_outputs`), in the variables' units.

    `given` are numbers or texts as "30deg" by name. UserError if a variable is unknown, cannot be
    set, or does not take the value.
    """
    values: dict[str, Value] = {}
    targets: dict[str, float] = {}
    for name, value in given.items():
        variable = subject.variable(name)
        is_target = variable.causality == "output" and not is_settable(variable)
        if is_target and variable.variability == "discrete":
            raise UserError(f"{name}: is discrete, which no equilibrium can aim at")
        if is_target and not with_outputs:
            raise UserError(f"{name}: is an output, which --trim leads to a value")
        if not is_target and not is_settable(variable):
            raise UserError(f"{name}: is calculated, expected a state, an input or a parameter")
        with placed(name):
            number = _checked_value(variable, value)
        if is_target:
            targets[name] = float(number)
        else:
            values[name] = number
    return values, targets


def _checked_value(variable: Variable, given: Any) -> Value:
    given = given.item() if isinstance(given, np.generic) else given
    if not isinstance(given, str):
        return variable.checked(given)
    if variable.type == "Real":
        number = typed_quantity(given, variable.units)
        variable.check_range(number, number)
        return number
    if variable.type == "Boolean":
        if given not in ("true", "false"):
            raise WrongValueError(f"expected true or false, got {given!r}")
        return given == "true"
    return variable.checked(int(given) if given.lstrip("-").isdecimal() else given)
