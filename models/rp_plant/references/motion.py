"""Motions of the plant in long double: heyoka's Taylor method from event to event.

The terminal events of an integrator (solver.py) find the next event; what follows is decided at an
instant (plant.py).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import heyoka as hy
import numpy as np
from rparm.models.rp_plant.references.automaton import real
from rparm.models.rp_plant.references.plant import Plant
from rparm.models.rp_plant.references.solver import PLACE, Solver

from rparm.errors import UserError

PROBES = np.linspace(0, 1, 17)[1:-1]  # of a step, for indicators that fall below 0 within it
MISSED = -1e-13  # in the unit of an indicator
NEGLIGIBLE = 7.0  # Stribeck velocities, from where on the fall of friction is below rounding
QUIET = real(1e-9)  # s, after it breaks away a joint is too slow to come to rest: both are roots
INSTANT = real(2.0**-30)  # s, over which the speed of an indicator is taken


@dataclass(frozen=True)
class Event:
    """What happened, where, and how fast its indicator fell."""

    time: float  # s
    what: str  # forward, backward: breaks away or, sliding, comes to rest; lower, upper: an
    # impact, or a contact begins or ends; push: a compliant stop begins or ends to push
    joint: int  # 1 or 2
    speed: float  # of the indicator, in its unit per s


class Motion(Plant):
    """One motion from t = 0; arguments are those of Plant."""

    def __init__(
        self,
        solver: Solver,
        values: Mapping[str, float],
        rates: Mapping[str, float] | None = None,
        rest_height: float = 1e-15,
    ) -> None:
        super().__init__(solver, values, rates, rest_height)
        self._quiet = [real(0), real(0)]  # until then a joint that has broken away is not watched
        self.events: list[Event] = []

    # ---- Between events --------------------------------------------------------------------------

    def advance(self, end: float, most_events: int | None = None) -> None:
        """To time `end` in s, or to the event number `most_events`."""
        end = real(end)
        while self.time < end:
            ahead = min([end, *(quiet for quiet in self._quiet if quiet > self.time)])
            found = self._held_until(ahead) if all(self.joints.held) else self._move_until(ahead)
            if found is not None:
                self._happen(*found)
                if most_events is not None and len(self.events) >= most_events:
                    return

    def _watch(self) -> np.ndarray:
        numbers = self._numbers
        sides = self._sides()
        for i, joint in enumerate((1, 2)):
            held, direction = self.joints.held[i], self.joints.direction[i]
            contact, compliant = self._contacts.now[i], self._contacts.possible[i]
            numbers[PLACE[f"direction{joint}"]] = direction
            watched = {
                "forward": sides[i] >= 0 if held else direction != 0,
                "backward": held and sides[i] <= 0,
                "lower": not held and (self._rigid[i] or (contact >= 0 and compliant)),
                "upper": not held and (self._rigid[i] or (contact <= 0 and compliant)),
                "push": not held and contact != 0,
            }
            for what, counts in watched.items():
                counts = counts and self.time >= self._quiet[i]
                numbers[PLACE[f"watch_{what}{joint}"]] = real(counts)
        return numbers

    def _held_until(self, end: real) -> tuple[str, int, real] | None:
        """Rest until `end` or the first breakaway: reactions are linear in time, as inputs are."""
        _, first, _, breakaway = self._blocks()
        begin, self.time = self.time, end
        last = self._blocks()[1]
        self.time = begin
        slope = (last - first) / (end - begin)
        sides = self._sides()
        found = None
        for i in (0, 1):
            for what, sign in (("forward", 1), ("backward", -1)):
                if sign * sides[i] < 0 or sign * slope[i] <= 0:
                    continue
                at = begin + (breakaway[i] - sign * first[i]) / (sign * slope[i])
                if at <= end and (found is None or at < found[0]):
                    found = (at, what, i, abs(slope[i]))
        if found is None:
            self.time = end
            return None
        self.time = found[0]
        return found[1:]

    def _move_until(self, end: real) -> tuple[str, int, real] | None:
        taylor, (names, evaluate) = self._solver.integrator(
            tuple(self.joints.held), tuple(self._contacts.now)
        )
        numbers = self._watch()
        taylor.pars[:] = numbers[: len(taylor.pars)]
        taylor.time = self.time
        taylor.state[:] = self.state
        shorter = real(np.inf)
        while True:
            begin, state = taylor.time, taylor.state.copy()
            limit = min(self._longest(state), shorter)
            outcome, taken = taylor.step(max_delta_t=min(limit, end - begin), write_tc=True)
            missed = self._first_missed(taylor, evaluate, begin, taken)
            if missed is not None or self._is_too_far(state, taylor.state):
                # heyoka may not see an indicator that is 0 at the start fall again within the step
                shorter = (begin + taken if missed is None else missed) / 2 - begin / 2
                taylor.time, taylor.state[:] = begin, state
                continue
            shorter = real(np.inf)
            if -len(names) <= int(outcome) < 0:
                break
            if outcome not in (hy.taylor_outcome.success, hy.taylor_outcome.time_limit):
                raise UserError(f"the motion blows up near {float(taylor.time)!r} s")
            if taylor.time >= end:
                break
        self.time = real(taylor.time)
        self.state = taylor.state.copy()
        if not -len(names) <= int(outcome) < 0:
            self.time = end
            return None
        index = -int(outcome) - 1
        before = self.time - INSTANT
        z = evaluate(taylor.update_d_output(before), pars=numbers, time=before)
        return (*names[index], z[index] / INSTANT)

    def _strides(self, state: np.ndarray) -> list[tuple[int, real]]:
        """Of sliding joints with Stribeck friction: joint, change of its velocity in a step."""
        found = []
        for i in (0, 1):
            scale = self._get(f"stribeck_velocity{i + 1}")
            falls = self._get(f"breakaway_friction{i + 1}") > self._get(f"coulomb_friction{i + 1}")
            if falls and not self.joints.held[i]:
                away = abs(state[2 + i]) - NEGLIGIBLE * scale
                found.append((i, max(scale / 4, away / 2)))
        return found

    def _longest(self, state: np.ndarray) -> real:
        """Length of a step in s: far from 0, Stribeck friction is not seen in the coefficients."""
        strides = self._strides(state)
        if not strides:
            return real(np.inf)
        inertia, forces, friction, _ = self._solver.blocks(state, self._now())
        forces = forces + self._contacts.forces(state)
        rates = np.abs(self._moving(inertia, forces - friction))
        return min([stride / rates[i] for i, stride in strides if rates[i] > 0], default=np.inf)

    def _is_too_far(self, state: np.ndarray, after: np.ndarray) -> bool:
        """Return whether a velocity has changed by more than twice the stride."""
        return any(abs(after[2 + i] - state[2 + i]) > 2 * x for i, x in self._strides(state))

    def _first_missed(
        self, taylor: hy.taylor_adaptive_ldbl, evaluate: hy.cfunc_ldbl, begin: real, taken: real
    ) -> real | None:
        """A time within the step at which an indicator is below 0; None: there is none."""

        def lowest(at: real) -> real:
            return np.min(evaluate(taylor.update_d_output(at), pars=self._numbers, time=at)[:-1])

        starts_at_zero = lowest(begin) < -MISSED
        probes = PROBES if starts_at_zero else PROBES[-1:]
        for at in (begin + part * taken for part in probes):
            if lowest(at) < MISSED:
                return at
        return None

    def _happen(self, what: str, i: int, speed: real) -> None:
        self.events.append(Event(float(self.time), what, i + 1, float(speed)))
        if what == "push":
            self._contacts.pass_push(i)
        elif what in ("lower", "upper") and self._contacts.possible[i]:
            self.state[i] = self._get(f"{what}{i + 1}")
            self._contacts.pass_limit(i, what)
        elif what in ("lower", "upper"):
            self.state[i] = self._get(f"{what}{i + 1}")
            self._strike()
            self._decide()
        elif self.joints.held[i]:  # the acceleration is 0 still: the force gives the direction
            self.joints.held[i] = False
            self._quiet[i] = self.time + QUIET
            breaks = self._blocks()[3][i] > 0
            self.joints.direction[i] = (1 if what == "forward" else -1) if breaks else 0
        else:
            self.state[2 + i] = real(0)
            self._decide()
