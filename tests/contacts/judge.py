"""Judges FMUs of random plants by the event loop, by Gauss' principle and by their energy.

build/venv/bin/python -m tests.contacts.judge 7            # seed 7, each method
build/venv/bin/python -m tests.contacts.judge 7 --method erk --text
"""

import argparse
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave

from tests.contacts.event_loop import FREE, LOWER, SLOW, EventLoop, Motion
from tests.contacts.random_plants import Numbers, Plant, plant
from tests.equations.compiled import ModelFileError
from tests.equations.examples import METHODS
from tests.equations.hybrid_runs import Unit

STOP, STEP = 3.0, 0.01  # s
TOLERANCE = 1e-10
FACTOR = 100.0  # of errors that have not grown, over the tolerance
DISTURBANCE = 1e-7
LARGEST_GROWTH = 3e3
NEAR = 1e-6  # s
LOW = 1e-9  # m: flights that the tolerance may end
STIFF = 300.0  # of forces, over errors of states
TIMES = np.linspace(0.0, STOP, round(STOP / STEP) + 1)


@dataclass
class Run:
    """What an FMU returned, row by row in time."""

    q: Numbers
    v: Numbers
    work: Numbers
    heat: Numbers
    friction: Numbers
    stop: Numbers
    impulse: Numbers
    loss: Numbers
    friction_mode: Numbers
    stop_mode: Numbers
    counts: Numbers
    failure: str = ""


def simulated(unit: Unit, plant: Plant, method: str) -> Run:
    """A run in Co-Simulation."""
    n, rows, fmu = len(plant.q), plant.rows, unit.instance(FMU2Slave)
    reals = [f"{letter}{i + 1}" for letter in "xv" for i in range(n)] + ["work", "heat"]
    frictions = [k for k, row in enumerate(rows) if row.friction]
    stops = [k for k, row in enumerate(rows) if row.stop]
    reals += [f"friction.e{k}.force" for k in frictions]
    reals += [f"stops.e{k}.{what}" for what in ("force", "impulse", "loss") for k in stops]
    integers = [f"friction.e{k}.mode" for k in frictions] + [f"stops.e{k}.mode" for k in stops]
    of_reals, of_integers = unit.of(*reals), unit.of(*integers, "event_count")
    found, modes, failure = [], [], ""
    fmu.instantiate()
    fmu.setupExperiment(tolerance=TOLERANCE)
    fmu.setInteger(unit.of("solver_method"), [METHODS[method]])
    try:
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        for k in range(len(TIMES)):
            if k:
                fmu.doStep(float(TIMES[k - 1]), STEP)
            found.append(fmu.getReal(of_reals))
            modes.append(fmu.getInteger(of_integers))
    except FMICallException as error:
        failure = f"{error.function} returned {error.status} after {TIMES[max(len(found) - 1, 0)]}"
    fmu.freeInstance()
    values, modes = np.array(found).reshape(len(found), -1), np.array(modes)

    def spread(first: int, elements: list[int], of: Numbers, other: float = 0.0) -> Numbers:
        full = np.full((len(found), len(rows)), other)
        full[:, elements] = of[:, first : first + len(elements)]
        return full

    at = 2 * n + 2
    f, s = len(frictions), len(stops)
    return Run(
        values[:, :n], values[:, n : 2 * n], values[:, 2 * n], values[:, 2 * n + 1],
        spread(at, frictions, values), *(spread(at + f + k * s, stops, values) for k in range(3)),
        spread(0, frictions, modes, SLOW), spread(f, stops, modes, FREE), modes[:, -1], failure,
    )  # fmt: skip


class Judge:
    """What is known of a plant's motion, and up to when."""

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self.loop = EventLoop(plant)
        self.motion = self.loop.run(TIMES)
        self.tails, low = tails(self.motion)
        if plant.is_round:  # a disturbance would end what is equal
            size, other = 1e-8, EventLoop(plant, 1e-8)
        else:
            size, other = DISTURBANCE, EventLoop(plant.disturbed(DISTURBANCE))
        self.horizon, self.reason = STOP, ""
        self.away = np.ones(len(TIMES), bool)
        self._compare(other.run(TIMES), size)
        for k, begin, end in self.tails:
            self.away &= (self.motion.times < begin - NEAR) | (self.motion.times > end + NEAR)
            self.errors[self.motion.times > end] += self._rubbed(k, begin, end)
        self._end(low - NEAR, "low flights")
        self._end(crowded(self.motion) - NEAR, "impacts in an order that rounding decides")
        events = np.array([event.t for event in self.motion.events[1:]])
        self.counts = np.array([np.sum(events <= t) for t in TIMES])
        ends = [begin for _, begin, _ in self.tails]
        # s; up to where numbers of events are equal: what begins in doubt may take one more
        self.counted = 0.0 if self.plant.is_round else min(ends, default=STOP)
        self.away &= self.motion.times < self.horizon

    def _end(self, t: float, reason: str) -> None:
        if t < self.horizon:
            self.horizon, self.reason = t, reason

    def _compare(self, other: Motion, size: float) -> None:
        motion = self.motion
        for each in (motion, other):
            self._end(each.end - 1e-3, each.reason)
        for one, two in zip(changes(motion), changes(other), strict=False):
            if one[1] != two[1] or abs(one[0] - two[0]) > 1e-3:
                self._end(min(one[0], two[0]) - 1e-3, "another sequence")
                break
        else:
            longer = max((changes(motion), changes(other)), key=len)
            least = min(len(changes(motion)), len(changes(other)))
            if len(longer) > least:
                self._end(longer[least][0] - 1e-3, "another number of changes")
        others = np.array([event.t for event in other.events])
        for event in motion.events:
            width = NEAR + min(1e-3, np.min(abs(others - event.t)))
            self.away &= abs(TIMES - event.t) > width
        for t in others:
            self.away &= abs(TIMES - t) > NEAR
        differences = np.max(abs(np.hstack([motion.q - other.q, motion.v - other.v])), axis=1)
        growth = 1 + np.maximum.accumulate(np.where(self.away, differences, 0.0)) / size
        self.errors = FACTOR * TOLERANCE * growth
        if np.any(growth > LARGEST_GROWTH):
            self._end(TIMES[np.argmax(growth > LARGEST_GROWTH)], "a disturbance grows")

    def _rubbed(self, k: int, begin: float, end: float) -> float:
        """What other frictions that switch while bouncing ends may change of velocities."""
        inside = [event.mode.friction for event in self.motion.events if begin <= event.t <= end]
        if not np.any(np.delete(np.ptp(inside, axis=0), k)):
            return 0.0
        at = np.searchsorted(self.motion.times, end)
        q, v = self.motion.q[min(at, len(TIMES) - 1)], self.motion.v[min(at, len(TIMES) - 1)]
        free = np.full(len(self.loop.J), FREE)
        most = self.loop.box(end, q, v, free)[1]
        return 2 * (end - begin) * float(np.max(abs(self.loop.W @ self.loop.J.T) @ most))

    def judge(self, run: Run) -> Iterator[tuple[str, str]]:
        """What a run contradicts, and how: the first of each kind."""
        found: dict[str, str] = {}
        if run.failure:
            found["status"] = run.failure
        for k in range(len(run.q)):
            t = TIMES[k]
            wrong = [*self._consistent(run, k), *self._balanced(run, k)]
            if self.away[k]:
                wrong += self._as_the_loop(run, k)
            for kind, text in wrong:
                found.setdefault(kind, f"at {t:.6g}: {text}")
        yield from found.items()

    def _as_the_loop(self, run: Run, k: int) -> Iterator[tuple[str, str]]:
        motion, error = self.motion, self.errors[k]
        for name, bound in (
            ("q", error), ("v", error), ("friction", STIFF * error), ("stop", STIFF * error),
            ("loss", STIFF * error), ("impulse", STIFF * error),
        ):  # fmt: skip
            one, two = getattr(run, name)[k], getattr(motion, name)[k]
            far = abs(one - two)
            if name == "impulse":
                ended = [r for r, begin, _ in self.tails if begin < TIMES[k]]
                far[ended] = 0.0
            if not np.all(far <= bound):
                yield name, f"{one} for {two}, {np.max(far):.3g} away, {bound:.3g} allowed"
        has_off = any(law.is_off for _, law in self.loop.frictions)  # whose events it has not
        if TIMES[k] < self.counted and run.counts[k] != self.counts[k] and not has_off:
            yield "event_count", f"{run.counts[k]} for {self.counts[k]}"
        mode = motion.modes[k]
        sure = mode.is_sure & (motion.sure[k] > STIFF * error + NEAR)
        off = [r for r, law in self.loop.frictions if law.is_off]  # they say "forward"
        for name, one, two in (
            ("friction mode", run.friction_mode[k], mode.friction),
            ("stop mode", run.stop_mode[k], mode.closed),
        ):
            differs = (one != two) & sure
            differs[off] &= name != "friction mode"
            if np.any(differs):
                yield name, f"{one} for {two}"

    def _consistent(self, run: Run, k: int) -> Iterator[tuple[str, str]]:
        """Whether forces and modes are those of the states, wherever those are."""
        loop, t, q, v = self.loop, TIMES[k], run.q[k], run.v[k]
        speeds, places = loop.J @ v, loop.J @ q
        f = run.stop[k] - run.friction[k]
        a = loop.J @ loop.W @ (self.plant.load(t, q, v) + loop.J.T @ f)
        small = 1e-6 * (1 + np.max(abs(self.plant.load(t, q, v))))
        modes, closed = run.friction_mode[k], run.stop_mode[k]
        for r, law in loop.frictions:
            sign = modes[r] - SLOW
            expected = sign * law.at(speeds[r], t, q, v)
            most = law.at(0.0, t, q, v)
            if sign and abs(run.friction[k][r] - expected) > small:
                yield "law", f"friction {r} is {run.friction[k][r]} for {expected}"
            if sign and sign * speeds[r] < -1e-8 and not law.is_off:
                yield "direction", f"friction {r} in mode {modes[r]} at {speeds[r]}"
            if not sign and (abs(speeds[r]) > 1e-8 or abs(a[r]) > small):
                yield "stuck", f"friction {r} moves by {speeds[r]} and {a[r]}"
            if not sign and abs(run.friction[k][r]) > most + small:
                yield "bound", f"friction {r} is {run.friction[k][r]} above {most}"
        for r, stop in loop.stops:
            low, high = places[r] - stop.lower, stop.upper - places[r]
            if min(low, high) < -1e-7:
                yield "passed", f"stop {r} by {min(low, high)}"
            if closed[r] == FREE:
                if run.stop[k][r]:
                    yield "free", f"stop {r} has {run.stop[k][r]}"
                continue
            side = 1 if closed[r] == LOWER else -1
            if abs(low if closed[r] == LOWER else high) > 1e-8:
                yield "closed", f"stop {r} in mode {closed[r]} at {places[r]}"
            if abs(speeds[r]) > 1e-8 or abs(a[r]) > small:
                yield "closed", f"stop {r} moves by {speeds[r]} and {a[r]}"
            if side * run.stop[k][r] < -small:
                yield "pulls", f"stop {r} by {run.stop[k][r]}"
            friction = self.plant.rows[r].friction
            if friction and abs(run.stop[k][r]) > small:
                most = friction.at(0.0, t, q, v)
                if abs(side * run.friction[k][r] + most) > small:
                    yield "share", f"stop {r} {run.stop[k][r]}, friction {run.friction[k][r]}"

    def _balanced(self, run: Run, k: int) -> Iterator[tuple[str, str]]:
        energy = [self.plant.energy(run.q[i], run.v[i]) for i in (0, k)]
        lost = run.heat[k] + run.loss[k].sum() - run.loss[0].sum()
        gained = energy[1] - energy[0] - run.work[k]
        if abs(gained + lost) > 1e-6 * (1 + energy[0] + abs(run.work[k]) + lost):
            yield "energy", f"grows by {gained} beyond the work, for {-lost}"
        if k:
            if run.heat[k] < run.heat[k - 1] - 1e-9:
                yield "heat", f"falls by {run.heat[k - 1] - run.heat[k]}"
            if np.any(run.loss[k] < run.loss[k - 1] - 1e-12):
                yield "loss falls", f"{run.loss[k - 1]} to {run.loss[k]}"


def tails(motion: Motion) -> tuple[list[tuple[int, float, float]], float]:
    """Ends of bouncing, which the tolerance decides: rows, times; when others get as low."""
    found, low, others = [], {}, [np.inf]
    for event in motion.events:
        for k in event.rests:
            found.append((k, low.pop(k, event.t), event.t))
        for k in event.hits.keys() - event.rests:
            if event.hits[k] < LOW:
                low.setdefault(k, event.t)
            elif k in low:
                others.append(low.pop(k))
    return found, min(*others, *low.values(), np.inf)


def crowded(motion: Motion) -> float:
    """When stops are hit almost at once, but not by one impact."""
    hits = [(event.t, rows) for event in motion.events for rows in event.struck]
    near = (t for (t, one), (s, two) in pairwise(hits) if s - t < NEAR and set(one) != set(two))
    return min(near, default=np.inf)


def changes(motion: Motion) -> list[tuple[float, tuple]]:
    """Times and modes, wherever modes change before bouncing ends."""
    ends = [(begin, end) for _, begin, end in tails(motion)[0]]
    keys = [
        (event.t, event.mode.key)
        for event in motion.events
        if not any(begin <= event.t < end for begin, end in ends)
    ]
    return keys[:1] + [two for one, two in pairwise(keys) if one[1] != two[1]]


def failures(seed: int, method: str = "", is_full: bool = True) -> tuple[float, list[str]]:
    """The horizon of a plant (s), and what runs by a method, all of them or two do wrong."""
    made, names = plant(seed), [*METHODS]
    methods = (
        [method] if method else names if is_full else [names[seed % 2], names[2 + seed // 2 % 2]]
    )
    judge = Judge(made)
    with tempfile.TemporaryDirectory() as folder:
        try:
            unit = Unit(Path(folder), made.text())
        except ModelFileError as error:
            return judge.horizon, [f"seed {seed}: {error}"]
        return judge.horizon, [
            f"seed {seed} {method} {kind}: {text}"
            for method in methods
            for kind, text in judge.judge(simulated(unit, made, method))
        ]


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("seed", type=int)
    parser.add_argument("--method", choices=METHODS)
    parser.add_argument("--text", action="store_true", help="write the file")
    arguments = parser.parse_args()
    made = plant(arguments.seed)
    judge = Judge(made)
    if arguments.text:
        print(made.text())
    print(f"horizon {judge.horizon}: {judge.reason}; error {judge.errors[-1]:.3g}")
    for event in judge.motion.events:
        print(
            f"{event.t:.12g} {event.mode.friction} {event.mode.closed} {event.hits} {event.rests}"
        )
    _, found = failures(arguments.seed, arguments.method or "")
    print(*found, sep="\n")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
