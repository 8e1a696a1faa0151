"""Derivatives with respect to all that an FMU of FMI 3.0 lists in its dependencies, in the modes in
which the importer can change it: against differences. FMI 3.0, sections 2.2.11 and 2.4.8.

In both versions: derivatives of all outputs at once, discrete ones too.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy.fmi3 import FMU3Model
from fmpy.model_description import ModelDescription, ModelVariable

from tests.support.instances import instantiated, set_value
from tests.support.paths import EVERY

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
# from where a derivative is far from constant over the difference
MOVED |= {"L": 0.5, "frequency": 0.1, "I_s": 0.1, "V_T": 0.5}
MOVED |= {"stribeck_velocity1": 0.8, "stribeck_velocity2": 0.9}


@contextmanager
def in_mode(
    fmu: Path, version: str, name: str, mode: str
) -> Iterator[tuple[Any, ModelDescription]]:
    """A new instance in this mode, moved away from its start values."""
    path = (fmu.parent if version == "fmi2" else fmu.parent / version) / f"{name}.fmu"
    kind = "CoSimulation" if mode == "step" else "ModelExchange"
    with instantiated(path, kind) as (model, description):
        if version == "fmi2":
            model.setupExperiment()
        model.enterInitializationMode()
        for variable in description.modelVariables:
            is_start = variable.initial == "exact" or variable.causality in ("input", "parameter")
            if variable.name in MOVED and is_start:
                set_value(model, variable, MOVED[variable.name])
        if mode != "initialization":
            model.exitInitializationMode()
        if mode in ("event", "continuous-time"):
            (model.newDiscreteStates if version == "fmi2" else model.updateDiscreteStates)()
        if mode == "continuous-time":
            model.enterContinuousTimeMode()
            model.setTime(0.4)
        if mode == "step":
            model.doStep(0.0, 0.01)
        yield model, description


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
@pytest.mark.parametrize("name", EVERY)
def test_every_dependency_has_the_derivative_of_differences(
    fmu: Path, name: str, mode: str
) -> None:
    with in_mode(fmu, "fmi3", name, mode) as (model, description):
        compared = 0
        for unknown in [*description.outputs, *description.derivatives]:
            reference = [unknown.variable.valueReference]
            for known in unknown.dependencies or []:
                if known.type != "Float64" or unknown.variable.type != "Float64":
                    continue
                if unknown.variable.variability == "discrete" and mode == "initialization":
                    continue  # a staircase: differences are not its derivatives
                if known.name.startswith(("relative_tolerance", "max_step")):
                    continue  # of the solver
                if (name, known.name) == ("RPController", "sample_time"):
                    continue  # 0 is another form of the law: a step
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
        # the parameters of the trajectory are fixed, and it has no inputs, nor has the ball; all
        # outputs of the sensor are discrete
        none = {("RPTrajectory", "event"), ("RPSensor", "initialization")}
        none |= {("BouncingBall", "continuous-time")}
        assert (compared > 0) == ((name, mode) not in none)


# ---- All at once, as linearizers ask -------------------------------------------------------------

ALL_MODES = (*MODES, "step")


@pytest.mark.parametrize("version", ["fmi2", "fmi3"])
@pytest.mark.parametrize("name", EVERY)
def test_all_at_once_is_one_by_one(fmu: Path, name: str, version: str) -> None:
    for mode in ALL_MODES:
        with in_mode(fmu, version, name, mode) as (model, description):
            real = [v for v in description.modelVariables if v.type in ("Real", "Float64")]
            states = {d.variable.derivative.name for d in description.derivatives}
            rates = {d.variable.name for d in description.derivatives}
            knowns = [v.valueReference for v in real if v.causality == "input" or v.name in states]
            unknowns = [
                v
                for v in real
                if v.causality == "output"
                or v.name in rates
                or (v.causality == "local" and v.variability == "discrete")
            ]
            references = [v.valueReference for v in unknowns]
            one_by_one = np.array(
                [
                    [model.getDirectionalDerivative([u], [k], [1.0])[0] for k in knowns]
                    for u in references
                ]
            ).reshape(len(references), len(knowns))
            seed = np.random.default_rng(1).normal(size=len(knowns))
            at_once = model.getDirectionalDerivative(references, knowns, list(seed))
            scale = np.abs(one_by_one) @ np.abs(seed)
            np.testing.assert_array_less(
                np.abs(at_once - one_by_one @ seed), 1e-13 * scale + 1e-300
            )
            held = [v.variability == "discrete" for v in unknowns]
            assert not np.any(one_by_one[held])
            if version == "fmi3":
                back = np.random.default_rng(2).normal(size=len(references))
                adjoint = model.getAdjointDerivative(
                    references, knowns, list(back), nSensitivity=len(knowns)
                )
                scale = np.abs(back) @ np.abs(one_by_one)
                np.testing.assert_array_less(
                    np.abs(adjoint - back @ one_by_one), 1e-13 * scale + 1e-300
                )
