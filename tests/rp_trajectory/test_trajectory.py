"""RPTrajectory.fmu: exact motions and derivatives, grasp and release."""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager

import mpmath as mp
import numpy as np
import pytest
from rparm.models.rp_trajectory.references import make_references

from tests.support.instances import Instance, LoadedFmu
from tests.support.paths import ROOT
from tests.support.rparm_project import declared

UNIT = "RPTrajectory"

MODEL = ROOT / "models" / "rp_trajectory"
DECLARED = declared(MODEL.name).variables
START = {name: v.start for name, v in DECLARED.items() if v.causality == "parameter"}
OUTPUTS = [n for n, v in DECLARED.items() if v.causality == "output" and v.type == "Real"]
ENUMERATIONS = {name: list(v.items) for name, v in DECLARED.items() if v.type == "Enumeration"}

AROUND = {"x_center": 0.05, "y_center": -0.1, "radius": 0.45, "start_angle": 2.0}
AROUND |= {"frequency": -0.8, "turns": 2.75, "ramp_time": 0.7}
LINE = {"ee_x_from": -0.4, "ee_y_from": 0.25, "ee_x_to": -0.15, "ee_y_to": -0.35, "duration": 1.6}
MOTIONS = {
    "point_to_point": {"motion": "point_to_point", "q1_from": -0.3, "duration": 1.7, "a": -0.2},
    "line": {"motion": "line", "a": 0.08, **LINE},
    "line_backward": {"motion": "line", "branch": "backward", "a": -0.12, "l1": 0.4, **LINE},
    "beside": {"frequency": -0.5},
    "beside_backward": {"branch": "backward", "start_angle": 3.0, "turns": 1.3},
    "around": {**AROUND},
    "around_backward": {"branch": "backward", "a": 0.2, **AROUND},
    "arc": {"x_center": 0.3, "y_center": 0.0, "radius": 0.35, "start_angle": -1.6, "turns": 0.5}
    | {"frequency": 0.4},
}
each_motion = pytest.mark.parametrize("motion", MOTIONS)


@pytest.fixture(autouse=True)
def digits() -> Iterator[None]:
    with mp.workdps(40):
        yield


def numbered(parameters: dict[str, object]) -> dict[str, float]:
    """Parameters with the numbers of items in place of their names."""
    return {
        name: ENUMERATIONS[name].index(value) + 1 if name in ENUMERATIONS else value
        for name, value in parameters.items()
    }


def give(instance: Instance, parameters: dict[str, object]) -> None:
    """Set parameters, items by their names."""
    for name, value in numbered(parameters).items():
        if name in ENUMERATIONS:
            instance.fmi.setInteger([instance.loaded.references[name]], [value])
        else:
            instance.set(**{name: value})


@contextmanager
def running(
    loaded: LoadedFmu, parameters: dict[str, object], start: float = 0.0
) -> Iterator[Instance]:
    """An instance with `parameters`, initialized at `start` (s)."""
    with Instance(loaded) as instance:
        give(instance, parameters)
        yield instance.initialize(start=start)


def boundaries(parameters: dict[str, object]) -> list[float]:
    """Times (s) at which segments meet."""
    value = START | numbered(parameters)
    t0 = value["start_time"]
    if value["motion"] != ENUMERATIONS["motion"].index("circle") + 1:
        return [t0, t0 + value["duration"]]
    full, ramp = value["turns"] / abs(value["frequency"]), value["ramp_time"]
    return [t0, t0 + ramp, t0 + full, t0 + full + ramp]


def random_times(parameters: dict[str, object], count: int = 4) -> np.ndarray:
    """Times within each segment and the holds before and after, rising, (n,) in s."""
    ends = boundaries(parameters)
    limits = [ends[0] - 0.3, *ends, ends[-1] + 0.3]
    random = np.random.default_rng(5)
    return np.concatenate(
        [np.sort(random.uniform(a, b, count)) for a, b in zip(limits, limits[1:], strict=False)]
    )


def derivatives(instance: Instance, order: int) -> list[float]:
    references = [instance.loaded.references[name] for name in OUTPUTS]
    refs = (ctypes.c_uint32 * len(references))(*references)
    orders = (ctypes.c_int * len(references))(*[order] * len(references))
    values = (ctypes.c_double * len(references))()
    instance.fmi.fmi2GetRealOutputDerivatives(
        instance.fmi.component, refs, len(references), orders, values
    )
    return list(values)


def assert_close(got: np.ndarray, expected: np.ndarray, bound: float) -> None:
    """Each column within `bound` of its largest expected value."""
    scale = np.maximum(np.max(np.abs(expected), axis=0), 1e-3)
    assert np.max(np.abs(got - expected) / scale) < bound


# ---- exact motions -----------------------------------------------------------------------------


@each_motion
def test_outputs_and_their_derivatives(loaded: LoadedFmu, motion: str) -> None:
    """At random times of each segment, against derivatives of the same motion in 40 digits."""
    parameters = MOTIONS[motion]
    times = random_times(parameters)
    exact = make_references.Motion(START | numbered(parameters))
    assert list(make_references.OUTPUTS) == OUTPUTS
    got, expected = {0: [], 1: [], 2: []}, {0: [], 1: [], 2: []}
    with running(loaded, parameters, start=times[0] - 0.01) as instance:
        t = times[0] - 0.01
        for target in times:
            instance.step(t, target - t)
            t = target
            now = float(t)
            got[0].append(instance.get(*OUTPUTS))
            expected[0].append([float(x) for x in follow(exact, now)])
            # differences in 40 digits: their errors are below 1e-15
            h = mp.mpf("1e-10")
            before, at, after = (exact.outputs(mp.mpf(now) + k * h) for k in (-1, 0, 1))
            expected[1].append(
                [float((c - a) / (2 * h)) for a, c in zip(before, after, strict=True)]
            )
            expected[2].append(
                [float((a - 2 * b + c) / h**2) for a, b, c in zip(before, at, after, strict=True)]
            )
            for order in (1, 2):
                got[order].append(derivatives(instance, order))
    for order, bound in ((0, 1e-13), (1, 1e-10), (2, 1e-10)):
        assert_close(np.array(got[order]), np.array(expected[order]), bound)


def follow(exact: object, t: float) -> list[mp.mpf]:
    """Outputs at `t` (s), the angle brought there in steps of less than half a turn."""
    if exact.q1 is None:
        exact.now = exact.value["start_time"]
        exact.outputs(exact.now)  # q1 is principal at the start
    for between in np.arange(float(exact.now), float(t), 0.2):
        exact.outputs(float(between))
    exact.now = t
    return exact.outputs(float(t))


@pytest.mark.parametrize("start", [-1e4, 1e5])
def test_the_motion_does_not_depend_on_when_it_starts(loaded: LoadedFmu, start: float) -> None:
    elapsed = np.arange(1, 48) / 8  # exact at both times
    with (
        running(loaded, {"start_time": 0.5}) as first,
        running(loaded, {"start_time": start + 0.5}, start=start) as second,
    ):
        for t in elapsed:
            first.step(t - 0.125, 0.125)
            second.step(start + t - 0.125, 0.125)
            assert first.get(*OUTPUTS) == second.get(*OUTPUTS)


@pytest.mark.parametrize(
    ("parameters", "order"),
    [
        ({"motion": "point_to_point", "duration": 1.25}, 1),
        ({"motion": "circle", "frequency": -0.5, "turns": 2.0, "ramp_time": 1.0}, 2),
    ],
)
def test_the_later_segment_holds_at_a_boundary(
    loaded: LoadedFmu, parameters: dict[str, object], order: int
) -> None:
    """There the acceleration's derivative jumps, where a ramp begins or ends only the second."""
    column = OUTPUTS.index("ddq1_ref")
    parameters = {"start_time": 0.5, **parameters}
    for boundary in boundaries(parameters):
        found = []
        for t in (boundary - 1e-9, boundary, boundary + 1e-9):
            with running(loaded, parameters, start=t) as instance:
                found.append(derivatives(instance, order)[column])
        before, now, after = found
        assert now == pytest.approx(after, rel=0, abs=1e-5)
        assert abs(now - before) > 1e-3


# ---- payload -----------------------------------------------------------------------------------

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
    with Instance(loaded).begin(start, **GRASPED) as instance:
        assert is_attached(instance) == expected
        instance.fmi.exitInitializationMode()
        assert is_attached(instance) == expected
