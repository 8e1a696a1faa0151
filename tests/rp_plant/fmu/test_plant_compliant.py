"""Compliant stops of the built FMU against closed forms, with every method.

One joint is held by firm friction, without gravity and offset: the other one meets its stop like a
block of mass m. Its stop pushes with k d (1 + c d') at the penetration d.
"""

import math
import re

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from tests.rp_plant.fmu.plant_model_exchange import model
from tests.rp_plant.fmu.plant_runs import (
    COMPLIANT,
    FIRM,
    each_method,
    each_step,
    events,
    last_event,
    modes,
    near,
    read,
    started,
)

LOWER, UPPER = -0.2, 0.3
MASS, STIFFNESS = 1.3, 5e3


def block(joint: int = 2, k: float = STIFFNESS, c: float = 0.0, **values: float) -> dict:
    """A joint with compliant stops between LOWER and UPPER while the other one is held."""
    return {
        "g": 0.0, "a": 0.0, "m2": MASS, f"coulomb_friction{3 - joint}": FIRM,
        f"stops{joint}": COMPLIANT, f"lower{joint}": LOWER, f"upper{joint}": UPPER,
        f"stop_stiffness{joint}": k, f"stop_damping{joint}": c, **values,
    }  # fmt: skip


def inertia(joint: int) -> float:
    """Of the moving joint with the start values: m2, or m1 lc1^2 + I1z + I2z + m2 l1^2."""
    return MASS if joint == 2 else 2.0 * 0.25**2 + 0.1 + 0.05 + MASS * 0.5**2


def conserved(y: float) -> float:
    """y - ln(1 + y), the same for y = c d' where a contact begins and where it ends."""
    return y - math.log1p(y)


def damped_exit(c: float, v: float) -> float:
    """Velocity at which a block leaves a damped stop that it met with v; c v < 1 is not needed."""
    low, high = 0.0, min(v, (1 - 1e-15) / c)
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if conserved(-c * middle) < conserved(c * v) else (low, middle)
    return (low + high) / 2


# ---- A contact -------------------------------------------------------------------------------


@each_method
@each_step
@pytest.mark.parametrize("joint", [1, 2])
@pytest.mark.parametrize("v", [1.2, -1.2])
def test_a_contact_lasts_pi_sqrt_m_over_k(
    plant: Fmu, method: str, h: float, joint: int, v: float
) -> None:
    """Without damping, and the joint leaves as fast as it came, for the other stop."""
    begin = (UPPER if v > 0 else -LOWER) / abs(v)
    lasts = math.pi * math.sqrt(inertia(joint) / STIFFNESS)
    period = lasts + (UPPER - LOWER) / abs(v)
    with started(plant, method, **block(joint, **{f"dq{joint}": v})) as instance:
        found = events(instance, h, 1.0)
        assert len(found) == 1 if h == 1 else len(found) >= 4
        for count, time in found:
            contact, ends = (count - 1) // 2, count % 2 == 0
            assert time == near(begin + contact * period + (lasts if ends else 0.0))
        assert read(instance, f"dq{joint}") == [near(v * (-1) ** (found[-1].count // 2))]
        assert read(instance, f"stop_impulse{joint}", "impact_loss") == [0.0, 0.0]
        assert modes(instance) == ((2, 0) if joint == 1 else (0, 2))


@each_method
@pytest.mark.parametrize("c", [0.01, 0.3, 2.0])
@pytest.mark.parametrize("v", [1.5, -1.5])
@pytest.mark.parametrize("k", [1e3, 1e7])
def test_hunt_and_crossley_conserve_a_function_of_velocity(
    plant: Fmu, method: str, c: float, v: float, k: float
) -> None:
    """y - ln(1 + y) is the same at y = c v_in and y = -c v_out, whatever stiffness and mass are."""
    with started(plant, method, **block(k=k, c=c, dq2=v)) as instance:
        events(instance, 0.01, 0.35)
        assert last_event(instance).count == 2
        (dq2,) = read(instance, "dq2")
        assert dq2 == near(-math.copysign(damped_exit(c, 1.5), v))
        assert conserved(-c * abs(dq2)) == near(conserved(1.5 * c), 1e-8)


@each_method
def test_the_error_falls_with_the_tolerance(plant: Fmu, method: str) -> None:
    """Of the velocity with which a block leaves its stop."""
    c, v = 0.3, 1.5
    expected = -damped_exit(c, v)
    errors = []
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10):
        with started(plant, method, tolerance, **block(c=c, dq2=v)) as instance:
            assert len(events(instance, 0.01, 0.35)) == 2
            errors.append(abs(read(instance, "dq2")[0] - expected))
    assert errors[-1] < 1e-10 and errors[-1] < 1e-3 * max(errors[0], 1e-8)
    for coarse, fine in zip(errors, errors[1:], strict=False):
        assert fine < 0.2 * coarse or fine < 1e-13


# ---- A stop never pulls ----------------------------------------------------------------------


def fall_free(instance: Instance, force: float) -> tuple[float, float]:
    """The slide, pulled out of its lower stop that has let go: time and velocity as it leaves."""
    count, at = last_event(instance)
    q2, dq2, now = read(instance, "q2", "dq2", "time")
    assert count == 1 and read(instance, "stop_force2") == [0.0]
    way, a = LOWER - q2, force / MASS
    v = math.sqrt(dq2 * dq2 + 2 * a * way)
    assert at < now
    return now + (v - dq2) / a, v


@each_method
def test_a_damped_stop_lets_go_of_a_joint_that_is_pulled_out(plant: Fmu, method: str) -> None:
    """From the velocity 1 / c on there is no force: what is left of the way is a free fall."""
    c, force, h = 2.0, 400.0, 1e-4
    with started(plant, method, **block(c=c, q2=LOWER - 0.05, f2=force)) as instance:
        t = 0.0
        while instance.integer("event_count") == 0:
            assert read(instance, "stop_force2")[0] > 0 and read(instance, "dq2")[0] < 1 / c
            instance.do_step(t, h)
            t += h
        leaves, v = fall_free(instance, force)
        (at,) = read(instance, "last_event_time")
        q2, dq2 = read(instance, "q2", "dq2")
        assert dq2 - force / MASS * (t - at) == near(1 / c)
        assert q2 < LOWER and read(instance, "stop2_push")[0] == near(c * dq2 - 1)
        while q2 < LOWER:
            instance.do_step(t, h)
            t += h
            (q2,) = read(instance, "q2")
            assert read(instance, "stop_force2") == [0.0]
        assert last_event(instance) == (2, near(leaves))
        assert read(instance, "dq2") == [near(v + force / MASS * (t - leaves))]


@each_method
def test_a_joint_that_slows_down_meets_the_stop_again(plant: Fmu, method: str) -> None:
    """The stop pushes again from the velocity 1 / c on, before the joint has left it."""
    c, a = 2.0, 40.0
    start = block(c=c, q2=LOWER - 0.05, dq2=0.8, f2=-a * MASS)
    with started(plant, method, **start) as instance:
        assert read(instance, "stop_force2", "stop2_push") == [0.0, pytest.approx(0.6)]
        assert events(instance, 1e-3, 8e-3) == [(1, near((0.8 - 1 / c) / a))]
        force, q2, dq2 = read(instance, "stop_force2", "q2", "dq2")
        assert q2 < LOWER and 0 < dq2 < 1 / c
        assert force == pytest.approx(STIFFNESS * (LOWER - q2) * (1 - c * dq2), rel=1e-12)


# ---- Rest ------------------------------------------------------------------------------------


@each_method
def test_a_slide_settles_on_its_stop(plant: Fmu, method: str) -> None:
    """Under gravity, at the depth m g / k; damping takes all the energy of the fall."""
    g, k, c = 9.81, 1e3, 3.0
    values = {"g": g, "q1": math.pi / 2, "q2": LOWER + 0.1}
    with started(plant, method, **block(k=k, c=c, **values)) as instance:
        begin, _ = read(instance, "total_energy", "time")
        instance.do_step(0.0, 200.0)
        depth = MASS * g / k
        assert read(instance, "q2") == [near(LOWER - depth, 1e-7)]
        assert read(instance, "stop_force2") == [near(MASS * g, 1e-4)]
        lost = MASS * g * (0.1 + depth) - k * depth * depth / 2
        assert begin - read(instance, "total_energy")[0] == near(lost, 1e-6)


@each_method
def test_friction_holds_a_joint_in_its_stop(plant: Fmu, method: str) -> None:
    """As far as it can; a joint pressed in farther is pushed until it rests in between."""
    friction, shallow, deep = 20.0, 0.0039, 0.006
    with started(plant, method, **block(q2=UPPER + shallow, coulomb_friction2=friction)) as held:
        held.do_step(0.0, 10.0)
        assert read(held, "q2", "dq2") == [UPPER + shallow, 0.0]
        push = pytest.approx(-STIFFNESS * shallow)
        assert read(held, "stop_force2", "friction2") == [push, push]
        assert last_event(held).count == 0 and modes(held) == (0, 0)
    with started(plant, method, **block(q2=UPPER + deep, coulomb_friction2=friction)) as pushed:
        assert modes(pushed) == (0, -1)
        assert events(pushed, 1e-3, 1.0) == [
            (1, near(math.pi * math.sqrt(MASS / STIFFNESS)))
        ]  # fmt: skip
        # half a period about the depth at which friction and stop are equal
        assert read(pushed, "q2", "dq2") == [near(UPPER + 2 * friction / STIFFNESS - deep), 0.0]


@each_method
def test_a_ramp_presses_a_joint_that_rests_on_its_limit(plant: Fmu, method: str) -> None:
    """Nothing pushes at first: where the force ends up is decided by its rate."""
    r = 3.0
    omega = math.sqrt(STIFFNESS / MASS)
    for direction in (1, -1):
        values = block(q2=LOWER)
        with started(plant, method, smooth_inputs=("f2",), **values) as instance:
            events(instance, 1e-2, 0.1, {"f2": direction * r})
            t = 0.1
            if direction > 0:
                expected = r * t**3 / (6 * MASS)
            else:  # m d'' + k d = r t
                expected = -r / STIFFNESS * (t - math.sin(omega * t) / omega)
            assert read(instance, "q2") == [near(LOWER + expected)]


# ---- Importers -------------------------------------------------------------------------------


def test_an_importer_pulls_a_joint_out_of_a_stop(plant: Fmu) -> None:
    """The push indicator is found, too: it lets go, leaves, and strikes the other stop."""
    c, force = 2.0, 400.0
    values = block(c=c, q2=LOWER - 0.05, f2=force)
    times = np.array([0.0, 0.1])
    names = ("q2", "dq2", "event_count")
    with started(plant, **values) as instance:
        instance.do_step(0.0, 0.1)
        expected = [*read(instance, "q2", "dq2"), last_event(instance).count]
    with model(plant.path, **values) as instance:
        rows = instance.simulate(times, {}, 1e-11, names)
    assert rows[-1].tolist() == [near(x, 1e-7) for x in expected] and expected[2] == 3


@each_method
def test_a_stop_that_is_far_too_stiff(plant: Fmu, method: str) -> None:
    """A step from deep in it is discarded, and the log says nothing about a step of nan."""
    limits = {"lower2": 0.0, "upper2": 1.0, "stops2": COMPLIANT, "stop_stiffness2": 1e300}
    with started(plant, method, 1e-8, q2=1.5, dq2=1.0, tau1=1.0, **limits) as instance:
        with pytest.raises(FMICallException):
            instance.do_step(0.0, 1.0)
        assert not any(re.search(r"\bnan\b", message) for message in instance.messages)
        if method == "cvode_adams":
            named = "the derivatives of the states are too large for a first step"
            assert f"cvode_adams: {named}" in instance.messages
