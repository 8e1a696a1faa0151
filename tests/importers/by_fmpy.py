"""What the importers are compared with: the same co-simulations and Euler steps through fmpy."""

from ctypes import Array, c_double
from typing import Any

import numpy as np
from fmpy import fmi2, fmi3

from tests.support.instances import STATES, Instance, LoadedFmu

Values = Array[c_double]


class Arm2(Instance):
    """An instance of FMI 2.0; beyond Instance, Model Exchange by names that both versions have."""

    def start_continuous_time(self) -> None:
        self.fmi.newDiscreteStates()
        self.fmi.enterContinuousTimeMode()

    def get_derivatives(self, dx: Values) -> None:
        self.fmi.getDerivatives(dx, len(dx))


class Arm3:
    """An instance of FMI 3.0, used like that of 2.0; a context manager that frees it."""

    def __init__(self, loaded: LoadedFmu, kind: type = fmi3.FMU3Slave) -> None:
        self.references = loaded.references
        element = loaded.description.coSimulation
        self.fmi = kind(
            guid=loaded.description.guid,
            modelIdentifier=element.modelIdentifier,
            unzipDirectory=str(loaded.folder),
            instanceName="arm",
        )
        self.fmi.instantiate()

    def __enter__(self) -> "Arm3":
        return self

    def __exit__(self, *_: object) -> None:
        self.fmi.freeInstance()

    def initialize(self, start: float = 0.0, **values: float) -> None:
        self.set(**values)
        self.fmi.enterInitializationMode(startTime=start)
        self.fmi.exitInitializationMode()

    def set(self, **values: float) -> None:
        self.fmi.setFloat64([self.references[name] for name in values], list(values.values()))

    def get(self, *names: str) -> list[float]:
        return self.fmi.getFloat64([self.references[name] for name in names])

    def step(self, t: float, h: float) -> None:
        self.fmi.doStep(t, h)

    def start_continuous_time(self) -> None:
        self.fmi.updateDiscreteStates()
        self.fmi.enterContinuousTimeMode()

    def get_derivatives(self, dx: Values) -> None:
        self.fmi.getContinuousStateDerivatives(dx, len(dx))


def instance(loaded: LoadedFmu, model_exchange: bool = False) -> Arm2 | Arm3:
    """A new instance, of the FMU's version."""
    if loaded.description.fmiVersion == "2.0":
        return Arm2(loaded, fmi2.FMU2Model if model_exchange else fmi2.FMU2Slave)
    return Arm3(loaded, fmi3.FMU3Model if model_exchange else fmi3.FMU3Slave)


def inputs_at(plan: dict[str, Any], i: int) -> dict[str, float]:
    return {name: values[i] for name, values in plan["inputs"].items()}


def times(plan: dict[str, Any]) -> list[float]:
    return [plan["start"] + i * plan["step"] for i in range(plan["steps"] + 1)]


def co_simulation(loaded: LoadedFmu, plan: dict[str, Any], held: int = 0) -> np.ndarray:
    """Return the outputs (steps + 1, outputs); a step holds the inputs of so many steps later."""
    with instance(loaded) as arm:
        arm.initialize(**plan["parameters"], **plan["initial"], **inputs_at(plan, 0))
        rows = [arm.get(*plan["outputs"])]
        for i, t in enumerate(times(plan)[:-1]):
            arm.set(**inputs_at(plan, i + held))
            arm.step(t, plan["step"])
            rows.append(arm.get(*plan["outputs"]))
    return np.array(rows)


def euler(loaded: LoadedFmu, plan: dict[str, Any]) -> np.ndarray:
    """Outputs (steps + 1, outputs) of Model Exchange by Euler's method, inputs as they are."""
    x, dx = (c_double * len(STATES))(), (c_double * len(STATES))()
    points = times(plan)
    with instance(loaded, model_exchange=True) as arm:
        arm.initialize(**plan["parameters"], **plan["initial"], **inputs_at(plan, 0))
        arm.start_continuous_time()
        rows = [arm.get(*plan["outputs"])]
        for i in range(plan["steps"]):
            arm.fmi.getContinuousStates(x, len(x))
            arm.get_derivatives(dx)
            for k in range(len(x)):
                x[k] += dx[k] * (points[i + 1] - points[i])
            arm.fmi.setTime(points[i + 1])
            arm.fmi.setContinuousStates(x, len(x))
            arm.set(**inputs_at(plan, i + 1))
            arm.fmi.completedIntegratorStep()
            rows.append(arm.get(*plan["outputs"]))
    return np.array(rows)
