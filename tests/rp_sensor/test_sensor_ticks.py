"""Counts, velocities and latency of the built FMU, tick by tick, against an independent sensor in
fractions."""

import random
import re
from fractions import Fraction

import pytest
from fmpy.fmi1 import FMICallException
from rparm.models.rp_sensor.references.make_references import Encoder

from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from tests.rp_sensor.sensor_runs import INPUTS, Cubic, Stepper, shown, start_values, started

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


@pytest.mark.parametrize("seed", range(8))
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


def refusal_of_step(instance: Instance, length: float) -> str:
    """The last message of a step from 0 s that is discarded."""
    with pytest.raises(FMICallException):
        instance.do_step(0.0, length)
    return instance.messages[-1]


def test_a_huge_step_with_short_ticks_ends_soon(sensor: Fmu) -> None:
    with started(sensor, sample_time=1e-6) as instance:
        message = refusal_of_step(instance, 1e6)
    time = float(re.search(r"ended at t = (\S+): a time event is due there", message)[1])
    assert time == pytest.approx(0.100001, rel=1e-12)
    assert message.endswith("max_internal_steps = 100000")


def test_ticks_allowed_in_a_step(sensor: Fmu) -> None:
    with started(sensor, sample_time=1e-3, max_internal_steps=100) as instance:
        instance.do_step(0.0, 0.1)
    with started(sensor, sample_time=1e-3, max_internal_steps=99) as instance:
        message = refusal_of_step(instance, 0.1)
    assert message.endswith("one more than max_internal_steps = 99")
