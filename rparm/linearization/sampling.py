"""Sampling: held inputs, the samplers of a file with equations, and the period they make.

The FMU of such a file has local variables that say when each sampler ticks, and which values it
would set now: a tick is differentiated like any other equation.
"""

import math
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rparm.errors import UnplacedError, UserError
from rparm.fmi.fmi_instance import Instance
from rparm.fmi.model import Model

TERMS = 13  # of Taylor's series of an exponential
SAME = 1e-12  # relative, of times that differ by rounding only
UNDEFINED = sys.float_info.max  # in place of a new value that is not finite
# description of a local variable, as fmu/equations writes it
ABOUT = re.compile(r"Sampler (\d+), ([^:]+): (?:(period|offset)|(new value|change|count) of (.+))")


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
    changes: dict[str, float]  # new value less the present one, by state
    modes: list[str]  # others that it changes here


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
                {name: new[name] - values[name] for name in targets},
                [name for name in new if name not in states and new[name]],
            )
        )
    return tuple(found)


# ---- From sample to sample -----------------------------------------------------------------------
def hold(A: np.ndarray, B: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return F, G, S, shapes (n, n), (n, m), (n, m), of x(h) = F x + G u + S u', u at the begin."""
    n, m = B.shape
    if not n:
        return np.zeros((0, 0)), np.zeros((0, m)), np.zeros((0, m))
    whole = np.zeros((n + 2 * m, n + 2 * m))
    whole[:n, :n], whole[:n, n : n + m] = A, B
    whole[n : n + m, n + m :] = np.eye(m)
    found = _exponential(whole * step)
    return found[:n, :n], found[:n, n : n + m], found[:n, n + m :]


def _exponential(matrix: np.ndarray) -> np.ndarray:
    """Return exp of a matrix: Taylor's series of a part of it, squared; exact but for rounding."""
    halvings = max(0, 4 + math.frexp(np.abs(matrix).sum(axis=1).max(initial=0.0))[1])
    part = matrix / 2.0**halvings  # below 1/16: terms fall below rounding at once
    result = term = np.eye(len(matrix))
    for order in range(1, TERMS):
        term = term @ part / order
        result = result + term
    for _ in range(halvings):
        result = result @ result
    return result


def _check(every: Sequence[Tick]) -> None:
    """Refuse ticks of several rates, and those that change modes."""
    for tick in every:
        if tick.modes:
            raise UnplacedError(
                f"sampler {tick.name} changes {', '.join(tick.modes)} at this point, expected a "
                "point at which samplers change no modes"
            )
    if not all(math.isclose(tick.every, every[0].every, rel_tol=SAME) for tick in every):
        rates = ", ".join(f"{tick.name} every {tick.every:.6g} s" for tick in every)
        raise UnplacedError(f"samples at several rates, expected one for a linear model: {rates}")


def period(A: np.ndarray, B: np.ndarray, every: Sequence[Tick]) -> tuple[np.ndarray, np.ndarray]:
    """Return what moves states and inputs, (n + m, n + m), over a period, and over its first ticks.

    A period begins just before the tick with the smallest offset, and ends before the next one of
    this sampler; inputs are held all the time. UnplacedError: rates differ, or modes change.
    """
    _check(every)
    n, m = B.shape
    whole, first = np.eye(n + m), None
    instants = _instants(every)
    ends = [time for time, _ in instants[1:]] + [instants[0][0] + every[0].every]
    for (time, here), end in zip(instants, ends, strict=True):
        for tick in here:
            whole[tick.rows] = tick.partials @ whole
        first = whole.copy() if first is None else first
        transition, forced, _ = hold(A, B, end - time)
        whole[:n] = np.hstack([transition, forced]) @ whole
    return whole, first


def _instants(every: Sequence[Tick]) -> list[tuple[float, list[Tick]]]:
    """Return the times of a period at which samplers tick, s, with the ticks in their order."""
    found: list[tuple[float, list[Tick]]] = []
    for tick in every:
        time = math.fmod(tick.offset, tick.every)
        rounding = SAME * (tick.every + tick.offset)
        time = 0.0 if tick.every - time <= rounding else time
        same = [here for other, here in found if abs(other - time) <= rounding]
        if same:
            same[0].append(tick)
        else:
            found.append((time, [tick]))
    return sorted(found, key=lambda instant: instant[0])
