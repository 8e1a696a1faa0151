"""The native FMUs, called as the page calls those in WebAssembly."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from fmpy.fmi1 import FMICallException

from tests.support.instances import Instance, LoadedFmu, set_value

STEP = 1e-3  # s
OUTPUTS = (
    "q1", "q2", "dq1", "dq2", "ddq1", "ddq2", "ee_x", "ee_y", "ee_vx", "ee_vy", "kinetic_energy",
    "potential_energy", "total_energy", "friction1", "friction2", "friction_power", "stop_impulse2",
    "impact_loss",
)  # fmt: skip
INPUTS = ("tau1", "f2", "ee_fx", "ee_fy")
MEASURED = ("q1_ref", "q2_ref", "q1", "q2", "dq1", "dq2")


class Native:
    """An FMU of this machine."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.loaded = LoadedFmu(path, folder)
        self.variables = {v.name: v for v in self.loaded.description.modelVariables}

    def set(self, instance: Instance, values: Mapping[str, float]) -> None:
        """Set variables of any type, one by one."""
        for name, value in values.items():
            set_value(instance.fmi, self.variables[name], value)

    @contextmanager
    def started(self, values: Mapping[str, float]) -> Iterator[Instance]:
        """An instance at time 0."""
        with Instance(self.loaded) as instance:
            instance.fmi.setupExperiment(startTime=0.0)
            self.set(instance, values)
            instance.fmi.enterInitializationMode()
            instance.fmi.exitInitializationMode()
            yield instance

    @staticmethod
    def steps(instance: Instance, inputs: np.ndarray) -> Iterator[None]:
        """Steps of 1 ms with rows (steps, INPUTS) of inputs."""
        for n, row in enumerate(inputs.tolist()):
            instance.set(**dict(zip(INPUTS, row, strict=True)))
            instance.step(n * STEP, STEP)
            yield

    def trajectory(self, values: Mapping[str, float], inputs: np.ndarray) -> bytes:
        """Outputs after each step, as doubles."""
        with self.started(values) as instance:
            rows = [instance.get(*OUTPUTS) for _ in self.steps(instance, inputs)]
        return np.array(rows).tobytes()

    def state(self, values: Mapping[str, float], inputs: np.ndarray) -> bytes:
        """The state after the last step, serialized."""
        with self.started(values) as instance:
            # as often read as in the page
            for _ in self.steps(instance, inputs):
                instance.get(*OUTPUTS)
            state = instance.fmi.getFMUState()
            serialized = instance.fmi.serializeFMUState(state)
            instance.fmi.freeFMUState(state)
        return serialized

    def refusal(self, values: Mapping[str, float], name: str, value: float) -> str:
        """What the FMU says when a variable of a running instance gets a value it refuses."""
        with self.started(values) as instance:
            try:
                self.set(instance, {name: value})
                instance.step(0.0, STEP)
            except FMICallException:
                return instance.messages[-1].text.replace("##", "#")
        raise AssertionError(f"{name} = {value} was not refused")


def coupled_trajectory(
    plant: Native,
    controller: Native,
    values: Mapping[str, Mapping[str, float]],
    reference: Sequence[float],
    efforts: np.ndarray,
) -> bytes:
    """Outputs of the plant after each step, coupled as the page couples both.

    `reference` has q1 (rad) and q2 (m) for the controller; rows (steps, 2) of efforts (N.m, N) are
    added to the controller's.
    """
    rows = []
    with plant.started(values["plant"]) as arm, controller.started(values["controller"]) as law:
        for n, (tau1, f2) in enumerate(efforts.tolist()):
            motion = arm.get("q1", "q2", "dq1", "dq2")
            law.set(**dict(zip(MEASURED, [*reference, *motion], strict=True)))
            own_tau1, own_f2 = law.get("tau1", "f2")
            arm.set(tau1=tau1 + own_tau1, f2=f2 + own_f2, ee_fx=0.0, ee_fy=0.0)
            arm.step(n * STEP, STEP)
            law.step(n * STEP, STEP)
            rows.append(arm.get(*OUTPUTS))
    return np.array(rows).tobytes()
