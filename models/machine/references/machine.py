"""The machine as a co-simulation steps it in Jacobi order, each component solved to rounding.

Parameters are named like the system's variables, ``plant.m2``; one that is not given has the start
value that the model's FMU declares. The plant is solved by heyoka from event to event, as in
models/rp_plant/references; the reference motion is taken from models/closed_loop/references.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np
from rparm.models.closed_loop.references.closed_loop import reference_motion
from rparm.models.machine.references.components import (
    Actuator,
    Controller,
    Environment,
    Sensor,
    real,
)
from rparm.models.rp_plant.references.motion import Motion
from rparm.models.rp_plant.references.solver import Solver

from rparm import project
from rparm.errors import UserError
from rparm.fmi.fmu_file import read_model
from rparm.fmi.model import Model, Value

MODELS = Path(__file__).resolve().parents[2]
COMPONENTS = {
    "trajectory": "rp_trajectory", "controller": "rp_controller", "actuator": "rp_actuator",
    "plant": "rp_plant", "sensor": "rp_sensor", "environment": "rp_environment",
}  # fmt: skip
# input of a component: the output that feeds it
REFERENCES = {name: f"trajectory.{name}" for name in Controller.REFERENCES}
MEASURED = {name: f"sensor.{name}_measured" for name in Controller.STATES}
WIRES: dict[str, dict[str, str]] = {
    "controller": REFERENCES | MEASURED | {"payload_attached": "trajectory.payload_attached"},
    "actuator": {
        "tau1_cmd": "controller.tau1",
        "f2_cmd": "controller.f2",
        "dq1": "plant.dq1",
        "dq2": "plant.dq2",
    },
    "plant": {
        "tau1": "actuator.tau1",
        "f2": "actuator.f2",
        "ee_fx": "environment.ee_fx",
        "ee_fy": "environment.ee_fy",
        "ee_mz": "environment.ee_mz",
        "payload_attached": "trajectory.payload_attached",
    },
    "sensor": {"q1": "plant.q1", "q2": "plant.q2"},
    "environment": {name: f"plant.{name}" for name in Environment.INPUTS},
}
DISCRETE = (
    *("plant.mode1", "plant.mode2", "sensor.counts1", "sensor.counts2"),
    "trajectory.payload_attached",
)

Parameters = Mapping[str, Value]


class Plant(Motion):
    """The plant as a component; a new input changes modes and payload as the next step begins."""

    def step(self, inputs: dict[str, real], begin: real, end: real) -> None:
        """The motion until `end`, from event to event."""
        del begin
        self.set_inputs(inputs)
        self.advance(end)

    def read(self, inputs: dict[str, real]) -> dict[str, real]:
        """All Real outputs and the modes, with these inputs and the modes and payload of before."""
        self._put_inputs(inputs, {})
        found = self.outputs() | dict(zip(("mode1", "mode2"), map(real, self.modes), strict=True))
        inertia, forces, *_ = self._blocks()
        reaction = forces - inertia @ np.array([found["ddq1"], found["ddq2"]])
        for i, side in enumerate(self._sides()):
            if self.joints.held[i] and side == 0:  # also if it is about to break away
                found[f"friction{i + 1}"] = reaction[i]
        return found


class Machine:
    """One run, with `parameters` ``component.name`` and communication points in s, from 0."""

    def __init__(self, solver: Solver, parameters: Parameters, times: Sequence[float]) -> None:
        self._times = np.asarray(times, real)
        if len(times) == 0 or times[0] != 0 or np.any(np.diff(self._times) <= 0):
            raise UserError("times must ascend from 0")
        p = completed(parameters)
        grasp, release = (p["trajectory"][f"{name}_time"] for name in ("grasp", "release"))
        if grasp < release:
            for moment in (grasp, release):
                if np.abs(self._times - moment).min() < 1e-9:
                    raise UserError(f"the payload changes at the communication point {moment!r} s")
        attached = (self._times >= grasp) & (self._times < release)
        self._trajectory = reference_motion(p["trajectory"], self._times)
        self._trajectory["payload_attached"] = attached.astype(real)
        self._now: dict[str, real] = {}  # values of all outputs
        self._show("trajectory", self._reference(0))
        self._initialize(solver, p)

    def _initialize(self, solver: Solver, p: dict[str, dict[str, Value]]) -> None:
        """Make the components in the order in which their outputs follow from each other."""
        self.actuator = Actuator(p["actuator"])
        still = {name: p["plant"][name] for name in ("dq1", "dq2")}
        self._show("actuator", self.actuator.outputs(still))
        self._show("environment", dict.fromkeys(("ee_fx", "ee_fy", "ee_mz"), real(0)))
        # where the end effector is does not depend on the wrench
        self._show("plant", Plant(solver, p["plant"] | self._inputs("plant")).outputs())
        self.environment = Environment(p["environment"])
        self._show("environment", self.environment.outputs(self._inputs("environment")))
        self.plant = Plant(solver, p["plant"] | self._inputs("plant"))
        self._show("plant", self.plant.read(self._inputs("plant")))
        self.sensor = Sensor(p["sensor"], self._inputs("sensor"))
        self._show("sensor", self.sensor.outputs({}))
        self.controller = Controller(solver, p["controller"], self._inputs("controller"))
        self._show("controller", self.controller.outputs(self._inputs("controller")))

    def _reference(self, row: int) -> dict[str, real]:
        """Return outputs of the trajectory at a point."""
        return {name: column[row] for name, column in self._trajectory.items()}

    def _show(self, component: str, outputs: Mapping[str, real]) -> None:
        self._now |= {f"{component}.{name}": value for name, value in outputs.items()}

    def _inputs(self, component: str) -> dict[str, real]:
        return {name: self._now[source] for name, source in WIRES[component].items()}

    def _read(self, inputs: Mapping[str, dict[str, real]], row: int) -> dict[str, real]:
        """Return outputs of all components at a point, with these inputs."""
        self._show("trajectory", self._reference(row))
        for name in ("controller", "actuator", "sensor", "environment"):
            self._show(name, getattr(self, name).outputs(inputs[name]))
        self._show("plant", self.plant.read(inputs["plant"]))
        return dict(self._now)

    def run(self) -> tuple[list[dict[str, real]], list[dict[str, real]]]:
        """Return values at all points: read before inputs are set there, and after it."""
        inputs = {name: self._inputs(name) for name in WIRES}
        before, after = [], [self._read(inputs, 0)]
        before.append(after[0])
        for row in range(1, len(self._times)):
            begin, end = self._times[row - 1], self._times[row]
            for name in WIRES:
                getattr(self, name).step(inputs[name], begin, end)
            before.append(self._read(inputs, row))
            inputs = {name: self._inputs(name) for name in WIRES}
            after.append(self._read(inputs, row))
        return before, after


@cache
def declared() -> dict[str, Model]:
    return {
        component: read_model(project.built(MODELS / folder, ".fmu"))
        for component, folder in COMPONENTS.items()
    }


def completed(parameters: Parameters) -> dict[str, dict[str, Value]]:
    """Return values of all variables that have a start value, by component."""
    values = {component: dict(model.start_values) for component, model in declared().items()}
    for name, value in parameters.items():
        component, _, variable = name.partition(".")
        if component not in values or variable not in values[component]:
            raise UserError(f"the machine has no parameter {name!r}")
        values[component][variable] = value
    return values


def columns() -> list[str]:
    """Return all Real outputs, then the states that are not outputs, as `system` compares them."""
    outputs, states = [], []
    for component, model in declared().items():
        outputs += [f"{component}.{name}" for name in model.real_outputs]
        states += [f"{component}.{name}" for name in model.states]
    return list(dict.fromkeys((*outputs, *states)))
