"""What the sensor shows depends neither on communication points nor on rollbacks, bit for bit, and
states that no ticks leave are refused."""

import random
import struct

import pytest

from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from tests.rp_sensor.sensor_runs import Shown, Stepper, shown, started
from tests.support.instances import ERROR, hashed, restore, serialized, status_of

CUBICS = ((0.3, -0.7, 0.9, -0.2), (0.01, 0.2, -0.3, 0.1))
OFF_GRID = {"sample_time": 0.00137, "latency": 3, "seed": 11, "noise1": 2e-3, "noise2": 3e-6}
SAMPLES = 66


def rows(sensor: Fmu, parts: int, values: dict[str, float]) -> list[Shown]:
    """What is shown every 10 ms over a second, of steps of 10 ms / parts."""
    found = []
    with started(sensor, 0.0, CUBICS, **values) as instance:
        stepper = Stepper(instance, CUBICS)
        for i in range(100 * parts):
            t, end = i / (100 * parts), (i + 1) / (100 * parts)
            stepper.step(t, end - t)
            if (i + 1) % parts == 0:
                found.append(shown(instance))
    return found


@pytest.mark.parametrize("sample_time", [0.00137, 0.0333, 0.0002171])
def test_communication_steps_do_not_matter(sensor: Fmu, sample_time: float) -> None:
    values = OFF_GRID | {"sample_time": sample_time}
    expected = rows(sensor, 1, values)
    assert len(set(expected)) > 25
    for parts in (5, 10):
        assert rows(sensor, parts, values) == expected


def test_rollback_leaves_no_trace(sensor: Fmu) -> None:
    """Steps that are undone, short and long ones, among those that count."""
    expected = rows(sensor, 1, OFF_GRID)
    chance = random.Random(3)
    with (
        started(sensor, 0.0, CUBICS, **OFF_GRID) as instance,
        started(sensor, 5.0, **OFF_GRID | {"seed": 1}) as other,
    ):
        stepper = Stepper(instance, CUBICS)
        saved = instance.saved_state()
        for i in range(100):
            t, end = i / 100, (i + 1) / 100
            saved.take()
            content = serialized(instance)
            for _ in range(chance.randrange(3)):
                stepper.step(t, chance.choice([1e-4, 0.004, 0.01, 0.3]))
                saved.restore()
            stepper.step(t, end - t)
            assert shown(instance) == expected[i]
            if i % 10 == 0:  # the same in another instance
                restore(other, content)
                Stepper(other, CUBICS).step(t, end - t)
                assert shown(other) == expected[i]
        saved.free()


def test_noise_does_not_depend_on_the_latency(sensor: Fmu) -> None:
    """Only shown later: each row is that of the same sample without latency."""
    late = OFF_GRID | {"sample_time": 0.01, "latency": 4}
    soon = late | {"latency": 0}
    at_once, later = ([row[0] for row in rows(sensor, 1, values)] for values in (soon, late))
    assert later[4:] == at_once[:-4]
    assert len(set(at_once)) > 90


# ---- Serialized states -------------------------------------------------------------------------


def integers(values: list[int]) -> bytes:
    """As src/instance/serialization.h writes ints."""
    return struct.pack(f"<{len(values)}q", *values)


def samples_of(instance: Instance) -> list[int]:
    """Counts of both joints in all places: without latency each tick shows the latest."""
    found = [0] * (2 * SAMPLES)
    found[0:2] = shown(instance)[0]
    for i in range(9):
        instance.set("q1", 0.1 * i)
        instance.set("q2", -1e-3 * i)
        instance.do_step(i * 1e-3, 1e-3)
        found[2 * (i + 1) : 2 * (i + 2)] = shown(instance)[0]
    return found


def test_forged_states_are_refused(sensor: Fmu) -> None:
    with started(sensor, start=0.0) as instance:
        samples = samples_of(instance)
        good = serialized(instance)
        ticks = struct.pack("<dd", 0.0, 10.0)
        assert integers(samples) in good and ticks in good
        forged = [
            good.replace(ticks, struct.pack("<dd", *pair))
            for pair in [(0.0, 9.5), (0.0, -1.0), (0.0, 0.0), (0.0, 9.0), (0.0, 1e18)]
            + [(0.0, float("nan")), (float("inf"), 10.0), (float("nan"), 10.0)]
            + [(-1e9, 10.0), (-0.0011, 10.0)]  # the next tick would be over
        ]
        for place, count in [(0, -(2**31)), (19, -(2**31)), (20, 1), (131, -1)]:
            other = [*samples[:place], count, *samples[place + 1 :]]
            forged.append(good.replace(integers(samples), integers(other)))
        before = shown(instance)
        for content in forged:
            assert content != good
            assert status_of(restore, instance, hashed(content)) == ERROR
            assert "impossible" in instance.messages[-1]
            assert shown(instance) == before
            restore(instance, good)  # an error ends with a state that is restored
        # other counts that ticks could have left are accepted, with the hash that fits
        possible = [5, *samples[1:]]
        restore(instance, hashed(good.replace(integers(samples), integers(possible))))


def test_a_state_of_the_initialization_has_no_ticks(sensor: Fmu) -> None:
    with started(sensor) as instance:
        place = serialized(instance).index(struct.pack("<dd", 0.0, 1.0))
    with sensor.instance("sensor") as instance:
        instance.set_up(0.0, None)
        instance.enter_initialization()
        before = shown(instance)
        good = serialized(instance)
        assert good[place : place + 16] == struct.pack("<dd", 0.0, 0.0)
        for ticks in (1.0, 1e300, -1.0):
            content = good[:place] + struct.pack("<dd", 0.0, ticks) + good[place + 16 :]
            assert status_of(restore, instance, hashed(content)) == ERROR
            assert shown(instance) == before
            restore(instance, good)
