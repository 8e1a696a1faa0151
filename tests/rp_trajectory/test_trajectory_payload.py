"""The Boolean output of RPTrajectory: the payload is attached from grasp_time to release_time."""

import pytest
from fmpy.fmi2 import FMU2Model

from tests.support.instances import ERROR, Instance, LoadedFmu, instantiated, set_value, status_of
from tests.support.rparm_project import FMUS, fmi3_fmu

UNIT = "RPTrajectory"
GRASP, RELEASE = 0.3, 0.70001
GRASPED = {"grasp_time": GRASP, "release_time": RELEASE}


def is_attached(instance: Instance) -> bool:
    (value,) = instance.fmi.getBoolean([instance.loaded.references["payload_attached"]])
    return bool(value)


@pytest.mark.parametrize("per_second", [10, 100, 1000, 7])
def test_it_is_attached_from_grasp_to_release(loaded: LoadedFmu, per_second: int) -> None:
    """Also where a communication point is the time of the grasp, but for rounding."""
    with Instance(loaded) as instance:
        instance.initialize(**GRASPED)
        assert not is_attached(instance)
        t = 0.0
        for i in range(per_second):
            t = instance.step(t, 1 / per_second)
            point = (i + 1) / per_second
            assert is_attached(instance) == (GRASP <= point < RELEASE), t


@pytest.mark.parametrize(
    ("start", "expected"), [(-1.0, False), (GRASP, True), (0.5, True), (RELEASE, False), (3, False)]
)
def test_initialization_knows_it(loaded: LoadedFmu, start: float, expected: bool) -> None:
    """Before initialization ends a payload becomes a part of the plant without a jump."""
    with Instance(loaded) as instance:
        instance.fmi.setupExperiment(startTime=start)
        instance.set(**GRASPED)
        instance.fmi.enterInitializationMode()
        assert is_attached(instance) == expected
        instance.fmi.exitInitializationMode()
        assert is_attached(instance) == expected


def test_grasp_and_release_are_time_events_in_model_exchange(loaded: LoadedFmu) -> None:
    with Instance(loaded, kind=FMU2Model) as instance:
        instance.initialize(**GRASPED)
        for due, before in ((GRASP, False), (RELEASE, True)):
            *_, is_defined, next_time = instance.fmi.newDiscreteStates()
            assert is_defined and next_time == due
            instance.fmi.enterContinuousTimeMode()
            instance.fmi.setTime(due)
            assert is_attached(instance) == before
            instance.fmi.enterEventMode()
        *_, is_defined, _ = instance.fmi.newDiscreteStates()
        assert not is_defined and not is_attached(instance)


def test_steps_end_at_grasp_and_release_in_event_mode() -> None:
    path = fmi3_fmu(FMUS["rp_trajectory"])
    options = {"event_mode_used": True, "early_return_allowed": True}
    with instantiated(path, "CoSimulation", **options) as (unit, description):
        variables = {v.name: v for v in description.modelVariables}

        def attached() -> bool:
            return bool(unit.getBoolean([variables["payload_attached"].valueReference])[0])

        for name, value in GRASPED.items():
            set_value(unit, variables[name], value)
        unit.enterInitializationMode()
        unit.exitInitializationMode()
        t = 0.0
        for due, after in ((GRASP, True), (RELEASE, False)):
            *_, is_defined, next_time = unit.updateDiscreteStates()
            assert is_defined and next_time == due
            unit.enterStepMode()
            event, _, early, t = unit.doStep(t, 1.0)
            assert event and early and t == due
            assert attached() != after
            unit.enterEventMode()
            *_, is_defined, _ = unit.updateDiscreteStates()
            assert attached() == after
        assert not is_defined


def test_times_are_fixed(loaded: LoadedFmu) -> None:
    with Instance(loaded) as instance:
        instance.initialize(**GRASPED)
        assert status_of(lambda: instance.set(grasp_time=0.1)) == ERROR
