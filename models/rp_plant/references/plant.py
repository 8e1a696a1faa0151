"""The plant at an instant: which joints stick, slide or rest on a stop, impacts, outputs.

Between two events this stays as it is (motion.py). The automaton decides what follows an event.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from rparm.models.rp_plant.references import automaton, contacts, equations
from rparm.models.rp_plant.references.automaton import real
from rparm.models.rp_plant.references.equations import INPUTS, STATES
from rparm.models.rp_plant.references.solver import LIMITS, NUMBERS, PLACE, RATES, Solver

from rparm.errors import UserError

RIGID, AT_REST = 2, 2  # items of stops and of grasp
FREE = 2  # a mode


@dataclass
class Joints:
    """What is constant between two events."""

    held: list[bool] = field(default_factory=lambda: [False, False])
    direction: list[int] = field(default_factory=lambda: [0, 0])  # of sliding joints with friction


class Plant:
    """State, modes and sums; bouncing ends below `rest_height` (rad, m); `rates` of inputs."""

    def __init__(
        self,
        solver: Solver,
        values: Mapping[str, float],
        rates: Mapping[str, float] | None = None,
        rest_height: float = 1e-15,
    ) -> None:
        self._solver = solver
        self._rest_height = real(rest_height)
        self.time = real(0)
        self.state = np.array([values[name] for name in STATES], real)
        self.joints = Joints()
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
        """Record how close the decision is to another one."""
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
        """Decide which joints are held and which move from now on."""
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

    def _moving(self, inertia: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Accelerations while held joints stay so, (2,)."""
        held = self.joints.held
        if held[0] or held[1]:
            return np.array([real(0) if held[i] else forces[i] / inertia[i, i] for i in (0, 1)])
        return automaton.after_impact(inertia, np.zeros(2, real), forces)

    # ---- What is read ----------------------------------------------------------------------------

    @property
    def modes(self) -> tuple[int, int]:
        return tuple(0 if self.joints.held[i] else self.joints.direction[i] or FREE for i in (0, 1))

    def outputs(self) -> dict[str, real]:
        """Return all Real outputs of the FMU at this time."""
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
