"""Derivatives with respect to all that an FMU of FMI 3.0 lists in its dependencies, in the modes in
which the importer can change it: against differences. FMI 3.0, sections 2.2.11 and 2.4.8.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi3 import FMU3Model
from fmpy.model_description import ModelDescription, ModelVariable

from tests.support.all_fmus import NAMES

MODES = ("initialization", "event", "continuous-time")
STEP = 1e-4  # of a value, relative to 1 + its absolute value
BOUND = 2e-5  # of the largest value among the two ways, or 1

# away from start values, where derivatives vanish by symmetry
MOVED = {"q1": 0.3, "q2": 0.2, "dq1": 0.7, "dq2": -0.4, "tau1": 2.0, "f2": 1.5}
# and from the gain at which integral action ends
MOVED |= {"Ki1": 0.8, "Ki2": 0.9}
# and from 0, where differences are one-sided
MOVED |= {"armature1": 0.2, "armature2": 0.3, "damping1": 0.4, "damping2": 0.3}
MOVED |= {"coulomb_friction1": 0.6, "coulomb_friction2": 0.5}
MOVED |= {"breakaway_friction1": 0.9, "breakaway_friction2": 0.8}
MOVED |= {"stribeck_velocity1": 0.8, "stribeck_velocity2": 0.9}


@contextmanager
def moved(fmu: Path, name: str, mode: str) -> Iterator[tuple[FMU3Model, ModelDescription]]:
    """An instance for Model Exchange in this mode, moved away from its start values."""
    path = fmu.parent / "fmi3" / f"{name}.fmu"
    description = fmpy.read_model_description(path)
    model = FMU3Model(
        guid=description.guid,
        modelIdentifier=description.modelExchange.modelIdentifier,
        unzipDirectory=fmpy.extract(path),
        instanceName="knowns",
    )
    model.instantiate()
    model.enterInitializationMode()
    references = {v.name: v.valueReference for v in description.modelVariables}
    start = {key: value for key, value in MOVED.items() if key in references}
    settable = [v for v in description.modelVariables if v.name in start and v.causality != "local"]
    for variable in settable:
        if variable.initial == "exact" or variable.causality in ("input", "parameter"):
            model.setFloat64([variable.valueReference], [start[variable.name]])
    if mode != "initialization":
        model.exitInitializationMode()
        model.updateDiscreteStates()
    if mode == "continuous-time":
        model.enterContinuousTimeMode()
        model.setTime(0.4)
    yield model, description
    model.terminate() if mode != "initialization" else model.reset()
    model.freeInstance()


def can_change(variable: ModelVariable, mode: str) -> bool:
    """Whether the importer may set the value in this mode."""
    if variable.causality == "independent":
        return mode == "continuous-time"
    if variable.causality == "parameter":
        return mode == "initialization" or (mode == "event" and variable.variability == "tunable")
    return variable.causality == "input" and variable.variability == "continuous"


def change(model: FMU3Model, variable: ModelVariable, value: float) -> None:
    if variable.causality == "independent":
        model.setTime(value)
    else:
        model.setFloat64([variable.valueReference], [value])


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", NAMES)
def test_every_dependency_has_the_derivative_of_differences(
    fmu: Path, name: str, mode: str
) -> None:
    with moved(fmu, name, mode) as (model, description):
        compared = 0
        for unknown in [*description.outputs, *description.derivatives]:
            reference = [unknown.variable.valueReference]
            for known in unknown.dependencies or []:
                if known.type != "Float64" or unknown.variable.type != "Float64":
                    continue
                if unknown.variable.variability == "discrete":
                    continue  # has no derivatives
                if known.name.startswith(("relative_tolerance", "max_step")):
                    continue  # of the solver
                # every known is accepted, whether it can be changed here or not
                seed = [known.valueReference]
                (derivative,) = model.getDirectionalDerivative(reference, seed, [1.0])
                (adjoint,) = model.getAdjointDerivative(reference, seed, [1.0])
                assert adjoint == derivative
                if not can_change(known, mode):
                    continue
                (value,) = model.getFloat64([known.valueReference])
                h = STEP * (1.0 + abs(value))
                values = (value + h, max(value - h, float(known.min or -np.inf)))
                results = []
                for moved_value in values:
                    change(model, known, moved_value)
                    results.append(model.getFloat64(reference)[0])
                change(model, known, value)
                difference = (results[0] - results[1]) / (values[0] - values[1])
                scale = max(1.0, abs(difference), *np.abs(results))
                assert abs(derivative - difference) <= BOUND * scale, (
                    unknown.variable.name,
                    known.name,
                )
                compared += 1
        # the parameters of the trajectory are fixed, and it has no inputs; all outputs of the
        # sensor are discrete
        assert (compared > 0) == ((name, mode) != ("RPTrajectory", "event") and name != "RPSensor")
