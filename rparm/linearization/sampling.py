"""Sampling: held inputs, the samplers of a file with equations, and the period they make.

The FMU of such a file has local variables that say when each sampler ticks, and which values it
would set now: a tick is differentiated like any other equation. The law of a component in Python is
differentiated by differences of its step over its inputs and the numbers that its save() gives.
"""

import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from itertools import pairwise

import numpy as np

from rparm.errors import UnplacedError, UserError
from rparm.fmi.fmi_instance import Instance
from rparm.fmi.model import Model
from rparm.systems.python_component import PythonInstance

SAME = 1e-12  # relative, of times that differ by rounding only
MOST_TICKS = 10_000  # in a period
STEPS_AHEAD = 50  # of a law in Python, that are compared
SMALLEST = 1e-17  # of a sum: a term that changes nothing
UNDEFINED = sys.float_info.max  # in place of a new value that is not finite
# description of a local variable, as fmu/compiler writes it
ABOUT = re.compile(r"Sampler (\d+), ([^:]+): (?:(period|offset)|(new value|change|count) of (.+))")

# steps of differences: a quarter of a number's size, and halves of it, as many as this
LEVELS = 48
AGREE, NEARLY = 1e-9, 1e-5  # of the steepest slope: derivatives by two steps that follow each other
BETWEEN = 0.62  # of a step: where one that agrees is checked
ROUNDED = 16 * sys.float_info.epsilon  # of the largest value of a difference
SEEN = 0.01  # of the steepest slope: rounding by a step is below it


@dataclass
class Sampler:
    """A sampler that an FMU declares, with the names of its variables."""

    name: str
    times: dict[str, str] = field(default_factory=dict)  # period and offset
    # new value of each variable that it sets; of modes and others that are no reals, the change
    new: dict[str, str] = field(default_factory=dict)
    counts: list[str] = field(default_factory=list)  # that it sets and nothing else follows from


@dataclass(frozen=True, eq=False)
class Tick:
    """New values of r of n states, after a tick of a sampler at a point."""

    name: str
    every: float  # s
    offset: float  # s, after the start
    rows: list[int]  # the states, (r,)
    partials: np.ndarray  # of the new values by states and inputs, (r, n + m)
    late: np.ndarray  # the part of it that other ticks of the instant do not change
    changes: dict[str, float]  # new value less the present one, by state
    modes: list[str]  # others that it changes here

    def reduced(self, states: list[int], columns: list[int]) -> "Tick":
        """Return the tick of a model with some of the states, and columns of partials."""
        kept = [i for i, row in enumerate(self.rows) if row in states]
        partials, late = (x[np.ix_(kept, columns)] for x in (self.partials, self.late))
        rows = [states.index(self.rows[i]) for i in kept]
        return replace(self, rows=rows, partials=partials, late=late)


Instant = tuple[float, list[Tick]]


# ---- Samplers of an FMU --------------------------------------------------------------------------
def samplers(model: Model) -> list[Sampler]:
    """Return the samplers that an FMU declares, in the order in which they tick at one instant."""
    found: dict[int, Sampler] = {}
    for variable in model.variables.values():
        if variable.causality == "local" and (about := ABOUT.fullmatch(variable.description)):
            number, name, time, meaning, target = about.groups()
            sampler = found.setdefault(int(number), Sampler(name))
            if meaning == "count":
                sampler.counts.append(target)
            else:
                (sampler.times if time else sampler.new)[time or target] = variable.name
    return [found[number] for number in sorted(found)]


def ticking(instance: Instance) -> list[Sampler]:
    """Return the samplers of an initialized instance whose period is not 0: the others rest."""
    declared = samplers(instance.fmu.model)
    periods = instance.reals([sampler.times["period"] for sampler in declared])
    with instance.explained("at the point"):
        periods.get()
    pairs = zip(declared, periods.view.tolist(), strict=True)
    return [sampler for sampler, period in pairs if period]


def held_numbers(model: Model, every: Sequence[Sampler]) -> list[str]:
    """Return the discrete variables that samplers set, in the order of the model."""
    given = {target for sampler in every for target in sampler.new}.difference(model.states)
    return [n for n, v in model.variables.items() if n in given and v.type == "Real"]


def ticks(
    instance: Instance, every: Sequence[Sampler], states: Sequence[str], inputs: Sequence[str]
) -> tuple[Tick, ...]:
    """Return a tick of each sampler at the present values; UserError if one is not finite."""
    found = []
    for sampler in every:
        targets = [name for name in sampler.new if name in states]
        reals = instance.reals([*targets, *sampler.new.values(), *sampler.times.values()])
        with instance.explained("at the point"):
            reals.get()
        values = dict(zip(reals.names, reals.view.tolist(), strict=True))
        new = {name: values[variable] for name, variable in sampler.new.items()}
        for name, value in new.items():
            if value == UNDEFINED:
                where = f"{instance.name}: sampler {sampler.name}"
                raise UserError(f"{where}: the new value of {name} is not finite at the point")
        found.append(
            Tick(
                sampler.name,
                values[sampler.times["period"]],
                values[sampler.times["offset"]],
                [states.index(name) for name in targets],
                instance.partials([sampler.new[name] for name in targets], [*states, *inputs]),
                np.zeros((len(targets), len(states) + len(inputs))),
                {name: new[name] - values[name] for name in targets},
                [name for name in new if name not in states and new[name]],
            )
        )
    return tuple(found)


# ---- From sample to sample -----------------------------------------------------------------------
def hold(
    A: np.ndarray, B: np.ndarray, step: float, instants: Sequence[Instant] = ()
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return F, G, S, shapes (n, n), (n, m), (n, m), of x(h) = F x + G u + S u', u at the begin.

    Samplers tick at `instants` of the step.
    """
    n, m = B.shape
    rates, whole = np.zeros((n + 2 * m, n + 2 * m)), np.eye(n + 2 * m)
    rates[:n, :n], rates[:n, n : n + m] = A, B
    rates[n : n + m, n + m :] = np.eye(m)
    over: dict[str, np.ndarray] = {}  # by the time between two instants
    ends = [*(time for time, _ in instants), step]
    for begin, end, here in zip([0.0, *ends], ends, [*(x for _, x in instants), ()], strict=False):
        if (gap := f"{end - begin:.10g}") not in over:
            over[gap] = exponential(rates * (end - begin))
        whole = over[gap] @ whole
        before = whole[: n + m].copy()
        for tick in here:
            late = tick.late @ (before - whole[: n + m])
            whole[tick.rows] = tick.partials @ whole[: n + m] + late
    return whole[:n, :n], whole[:n, n : n + m], whole[:n, n + m :]


def exponential(A: np.ndarray) -> np.ndarray:
    """Return exp(A): what is 0 as no power of A leads there is exactly 0.

    A series and squares only add and multiply: no units cost accuracy. Where states are slow, their
    exp - 1 is doubled: they keep their digits beside fast ones.
    """
    radius = float(np.abs(np.linalg.eigvals(np.abs(A))).max(initial=0.0))
    doublings = max(0, math.ceil(math.log2(radius)) + 1) if radius else 0
    small = A * 0.5**doublings
    term = found = small
    size, k = np.abs(term), 1
    while (np.abs(term) > SMALLEST * size).any():
        k += 1
        term = term @ small / k
        found, size = found + term, size + np.abs(term)
    whole, i = np.eye(len(A)) + found, np.arange(len(A))
    for _ in range(doublings):
        less = (2 * found + found @ found)[i, i]
        whole = whole @ whole
        whole[i, i] = np.where(less > -0.5, 1 + less, whole[i, i])
        found = whole.copy()
        found[i, i] = np.where(less > -0.5, less, whole[i, i] - 1)
    return whole


def period(every: Sequence[Tick], step: float = 0.0) -> float:
    """Return the shortest time, s, in which samplers tick, and steps fit, a whole number of times.

    UnplacedError: there is no such time, or ticks change modes.
    """
    for tick in every:
        if tick.modes:
            raise UnplacedError(
                f"sampler {tick.name} changes {', '.join(tick.modes)} at this point, expected a "
                "point at which samplers change no modes"
            )
    times = [(tick.name, tick.every) for tick in every] + [("communication", step)] * (step > 0)
    longest = max(time for _, time in times)
    ratios = [Fraction(longest / time).limit_denominator(MOST_TICKS) for _, time in times]
    found = longest * math.lcm(*(ratio.denominator for ratio in ratios))
    counts = [found / time for _, time in times]
    if sum(counts) > MOST_TICKS or any(abs(n - round(n)) > SAME * n for n in counts):
        rates = ", ".join(f"{name} every {time:.6g} s" for name, time in times)
        expected = f"expected a common period of at most {MOST_TICKS} ticks"
        raise UnplacedError(f"samples at several rates, {expected}: {rates}")
    return found


def slowest(every: Sequence[Tick]) -> float:
    """Return the first time, s, of a tick of a sampler of the slowest rate."""
    least = max(tick.every for tick in every) * (1 - SAME)
    return min(_first(tick, 0.0) for tick in every if tick.every >= least)


def instants(every: Sequence[Tick], length: float, begin: float) -> list[Instant]:
    """Return when samplers tick in `length` s from `begin`, s after it, ticks in order."""
    times = [
        (_first(tick, begin) + k * tick.every, i)
        for i, tick in enumerate(every)
        for k in range(round(length / tick.every))
    ]
    rounding = SAME * (length + max((tick.offset for tick in every), default=0.0))
    found: list[tuple[float, list[int]]] = []
    for time, i in sorted(times):
        if not found or time - found[-1][0] > rounding:
            found.append((time, []))
        found[-1][1].append(i)
    return [(time, [every[i] for i in sorted(here)]) for time, here in found]


def by_steps(
    every: Mapping[str, Sequence[Tick]], step: float
) -> tuple[float, list[dict[str, list[Instant]]]]:
    """Return the period, s, of parts with these ticks and of steps, and the instants of each step.

    It begins just after the ticks of an instant: ticks at the end of a step belong to it.
    """
    ticking = [replace(tick, name=f"{name}.{tick.name}") for name in every for tick in every[name]]
    length = period(ticking, step)
    steps = [{name: list[Instant]() for name in every} for _ in range(round(length / step))]
    for name, own in every.items():
        found = [(time or length, here) for time, here in instants(own, length, 0.0)]
        for time, here in sorted(found, key=lambda instant: instant[0]):
            k = math.ceil(time / step - SAME * len(steps)) - 1
            steps[k][name].append((time - k * step, here))
    return length, steps


def _first(tick: Tick, begin: float) -> float:
    """Return the first time of a tick after `begin`, s, or 0 there."""
    time = (tick.offset - begin) % tick.every
    return 0.0 if tick.every - time <= SAME * (tick.every + tick.offset) else time


# ---- Components in Python ------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Law:
    """A component in Python: from states and inputs to the states one step later.

    States are the numbers that save() gives, then its outputs: those returned hold after the step.
    """

    states: tuple[str, ...]
    x: np.ndarray  # (n,)
    after: np.ndarray  # (n,) one step later
    partials: np.ndarray  # (n, n + m) of `after` by states and inputs
    flat: tuple[str, ...]  # effects on a stair or in a dead zone, with the causes
    is_uneven: bool  # inputs that did not matter in a step do so in a later one


def law(
    instance: PythonInstance,
    time: float,
    step: float,
    inputs: np.ndarray,
    nominals: Mapping[str, float] | None = None,
) -> Law:
    """Differentiate the step from `time` with `inputs` (m,), which may have `nominals` by name.

    UserError if there is a corner or a jump, or differences do not agree.
    """
    kept, made = instance.save(), instance.made
    numbers = _Numbers(instance)
    x, are_whole = numbers.of(kept), numbers.are_whole
    names = [f"saved {name}" if name in made.outputs else name for name in numbers.names]
    point = np.array([*x, *inputs])

    def stepped(moved: np.ndarray) -> np.ndarray:
        instance.restore(numbers.put(kept, moved[: len(x)].tolist()))
        outputs = instance.stepped(time, step, moved[len(x) :])
        found = numbers.of(instance.save())
        if len(found) != len(x):
            raise UserError(f"{instance.name}: save() gives {len(found)} numbers after a step, "
                            f"and {len(x)} before")  # fmt: skip
        return np.array([*found, *outputs])

    after = stepped(point)
    known, effects = [*names, *made.inputs], [*names, *made.outputs]
    given = [0.0] * len(x) + [(nominals or {}).get(name, 0.0) for name in made.inputs]
    sizes = [
        2.0 ** math.ceil(math.log2(max(abs(number), nominal or 1.0)))
        for number, nominal in zip(point.tolist(), given, strict=True)
    ]
    columns, flat = [], list[str]()
    for i, cause in enumerate(known):
        size = sizes[i]
        try:
            column, is_flat = _difference(stepped, point, i, size / 4, after)
        except UserError:
            if i >= len(x) or not are_whole[i]:
                raise
            if after[i] != x[i]:
                instance.restore(kept)
                why = f"each step changes {cause}, a whole number: it has no linear model"
                way_out = "in place of an index keep a list, and append() and pop(0)"
                raise UserError(f"{instance.name}: {why}: {way_out}") from None
            flat.append(f"{instance.name} over {cause}")
            columns.append(np.zeros(len(after)))
            continue
        columns.append(column)
        flat += [f"{effects[j]} over {cause}" for j in np.flatnonzero(is_flat)]
        if (bad := np.isnan(column)).any():
            instance.restore(kept)
            effect = effects[int(bad.argmax())]
            why = f"{effect} has a corner or a jump over {cause} at the point, or noise"
            steps = f"differences agree at no step from {size / 4:.3g} to {size / 2**LEVELS:.3g}"
            raise UserError(f"{instance.name}: {why}: {steps}: it has no linear model")
    instance.restore(kept)
    whole = np.array(columns).reshape(len(point), len(after)).T
    resting = np.zeros((len(after), len(made.outputs)))  # no output of before matters
    partials = np.hstack([whole[:, : len(x)], resting, whole[:, len(x) :]])
    outputs = instance.memory[len(made.inputs) :]
    moved = inputs + np.array(sizes[len(x) :]) / 4
    is_uneven = _is_uneven(instance, time, step, inputs, moved)
    instance.restore(kept)
    x = np.array([*x, *outputs])
    return Law((*names, *made.outputs), x, after, partials, tuple(flat), is_uneven)


def _is_uneven(
    instance: PythonInstance, time: float, step: float, inputs: np.ndarray, moved: np.ndarray
) -> bool:
    """Return whether moved inputs matter in a step after one in which they do not.

    Where no output of a step follows from its inputs, what is saved counts.
    """
    numbers, seen = _Numbers(instance), list[tuple[bool, bool]]()

    def after(kept: object, k: int, u: np.ndarray) -> tuple[list[float], list[float]]:
        instance.restore(numbers.put(kept, numbers.of(kept)))
        return instance.stepped(time + k * step, step, u), numbers.of(instance.save())

    with suppress(UserError):
        for k in range(STEPS_AHEAD):
            kept = instance.save()
            others, own = after(kept, k, moved), after(kept, k, inputs)
            seen.append((own[0] != others[0], own[1] != others[1]))
    matter = [output if any(x for x, _ in seen) else saved for output, saved in seen]
    return any(earlier < later for earlier, later in pairwise(matter))


def _difference(
    function: Callable[[np.ndarray], np.ndarray],
    point: np.ndarray,
    i: int,
    longest: float,
    middle: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return derivatives (k,) by number i, of fourth order, and where they miss a stair.

    Each is by the longest step that agrees with the two before it, or by shorter ones as long as
    they agree better; else by the longest that nearly agrees, as rounding to few digits leaves it;
    else it is 0 on a stair, or nan. One that is below its error is 0.
    """
    raised: list[UserError] = []
    changes = partial(_changes, function, point, i, middle, raised)
    nothing = np.full(len(middle), np.nan)
    best, nearly, least, steepest = nothing, nothing, nothing, np.zeros(len(middle))
    is_open, is_new, is_flat = np.ones(len(middle), bool), np.ones(len(middle), bool), best > 0
    before, sides = [nothing] * 5, []
    with np.errstate(all="ignore"):
        for k in range(LEVELS):
            length = longest * 2.0**-k
            slope, bend, size = changes(length)
            sides.append([slope + bend / (2 * length), slope - bend / (2 * length)])
            wide_slope, wide_bend, wide_size, wide_value, wide_error = before
            value = (4 * slope - wide_slope) / 3
            error, corner = np.abs(value - wide_value), np.abs(2 * bend - wide_bend / 2) / length
            rounding = np.maximum(size, wide_size) + abs(point[i]) * np.abs(value)
            rounding = ROUNDED * rounding / length
            is_seen = is_new | (rounding <= SEEN * steepest)
            is_still = (error + corner + np.abs(value) == 0) & ~is_new
            is_new &= np.isnan(wide_error)
            steepest = np.fmax(steepest, np.fmax(np.abs(value), corner))
            slopes = np.fmax(steepest, np.abs(bend) / length)
            worst, missed = np.maximum(np.maximum(error, wide_error), corner) - rounding, error
            if (is_open & is_seen & (worst <= NEARLY * slopes)).any():
                between, _, _ = changes(BETWEEN * length)  # a stair may have steps at all halves
                missed = np.abs(value + BETWEEN**2 * (slope - value) - between) - error - rounding
            agrees, almost = (
                is_seen & ~is_still & (np.maximum(worst, missed) <= limit * slopes)
                for limit in (AGREE, NEARLY)
            )
            better = is_open & np.where(np.isfinite(best), error < least, agrees)
            is_clear = np.abs(value) > np.maximum(4 * error, rounding)
            best = np.where(better, np.where(is_clear, value, 0.0), best)
            least = np.where(better, error, least)
            nearly = np.where(almost & np.isnan(nearly), value, nearly)
            is_flat |= is_still & (k < LEVELS // 2)
            is_open &= np.where(np.isfinite(best), better & (error > rounding), True)
            if not is_open.any():
                break
            before = [slope, bend, size, value, error]
    if len(raised) >= 2 * LEVELS:
        raise raised[-1]
    best = np.where(np.isfinite(best), best, nearly)
    is_flat &= np.isnan(best)
    best = np.where(is_flat, 0.0, best)
    return best, is_flat | _is_stair(best, np.array(sides), steepest)


def _changes(
    function: Callable[[np.ndarray], np.ndarray],
    point: np.ndarray,
    i: int,
    middle: np.ndarray,
    raised: list[UserError],
    length: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return slopes over a step to both sides, twice the even part, and the largest values."""
    ends, values = [], []
    for side in (length, -length):
        moved = point.copy()
        moved[i] += side
        ends.append(moved[i])
        try:
            values.append(function(moved))
        except UserError as error:  # so far away the law may have no value
            raised.append(error)
            values.append(np.full(len(middle), np.nan))
    slope = (values[0] - values[1]) / (ends[0] - ends[1])
    return slope, values[0] + values[1] - 2 * middle, np.max(np.abs([*values, middle]), axis=0)


def _is_stair(best: np.ndarray, sides: np.ndarray, steepest: np.ndarray) -> np.ndarray:
    """Return where slopes to both sides (levels, 2, k) leave the best one (k,) at once for another.

    On a smooth function they leave it by and by; at a limit they go to 0, and beyond one corner
    only one side does.
    """
    away = np.abs(sides - best)
    is_away = away.min(axis=1) > 1e-4 * steepest
    last = len(sides) - 1 - is_away[::-1].argmax(axis=0)
    then = away.max(axis=1)[np.minimum(last + 2, len(sides) - 1), np.arange(len(best))]
    first, second = sides[:2].mean(axis=1)
    is_other = np.abs(first - second) <= 0.1 * np.minimum(np.abs(first - best), np.abs(first))
    return is_away.any(axis=0) & (last + 2 < len(sides)) & (then <= 1e-7 * steepest) & is_other


class _Numbers:
    """The numbers within what save() gives: in lists, tuples, dicts and arrays."""

    def __init__(self, instance: PythonInstance) -> None:
        self._instance, self.names = instance, list[str]()
        self.are_whole: list[bool] = []  # integers of Python

    def of(self, state: object) -> list[float]:
        """Return the numbers; `names` are theirs."""
        found: list[float] = []
        self.names, self.are_whole = [], []

        def take(name: str, number: float) -> float:
            found.append(float(number))
            self.are_whole.append(isinstance(number, int))
            self.names.append(name if name and name[0] != "[" else f"saved{name}")
            return number

        self._walked(state, "", take)
        return found

    def put(self, state: object, numbers: Sequence[float]) -> object:
        """Return the state with other numbers."""
        rest = iter(numbers)
        return self._walked(state, "", lambda _name, _number: next(rest))

    def _walked(self, state: object, name: str, visit: Callable[[str, float], float]) -> object:
        if isinstance(state, np.ndarray) and state.dtype.kind in "fiu":
            moved = [visit(f"{name}[{i}]", x) for i, x in enumerate(state.ravel().tolist())]
            return np.array(moved, float).reshape(state.shape)
        if state is None or isinstance(state, bool | str | np.bool_):
            return state
        if isinstance(state, int | np.integer):
            moved = visit(name, int(state))
            return int(moved) if float(moved).is_integer() else moved
        if isinstance(state, float | np.floating):
            return visit(name, float(state))
        if isinstance(state, dict):
            begin = f"{name}." if name else ""
            return {key: self._walked(x, f"{begin}{key}", visit) for key, x in state.items()}
        if isinstance(state, list | tuple):
            items = [self._walked(x, f"{name}[{i}]", visit) for i, x in enumerate(state)]
            return items if isinstance(state, list) else tuple(items)
        given = type(state).__name__
        expected = "expected numbers, in lists, dicts or arrays"
        raise UserError(f"{self._instance.name}: save() gives a {given}, {expected}")
