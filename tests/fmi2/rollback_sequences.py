"""Random sequences of steps, and states that are saved and restored in between."""

import random
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from tests.support.instances import ERROR, INPUTS, Instance, LoadedFmu, status_of

START = {"q1": -1.43, "q2": 0.58, "dq1": 1.97, "dq2": 0.12}
WHIRL = {"g": 0.0, "q2": 0.1, "dq1": 20.0, "f2": -60.0, "relative_tolerance": 1e-12}
KINDS = ("undisturbed", "held", "changing", "moving", "mixed")


@dataclass(frozen=True)
class Move:
    """One communication step and what is set before it."""

    length: float  # s
    values: dict[str, float]  # inputs and tunable parameters
    derivatives: dict[str, list[float]]  # of inputs, from order 1 on


def sequence(kind: str, length: int, chance: random.Random) -> list[Move]:
    """Random steps.

    undisturbed: nothing changes, the integrator continues its history; held: inputs change now
    and then; changing: at every step; moving: with derivatives at every step; mixed: all this, and
    parameters too.
    """
    moves = []
    for _ in range(length):
        values: dict[str, float] = {}
        derivatives: dict[str, list[float]] = {}
        mode = chance.choice(KINDS[:-1]) if kind == "mixed" else kind
        if mode in ("changing", "moving") or (mode == "held" and chance.random() < 0.05):
            values = {"tau1": chance.gauss(0, 2), "f2": chance.gauss(-9, 2)}
            for name in chance.sample(INPUTS, chance.choice((0, 0, 1))):
                del values[name]  # set one input only
        if mode == "moving":
            for name in chance.sample(INPUTS, chance.choice((1, 2))):
                derivatives[name] = [chance.gauss(0, 5) for _ in range(chance.randint(1, 3))]
        if kind == "mixed" and chance.random() < 0.1:
            values["m2"] = chance.uniform(0.5, 2)
            values["g"] = chance.uniform(0, 10)
        moves.append(Move(chance.choice((1e-3, 1e-2, 1 / 60, 0.03)), values, derivatives))
    return moves


def times(moves: Sequence[Any]) -> list[float]:
    """Communication points of a master that adds up its steps."""
    found = [0.0]
    for move in moves:
        found.append(found[-1] + move.length)
    return found


def do(instance: Instance, t: float, move: Move) -> bytes:
    """One step; all values before it, with the new inputs, and after it."""
    instance.set(**move.values)
    instance.set_input_derivatives(**move.derivatives)
    before = instance.everything()
    instance.step(t, move.length)
    return before + instance.everything()


def run(loaded: LoadedFmu, moves: list[Move], start: dict[str, float] = START) -> list[bytes]:
    """Bytes after every step of a run without any snapshot."""
    with Instance(loaded) as instance:
        instance.initialize(**start)
        return [do(instance, t, move) for t, move in zip(times(moves), moves, strict=False)]


def other(loaded: LoadedFmu, chance: random.Random) -> Instance:
    """Another instance in some state, with other values."""
    instance = Instance(loaded)
    state = chance.randrange(4)
    if state > 0:
        instance.initialize(3.0, tolerance=1e-5, q1=0.7, m1=3.0)
    if state > 1:
        instance.set(tau1=1.0)
        instance.step(3.0, 0.1)
    if state > 2:
        assert status_of(instance.fmi.getReal, [9999]) == ERROR
    instance.messages.clear()
    return instance
