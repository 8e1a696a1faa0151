"""RPPlant in Model Exchange: a small importer around fmpy's CVode, which sets discrete inputs and
parameters in event mode only. fmpy's own loop sets Booleans in continuous-time mode, too."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from ctypes import c_double
from pathlib import Path
from typing import Any

import numpy as np
from fmpy.sundials import CVodeSolver

from tests.support.instances import instantiated, set_value

STATES = ("q1", "q2", "dq1", "dq2")


def unknowns(description: Any) -> list[str]:
    """Real variables that follow from states and inputs, of fmpy's model description."""
    return [
        v.name
        for v in description.modelVariables
        if v.type in ("Real", "Float64")
        and v.variability == "continuous"
        and v.initial == "calculated"
    ]


class NoInput:
    """What the solver asks for inputs: they stay as they were set."""

    def apply(self, time: float) -> None:
        """Change nothing."""


class PlantModel:
    """An instance in continuous-time mode.

    Parameters
    ----------
    fmu : Any
        fmpy's instance.
    description : Any
        fmpy's model description.
    updates : int
        How often discrete states are updated at each event.
    """

    def __init__(self, fmu: Any, description: Any, updates: int) -> None:
        self.fmu = fmu
        self.is_fmi3 = description.fmiVersion != "2.0"
        self.variables = {v.name: v for v in description.modelVariables}
        self.counts = (description.numberOfContinuousStates, description.numberOfEventIndicators)
        self.updates = updates
        self.jumps: list[bool] = []  # whether states changed, of each update

    def set(self, name: str, value: float | bool) -> None:
        """Set a variable of any type."""
        set_value(self.fmu, self.variables[name], value)

    def get(self, name: str) -> float:
        """Value of a variable."""
        variable = self.variables[name]
        return getattr(self.fmu, f"get{variable.type}")([variable.valueReference])[0]

    def set_states(self, x: np.ndarray) -> None:
        """Set q1, q2, dq1, dq2 (4,); modes stay."""
        self.fmu.setContinuousStates((c_double * len(x))(*x), len(x))

    def handle_event(self, changes: Mapping[str, float | bool]) -> None:
        """Set `changes` in event mode and update the discrete states."""
        self.fmu.enterEventMode()
        self.update(changes)

    def update(self, changes: Mapping[str, float | bool]) -> None:
        """In event mode: the same, and back to continuous-time mode."""
        for name, value in changes.items():
            self.set(name, value)
        for _ in range(self.updates):
            fmu = self.fmu
            answer = fmu.updateDiscreteStates() if self.is_fmi3 else fmu.newDiscreteStates()
            needs_update, terminates, nominals_changed, states_changed, has_next, _ = answer
            assert not (needs_update or terminates or nominals_changed or has_next)
            self.jumps.append(bool(states_changed))
        self.fmu.enterContinuousTimeMode()

    def simulate(
        self,
        times: np.ndarray,
        schedule: Mapping[float, Mapping[str, float | bool]],
        tolerance: float,
        names: tuple[str, ...],
        efforts: Callable[[float], Mapping[str, float]] | None = None,
    ) -> np.ndarray:
        """Values of `names` at `times` (s), one row each, before the changes at that time.

        `efforts`: inputs that move with the time (s). fmpy's own loop sets them in its root
        function only, so that its right-hand side sees old ones.
        """

        def set_time(time: float) -> None:
            self.fmu.setTime(time)
            for name, value in (efforts(time) if efforts else {}).items():
                self.set(name, value)

        solver = CVodeSolver(
            *self.counts,
            self.fmu.getContinuousStates,
            self.fmu.setContinuousStates,
            self.fmu.getContinuousStateDerivatives if self.is_fmi3 else self.fmu.getDerivatives,
            self.fmu.getEventIndicators,
            self.fmu.getNominalsOfContinuousStates,
            set_time,
            NoInput(),
            self.get("time"),
            relativeTolerance=tolerance,
            maxNumSteps=100000,
        )
        rows = []
        time = self.get("time")
        for point in sorted({*times, *schedule}):
            while time < point:
                is_event, _, time = solver.step(time, point)
                set_time(time)
                if is_event:
                    self.handle_event({})
                    solver.reset(time)
            if point in times:
                rows.append([self.get(name) for name in names])
            if point in schedule:
                self.handle_event(schedule[point])
                solver.reset(time)
        return np.array(rows)


@contextmanager
def model(path: Path, updates: int = 1, **values: float | bool) -> Iterator[PlantModel]:
    """An instance at t = 0, with these parameters, start values and inputs."""
    with instantiated(path, "ModelExchange") as (fmu, description):
        plant = PlantModel(fmu, description, updates)
        start = {"startTime": 0.0}
        if not plant.is_fmi3:
            fmu.setupExperiment(**start)
        fmu.enterInitializationMode(**(start if plant.is_fmi3 else {}))
        for name, value in values.items():
            plant.set(name, value)
        fmu.exitInitializationMode()
        plant.update({})
        yield plant
        fmu.terminate()
