"""An event loop for dry friction and stops that shares nothing with the FMUs it judges.

Gauss' principle in its dual form decides: accelerations are those of least squares with bounded
forces, M a = load + J' f, f in a box. Impacts are least squares of impulses that are not negative.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq, lsq_linear, nnls

from tests.contacts.random_plants import Friction, Numbers, Plant, Stop

AT_REST = 1e-11  # m/s, what rounding leaves of a relative velocity
AT_LIMIT = 1e-13  # m
LONGEST_STEP = 0.02  # s
SAMPLES = 10  # of each step, where conditions are looked at
ROUNDS = 20  # of impacts at an instant
AHEAD = (1e-6, 1e-4, 1e-2)  # s; where a force at its bound decides itself
SLOW, FORWARD, BACKWARD = 2, 3, 1  # as the enumeration of friction
FREE, LOWER, UPPER = 1, 2, 3  # as the enumeration of stops


class Chattering(Exception):
    """More events than a motion should have, or a decision that does not hold."""


@dataclass
class Mode:
    """What holds between two events, row by row."""

    is_held: Numbers
    signs: Numbers  # of sliding frictions
    closed: Numbers  # FREE, LOWER or UPPER
    is_sure: Numbers  # false where a force stays at its bound

    @property
    def key(self) -> tuple:
        return tuple(self.friction), tuple(self.closed)

    @property
    def friction(self) -> Numbers:
        return np.where(self.signs > 0, FORWARD, np.where(self.signs < 0, BACKWARD, SLOW))


@dataclass
class Event:
    t: float
    mode: Mode  # from here on
    hits: dict[int, float] = field(default_factory=dict)  # rows, flights (m) after impacts
    rests: list[int] = field(default_factory=list)  # rows that end bouncing
    struck: list[list[int]] = field(default_factory=list)  # rows, impact by impact


@dataclass
class Motion:
    """Row by row at given times, and events."""

    times: Numbers
    q: Numbers
    v: Numbers
    friction: Numbers  # forces
    stop: Numbers
    impulse: Numbers
    loss: Numbers
    sure: Numbers  # times, rows: how far the mode is from another
    events: list[Event]
    modes: list[Mode]
    end: float = np.inf  # s; where the loop gave up
    reason: str = ""


class EventLoop:
    """Runs a plant. `rest`: height (m) of the flights that end bouncing."""

    def __init__(self, plant: Plant, tolerance: float = 1e-12, rest: float = 1e-12) -> None:
        self.plant, self.tolerance, self.rest = plant, tolerance, rest
        self.J, self.W, self.n = plant.J, plant.W, len(plant.q)
        self.A = self.J @ self.W @ self.J.T
        self.frictions: list[tuple[int, Friction]] = [
            (k, row.friction) for k, row in enumerate(plant.rows) if row.friction
        ]
        self.stops: list[tuple[int, Stop]] = [
            (k, row.stop) for k, row in enumerate(plant.rows) if row.stop
        ]

    @cached_property
    def root(self) -> Numbers:
        """L with W = L L'."""
        return np.linalg.cholesky(self.W)

    # forces

    def sliding(self, t: float, q: Numbers, v: Numbers, signs: Numbers) -> Numbers:
        """All forces but those of rows that are held."""
        load = self.plant.load(t, q, v)
        for k, friction in self.frictions:
            if signs[k]:
                load = load - self.J[k] * signs[k] * friction.at(self.J[k] @ v, t, q, v)
        return load

    def box(self, t: float, q: Numbers, v: Numbers, closed: Numbers) -> tuple[Numbers, Numbers]:
        """Bounds of the forces that rows at rest can bear."""
        high = np.zeros(len(self.J))
        for k, friction in self.frictions:
            high[k] = friction.at(0.0, t, q, v)
        low = np.where(closed == UPPER, -np.inf, -high)
        return low, np.where(closed == LOWER, np.inf, high)

    def decide(self, t: float, q: Numbers, v: Numbers) -> Mode:
        """The mode behind an instant, by the forces there and shortly after."""
        closed = self.touching(q, v)
        speeds = self.J @ v
        has_friction = np.zeros(len(self.J), bool)
        has_friction[[k for k, _ in self.frictions]] = True
        rests = (has_friction | (closed != FREE)) & (abs(speeds) <= AT_REST)
        signs = np.where(has_friction & ~rests, np.sign(speeds), 0.0)
        mode = Mode(rests.copy(), signs, closed, np.ones(len(self.J), bool))
        left = np.flatnonzero(rests)  # rows that are not decided
        for ahead in (0.0, *AHEAD):
            if not left.size:
                break
            self._decide(t, q, v, ahead, rests, left, mode)
            left = left[~mode.is_sure[left]]
        for k in left:  # as long as one can see at its bound: a rest in either mode
            mode.is_held[k] = True
        held = mode.is_held
        moves = rests & ~held
        mode.closed = np.where(moves, FREE, closed)
        mode.signs = np.where(has_friction, mode.signs, 0.0)
        return mode

    def _decide(
        self, t: float, q: Numbers, v: Numbers, ahead: float, rests: Numbers, left: Numbers,
        mode: Mode,
    ) -> None:  # fmt: skip
        before, closed = mode.signs * ~rests, mode.closed

        def rates(t: float, q: Numbers, v: Numbers) -> Numbers:
            return self.accelerations(t, q, v, rests, before, closed)[0]

        if ahead:
            q, v = self._moved(t, q, v, ahead, rates)
            t += ahead
        a, f, (low, high) = self.accelerations(t, q, v, rests, before, closed)
        moved = self.J @ a
        scale = (1e-6 * ahead or 1e-9) * (1 + np.max(abs(self.plant.load(t, q, v))))
        for k in left:
            room = min(high[k] - f[k], f[k] - low[k])
            is_held, moves = room > scale, abs(moved[k]) > scale * self.A[k, k]
            mode.is_sure[k] = is_held != moves
            mode.is_held[k] = is_held
            mode.signs[k] = 0.0 if is_held else np.sign(moved[k])

    @staticmethod
    def _moved(t: float, q: Numbers, v: Numbers, h: float, rates: Callable) -> tuple:
        """A step of Runge and Kutta."""
        n, x, k = len(q), np.concatenate([q, v]), []
        for part in (0.0, 0.5, 0.5, 1.0):
            at = x + part * h * k[-1] if k else x
            k.append(np.concatenate([at[n:], rates(t + part * h, at[:n], at[n:])]))
        x = x + h / 6 * (k[0] + 2 * k[1] + 2 * k[2] + k[3])
        return x[:n], x[n:]

    def accelerations(
        self, t: float, q: Numbers, v: Numbers, rests: Numbers, signs: Numbers, closed: Numbers
    ) -> tuple[Numbers, Numbers, tuple[Numbers, Numbers]]:
        """By Gauss' principle, with forces and bounds of the rows at rest."""
        load, (low, high) = self.sliding(t, q, v, signs), self.box(t, q, v, closed)
        f, at = np.zeros(len(self.J)), np.flatnonzero(rests)
        can = at[low[at] < high[at]]
        if can.size:
            found = lsq_linear(
                self.root.T @ self.J[can].T, -self.root.T @ load, (low[can], high[can]), "bvls",
                tol=1e-15,
            )  # fmt: skip
            f[can] = found.x
        return self.W @ (load + self.J.T @ f), f, (low, high)

    # stops

    def touching(self, q: Numbers, v: Numbers) -> Numbers:
        """Which stops a row rests at."""
        closed = np.full(len(self.J), FREE)
        for k, stop in self.stops:
            x = self.J[k] @ q
            for side, limit in ((LOWER, stop.lower), (UPPER, stop.upper)):
                if abs(x - limit) <= AT_LIMIT and abs(self.J[k] @ v) <= AT_REST:
                    closed[k] = side
        return closed

    def impact(
        self, t: float, q: Numbers, v: Numbers, event: Event
    ) -> tuple[Numbers, dict[int, float], dict[int, float], dict[int, float]]:
        """Velocities after the impacts of an instant, impulses, losses and signs."""
        sides = {}
        for k, stop in self.stops:
            x, speed = self.J[k] @ q, self.J[k] @ v
            if x - stop.lower <= AT_LIMIT and speed <= AT_REST:
                sides[k] = (1.0, stop.restitution)
            elif stop.upper - x <= AT_LIMIT and speed >= -AT_REST:
                sides[k] = (-1.0, stop.restitution)
        speeds = {k: side * (self.J[k] @ v) for k, (side, _) in sides.items()}
        if not any(speed < -AT_REST for speed in speeds.values()):
            return v, {}, {}, {}
        while True:
            after, P = self._impact(v, sides, speeds)
            ended = self._ended(t, q, after, sides, event)
            if not ended:
                break
            event.rests += ended
            sides |= {k: (sides[k][0], 0.0) for k in ended}
        losses = {k: -P[k] * (1 - sides[k][1]) * speeds[k] / 2 for k in sides}
        return after, P, losses, {k: side for k, (side, _) in sides.items()}

    def _impact(self, v: Numbers, sides: dict, speeds: dict) -> tuple[Numbers, dict]:
        at, signs = list(sides), np.array([side for side, _ in sides.values()])
        e, w = (np.array([pair[1] for pair in sides.values()]), np.array([*speeds.values()]))
        N = signs[:, None] * self.J[at]
        G = N @ self.root  # N W N' = G G'
        least = np.linalg.lstsq(G, (1 + e) * w, rcond=None)[0]
        P, _ = nnls(G.T, -least)
        return v + self.W @ N.T @ P, dict(zip(at, P, strict=True))

    def _ended(self, t: float, q: Numbers, v: Numbers, sides: dict, event: Event) -> list[int]:
        """Rows that would leave for a flight below the least height."""
        mode_speeds = self.J @ v
        rests = abs(mode_speeds) <= AT_REST
        rests &= [row.friction is not None or k in sides for k, row in enumerate(self.plant.rows)]
        signs = np.where(rests, 0.0, np.sign(mode_speeds))
        a = self.J @ self.accelerations(t, q, v, rests, signs, self.touching(q, v))[0]
        ended = []
        for k, (side, e) in sides.items():
            speed, pull = side * mode_speeds[k], -side * a[k]
            if speed > AT_REST and pull > 0.0 and e > 0.0:
                event.hits[k] = speed**2 / (2 * pull)
                if event.hits[k] <= self.rest:
                    ended.append(k)
            elif speed > AT_REST:
                event.hits[k] = np.inf
        return ended

    def put_back(self, q: Numbers, closed: Numbers) -> Numbers:
        """Without what rounding has moved closed stops."""
        at = np.flatnonzero(closed != FREE)
        stops = [self.plant.rows[k].stop for k in at]
        pairs = zip(stops, closed[at], strict=True)
        limits = np.array([stop.lower if side == LOWER else stop.upper for stop, side in pairs])
        away = np.linalg.solve(self.A[np.ix_(at, at)], self.J[at] @ q - limits)
        return q - self.W @ self.J[at].T @ away

    # motion

    def instant(self, t: float, q: Numbers, v: Numbers, impulse: Numbers, loss: Numbers) -> tuple:
        """Impacts, rest and mode of an instant; impulses and losses change in place."""
        event = Event(t, None)
        for _ in range(ROUNDS):  # an impact may drive what was leaving into its stop
            v, P, losses, sides = self.impact(t, q, v, event)
            if not P:
                break
            struck = [k for k in P if P[k] > 1e-9 * max(P.values())]  # not those that only rest
            event.struck.append(struck)
            for k in struck:
                impulse[k], loss[k] = P[k] * sides[k], loss[k] + losses[k]
        else:
            raise Chattering(f"{ROUNDS} impacts at {t}")
        rests = np.flatnonzero(abs(self.J @ v) <= 10 * AT_REST)
        v = v - self.W @ self.J[rests].T @ np.linalg.solve(
            self.A[np.ix_(rests, rests)], self.J[rests] @ v
        )
        event.mode = self.decide(t, q, v)
        return v, event

    def run(self, times: Numbers, most: int = 2000) -> Motion:
        """The motion at rising times, the first of which is 0."""
        t, q, v = 0.0, self.plant.q.copy(), self.plant.v.copy()
        impulse, loss = np.zeros(len(self.J)), np.zeros(len(self.J))
        rows, events, end, reason = [], [], np.inf, ""
        while True:
            try:
                v, event = self.instant(t, q, v, impulse, loss)
                part = Part(self, event.mode, t, q, v)
                part.run(times[-1])
                if len(events) > most:
                    raise Chattering(f"{most} events at {t}")
            except Chattering as error:
                end, reason = t, str(error)
            else:
                events.append(event)
            until = part.end if end > t and part.end is not None else np.inf
            # behind an event: times in front of it keep its values
            for s in times[(times >= t) & (times < until)]:
                rows.append((s, *part.row(s), impulse.copy(), loss.copy(), event.mode))
            if until == np.inf:
                break
            t, (q, v) = until, part.at(until)
            q = self.put_back(q, event.mode.closed)
        columns = [np.array(column) for column in zip(*(row[:-1] for row in rows), strict=True)]
        modes = [row[-1] for row in rows]
        s, q, v, friction, stop, sure, impulse, loss = columns
        return Motion(s, q, v, friction, stop, impulse, loss, sure, events, modes, end, reason)


class Part:
    """The motion from an event to the next."""

    def __init__(self, loop: EventLoop, mode: Mode, t: float, q: Numbers, v: Numbers) -> None:
        self.loop, self.mode, self.begin = loop, mode, t
        self.start, self.n = np.concatenate([q, v]), loop.n
        self.held = np.flatnonzero(mode.is_held)
        H = loop.J[self.held]
        self.forces = -np.linalg.solve(loop.A[np.ix_(self.held, self.held)], H @ loop.W)
        self.G = loop.W + loop.W @ H.T @ self.forces
        self.signs = np.where(mode.is_held, 0.0, mode.signs)
        self.pieces: list[tuple[float, Callable]] = []  # ends and interpolants
        self.end: float | None = None

    def rates(self, t: float, x: Numbers) -> Numbers:
        q, v = x[: self.n], x[self.n :]
        return np.concatenate([v, self.G @ self.loop.sliding(t, q, v, self.signs)])

    def at(self, t: float) -> tuple[Numbers, Numbers]:
        x = self.start
        if t > self.begin:
            x = next((f for end, f in self.pieces if t <= end), self.pieces[-1][1])(t)
        return x[: self.n].copy(), x[self.n :].copy()

    def margins(self, t: float, x: Numbers) -> Numbers:
        """Above 0 while the mode holds: speeds of sliding rows, room of forces, gaps."""
        loop, q, v = self.loop, x[: self.n], x[self.n :]
        low, high = (bound[self.held] for bound in loop.box(t, q, v, self.mode.closed))
        f = self.forces @ loop.sliding(t, q, v, self.signs)
        found = [*(high - f), *(f - low)]
        found += [self.signs[k] * (loop.J[k] @ v) for k, _ in loop.frictions if self.signs[k]]
        for k, stop in loop.stops:
            if self.mode.closed[k] == FREE:
                x = loop.J[k] @ q
                found += [gap for gap in (x - stop.lower, stop.upper - x) if np.isfinite(gap)]
        return np.array(found)

    def run(self, stop: float) -> None:
        """Up to the first margin that ends, or to this time."""
        scale = max(1.0, *abs(self.start))
        if stop <= self.begin:
            return
        solver = DOP853(
            self.rates, self.begin, self.start, stop, LONGEST_STEP,
            self.loop.tolerance, self.loop.tolerance * 0.1 * scale,
        )  # fmt: skip
        # what begins at 0 may stay there, up to rounding
        begin = self.margins(self.begin, self.start)
        floor = np.full(len(begin), 1e-14)
        floor[: 2 * len(self.held)] = 1e-10
        seen = begin > floor
        last = self.begin
        while solver.status == "running":
            solver.step()
            dense = solver.dense_output()
            self.pieces.append((solver.t, dense))
            for s in self.samples(solver.t_old, solver.t):
                margins = self.margins(s, dense(s))
                ended = np.flatnonzero((margins <= 0.0) & (seen | (margins < -1e-7)))
                if ended.size:
                    self.end = self.first(ended, last, s, dense)
                    return
                seen |= margins > floor
                last = s

    def samples(self, begin: float, end: float) -> list[float]:
        """Times within a step; many right behind the event."""
        h = (end - begin) / SAMPLES
        even = [begin + h * k for k in range(1, SAMPLES)] + [end]
        if begin > self.begin:
            return even
        near = [begin + h * 4.0**-k for k in range(20, 0, -1) if h * 4.0**-k > 1e-9]
        return [*near, *even]

    def first(self, ended: Numbers, last: float, s: float, dense: Callable) -> float:
        """The earliest end of some margins between two times."""
        found = []
        for i in ended:

            def margin(t: float, i: int = i) -> float:
                return self.margins(t, dense(t))[i]

            if margin(last) <= 0.0:
                raise Chattering(f"margin {i} of {self.mode.key} at {last}")
            found.append(brentq(margin, last, s, xtol=1e-15, rtol=1e-15))
        return min(found)

    def row(self, t: float) -> tuple[Numbers, ...]:
        """Positions, velocities, forces of frictions and stops, and how sure the mode is."""
        loop, (q, v) = self.loop, self.at(t)
        m = len(loop.J)
        friction, stop, sure = np.zeros(m), np.zeros(m), np.full(m, np.inf)
        f = np.zeros(m)
        f[self.held] = self.forces @ loop.sliding(t, q, v, self.signs)
        low, high = loop.box(t, q, v, np.full(m, FREE))
        for k, law in loop.frictions:
            if self.signs[k]:
                speed = loop.J[k] @ v
                friction[k] = self.signs[k] * law.at(speed, t, q, v)
                sure[k] = abs(speed)
            else:
                friction[k] = -np.clip(f[k], low[k], high[k])
                sure[k] = high[k] - abs(f[k])
        for k, limits in loop.stops:
            x = loop.J[k] @ q
            if self.mode.closed[k] == FREE:
                sure[k] = min(sure[k], x - limits.lower, limits.upper - x)
            else:
                stop[k] = f[k] + friction[k]
                side = 1 if self.mode.closed[k] == LOWER else -1
                sure[k] = side * f[k] + high[k]
        return q, v, friction, stop, sure
