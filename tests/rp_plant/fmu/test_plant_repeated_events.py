"""Events that must come once: those that follow where an indicator begins at 0, which rounding may
leave on either side of it."""

import math
import random

import pytest

from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from tests.rp_plant.fmu.plant_runs import (
    COMPLIANT,
    FIRM,
    METHODS,
    RIGID,
    each_method,
    last_event,
    modes,
    read,
    started,
)


def ramp(instance: Instance, begin: dict[str, float], rates: dict[str, float]) -> None:
    """Inputs of the next step, and their derivatives; `started` was given them as smooth ones."""
    polynomials = instance.input_polynomials(list(begin), 1)
    polynomials.view[:] = [list(begin.values()), [rates.get(name, 0.0) for name in begin]]
    polynomials.set()


@each_method
@pytest.mark.parametrize("tolerance", [1e-12, 1e-9])
@pytest.mark.parametrize("joint_1", [{"coulomb_friction1": 1e6, "a": 0.0}, {"dq1": 1.5}])
def test_a_slide_pulled_out_of_a_damped_stop(
    plant: Fmu, method: str, tolerance: float, joint_1: dict[str, float]
) -> None:
    """It begins to touch, the stop lets go at 1 / c, the slide is out."""
    c, f, m = 1.5, -200.0, 1.0
    stop = {"stops2": COMPLIANT, "lower2": -0.2, "upper2": 0.2, "dq2": 2.0}
    soft = {"stop_stiffness2": 2e3, "stop_damping2": c}
    with started(plant, method, tolerance, g=0.0, **stop, **soft, **joint_1) as instance:
        instance.do_step(0.0, 0.12)
        instance.set("f2", f)
        instance.do_step(0.12, 0.01)
        count, time = last_event(instance)
        assert count == 2
        dq2 = read(instance, "dq2")[0]
        if "a" in joint_1:
            assert dq2 == pytest.approx(-1 / c + f / m * (0.13 - time), rel=0, abs=1e-8)
        instance.do_step(0.13, 0.01)
        assert last_event(instance).count == 3


@each_method
@pytest.mark.parametrize("others", [{"dq2": 0.5}, {"coulomb_friction2": 1.0}])
def test_efforts_at_their_limit_that_go_back(
    plant: Fmu, method: str, others: dict[str, float]
) -> None:
    """A joint at exactly its friction stays where the effort falls, to break away backward."""
    friction, rate = 3.0, -6.0
    values = {"g": 0.0, "a": 0.0, "coulomb_friction1": friction, **others}
    with started(plant, method, 1e-12, ("tau1",), **values) as instance:
        ramp(instance, {"tau1": friction}, {"tau1": rate})
        instance.do_step(0.0, 0.5)
        assert (modes(instance)[0], last_event(instance).count) == (0, 0)
        ramp(instance, {"tau1": 0.0}, {"tau1": rate})
        instance.do_step(0.5, 0.6)
        assert modes(instance)[0] == -1
        count, time = last_event(instance)
        assert (count, time) == (1, pytest.approx(2 * friction / -rate, rel=0, abs=1e-9))


@each_method
def test_a_slide_that_nothing_pushes_rests_on_its_stop(plant: Fmu, method: str) -> None:
    with started(plant, method, stops2=RIGID, lower2=0.0, g=0.0) as instance:
        instance.do_step(0.0, 1.0)
        assert (modes(instance)[1], last_event(instance).count) == (0, 0)


@each_method
@pytest.mark.parametrize("stops", [RIGID, COMPLIANT])
@pytest.mark.parametrize("limit", [0.3, 1000.0])
def test_a_joint_that_leaves_its_stop_does_not_meet_it(
    plant: Fmu, method: str, stops: int, limit: float
) -> None:
    """Breaking away from it is the only event; the rounding of the limit is no contact."""
    friction, rate = 3.0, -4.0
    values = {"g": 0.0, "a": 0.0, "coulomb_friction1": FIRM, "coulomb_friction2": friction}
    stop = {"stops2": stops, "upper2": limit, "lower2": limit - 0.5, "stop_stiffness2": 1e4}
    with started(plant, method, 1e-10, ("f2",), q2=limit, **values, **stop) as instance:
        ramp(instance, {"f2": 0.0}, {"f2": rate})
        instance.do_step(0.0, 1.0)
        count, time = last_event(instance)
        assert (count, time) == (1, pytest.approx(friction / -rate, rel=0, abs=1e-9))


# ---- Pulls at random -------------------------------------------------------------------------

MOST = 300  # events of a step; without repeated ones a step here has far fewer


def joint_values(chance: random.Random, joint: int) -> dict[str, float]:
    """Friction and stops of a joint that begins at 0, at its stops or between them."""
    values: dict[str, float] = {f"dq{joint}": chance.choice([0.0, chance.uniform(-2, 2)])}
    if chance.random() < 0.5:
        coulomb = chance.choice([1.0, 3.0, 1e-6, 1e6, chance.uniform(0.1, 5)])
        values[f"coulomb_friction{joint}"] = coulomb
        values[f"breakaway_friction{joint}"] = coulomb * chance.choice([1.0, 1.4])
        values[f"stribeck_velocity{joint}"] = 10 ** chance.uniform(-3, 0)
    if chance.random() < 0.9:
        values[f"stops{joint}"] = chance.choice([RIGID, COMPLIANT, COMPLIANT, COMPLIANT])
        values[f"lower{joint}"] = -chance.choice([0.0, 0.2, chance.uniform(0, 0.5)])
        values[f"upper{joint}"] = chance.choice([0.2, chance.uniform(1e-3, 0.5)])
        values[f"stop_stiffness{joint}"] = 10 ** chance.uniform(1, 6)
        values[f"stop_damping{joint}"] = chance.choice([0.0, 1.5, 10 ** chance.uniform(-2, 1)])
    return values


@pytest.mark.parametrize("version", ["fmi2"], indirect=True)
def test_pulls_at_random_end(plant: Fmu) -> None:
    """At all indicators, with all methods and the tightest tolerances: no event repeats itself."""
    chance = random.Random(28)
    for _ in range(200):
        method = chance.choice(list(METHODS))
        values = joint_values(chance, 1) | joint_values(chance, 2)
        values |= {"g": chance.choice([0.0, 9.81]), "a": chance.choice([0.0, 0.1, -0.3])}
        tolerance = chance.choice([1e-12, 1e-12, 1e-11])
        values |= {"relative_tolerance": tolerance, "max_events": MOST}
        with started(plant, method, tolerance, ("tau1", "f2"), **values) as instance:
            time = 0.0
            for _ in range(10):
                begin, rates = {}, {}
                for name in ("tau1", "f2"):
                    begin[name] = chance.choice([0.0, -3.0, 1.0, chance.uniform(-300, 300)])
                    size = 10 ** chance.uniform(0, 4)
                    rates[name] = chance.choice([0.0, math.copysign(size, chance.random() - 0.5)])
                ramp(instance, begin, rates)
                step = 10 ** chance.uniform(-3, -1)
                instance.do_step(time, step)
                time += step
