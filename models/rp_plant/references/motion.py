"""Motions of the plant in long double: heyoka's Taylor method from event to event.

Which joints are held, in which direction the others slide, and on which stop a joint rests stays as
it is between two events. The terminal events of an integrator (solver.py) find the next one, the
automaton decides what follows.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import heyoka as hy
import numpy as np

from cosim.errors import UserError
from models.rp_plant.references import automaton, contacts, equations
from models.rp_plant.references.automaton import real
from models.rp_plant.references.equations import INPUTS, STATES
from models.rp_plant.references.solver import LIMITS, NUMBERS, PLACE, RATES, Solver

RIGID, AT_REST = 2, 2  # items of stops and of grasp
FREE = 2  # a mode
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


@dataclass
class Joints:
    """What is constant between two events."""

    held: list[bool] = field(default_factory=lambda: [False, False])
    direction: list[int] = field(default_factory=lambda: [0, 0])  # of sliding joints with friction


class Motion:
    """One motion from t = 0.

    Parameters
    ----------
    solver : Solver
    values : mapping
        Parameters, initial states and inputs by the FMU's names.
    rates : mapping, optional
        Of the inputs, per s.
    rest_height : float, optional
        Bouncing ends where the next bounce goes no higher (rad, m).
    """

    def __init__(
        self,
        solver: Solver,
        values: Mapping[str, float],
        rates: Mapping[str, float] | None = None,
        rest_height: float = 1e-15,
    ) -> None:
        self._solver = solver
        self._rest_height = real(rest_height)
        self._quiet = [real(0), real(0)]  # until then a joint that has broken away is not watched
        self.time = real(0)
        self.state = np.array([values[name] for name in STATES], real)
        self.joints = Joints()
        self.events: list[Event] = []
        self.margin = np.inf  # by which decisions could have been others, in parts of the forces
        self.impulse = np.zeros(2, real)
        self.impact_loss = self.grasp_loss = real(0)
        self._numbers = np.zeros(len(NUMBERS), real)
        for name, value in equations.prepared(dict(values)).items():
            self._put(name, value)
        for name in (*LIMITS, *contacts.PARAMETERS):
            self._put(name, values[name])
        self._rigid = [values[f"stops{i}"] == RIGID for i in (1, 2)]
        self._restitution = [real(values[f"restitution{i}"]) for i in (1, 2)]
        self._at_rest_grasp = values["grasp"] == AT_REST
        self._put("attached", float(bool(values["payload_attached"])))
        self._put_inputs(values, rates or {})
        self._contacts = contacts.Contacts(values)
        self._strike()
        self._decide()

    def _put(self, name: str, value: float) -> None:
        self._numbers[PLACE[name]] = real(value)

    def _get(self, name: str) -> real:
        return self._numbers[PLACE[name]]

    # ---- What is decided at an instant -----------------------------------------------------------

    def _put_inputs(self, values: Mapping[str, float], rates: Mapping[str, float]) -> None:
        """Inputs from now on; `values` are those at this time."""
        for name, rate in zip(INPUTS, RATES, strict=True):
            if name in values:
                slope = real(rates.get(name, 0.0))
                self._put(rate, slope)
                self._put(name, real(values[name]) - slope * self.time)

    def set_inputs(
        self, values: Mapping[str, float], rates: Mapping[str, float] | None = None
    ) -> None:
        """Change inputs, payload_attached among them, at this time."""
        self._put_inputs(values, rates or {})
        attached = float(values.get("payload_attached", self._get("attached")))
        if attached != self._get("attached"):
            inertia, *_ = self._blocks()
            momenta = inertia @ self.state[2:]
            self._put("attached", attached)
            if attached and self._at_rest_grasp:
                energy = self.state[2:] @ momenta
                self.state[2:] = automaton.after_impact(
                    self._blocks()[0], np.zeros(2, real), momenta
                )
                self.grasp_loss += (energy - self.state[2:] @ momenta) / 2
        self._strike()
        self._decide()

    def _now(self) -> np.ndarray:
        """Numbers with the inputs of this time."""
        numbers = self._numbers.copy()
        for name, rate in zip(INPUTS, RATES, strict=True):
            numbers[PLACE[name]] += numbers[PLACE[rate]] * self.time
        for i in (0, 1):
            numbers[PLACE[f"direction{i + 1}"]] = self.joints.direction[i]
        return numbers

    def _blocks(self) -> tuple[np.ndarray, ...]:
        inertia, forces, friction, breakaway = self._solver.blocks(self.state, self._now())
        return inertia, forces + self._contacts.forces(self.state), friction, breakaway

    def _sides(self) -> list[int]:
        """+1: on the lower stop, -1: on the upper one, 0: on none."""
        return [
            (int(self.state[i] == self._get(f"lower{i + 1}"))
             - int(self.state[i] == self._get(f"upper{i + 1}"))) if self._rigid[i] else 0
            for i in (0, 1)
        ]  # fmt: skip

    def _resting(self) -> list[bool]:
        breakaway, sides = self._blocks()[3], self._sides()
        return [self.state[2 + i] == 0 and (breakaway[i] > 0 or sides[i] != 0) for i in (0, 1)]

    def _slide(self, at_rest: Sequence[bool]) -> None:
        """Directions of the joints that move."""
        breakaway = self._blocks()[3]
        for i in (0, 1):
            self.joints.held[i] = at_rest[i]
            moves = not at_rest[i] and breakaway[i] > 0
            self.joints.direction[i] = int(np.sign(self.state[2 + i])) if moves else 0

    def _gauss(self) -> np.ndarray:
        """Accelerations of both joints after those that move have their directions."""
        at_rest = self._resting()
        self._slide(at_rest)
        inertia, forces, friction, breakaway = self._blocks()
        ddq = automaton.accelerations(inertia, forces - friction, at_rest, breakaway, self._sides())
        self._judge(inertia @ ddq - forces + friction, at_rest, breakaway, ddq)
        return ddq

    def _judge(
        self, left: np.ndarray, at_rest: Sequence[bool], breakaway: np.ndarray, ddq: np.ndarray
    ) -> None:
        """Note how near the decision is to another one."""
        for i in (0, 1):
            if at_rest[i] and ddq[i] == 0:
                closed = self._sides()[i]
                open_sides = [s for s in (1, -1) if closed == 0 or s == closed]
                size = max(abs(left[i]), breakaway[i], real(1e-3))
                for side in open_sides:
                    self.margin = min(self.margin, (breakaway[i] + side * left[i]) / size)
            elif at_rest[i]:
                self.margin = min(self.margin, abs(ddq[i]))

    def _decide(self) -> None:
        """Who is held and who moves from now on."""
        ddq = self._gauss()
        breakaway = self._blocks()[3]
        for i in (0, 1):
            if self.joints.held[i] and ddq[i] != 0:
                self.joints.held[i] = False
                self.joints.direction[i] = int(np.sign(ddq[i])) if breakaway[i] > 0 else 0

    def _strike(self) -> None:
        """Impacts at this instant, until no joint moves into the stop it is on."""
        sides = self._sides()
        for _ in range(automaton.MOST_IMPACTS):
            if all(sides[i] * self.state[2 + i] >= 0 for i in (0, 1)):
                self._contacts.find(self.state)
                return
            self._strike_once(sides)
        raise UserError("impacts at one instant do not end")

    def _strike_once(self, sides: list[int]) -> None:
        inertia, *_ = self._blocks()
        before = self.state[2:].copy()
        restitution = list(self._restitution)
        while True:
            impulse = automaton.impulses(inertia, before, sides, restitution)
            after = automaton.after_impact(inertia, before, impulse)
            for i in (0, 1):  # exact where the law is an equation
                if impulse[i] != 0:
                    after[i] = -restitution[i] * before[i] + real(0)
            self.state[2:] = after
            plastic = self._last_bounces(before, sides, restitution)
            if not plastic:
                break
            for i in plastic:
                restitution[i] = real(0)
        self.impulse += impulse
        self.impact_loss -= impulse @ (before + after) / 2

    def _last_bounces(
        self, before: np.ndarray, sides: list[int], restitution: list[real]
    ) -> list[int]:
        """Joints whose next bounce would go too low to count."""
        bouncing = [i for i in (0, 1) if sides[i] * before[i] < 0 and restitution[i] > 0]
        if not bouncing:
            return []
        margin, joints = self.margin, Joints(list(self.joints.held), list(self.joints.direction))
        ddq = self._gauss()
        self.margin, self.joints = margin, joints
        found = []
        for i in bouncing:
            into, away = -sides[i] * ddq[i], self.state[2 + i]
            if into > 0 and away**2 <= 2 * into * self._rest_height:
                found.append(i)
        return found

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
        """Numbers of this combination."""
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
        """Nothing moves: the reactions are linear in time, as the inputs are."""
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
        """Whether a velocity has changed by more than twice the stride."""
        return any(abs(after[2 + i] - state[2 + i]) > 2 * x for i, x in self._strides(state))

    def _moving(self, inertia: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Accelerations while held joints stay so, (2,)."""
        held = self.joints.held
        if held[0] or held[1]:
            return np.array([real(0) if held[i] else forces[i] / inertia[i, i] for i in (0, 1)])
        return automaton.after_impact(inertia, np.zeros(2, real), forces)

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
        elif self.joints.held[i]:  # the acceleration is 0 still: the direction is that of the force
            self.joints.held[i] = False
            self._quiet[i] = self.time + QUIET
            breaks = self._blocks()[3][i] > 0
            self.joints.direction[i] = (1 if what == "forward" else -1) if breaks else 0
        else:
            self.state[2 + i] = real(0)
            self._decide()

    # ---- What is read ----------------------------------------------------------------------------

    @property
    def modes(self) -> tuple[int, int]:
        return tuple(0 if self.joints.held[i] else self.joints.direction[i] or FREE for i in (0, 1))

    def outputs(self) -> dict[str, real]:
        """All Real outputs of the FMU at this time."""
        inertia, forces, friction, breakaway = self._blocks()
        held = self.joints.held
        ddq = self._moving(inertia, forces - friction)
        reaction = forces - inertia @ ddq
        found = dict(
            zip(
                self._solver.output_names,
                self._solver.outputs(self.state, ddq, self._now()),
                strict=True,
            )
        )
        stored = self._contacts.energy(self.state)
        found |= {name: found[name] + stored for name in ("potential_energy", "total_energy")}
        friction, stops, power = list(friction), list(self._contacts.forces(self.state)), real(0)
        for i in (0, 1):
            if held[i]:  # friction carries what it can, the stop the rest
                friction[i] = min(max(reaction[i], -breakaway[i]), breakaway[i])
                stops[i] += friction[i] - reaction[i] if self._sides()[i] != 0 else real(0)
            rate = self.state[2 + i]
            power += (friction[i] + self._get(f"damping{i + 1}") * rate) * rate
        found |= {"friction1": friction[0], "friction2": friction[1], "friction_power": power}
        found |= {"stop_force1": stops[0], "stop_force2": stops[1]}
        found |= {"stop_impulse1": self.impulse[0], "stop_impulse2": self.impulse[1]}
        found |= {"impact_loss": self.impact_loss, "grasp_loss": self.grasp_loss}
        return found
