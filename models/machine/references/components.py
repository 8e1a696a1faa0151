"""The machine's components with held inputs, each from its equations, without the code of the FMUs.

A component takes a step to the next communication point with the inputs that it was given; between
two points nothing reaches it. All numbers are long doubles. Names are those of the FMUs.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import mpmath as mp
import numpy as np
from rparm.models.rp_plant.references.equations import PARAMETERS as PLANT_PARAMETERS
from rparm.models.rp_plant.references.solver import NUMBERS, PLACE, Solver
from rparm.models.rp_sensor.references.make_references import noise

from rparm.errors import UserError

real = np.longdouble
Values = Mapping[str, float]
JOINTS = (1, 2)
UNKNOWN_TO_THE_CONTROLLER = (
    "armature", "damping", "coulomb_friction", "breakaway_friction", "stribeck_velocity",
)  # fmt: skip


class Ticks:
    """Times start + k period of a component that works at them."""

    def __init__(self, period: float, start: float = 0.0) -> None:
        self._period, self._start = real(period), real(start)
        self.next = 1

    def time(self, k: int) -> real:
        return self._start + k * self._period

    def until(self, end: real) -> Iterator[int]:
        """Ticks before `end`; none may be at `end`, where the order would be undefined."""
        while self.time(self.next) < end:
            yield self.next
            self.next += 1
        if self.time(self.next) - end < 1e-9:
            raise UserError(f"tick {self.next} is at the communication point {float(end)!r} s")


class Actuator:
    """Motors without inertia: current loops of first order, exact for held inputs."""

    INPUTS = ("tau1_cmd", "f2_cmd", "dq1", "dq2")

    def __init__(self, parameters: Values) -> None:
        p = {name: real(value) for name, value in parameters.items()}
        self._parameters = p
        self.force = [p[f"torque_constant{i}"] * p[f"gear_ratio{i}"] for i in JOINTS]  # N.m/A, N/A
        self.current = [p["current1"], p["current2"]]

    def step(self, inputs: Values, begin: real, end: real) -> None:
        """Currents at `end`."""
        p = self._parameters
        for j, (i, effort) in enumerate(zip(JOINTS, ("tau1_cmd", "f2_cmd"), strict=True)):
            back = self.force[j] * real(inputs[f"dq{i}"])  # V
            ends = [(sign * p[f"voltage_max{i}"] - back) / p[f"resistance{i}"] for sign in (-1, 1)]
            low, high = max(ends[0], -p[f"current_max{i}"]), min(ends[1], p[f"current_max{i}"])
            if not low < high:
                raise UserError(f"joint {i} is beyond the no-load speed of its motor")
            target = min(max(real(inputs[effort]) / self.force[j], low), high)
            decay = np.exp((begin - end) / p[f"time_constant{i}"])
            self.current[j] = target + (self.current[j] - target) * decay

    def outputs(self, inputs: Values) -> dict[str, real]:
        """Return all Real outputs with these inputs."""
        p, found = self._parameters, {}
        for j, (i, effort) in enumerate(zip(JOINTS, ("tau1", "f2"), strict=True)):
            found[effort] = self.force[j] * self.current[j]
            found[f"current{i}"] = self.current[j]
            found[f"voltage{i}"] = p[f"resistance{i}"] * self.current[j] + self.force[j] * real(
                inputs[f"dq{i}"]
            )
        return found


@dataclass(frozen=True)
class Sample:
    """What the encoders took at a tick."""

    time: real  # s, of the communication point whose positions they were given
    positions: tuple[real, ...]  # (2,) rad, m
    margins: tuple[real, ...]  # (2,) rad, m: how far the next count is


class Sensor:
    """Encoders: counts at ticks (`samples`), shown `latency` ticks later; velocities from them."""

    INPUTS = ("q1", "q2")

    def __init__(self, parameters: Values, inputs: Values, start: float = 0.0) -> None:
        self._parameters = parameters
        self._ticks = Ticks(parameters["sample_time"], start)
        self.samples: list[Sample] = []
        self._counts: list[list[int]] = []
        self._sample(inputs, real(start), 0)

    def _sample(self, inputs: Values, time: real, tick: int) -> None:
        p, counts, margins = self._parameters, [], []
        positions = tuple(real(inputs[f"q{i}"]) for i in JOINTS)
        for j, (i, position) in enumerate(zip(JOINTS, positions, strict=True)):
            resolution = real(p[f"resolution{i}"])
            if p[f"noise{i}"] != 0:
                normal = mp.nstr(noise(int(p["seed"]), j, tick), 25)
                position = position + real(p[f"noise{i}"]) * real(normal)
            place = position / resolution + real(0.5)
            counts.append(int(np.floor(place)))
            margins.append(np.abs(place - np.rint(place)) * resolution)
        self.samples.append(Sample(time, positions, tuple(margins)))
        self._counts.append(counts)

    def step(self, inputs: Values, begin: real, end: real) -> None:
        """The ticks until `end`."""
        for k in self._ticks.until(end):
            self._sample(inputs, begin, k)

    def _shown(self, back: int) -> list[int]:
        """Counts that are shown, `back` ticks ago."""
        place = len(self._counts) - 1 - int(self._parameters["latency"]) - back
        return self._counts[max(place, 0)]

    def outputs(self, inputs: Values) -> dict[str, real]:
        """Return all Real outputs, and the counts; between two ticks none depends on the inputs."""
        del inputs
        p, found = self._parameters, {}
        now, before = self._shown(0), self._shown(1)
        for j, i in enumerate(JOINTS):
            resolution = real(p[f"resolution{i}"])
            found[f"q{i}_measured"] = now[j] * resolution
            found[f"dq{i}_measured"] = (now[j] - before[j]) * resolution / real(p["sample_time"])
            found[f"counts{i}"] = real(now[j])
        return found


class Environment:
    """The compliant wall: a force along its outward normal, never towards it."""

    INPUTS = ("ee_x", "ee_y", "ee_vx", "ee_vy", "ee_angle", "ee_rate")

    def __init__(self, parameters: Values) -> None:
        self._parameters = {name: real(value) for name, value in parameters.items()}

    def step(self, inputs: Values, begin: real, end: real) -> None:
        """Nothing happens: there are no states."""

    def outputs(self, inputs: Values) -> dict[str, real]:
        """Wrench at the origin of frame 2, penetration and force of the wall."""
        p = self._parameters
        x, y, vx, vy, turn, rate = (real(inputs[name]) for name in self.INPUTS)
        along = np.array([np.cos(turn), np.sin(turn)])
        across = np.array([-np.sin(turn), np.cos(turn)])
        arm = p["tip_z"] * along + p["tip_x"] * across
        normal = np.array([np.cos(p["angle"]), np.sin(p["angle"])])
        velocity = np.array([vx, vy]) + rate * np.array([-arm[1], arm[0]])
        penetration = max(real(0), p["position"] - normal @ (np.array([x, y]) + arm))
        force = real(0)
        if penetration > 0:
            force = max(real(0), p["stiffness"] * penetration - p["damping"] * (normal @ velocity))
        push = force * normal
        return {
            "ee_fx": push[0],
            "ee_fy": push[1],
            "ee_mz": arm[0] * push[1] - arm[1] * push[0],
            "penetration": penetration,
            "wall_force": force,
        }


class Controller:
    """Computed torque, with integral action, by the plant's Lagrangian and its own parameters."""

    REFERENCES = ("q1_ref", "q2_ref", "dq1_ref", "dq2_ref", "ddq1_ref", "ddq2_ref")
    STATES = ("q1", "q2", "dq1", "dq2")
    INPUTS = (*REFERENCES, *STATES, "payload_attached")

    def __init__(
        self, solver: Solver, parameters: Values, inputs: Values, start: float = 0.0
    ) -> None:
        self._solver = solver
        self._parameters = p = {
            name: real(value) for name, value in parameters.items() if not isinstance(value, str)
        }
        self._numbers = np.zeros(len(NUMBERS), real)
        for name in PLANT_PARAMETERS:
            if name[:-1] not in UNKNOWN_TO_THE_CONTROLLER:
                self._numbers[PLACE[name]] = p[name]
        for i in JOINTS:
            self._numbers[PLACE[f"stribeck_velocity{i}"]] = 1  # it divides
        self._gains = [np.array([p[f"{k}{i}"] for i in JOINTS]) for k in ("Kp", "Kd", "Ki")]
        self._limits = np.array([p["tau1_max"], p["f2_max"]])
        self._integral = np.array([p["integral1"], p["integral2"]])
        self._is_sampled = p["sample_time"] > 0
        if self._is_sampled:
            self._ticks = Ticks(p["sample_time"], start)
            self._rate = np.zeros(2, real)
            self._take(inputs, real(0))
            self._effort, self._due = self._next, real(np.inf)

    def _law(self, inputs: Values, integral: np.ndarray) -> np.ndarray:
        """Efforts, (2,) N.m and N; within their limits, or the references would not hold."""
        reference = np.array([inputs[name] for name in self.REFERENCES], real)
        state = np.array([inputs[name] for name in self.STATES], real)
        Kp, Kd, _ = self._gains
        wanted = reference[4:] + Kp * (reference[:2] - state[:2])
        wanted = wanted + Kd * (reference[2:4] - state[2:]) + integral
        self._numbers[PLACE["attached"]] = real(bool(inputs["payload_attached"]))
        inertia, forces, *_ = self._solver.blocks(state, self._numbers)
        effort = inertia @ wanted - forces
        if np.any(np.abs(effort) > self._limits):
            raise UserError("the references are for efforts within the controller's limits")
        return effort

    def _rates(self, inputs: Values) -> np.ndarray:
        """Return rates of the integral parts, (2,)."""
        return self._gains[2] * np.array(
            [real(inputs[f"q{i}_ref"]) - real(inputs[f"q{i}"]) for i in JOINTS]
        )

    def _take(self, inputs: Values, since: real) -> None:
        """A sample, `since` s after the last one."""
        self._integral = self._integral + since * self._rate
        self._next, self._rate = self._law(inputs, self._integral), self._rates(inputs)

    def step(self, inputs: Values, begin: real, end: real) -> None:
        """Return the integral parts, and efforts of the sampled form, at `end`."""
        if not self._is_sampled:
            self._integral = self._integral + (end - begin) * self._rates(inputs)
            return
        for k in self._ticks.until(end):
            if self._due <= self._ticks.time(k):
                self._effort = self._next
            self._take(inputs, self._parameters["sample_time"])
            self._due = self._ticks.time(k) + self._parameters["delay"]
        if self._due <= end:
            if end - self._due < 1e-9:
                raise UserError(f"an effort changes at the communication point {float(end)!r} s")
            self._effort, self._due = self._next, real(np.inf)

    def outputs(self, inputs: Values) -> dict[str, real]:
        """Return all Real outputs and the integral parts with these inputs."""
        effort = self._effort if self._is_sampled else self._law(inputs, self._integral)
        errors = {
            f"{name}_error": real(inputs[f"{name}_ref"]) - real(inputs[name])
            for name in self.STATES
        }
        integrals = {f"integral{i}": self._integral[i - 1] for i in JOINTS}
        return {"tau1": effort[0], "f2": effort[1], **errors, **integrals}
