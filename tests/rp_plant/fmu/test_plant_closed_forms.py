"""The built FMU against closed forms, with every method: rest, steep friction and stiff stops.
test_plant_random_motions.py has motions of all kinds, events/test_impacts.c endless bounces.

One joint is held by firm friction where the form is that of the other one.
"""

import math
import re

import mpmath
import pytest
from fmpy.fmi1 import FMICallException

from rparm.fmi.fmu_file import Fmu
from tests.rp_plant.fmu.plant_runs import (
    COMPLIANT,
    FIRM,
    RIGID,
    each_method,
    each_step,
    events,
    last_event,
    modes,
    near,
    read,
    started,
)

# ---- Friction --------------------------------------------------------------------------------


def time_to_rest(m: float, v0: float, Fc: float, Fb: float, vs: float) -> float:
    """Integral of m / F(v) over the velocity, in parts, as F changes near 0 only."""
    ends = [k * vs for k in (0, 0.5, 1, 2, 3, 4, 6, 9) if k * vs < v0] + [v0]
    return float(mpmath.quad(lambda v: m / (Fc + (Fb - Fc) * mpmath.exp(-((v / vs) ** 2))), ends))


@each_method
@each_step
@pytest.mark.parametrize(
    ("Fc", "Fb", "vs", "v0"),
    [
        (1.0, 2.0, 0.3, 1.5),
        (1.0, 2.0, 0.1, -1.5),
        (1.0, 2.0, 0.01, 1.5),
        (1.0, 2.0, 1e-4, -1.5),
        (1.4, 4.0, 0.1, 3.0),
        (1.4, 4.0, 0.2, -3.0),
    ],
)
def test_a_block_stops_by_stribecks_law(
    fmi2_plant: Fmu, method: str, h: float, Fc: float, Fb: float, vs: float, v0: float
) -> None:
    """However small the velocity is below which friction grows: no step passes over it."""
    m = 1.3
    friction = {"coulomb_friction2": Fc, "breakaway_friction2": Fb, "stribeck_velocity2": vs}
    values = {"m2": m, "a": 0.0, "dq2": v0, "coulomb_friction1": FIRM}
    with started(fmi2_plant, method, **values, **friction) as instance:
        assert events(instance, h, 3.0) == [(1, near(time_to_rest(m, abs(v0), Fc, Fb, vs)))]
        assert modes(instance) == (0, 0)


@each_method
def test_held_against_efforts_that_change(fmi2_plant: Fmu, method: str) -> None:
    """Each millisecond for 6 s, within what friction holds: nothing moves or is integrated."""
    start = {"q1": 0.4, "q2": 0.123456789}
    friction = {"coulomb_friction1": 14.0, "coulomb_friction2": 6.0}
    with started(fmi2_plant, method, tolerance=1e-8, **start, **friction) as instance:
        efforts = instance.reals(["tau1", "f2"])
        states = instance.reals(["q1", "q2", "dq1", "dq2"])
        for i in range(6_000):
            efforts.view[:] = math.sin(0.3 * i), math.cos(0.7 * i)
            efforts.set()
            instance.do_step(i * 1e-3, 1e-3)
            if i % 100 == 0:
                states.get()
                assert states.view.tolist() == [*start.values(), 0.0, 0.0]
        states.get()
        assert states.view.tolist() == [*start.values(), 0.0, 0.0]
        assert last_event(instance) == (0, 0.0)
        assert instance.integer("solver_restarts") == 0


# ---- Rigid stops -----------------------------------------------------------------------------


@each_method
def test_bouncing_ends_at_a_tenth_of_the_requested_tolerance(fmi2_plant: Fmu, method: str) -> None:
    """The slide falls on its stop. Each bounce has a quarter of the height of the one before."""
    g, height, e, tolerance = 9.81, 0.3, 0.5, 1e-8
    bounces = math.ceil(math.log(0.1 * tolerance * (0.2 + 0.01) / height) / math.log(e * e))
    fall = math.sqrt(2 * height / g)
    end = fall * (1 + 2 * sum(e**n for n in range(1, bounces)))
    start = {"stops2": RIGID, "lower2": -0.2, "restitution2": e}
    start |= {"a": 0.0, "q1": math.pi / 2, "q2": height - 0.2, "coulomb_friction1": FIRM}
    with started(fmi2_plant, method, tolerance, **start) as instance:
        assert events(instance, 1.0, 1.0) == [(bounces, near(end, 100 * tolerance))]
        assert read(instance, "q2", "dq2") == [-0.2, 0.0]


# ---- Compliant stops -------------------------------------------------------------------------

LOWER, UPPER = -0.2, 0.3
MASS, STIFFNESS = 1.3, 5e3


def block(k: float = STIFFNESS, c: float = 0.0, **values: float) -> dict:
    """Return values of a slide of mass MASS between stops that push with k d (1 + c d') at the
    penetration d, while joint 1 is held."""
    return {
        "g": 0.0, "a": 0.0, "m2": MASS, "coulomb_friction1": FIRM,
        "stops2": COMPLIANT, "lower2": LOWER, "upper2": UPPER,
        "stop_stiffness2": k, "stop_damping2": c, **values,
    }  # fmt: skip


@each_method
def test_a_slide_settles_on_its_stop(fmi2_plant: Fmu, method: str) -> None:
    """Under gravity, at the depth m g / k; damping takes all the energy of the fall."""
    g, k, c = 9.81, 1e3, 3.0
    values = {"g": g, "q1": math.pi / 2, "q2": LOWER + 0.1}
    with started(fmi2_plant, method, **block(k=k, c=c, **values)) as instance:
        begin, _ = read(instance, "total_energy", "time")
        instance.do_step(0.0, 200.0)
        depth = MASS * g / k
        assert read(instance, "q2") == [near(LOWER - depth, 1e-7)]
        assert read(instance, "stop_force2") == [near(MASS * g, 1e-4)]
        lost = MASS * g * (0.1 + depth) - k * depth * depth / 2
        assert begin - read(instance, "total_energy")[0] == near(lost, 1e-6)


@each_method
def test_a_ramp_presses_a_joint_that_rests_on_its_limit(fmi2_plant: Fmu, method: str) -> None:
    """Nothing pushes at first: where the force ends up is decided by its rate."""
    r = 3.0
    omega = math.sqrt(STIFFNESS / MASS)
    for direction in (1, -1):
        values = block(q2=LOWER)
        with started(fmi2_plant, method, smooth_inputs=("f2",), **values) as instance:
            events(instance, 1e-2, 0.1, {"f2": direction * r})
            t = 0.1
            if direction > 0:
                expected = r * t**3 / (6 * MASS)
            else:  # m d'' + k d = r t
                expected = -r / STIFFNESS * (t - math.sin(omega * t) / omega)
            assert read(instance, "q2") == [near(LOWER + expected)]


@each_method
def test_a_stop_that_is_far_too_stiff(fmi2_plant: Fmu, method: str) -> None:
    """A step from deep in it is discarded, and the log says nothing about a step of nan."""
    limits = {"lower2": 0.0, "upper2": 1.0, "stops2": COMPLIANT, "stop_stiffness2": 1e300}
    with started(fmi2_plant, method, 1e-8, q2=1.5, dq2=1.0, tau1=1.0, **limits) as instance:
        with pytest.raises(FMICallException):
            instance.do_step(0.0, 1.0)
        assert not any(re.search(r"\bnan\b", message) for message in instance.messages)
        if method == "cvode_adams":
            named = "the derivatives of the states are too large for a first step"
            assert f"cvode_adams: {named}" in instance.messages
