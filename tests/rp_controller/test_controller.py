"""RPController against a sympy model of its laws, whose arm comes from positions; what a sample
computes, and when its efforts take effect.

Values must agree within 1e-12 of the exact ones, relative to the sum of the absolute values of
their terms.
"""

import random
from bisect import bisect_right
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path

import pytest
from fmpy.fmi2 import FMU2Model

from tests.support.instances import DISCARD, ERROR, OK, Instance, LoadedFmu, status_of
from tests.support.symbolic import (
    CASES,
    CONTROLLER_KNOWNS,
    EFFORTS,
    LAWS,
    LIMITS,
    PARAMETERS,
    UNKNOWNS,
    Case,
    Values,
    assert_close,
    case_point,
    numbers,
    terms_of_values,
)

UNIT = "RPController"


@contextmanager
def in_initialization_mode(loaded: LoadedFmu, case: Case, point: Values) -> Iterator[Instance]:
    with Instance(loaded) as instance:
        instance.fmi.setInteger([loaded.references["mode"]], [LAWS[case.mode]])
        instance.fmi.setBoolean([loaded.references["payload_attached"]], [case.is_attached])
        yield instance.begin(**point)


# ---- Values and derivatives ----------------------------------------------------------------------


@pytest.mark.parametrize("case", CASES)
def test_values_are_those_of_the_law(loaded: LoadedFmu, case: Case) -> None:
    for seed in range(5):
        point = case_point(case, seed)
        with in_initialization_mode(loaded, case, point) as instance:
            rows = terms_of_values(case)(*numbers(point, CONTROLLER_KNOWNS))
            for name, actual, row in zip(UNKNOWNS, instance.get(*UNKNOWNS), rows, strict=True):
                assert_close(actual, row, 1e-12, (name, seed))


# ---- With the arm --------------------------------------------------------------------------------


def test_gravity_compensation_holds_the_arm_in_place(
    fmu: Path, loaded: LoadedFmu, tmp_path: Path
) -> None:
    arm_unit = LoadedFmu(fmu, tmp_path)
    measured = ("q1", "q2", "dq1", "dq2")
    with Instance(arm_unit) as arm, Instance(loaded) as controller:
        controller.fmi.setInteger([loaded.references["mode"]], [LAWS["pd_gravity"]])
        controller.initialize(q1=0.7, q2=0.2, q1_ref=0.7, q2_ref=0.2, Ki1=50.0, Ki2=50.0)
        arm.initialize(q1=0.7, q2=0.2, **dict(zip(EFFORTS, controller.get(*EFFORTS), strict=True)))
        for i in range(500):
            arm.step(0.002 * i, 0.002)
            controller.set(**dict(zip(measured, arm.get(*measured), strict=True)))
            controller.step(0.002 * i, 0.002)
            arm.set(**dict(zip(EFFORTS, controller.get(*EFFORTS), strict=True)))
        assert arm.get(*measured) == pytest.approx([0.7, 0.2, 0.0, 0.0], abs=1e-12)


# ---- As a unit -----------------------------------------------------------------------------------


def test_the_taylor_method_is_refused_where_the_fmu_integrates(loaded: LoadedFmu) -> None:
    references = [loaded.references["solver_method"]]
    with Instance(loaded) as instance:
        instance.fmi.setInteger(references, [4])
        instance.begin()
        assert status_of(instance.fmi.exitInitializationMode) == ERROR
        text = instance.messages[-1].text
        assert "solver_method = 4 (taylor) is refused: RPController has no Taylor series" in text
        assert all(name in text for name in ("1 (cvode_adams)", "2 (cvode_bdf)", "3 (erk)"))
    with Instance(loaded, kind=FMU2Model) as instance:
        instance.fmi.setInteger(references, [4])
        instance.begin()
        assert status_of(instance.fmi.exitInitializationMode) == OK
        saved = instance.fmi.getFMUstate()
        read = instance.fmi.deSerializeFMUstate(instance.fmi.serializeFMUstate(saved))
        instance.fmi.setFMUstate(read)
        instance.fmi.freeFMUstate(read)
        instance.fmi.freeFMUstate(saved)


def test_mode_changes_between_steps(loaded: LoadedFmu) -> None:
    point = case_point(Case("pd"), 1) | dict.fromkeys(LIMITS, 1e9) | {"Ki1": 0.0, "Ki2": 0.0}
    with in_initialization_mode(loaded, Case("pd"), point) as instance:
        instance.fmi.exitInitializationMode()
        for i, (mode, number) in enumerate(LAWS.items()):
            instance.fmi.setInteger([loaded.references["mode"]], [number])
            rows = terms_of_values(Case(mode))(*numbers(point, CONTROLLER_KNOWNS))
            for name, actual in zip(EFFORTS, instance.get(*EFFORTS), strict=True):
                assert_close(actual, rows[UNKNOWNS.index(name)], 1e-12, (mode, name))
            instance.step(0.1 * i, 0.1)


def test_parameters_of_the_arm_are_the_arms(fmu: Path, loaded: LoadedFmu, tmp_path: Path) -> None:
    arm = {v.name: v for v in LoadedFmu(fmu, tmp_path).description.modelVariables}
    own = {v.name: v for v in loaded.description.modelVariables}
    for name in PARAMETERS:
        for key in ("valueReference", "start", "min"):
            assert getattr(own[name], key) == getattr(arm[name], key), (name, key)


# ---- The sampled form ----------------------------------------------------------------------------

# The law of a sample is the continuous one. Here it is PD at one joint, written out in the order of
# operations of the equations, so that all bits count.
PD = 1
GAINS = {"Kp1": 50.0, "Kd1": 8.0, "Ki1": 240.0, "inertia1": 0.75, "tracking_time": 0.125}
MOTION = {"q1_ref": 0.3125, "q1": 0.0625, "dq1_ref": 0.25, "dq1": 0.75}
LIMIT = 30.0
# on the grid of 1 ms or off it; efforts at once, late, or as late as the next sample
TIMES = {
    "off the grid": (0.0037, 0.0011),
    "fast": (0.00031, 0.0003),
    "slow": (0.0273, 0.0),
    "on the grid": (0.002, 0.001),
    "a whole period": (0.003, 0.003),
    "a whole period, off the grid": (0.0017, 0.0017),
}
each_times = pytest.mark.parametrize(("period", "delay"), TIMES.values(), ids=TIMES.keys())


@pytest.fixture
def sampled(loaded: LoadedFmu) -> Iterator[Callable[..., Instance]]:
    """Makes instances of PD at joint 1 in the sampled form."""
    made: list[Instance] = []

    def make(period: float, delay: float = 0.0, start: float = 0.0, **values: float) -> Instance:
        instance = Instance(loaded)
        made.append(instance)
        instance.fmi.setInteger([loaded.references["mode"]], [PD])
        times = {"sample_time": period, "delay": delay}
        return instance.initialize(start, **(GAINS | MOTION | {"tau1_max": LIMIT} | times | values))

    yield make
    for instance in made:
        instance.fmi.freeInstance()


def samples(period: float, w: float, count: int, **changed: float) -> list[tuple[float, float]]:
    """Effort and integral part of joint 1 at each sample, by Euler's method."""
    v = GAINS | MOTION | changed
    e, de = v["q1_ref"] - v["q1"], v["dq1_ref"] - v["dq1"]
    rate, found = 0.0, []
    for _ in range(count):
        w += period * rate
        u = v["inertia1"] * ((v["Kp1"] * e + v["Kd1"] * de) + w)
        effort = max(-LIMIT, min(LIMIT, u))
        rate = v["Ki1"] * e - (u - effort) / (v["inertia1"] * v["tracking_time"])
        found.append((effort, w))
    return found


def last_of(times: list[Fraction], t: float) -> int:
    """Number of the last of `times` that is not after t."""
    return bisect_right(times, Fraction(t)) - 1


# ---- What a sample computes, and when ------------------------------------------------------------


@each_times
@pytest.mark.parametrize("start", [0.0, -3.3])
def test_efforts_are_those_of_the_last_sample_that_has_been_computed(
    sampled: Callable[..., Instance], period: float, delay: float, start: float
) -> None:
    """At irregular points none of which is at a sample or an effort; the limit is met."""
    instance = sampled(period, delay, start, integral1=2.0)
    count = int(0.62 / period) + 3
    expected = samples(period, 2.0, count)
    T, d = Fraction(period), Fraction(delay)
    starts = [Fraction(start) + k * T for k in range(count)]
    shown = [starts[0], *(t + d for t in starts[1:])]
    source = random.Random(3)
    t, seen = start, set()
    while t < start + 0.6:
        t = instance.step(t, source.choice((0.0002, 0.003, 0.011)) * source.uniform(0.5, 1.5))
        effort, w, rate = instance.get("tau1", "integral1", "dintegral1")
        assert effort == expected[last_of(shown, t)][0], t
        assert w == expected[last_of(starts, t)][1], t
        assert rate == 0.0
        seen.add(effort)
    assert LIMIT in seen and min(seen) < LIMIT
    assert instance.count("solver_steps") == instance.count("solver_rhs_evaluations") == 0


def test_the_first_efforts_take_effect_at_once(sampled: Callable[..., Instance]) -> None:
    instance = sampled(0.25, 0.25, integral1=2.0)
    (first, _), (second, _) = samples(0.25, 2.0, 2)
    assert instance.get("tau1", "integral1") == [first, 2.0]
    instance.set(q1=5.0)
    assert instance.get("tau1") == [first]
    instance.set(q1=MOTION["q1"])
    instance.step(0.0, 0.4375)
    assert instance.get("tau1") == [first]
    instance.step(0.4375, 0.125)
    assert instance.get("tau1") == [second] != [first]


def test_inputs_count_at_samples_only(sampled: Callable[..., Instance]) -> None:
    """Samples at 0, 0.25 and 0.5 s, whose efforts take effect at 0, 0.3125 and 0.5625 s."""
    instance = sampled(0.25, 0.0625, Ki1=0.0)
    seen = []
    for t, q1 in ((0.0, 0.1), (0.125, 0.2), (0.28125, 0.3), (0.4375, 0.0625)):
        instance.set(q1=q1)
        instance.step(t, 0.15625 if t else 0.125)
        seen += instance.get("tau1", "q1_error")
    (at_start, _), *_ = samples(0.25, 0.0, 1)
    (at_sample, _), *_ = samples(0.25, 0.0, 1, q1=0.2)
    errors = [MOTION["q1_ref"] - q1 for q1 in (0.1, 0.2, 0.3, 0.0625)]
    efforts = [at_start, at_start, at_sample, at_start]  # the input is what it was
    assert seen == [x for pair in zip(efforts, errors, strict=True) for x in pair]


def test_output_derivatives_are_those_of_held_efforts(sampled: Callable[..., Instance]) -> None:
    instance = sampled(0.25)
    instance.set_input_derivatives(q1=(0.5, 0.25))
    names = ("tau1", "f2", "q1_error")
    references = [instance.loaded.references[name] for name in names]
    assert instance.fmi.getRealOutputDerivatives(references, [1] * 3) == [0.0, 0.0, -0.5]
    assert instance.fmi.getRealOutputDerivatives(references, [2] * 3) == [0.0, 0.0, -0.25]
    known = [instance.loaded.references["q1"]]
    assert instance.fmi.getDirectionalDerivative(references, known, [1.0]) == [0.0, 0.0, -1.0]


# ---- Independence of the master's step -----------------------------------------------------------


@each_times
def test_same_bits_along_the_same_polynomial(
    sampled: Callable[..., Instance], period: float, delay: float
) -> None:
    """Where no value of the line that the input follows is rounded."""

    def seen(every: int) -> list[bytes]:
        instance = sampled(period, delay, integral1=2.0)
        found = []
        for i in range(0, 256, every):
            t = i / 1024
            instance.set(q1=0.0625 - 0.5 * t)
            instance.set_input_derivatives(q1=(-0.5,))
            instance.step(t, every / 1024)
            if (i + every) % 8 == 0:
                found.append(instance.get("tau1", "integral1", "q1_error"))
        return found

    once = seen(8)
    assert len({effort for effort, *_ in once}) > 8
    assert seen(1) == seen(2) == once


# ---- What is refused -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("start", "values", "said"),
    [
        (1e12, {"sample_time": 0.01},
         "sample_time = 0.01 s is refused: at a start time of 1e+12 s it must be 0.909495 s"),
        (0.0, {"delay": 0.0625},
         "delay = 0.0625 s is refused: it must not be above sample_time = 0 s"),
        (0.0, {"delay": 0.0625, "sample_time": 0.03125},
         "delay = 0.0625 s is refused: it must not be above sample_time = 0.03125 s"),
        (0.0, {"sample_time": 0.999e-6},
         "sample_time = 9.99e-07 s is refused: it must be 0, for a continuous law, or at least "
         "1e-06 s"),
    ],
)  # fmt: skip
def test_times_that_do_not_fit_are_refused(
    loaded: LoadedFmu, start: float, values: dict[str, float], said: str
) -> None:
    with Instance(loaded) as instance:
        assert status_of(lambda: instance.initialize(start, **values)) == ERROR
        assert said in instance.messages[-1].text
    with Instance(loaded) as instance:
        instance.initialize(sample_time=1e-6, delay=1e-6)


@pytest.mark.parametrize("wrong", [{"Kp1": 1e308, "q1_ref": 10.0}, {"Ki1": 10.0, "q1_ref": 1e308}])
def test_a_sample_that_is_not_finite_is_refused(
    sampled: Callable[..., Instance], wrong: dict[str, float]
) -> None:
    instance = sampled(0.25, integral1=2.0)
    before = instance.get("tau1", "integral1")
    instance.set(**wrong)
    assert status_of(lambda: instance.step(0.0, 0.3)) == DISCARD
    assert "is not finite" in instance.messages[-1].text
    assert instance.get("tau1", "integral1") == before


# ---- Limits and payload --------------------------------------------------------------------------


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_an_effort_at_its_limit_counts_as_beyond(loaded: LoadedFmu, side: float) -> None:
    """It has the limit's derivative exactly there, too, and inputs move it at once."""
    with Instance(loaded) as instance:
        instance.fmi.setInteger([loaded.references["mode"]], [PD])
        instance.initialize(**GAINS, q1_ref=0.5 * side, tau1_max=18.75, integral1=0.0)
        assert instance.get("tau1", "tau1_unlimited") == [18.75 * side, 18.75 * side]
        effort, known = ([loaded.references[name]] for name in ("tau1", "q1_ref"))
        assert instance.fmi.getDirectionalDerivative(effort, known, [1.0]) == [0.0]
        instance.set(q1_ref=0.25 * side)
        assert instance.get("tau1") == [9.375 * side]
        assert instance.fmi.getDirectionalDerivative(effort, known, [1.0]) == [37.5]
        instance.step(0.0, 1.0)
        assert instance.count("event_count") == 0


def test_a_sample_knows_the_payload(loaded: LoadedFmu) -> None:
    """With the arm level and nothing else to do, the torque of the payload is its weight at L."""
    arm = {"m1": 2.0, "m2": 1.0, "l1": 0.5, "lc1": 0.25, "a": 0.0, "g": 9.81, "payload_mass": 1.5}
    with Instance(loaded) as instance:
        instance.fmi.setInteger([loaded.references["mode"]], [LAWS["pd_gravity"]])
        instance.initialize(**arm, sample_time=0.25, q2=0.2, q2_ref=0.2)
        instance.step(0.0, 0.25)
        bare = instance.get("tau1")[0]
        instance.fmi.setBoolean([loaded.references["payload_attached"]], [True])
        assert instance.get("tau1") == [bare]
        instance.step(0.25, 0.25)
        assert bare == pytest.approx(2.0 * 9.81 * 0.25 + 1.0 * 9.81 * 0.7, rel=1e-14)
        assert instance.get("tau1")[0] - bare == pytest.approx(1.5 * 9.81 * 0.7, rel=1e-14)
