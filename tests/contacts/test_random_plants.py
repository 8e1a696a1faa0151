"""Dry friction and stops: FMUs of random plants against an event loop, and what judges them.

CONTACT_PLANTS: how many plants, and by each method if there are more than 100.
"""

import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
import pytest

from tests.contacts.event_loop import FREE, LOWER, EventLoop
from tests.contacts.judge import STOP, TIMES, Judge, Run, failures
from tests.contacts.random_plants import Coulomb, Friction, Numbers, Plant, Row, Stop, plant

COUNT = int(os.environ.get("CONTACT_PLANTS", "40"))
FAILED = (65, 402, 444, 684, 997)  # seeds that have done so
KNOWN = 0.9  # of all times, up to horizons
G = 9.81


def test_random_plants_follow_the_event_loop() -> None:
    """A failure is repeated by python -m tests.contacts.judge SEED."""
    seeds = [*range(COUNT), *FAILED]
    judged = partial(failures, is_full=COUNT > 100)
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        made = [*pool.map(judged, seeds, chunksize=2)]
    found = [text for _, texts in made for text in texts]
    assert not found, "\n".join(found)
    assert np.mean([horizon for horizon, _ in made]) > KNOWN * STOP


def bodies(
    rows: list[Row], q: list[float], v: list[float], ramps: list[list[float]],
    M: Numbers | None = None,
) -> Plant:  # fmt: skip
    """Without springs, dampers and sines."""
    n = len(q)
    M, zero = np.eye(n) if M is None else M, np.zeros((n, n))
    return Plant(
        0, M, zero, zero, np.zeros((n, 6)), np.array(ramps), np.array(q), np.array(v), rows
    )


def dry(size: float) -> Friction:
    return Friction(Coulomb(size))


def test_the_loop_stops_a_block() -> None:
    """After v m / F, at m v**2 / 2 F; pulled by r t it breaks away at F / r."""
    sliding = bodies([Row({0: 2.0}, friction=dry(0.6))], [0.0], [1.0], [[0.0, 0.0]], np.eye(1) * 3)
    motion = EventLoop(sliding).run(TIMES)
    assert [event.t for event in motion.events] == pytest.approx([0.0, 2.5], abs=1e-12)
    assert motion.q[-1, 0] == pytest.approx(1.25, abs=1e-12) and motion.v[-1, 0] == 0.0
    pulled = bodies([Row({0: 1.0}, friction=dry(0.6))], [0.0], [0.0], [[0.0, 0.4]])
    motion = EventLoop(pulled).run(TIMES)
    assert [event.t for event in motion.events] == pytest.approx([0.0, 1.5], abs=1e-12)
    assert motion.q[-1, 0] == pytest.approx(0.4 * 1.5**3 / 6, abs=1e-12)


def test_the_loop_lets_a_sliding_mass_pull_a_stuck_one() -> None:
    """By M12 / M22 of what accelerates it: that breaks away at (F2 + F1 M22 / M12) / r."""
    M = np.array([[2.0, 0.5], [0.5, 1.0]])
    rows = [Row({0: 1.0}, friction=dry(0.3)), Row({1: 1.0}, friction=dry(0.5))]
    motion = EventLoop(bodies(rows, [0.0, 0.0], [0.0, 0.0], [[0.0, 0.0], [0.0, 1.0]], M)).run(TIMES)
    assert [event.t for event in motion.events] == pytest.approx([0.0, 0.5, 1.1], abs=1e-12)
    assert [list(event.mode.signs) for event in motion.events] == [[0, 0], [0, 1], [-1, 1]]


@pytest.mark.parametrize("e", [0.0, 0.3, 0.7])
def test_the_loop_lets_a_ball_bounce(e: float) -> None:
    """Times of impacts are a geometric series, at the end of which it rests."""
    floor = Row({0: 1.0}, stop=Stop(0.0, np.inf, e))
    motion = EventLoop(bodies([floor], [0.2], [0.0], [[-G, 0.0]])).run(TIMES)
    first = np.sqrt(0.4 / G)
    impacts = [event.t for event in motion.events[1:]]
    exact = first * np.cumsum([1.0, *(2 * e**k for k in range(1, len(impacts)))])
    assert impacts == pytest.approx(exact, abs=1e-10)
    assert len(impacts) == (np.ceil(np.log(1e-12 / 0.2) / np.log(e) / 2) if e else 1)
    assert impacts[-1] == pytest.approx(first * (1 + e) / (1 - e), abs=1e-5)
    assert motion.q[-1, 0] == pytest.approx(0.0, abs=1e-14) and motion.v[-1, 0] == 0.0
    assert motion.stop[-1, 0] == pytest.approx(G) and motion.modes[-1].closed[0] == LOWER
    assert motion.loss[-1, 0] == pytest.approx(0.2 * G, abs=1e-9)


def random_instant(chance: np.random.Generator) -> tuple[Plant, Numbers]:
    """Rows at rest under a constant load: frictions, stops and both; which stops are closed."""
    n = chance.integers(1, 4)
    L = chance.normal(size=(n, n)) + np.eye(n)
    directions, rows = chance.normal(size=(n, n)), []
    for factors in directions:
        kind = chance.integers(3)
        friction = dry(chance.uniform(0.1, 2)) if kind != 1 else None
        stop = [Stop(0.0, 1.0, 0.5), Stop(-1.0, 0.0, 0.5)][chance.integers(2)] if kind else None
        rows.append(Row(dict(enumerate(factors)), friction=friction, stop=stop))
    ramps = np.column_stack([3 * chance.normal(size=n), np.zeros(n)])
    made = bodies(rows, [0.0] * n, [0.0] * n, ramps, L @ L.T + 0.3 * np.eye(n))
    sides = [(FREE if not r.stop else LOWER if r.stop.lower == 0 else 3) for r in rows]
    return made, np.array(sides)


def test_least_squares_find_the_one_pattern_that_fits() -> None:
    """Of all in which rows are held, or leave with the force of a bound."""
    chance = np.random.default_rng(3)
    for _ in range(200):
        made, sides = random_instant(chance)
        loop, load = EventLoop(made), made.drive(0.0)
        low, high = loop.box(0.0, made.q, made.v, sides)
        fits = []
        for pattern in product((-1, 0, 1), repeat=len(made.rows)):
            held = np.array(pattern) == 0
            f = np.where(held, 0.0, np.where(np.array(pattern) > 0, low, high))
            if not np.isfinite(f).all():
                continue
            free = loop.J @ loop.W @ (load + loop.J.T @ f)
            f[held] = np.linalg.solve(loop.A[np.ix_(held, held)], -free[held])
            a = loop.J @ loop.W @ (load + loop.J.T @ f)
            if np.all(np.where(held, (low <= f) & (f <= high), a * pattern > 0)):
                fits.append((pattern, f))
        ((pattern, f),) = fits
        mode = loop.decide(0.0, made.q, made.v)
        rests = np.ones(len(f), bool)
        assert loop.accelerations(0.0, made.q, made.v, rests, 0.0 * f, sides)[1] == pytest.approx(f)
        assert list(mode.is_held) == [not p for p in pattern]
        signs = [p if row.friction else 0 for p, row in zip(pattern, made.rows, strict=True)]
        assert list(mode.signs) == signs


def exact_run(judge: Judge) -> Run:
    """What the judge expects; work and heat follow from that."""
    motion, plant = judge.motion, judge.plant
    energy = np.array([plant.energy(*x) for x in zip(motion.q, motion.v, strict=True)])
    heat = np.linspace(0.0, 1.0, len(TIMES))
    return Run(
        motion.q, motion.v, energy - energy[0] + heat + motion.loss.sum(axis=1), heat,
        motion.friction, motion.stop, motion.impulse, motion.loss,
        np.array([mode.friction for mode in motion.modes]),
        np.array([mode.closed for mode in motion.modes]), judge.counts,
    )  # fmt: skip


def shifted(name: str, size: float, first: int = 0) -> Callable[[Run], Run]:
    def change(run: Run) -> Run:
        values = getattr(run, name).copy()
        values[first:] = values[first:] + size
        return replace(run, **{name: values})

    return change


WRONG = {
    "q": shifted("q", 1e-6, 5), "v": shifted("v", 1e-6, 5),
    "friction": shifted("friction", 1e-3, 5), "stop": shifted("stop", 1e-3, 290),
    "loss": shifted("loss", 1e-3, 290),
    "impulse": shifted("impulse", 1e-3, 5), "event_count": shifted("counts", 1, 5),
    "friction mode": shifted("friction_mode", -1, 5), "stop mode": shifted("stop_mode", 1, 5),
    "law": shifted("friction", 1e-3), "direction": shifted("friction_mode", -2, 5),
    "stuck": shifted("v", 1e-6), "bound": shifted("friction", 9.0), "passed": shifted("q", -1.0),
    "free": shifted("stop", 1e-9), "closed": shifted("q", 1e-6), "pulls": shifted("stop", -99.0),
    "share": shifted("friction", 1e-3), "energy": shifted("work", 1e-4, 5),
    "heat": shifted("heat", -1e-1, 100), "loss falls": shifted("loss", -1e-3, 290),
    "status": lambda run: replace(run, failure="fmi2DoStep returned 2"),
}  # fmt: skip


@pytest.fixture(scope="module")
def judge() -> Judge:
    """Of a block that is drawn to and fro, falls on a floor and rests there."""
    row = Row({0: 1.0}, friction=dry(0.5), stop=Stop(-0.3, np.inf, 0.4))
    made = bodies([row], [0.0], [0.5], [[0.5, -2.5]])
    made.sines[0, :3] = 1.0, 8.0, 0.0
    return Judge(made)


def test_an_exact_run_is_right(judge: Judge) -> None:
    assert not [*judge.judge(exact_run(judge))]
    assert judge.horizon == STOP and judge.motion.stop[-1, 0] > 1.0


@pytest.mark.parametrize("kind", WRONG)
def test_a_wrong_run_is_noticed(judge: Judge, kind: str) -> None:
    assert kind in dict(judge.judge(WRONG[kind](exact_run(judge))))


def test_seeds_give_all_kinds_of_plants() -> None:
    plants = [plant(seed) for seed in range(40)]
    rows = [row for made in plants for row in made.rows]
    assert {len(made.q) for made in plants} == {1, 2, 3, 4}
    assert {made.form for made in plants} == {"mass", "inverse", "determinant"}
    assert {made.is_round for made in plants} == {True, False}
    assert any(row.friction and row.stop for row in rows)
    assert any(row.friction and row.friction.ratio > 1 for row in rows)
    assert any(row.named >= 0 for row in rows)
    assert {0.0, 1.0} < {row.stop.restitution for row in rows if row.stop}
    kinds = {row.friction.coulomb.kind for row in rows if row.friction}
    assert kinds == {"constant", "time", "position", "velocity"}
