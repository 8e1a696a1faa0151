"""RPSensor.fmu: event mode; what it counts and refuses; counts, velocities and latency, tick by
tick, against an independent sensor in fractions."""

import math
import random
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path

import fmpy
import numpy as np
import pytest
from rparm.models.rp_sensor.references.make_references import Encoder

from rparm.errors import UserError
from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from tests.support.instances import instantiated
from tests.support.paths import ROOT
from tests.support.rparm_project import declared, fmi3_fmu

MODEL = ROOT / "models" / "rp_sensor"
INPUTS = ("q1", "q2")
OUTPUTS = ("q1_measured", "q2_measured", "dq1_measured", "dq2_measured")
COUNTS = ("counts1", "counts2")
DEGREE = 3

Cubic = Sequence[float]  # coefficients from order 0 on, rad or m per power of s
Shown = tuple[tuple[int, ...], tuple[float, ...]]  # COUNTS and OUTPUTS


def start_values() -> dict[str, float]:
    variables = declared(MODEL.name).variables
    return {name: v.start for name, v in variables.items() if v.causality == "parameter"}


def at(cubic: Cubic, t: Fraction) -> Fraction:
    """Exact value of a cubic."""
    return sum((Fraction(c) * t**k for k, c in enumerate(cubic)), Fraction(0))


def derivatives(cubic: Cubic, t: float) -> list[float]:
    """Value and derivatives of a cubic, orders 0 to 3, each rounded once."""
    result, rest = [], [Fraction(c) for c in cubic]
    for _ in range(DEGREE + 1):
        result.append(float(at(rest, Fraction(t))))
        rest = [k * c for k, c in enumerate(rest)][1:] or [Fraction(0)]
    return result


@contextmanager
def started(
    fmu: Fmu, start: float = 0.0, cubics: Sequence[Cubic] = ((0.0,), (0.0,)), **values: float
) -> Iterator[Instance]:
    """An instance at `start` (s) with these parameters, the inputs at their values there."""
    with fmu.instance("sensor", INPUTS) as instance:
        instance.set_up(start, None)
        for name, value in values.items():
            instance.set(name, value)
        instance.enter_initialization()
        for name, cubic in zip(INPUTS, cubics, strict=True):
            instance.set(name, derivatives(cubic, start)[0])
        instance.exit_initialization()
        yield instance


class Stepper:
    """Moves the inputs of an instance along cubics, which count the time from 0."""

    def __init__(self, instance: Instance, cubics: Sequence[Cubic]) -> None:
        self.instance, self.cubics = instance, cubics
        self._polynomials = instance.input_polynomials(INPUTS, DEGREE)

    def step(self, t: float, h: float) -> None:
        rows = zip(*(derivatives(cubic, t) for cubic in self.cubics), strict=True)
        self._polynomials.view[:] = list(rows)
        self._polynomials.set()
        self.instance.do_step(t, h, goes_back=True)


def shown(instance: Instance) -> Shown:
    reals = instance.reals(OUTPUTS)
    reals.get()
    return tuple(instance.integer(name) for name in COUNTS), tuple(reals.view.tolist())


@pytest.fixture(scope="session", params=["fmi2", "fmi3"])
def sensor(request: pytest.FixtureRequest, fmu: Path) -> Iterator[Fmu]:
    """RPSensor, in each version of FMI."""
    path = fmu.with_name("RPSensor.fmu")
    with Fmu(path if request.param == "fmi2" else fmi3_fmu(path)) as opened:
        yield opened


# Further from the end of a step than what counts as rounding of a time, relative to the step.
CLEAR = 0.02


def random_cubic(chance: random.Random, resolution: float) -> Cubic:
    """Hundreds of counts within a second."""
    return [chance.uniform(-200.0, 200.0) * resolution for _ in range(4)]


def random_parameters(chance: random.Random) -> dict[str, float]:
    values = {
        "sample_time": chance.uniform(1e-3, 0.03),
        "latency": chance.choice([0, 1, 2, 5, 63, 64]),
        "seed": chance.randrange(-(2**31), 2**31),
    }
    for i in (1, 2):
        values[f"resolution{i}"] = 10 ** chance.uniform(-6.0, -3.0)
        values[f"noise{i}"] = chance.choice([0.0, 0.3, 4.0]) * values[f"resolution{i}"]
    return values


def steps_clear_of_ticks(
    chance: random.Random, start: float, sample_time: float, count: int
) -> list[tuple[float, float]]:
    """Begin and length (s) of random steps, short and long, that end at no tick."""
    found: list[tuple[float, float]] = []
    t = start
    while len(found) < count:
        h = chance.choice([0.1, 1.0, 5.0]) * chance.uniform(0.05, 1.0) * sample_time
        ticks = (Fraction(t + h) - Fraction(start)) / Fraction(sample_time)
        if abs(ticks - round(ticks)) * sample_time > CLEAR * h:
            found.append((t, h))
            t += h
    return found


def assert_shown(instance: Instance, encoder: object) -> None:
    """Counts exactly, what is made of them up to its rounding."""
    counts, outputs = shown(instance)
    assert counts == tuple(encoder.counts())
    for got, exact in zip(outputs, encoder.outputs(), strict=True):
        assert abs(Fraction(got) - exact) <= abs(exact) * Fraction(1, 2**51)


@pytest.mark.parametrize(
    ("sensor", "seed"), [(f"fmi{2 + seed % 2}", seed) for seed in range(8)], indirect=["sensor"]
)
def test_random_motions(sensor: Fmu, seed: int) -> None:
    """Both joints along cubics, communication points anywhere, against the sensor in fractions."""
    chance = random.Random(seed)
    values = random_parameters(chance)
    start = chance.choice([0.0, -3.7, 12.5])
    cubics = [random_cubic(chance, values[f"resolution{i}"]) for i in (1, 2)]
    cubics[0][0] += chance.uniform(-1.0, 1.0)
    encoder = Encoder(start_values() | values)
    sample_time, begin = Fraction(values["sample_time"]), Fraction(start)

    def sample_until(end: float) -> None:
        while (t := begin + encoder.ticks * sample_time) <= Fraction(end):
            encoder.sample([sum(Fraction(c) * t**k for k, c in enumerate(q)) for q in cubics])

    with started(sensor, start, cubics, **values) as instance:
        stepper = Stepper(instance, cubics)
        sample_until(start)
        assert_shown(instance, encoder)
        for t, h in steps_clear_of_ticks(chance, start, values["sample_time"], 250):
            stepper.step(t, h)
            sample_until(t + h)
            assert_shown(instance, encoder)
    assert encoder.ticks > 200


def test_a_tick_at_a_communication_point_belongs_to_the_step_before(sensor: Fmu) -> None:
    """It samples the inputs of that step, and new ones a tick later."""
    with started(sensor, resolution1=0.25, sample_time=0.125) as instance:
        inputs = instance.reals(INPUTS)
        seen = []
        for i in range(1, 9):
            inputs.view[:] = [0.25 * i * i, 0.0]
            inputs.set()
            assert shown(instance)[0][0] == (i - 1) ** 2
            instance.do_step((i - 1) * 0.125, 0.125)
            seen.append(shown(instance)[0][0])
        assert seen == [i * i for i in range(1, 9)]


# ---- FMI 3.0's event mode ----------------------------------------------------------------------

STILL = {"q1": 0.4, "q2": -0.01}


def assert_counts(result: np.ndarray, values: dict[str, float]) -> None:
    """Of joints at STILL, with ticks every 0.00737 s."""
    encoder = Encoder(start_values() | values)
    expected = []
    for _ in range(70):
        encoder.sample([*STILL.values()])
        expected.append(encoder.counts())
    for t, *counts in result:
        ticks = t / 0.00737
        if abs(ticks - round(ticks)) > 1e-6:  # at a tick both rows are right
            assert counts == expected[int(ticks)], t


@pytest.mark.parametrize("event_mode", [False, True])
@pytest.mark.parametrize("early_return", [False, True])
def test_steps_that_return_at_ticks(fmu: Path, event_mode: bool, early_return: bool) -> None:
    """The counts are the same; a step that may return early does so at each tick within it."""
    values = {"sample_time": 0.00737, "noise1": 0.01, "noise2": 1e-4, "seed": 9, "latency": 1}
    result = fmpy.simulate_fmu(
        str(fmi3_fmu(fmu.with_name("RPSensor.fmu"))),
        fmi_type="CoSimulation",
        use_event_mode=event_mode,
        early_return_allowed=early_return,
        stop_time=0.3,
        output_interval=0.01,
        start_values=values | STILL,
        output=COUNTS,
    )
    assert_counts(result, values)
    within = [k * 0.00737 for k in range(1, 41)]
    found = [np.abs(result["time"] - t).min() < 1e-12 for t in within]
    assert all(found) if early_return else not any(found)


def test_inputs_set_at_a_tick_in_event_mode_are_sampled(fmu: Path) -> None:
    path = fmi3_fmu(fmu.with_name("RPSensor.fmu"))
    options = {"early_return_allowed": True, "event_mode_used": True}
    with instantiated(path, "CoSimulation", **options) as (sensor, description):
        reference = {v.name: v.valueReference for v in description.modelVariables}
        sensor.enterInitializationMode(startTime=0.0)
        sensor.setFloat64([reference["resolution1"], reference["sample_time"]], [0.25, 0.125])
        sensor.exitInitializationMode()
        assert sensor.updateDiscreteStates()[-2:] == (True, 0.125)
        sensor.enterStepMode()
        t = 0.0
        for k in range(1, 9):
            has_event, _, early, t = sensor.doStep(t, 2.0 - t)
            assert (bool(has_event), bool(early), t) == (True, True, k * 0.125)
            sensor.enterEventMode()
            sensor.setFloat64([reference["q1"]], [0.25 * k * k])
            assert sensor.getInt32([reference["counts1"]]) == [(k - 1) ** 2]
            assert sensor.updateDiscreteStates()[-2:] == (True, (k + 1) * 0.125)
            assert sensor.getInt32([reference["counts1"]]) == [k * k]
            sensor.enterStepMode()


# ---- Counts --------------------------------------------------------------------------------------

MOST = 2**31 - 1


def counted(sensor: Fmu, resolution: float, positions: Sequence[float]) -> list[int]:
    """Counts of positions of joint 1 during the initialization."""
    found = []
    with sensor.instance("sensor", INPUTS) as instance:
        instance.set_up(0.0, None)
        instance.set("resolution1", resolution)
        instance.enter_initialization()
        for position in positions:
            instance.set("q1", position)
            found.append(instance.integer("counts1"))
    return found


@pytest.mark.parametrize("resolution", [0.125, 1e-12, 3e5])
def test_counts_of_multiples(sensor: Fmu, resolution: float) -> None:
    numbers = range(-500, 501)
    assert counted(sensor, resolution, [n * resolution for n in numbers]) == [*numbers]


def test_counts_change_halfway(sensor: Fmu) -> None:
    """With a resolution of 1/8 all quotients are exact."""
    edges = [((n + 0.5) * 0.125, n + 1) for n in range(-300, 300)]
    beside = [(math.nextafter(x, -math.inf), n - 1) for x, n in edges]
    beside += [(math.nextafter(x, math.inf), n) for x, n in edges]
    for pairs in (edges, beside):
        assert counted(sensor, 0.125, [x for x, _ in pairs]) == [n for _, n in pairs]
    # the sum of the first one with 1/2 would be 1
    small = [0.49999999999999994, -0.5, -0.0, 5e-324, -5e-324, math.nextafter(-0.5, -1.0)]
    assert counted(sensor, 1.0, small) == [0, 0, 0, 0, 0, -1]


def test_the_counter_stops_at_its_ends(sensor: Fmu) -> None:
    above = [MOST - 0.75, MOST - 0.5, MOST + 0.75, 1e300]
    assert counted(sensor, 1.0, above) == [MOST - 1, MOST, MOST, MOST]
    below = [-MOST + 0.5, -MOST + 0.25, -MOST - 0.75, -MOST - 1.0, -1e300]
    assert counted(sensor, 1.0, below) == [-MOST + 1, -MOST, -MOST, -MOST, -MOST]
    assert counted(sensor, 1e-12, [1e300, -1e300]) == [MOST, -MOST]


def test_velocities_do_not_overflow_a_counter(sensor: Fmu) -> None:
    with started(sensor, cubics=[(-1e300,), (0.0,)], resolution1=0.25) as instance:
        assert shown(instance)[0][0] == -MOST
        instance.set("q1", 1e300)
        instance.do_step(0.0, 0.001)
        counts, (q1, _, dq1, _) = shown(instance)
        assert (counts[0], q1, dq1) == (MOST, MOST * 0.25, 2.0 * MOST * 0.25 / 0.001)


def test_the_initialization_shows_what_the_start_will_show(sensor: Fmu) -> None:
    with sensor.instance("sensor", INPUTS) as instance:
        for seed in range(50):
            instance.set_up(0.0, None)
            for name, value in {"noise1": 3.0, "latency": 5, "seed": seed}.items():
                instance.set(name, value)
            instance.enter_initialization()
            instance.set("q1", float(seed))
            before = shown(instance)
            instance.exit_initialization()
            assert shown(instance) == before and before[1][2] == 0.0
            instance.reset()


@pytest.mark.parametrize(
    ("start", "values", "said"),
    [
        (1e12, {"sample_time": 0.01},
         "sample_time = 0.01 s is refused: at a start time of 1e+12 s it must be 0.909495 s"),
        (0.0, {"resolution2": 1e296},
         "resolution2 = 1e+296 is refused: with sample_time = 0.001 s the velocity of 2^32 counts "
         "in one sample time is not finite"),
    ],
)  # fmt: skip
def test_what_gives_no_ticks_or_velocities_is_refused(
    sensor: Fmu, start: float, values: dict[str, float], said: str
) -> None:
    with pytest.raises(UserError, match=re.escape(said)), started(sensor, start, **values):
        pass
    fits = {name: value / 10 if name != "sample_time" else 0.91 for name, value in values.items()}
    with started(sensor, start, **fits) as instance:
        instance.do_step(start, 1.0)
