"""Events of the built FMU do not depend on communication points, and rollback leaves no trace of
them: bit for bit."""

import dataclasses
import os
import random
import re
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import accumulate
from pathlib import Path

import pytest

from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from tests.rp_plant.fmu.plant_runs import (
    AT_REST,
    BOUNCY_STOPS,
    COMPLIANT,
    FIRM,
    FRICTION,
    METHODS,
    RIGID,
    each_method,
    events,
    last_event,
    started,
)
from tests.support.instances import DISCARD, LoadedFmu, status_of
from tests.support.instances import Instance as Fmi2Instance

SEQUENCES = int(os.environ.get("PLANT_SEQUENCES", "100"))
PAYLOAD = {"payload_mass": 0.8, "payload_inertia": 0.01, "payload_x": 0.05, "payload_z": 0.1}
BUSY = FRICTION | BOUNCY_STOPS | PAYLOAD | {"grasp": AT_REST, "dq1": 1.2, "dq2": -0.4}

# stops that give way, one of them damped
BUFFERS = {
    "stops1": COMPLIANT,
    "lower1": -0.6,
    "upper1": 0.9,
    "stop_stiffness1": 500.0,
    "stops2": COMPLIANT,
    "lower2": -0.1,
    "upper2": 0.2,
    "stop_stiffness2": 4000.0,
    "stop_damping2": 0.5,
}


# ---- The same bits of every event time -------------------------------------------------------

MOTIONS = {
    "bounces": BOUNCY_STOPS
    | {"q1": 0.7, "dq2": 0.5, "coulomb_friction1": FIRM, "restitution2": 0.8},
    "slides": FRICTION | {"tau1": 14.0, "f2": 3.0, "dq1": -1.0, "dq2": 0.8},
    "buffers": BUFFERS
    | {"dq1": 1.2, "dq2": -0.8, "coulomb_friction1": 0.5, "coulomb_friction2": 0.5},
    "everything": FRICTION | BOUNCY_STOPS | {"dq1": 1.2, "dq2": -0.4},
}


@pytest.mark.parametrize("method", ["cvode_adams", "cvode_bdf", "taylor"])
@pytest.mark.parametrize("motion", MOTIONS)
def test_later_communication_points_do_not_matter(plant: Fmu, method: str, motion: str) -> None:
    """With constant inputs and the same first step: all event times, and the state at the end."""
    stop, first = 3.0, 1e-3
    with started(plant, method, **MOTIONS[motion]) as instance:
        expected = dict(events(instance, first, stop))
        end = last_event(instance)
    assert end.count >= 3
    for seed in range(4):
        chance = random.Random(seed)
        longest = (2e-3, 0.02, 0.3, 2.0)[seed]
        with started(plant, method, **MOTIONS[motion]) as instance:
            t, h = 0.0, first
            while t < stop:
                instance.do_step(t, h)
                t += h
                event = last_event(instance)
                if event.count > 0:
                    assert event.time == expected.get(event.count, event.time)
                h = min(chance.uniform(1e-6, longest), stop - t) if stop - t > 1e-6 else stop - t
            assert last_event(instance) == end


# ---- Rollback --------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Move:
    """One communication step and what is set before it."""

    length: float  # s
    values: dict[str, float | bool]


def times(moves: list[Move]) -> list[float]:
    """Communication points of a master that adds up its steps."""
    return list(accumulate((move.length for move in moves), initial=0.0))


def sequence(length: int, chance: random.Random) -> list[Move]:
    """Random steps; now and then the efforts change, and the payload is grasped or released."""
    moves = []
    for _ in range(length):
        values: dict[str, float | bool] = {}
        if chance.random() < 0.2:
            values |= {"tau1": chance.gauss(8, 6), "f2": chance.gauss(2, 6)}
        if chance.random() < 0.05:
            values["payload_attached"] = chance.random() < 0.5
        if chance.random() < 0.02:
            values |= {"coulomb_friction1": chance.uniform(0, 2), "upper2": chance.uniform(0.1, 1)}
        moves.append(Move(chance.choice((1e-3, 1e-2, 0.05, 0.2)), values))
    return moves


class Run:
    """An instance, with all that it shows after a step."""

    def __init__(self, instance: Instance) -> None:
        self.instance = instance
        variables = instance.fmu.model.variables.values()
        self._reals = instance.reals([v.name for v in variables if v.type == "Real"])
        self._integers = [v.name for v in variables if v.type == "Integer"]

    def do(self, t: float, move: Move) -> tuple[bytes, list[int | None]]:
        """Make one step; all Real and Integer variables after it, bit for bit."""
        for name, value in move.values.items():
            self.instance.set(name, value)
        self.instance.do_step(t, move.length, goes_back=True)
        self._reals.get()
        return self._reals.view.tobytes(), [self.instance.integer(name) for name in self._integers]


@contextmanager
def busy(plant: Fmu, method: str, start: dict[str, float] | None = None) -> Iterator[Run]:
    with started(plant, method, tolerance=1e-8, **BUSY | (start or {})) as instance:
        yield Run(instance)


def random_start(chance: random.Random) -> dict[str, float]:
    """Start values within the stops of BUSY, or on them, and other restitutions."""
    return {
        "q1": chance.choice((0.0, -0.6, 0.9, chance.uniform(-0.6, 0.9))),
        "q2": chance.choice((0.0, -0.1, 0.2, chance.uniform(-0.1, 0.2))),
        "dq1": chance.gauss(0.0, 2.0),
        "dq2": chance.gauss(0.0, 1.0),
        "restitution1": chance.choice((0.0, 0.5, chance.uniform(0.0, 0.9))),
        "restitution2": chance.choice((0.0, 0.7, chance.uniform(0.0, 0.9))),
        "payload_attached": chance.random() < 0.3,
    }


@dataclasses.dataclass(frozen=True)
class RandomCase:
    """A random start, and steps from there."""

    method: str
    start: dict[str, float]
    moves: list[Move]


def random_case(number: int) -> tuple[RandomCase, random.Random]:
    """The case of this number, and its random numbers from there on. A third of the cases have
    compliant stops."""
    chance = random.Random(number)
    moves = sequence(chance.randint(10, 50), chance)
    start = random_start(chance) | (BUFFERS if number % 3 == 2 else {})
    return RandomCase([*METHODS][number % len(METHODS)], start, moves), chance


def test_most_random_cases_meet_events(plant: Fmu) -> None:
    """Otherwise the next test would jump across nothing."""
    count = 0
    for number in range(40):
        case, _ = random_case(number)
        with busy(plant, case.method, case.start) as run:
            for t, move in zip(times(case.moves), case.moves, strict=False):
                run.do(t, move)
            count += last_event(run.instance).count > 0
    assert count >= 30


@pytest.mark.parametrize("number", range(SEQUENCES))
def test_random_rollback(plant: Fmu, number: int) -> None:
    """Saved states and jumps back at random, across events, with every method."""
    case, chance = random_case(number)
    method, start, moves = case.method, case.start, case.moves
    at = times(moves)
    with busy(plant, method, start) as run:
        expected = [run.do(t, move) for t, move in zip(at, moves, strict=False)]
    with busy(plant, method, start) as run:
        saved = []
        position, left = 0, 4 * len(moves)
        while position < len(moves):
            left -= 1
            action = chance.random() if left > 0 else 1.0
            if action < 0.25:
                state = run.instance.saved_state()
                state.take()
                saved.append((position, state))
            elif action < 0.45 and saved:
                position, state = chance.choice(saved)
                state.restore()
            else:
                assert run.do(at[position], moves[position]) == expected[position]
                position += 1
        for _, state in saved:
            state.free()


# ---- Too many events -------------------------------------------------------------------------


@each_method
def test_one_event_too_many_discards_the_step(fmu: Path, tmp_path: Path, method: str) -> None:
    """The message names indicator and time; FMI 2.0 says how far the step came."""
    g, height, e = 9.81, 0.5, 0.5
    t1 = (2 * height / g) ** 0.5
    third = t1 * (1 + 2 * e + 2 * e**2)
    loaded = LoadedFmu(fmu.with_name("RPPlant.fmu"), tmp_path)
    with Fmi2Instance(loaded) as instance:
        integers = {"solver_method": METHODS[method], "stops2": RIGID, "max_events": 2}
        references = [loaded.references[name] for name in integers]
        instance.fmi.setInteger(references, [*integers.values()])
        start = {"a": 0.0, "q1": 1.5707963267948966, "q2": height, "coulomb_friction1": FIRM}
        limits = {"lower2": 0.0, "upper2": 2.0, "restitution2": e}
        instance.initialize(tolerance=1e-10, **start, **limits)
        before = instance.fmi.getFMUstate()
        assert status_of(instance.fmi.doStep, 0.0, 10.0) == DISCARD
        text = instance.messages[-1].text
        assert "stop2_lower" in text and "max_events = 2" in text
        named = float(text.split("t = ")[1].split(":")[0])
        assert named == pytest.approx(third, rel=0, abs=1e-9)
        assert instance.fmi.getRealStatus(2) == named  # fmi2LastSuccessfulTime
        # a shorter step has fewer of them
        instance.fmi.setFMUstate(before)
        instance.step(0.0, named - 1e-6)
        assert instance.count("event_count") == 2
        instance.step(named - 1e-6, 2e-6)
        assert instance.count("event_count") == 3


def test_the_message_of_both_versions_names_indicator_and_time(plant: Fmu) -> None:
    stops = {"stops2": RIGID, "lower2": 0.0, "upper2": 2.0, "restitution2": 0.5, "max_events": 2}
    with started(plant, q1=1.5, q2=0.5, coulomb_friction1=FIRM, **stops) as instance:
        assert status_of(instance.do_step, 0.0, 10.0) == DISCARD
        assert re.search(
            r"ended at t = 0\.\d+: stop2_lower.* more than max_events = 2", instance.messages[-1]
        )
