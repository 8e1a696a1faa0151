"""Friction and stops of the built FMU against closed forms, with every method and steps of
1 ms, 10 ms and 1 s.

One joint is held by firm friction where the form is that of the other one.
"""

import math

import mpmath
import pytest

from rparm.fmi.fmu_file import Fmu
from tests.rp_plant.fmu.plant_runs import (
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


def inertia1(m1: float = 2.0, m2: float = 1.0, q2: float = 0.0) -> float:
    """J = m1 lc1^2 + I1z + I2z + m2 (l1 + q2)^2 with start values, kg.m2."""
    return m1 * 0.25**2 + 0.1 + 0.05 + m2 * (0.5 + q2) ** 2


# ---- Friction --------------------------------------------------------------------------------


@each_method
@each_step
@pytest.mark.parametrize("damping", [0.0, 0.7])
@pytest.mark.parametrize("v0", [1.5, -1.5])
def test_a_block_stops(plant: Fmu, method: str, h: float, damping: float, v0: float) -> None:
    """After m v0 / F, or (m / c) ln(1 + c v0 / F), and stays."""
    m, F = 1.3, 1.1
    stop, way = m * abs(v0) / F, m * v0 * abs(v0) / (2 * F)
    if damping > 0:
        scale = m / damping
        stop = scale * math.log1p(damping * abs(v0) / F)
        way = scale * math.copysign(abs(v0) - F / m * stop, v0)
    values = {"m2": m, "coulomb_friction2": F, "damping2": damping, "dq2": v0}
    with started(plant, method, a=0.0, coulomb_friction1=FIRM, **values) as instance:
        assert events(instance, h, 3.0) == [(1, near(stop))]
        assert read(instance, "dq1", "dq2") == [0, 0]
        assert read(instance, "q2") == [near(way)]
        assert modes(instance) == (0, 0)


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
    plant: Fmu, method: str, h: float, Fc: float, Fb: float, vs: float, v0: float
) -> None:
    """However small the velocity is below which friction grows: no step passes over it."""
    m = 1.3
    friction = {"coulomb_friction2": Fc, "breakaway_friction2": Fb, "stribeck_velocity2": vs}
    values = {"m2": m, "a": 0.0, "dq2": v0, "coulomb_friction1": FIRM}
    with started(plant, method, **values, **friction) as instance:
        assert events(instance, h, 3.0) == [(1, near(time_to_rest(m, abs(v0), Fc, Fb, vs)))]
        assert modes(instance) == (0, 0)


@each_method
@each_step
def test_a_ramp_breaks_joint_2_away(plant: Fmu, method: str, h: float) -> None:
    """At Fb2 / r; before, nothing moves at all."""
    breakaway, r = 3.3, 2.03
    friction = {"coulomb_friction2": 2.0, "breakaway_friction2": breakaway}
    friction |= {"stribeck_velocity2": 0.1, "coulomb_friction1": FIRM}
    with started(plant, method, smooth_inputs=("f2",), **friction) as instance:
        assert events(instance, h, 1.0, {"f2": r}) == []
        assert read(instance, "q1", "q2", "dq1", "dq2") == [0, 0, 0, 0]
    with started(plant, method, smooth_inputs=("f2",), **friction) as instance:
        assert events(instance, h, 2.0, {"f2": r}) == [(1, near(breakaway / r))]
        assert modes(instance) == (0, 1)
        assert read(instance, "dq2")[0] > 0


@each_method
@each_step
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_ramp_breaks_joint_1_away(plant: Fmu, method: str, h: float, direction: float) -> None:
    """At (Fb1 + gravity1) / r upwards, (Fb1 - gravity1) / r downwards."""
    breakaway, r, m1, m2, q2 = 24.9, 12.3, 2.0, 1.0, 0.2
    gravity = 9.81 * (m1 * 0.25 + m2 * (0.5 + q2))
    friction = {"coulomb_friction1": breakaway, "coulomb_friction2": FIRM}
    expected = (breakaway + direction * gravity) / r
    slopes = {"tau1": direction * r}
    with started(plant, method, smooth_inputs=("tau1",), q2=q2, **friction) as instance:
        found = events(instance, h, math.ceil(expected), slopes)
        assert found == [(1, near(expected))]
        assert modes(instance) == (direction, 0)


@each_method
@each_step
def test_a_sliding_joint_2_breaks_joint_1_away(plant: Fmu, method: str, h: float) -> None:
    """It breaks away at F2 / r, joint 1 at (F2 + F1 / |a|) / r."""
    F1, F2, a, r = 0.32, 1.4, -0.2, 2.03
    friction = {"coulomb_friction1": F1, "coulomb_friction2": F2}
    with started(plant, method, smooth_inputs=("f2",), g=0.0, a=a, **friction) as instance:
        expected = [(1, near(F2 / r)), (2, near((F2 + F1 / abs(a)) / r))]
        assert events(instance, h, 2.0, {"f2": r}) == expected
        assert modes(instance) == (-1, 1)


@each_method
@each_step
def test_a_spinning_arm_throws_its_slide_out(plant: Fmu, method: str, h: float) -> None:
    """At J / (tau1 - F1) sqrt(F2 / (m2 L))."""
    F1, F2, torque = 0.4, 2.5, 1.1
    expected = inertia1() / (torque - F1) * math.sqrt(F2 / (1.0 * 0.5))
    values = {"g": 0.0, "a": 0.0, "tau1": torque}
    friction = {"coulomb_friction1": F1, "coulomb_friction2": F2}
    with started(plant, method, **values, **friction) as instance:
        assert events(instance, h, math.ceil(expected)) == [(1, near(expected))]
        assert modes(instance)[1] in (0, 1)
        assert read(instance, "q2")[0] > 0


@each_method
@pytest.mark.parametrize("h", [1.0, 10.0])
def test_held_for_an_hour(plant: Fmu, method: str, h: float) -> None:
    """Under gravity without efforts: not one bit of the positions changes."""
    start = {"q1": 0.4, "q2": 0.123456789}
    friction = {"coulomb_friction1": 12.0, "coulomb_friction2": 4.0}
    with started(plant, method, tolerance=1e-8, **start, **friction) as instance:
        reals = instance.reals(["q1", "q2", "dq1", "dq2"])
        for i in range(round(3600 / h)):
            instance.do_step(i * h, h)
            reals.get()
            assert reals.view.tolist() == [*start.values(), 0.0, 0.0]
        assert last_event(instance) == (0, 0.0)


@each_method
def test_held_against_efforts_that_change(plant: Fmu, method: str) -> None:
    """Each millisecond for a minute, within what friction holds: nothing moves or is integrated."""
    start = {"q1": 0.4, "q2": 0.123456789}
    friction = {"coulomb_friction1": 14.0, "coulomb_friction2": 6.0}
    with started(plant, method, tolerance=1e-8, **start, **friction) as instance:
        efforts = instance.reals(["tau1", "f2"])
        states = instance.reals(["q1", "q2", "dq1", "dq2"])
        for i in range(60_000):
            efforts.view[:] = math.sin(0.3 * i), math.cos(0.7 * i)
            efforts.set()
            instance.do_step(i * 1e-3, 1e-3)
            if i % 1000 == 0:
                states.get()
                assert states.view.tolist() == [*start.values(), 0.0, 0.0]
        states.get()
        assert states.view.tolist() == [*start.values(), 0.0, 0.0]
        assert last_event(instance) == (0, 0.0)
        assert instance.integer("solver_restarts") == 0


# ---- Stops -----------------------------------------------------------------------------------


@each_method
@each_step
def test_a_slide_bounces_to_rest(plant: Fmu, method: str, h: float) -> None:
    """Impact k at t1 + 2 v1 (e + ... + e^(k-1)) / g; at rest t1 (1 + e) / (1 - e) after the start.

    Rest comes early by the bounces that go no higher than the absolute tolerance of q2. Those
    before them are not much higher, and with cvode_bdf as inexact.
    """
    g, e, height = 9.81, 0.8, 0.5
    t1 = math.sqrt(2 * height / g)
    stops = {"stops2": RIGID, "lower2": 0.0, "upper2": 5.0, "restitution2": e}
    values = {"a": 0.0, "q1": math.pi / 2, "q2": height, "coulomb_friction1": FIRM}
    with started(plant, method, **stops, **values) as instance:
        found = events(instance, h, 4.0)
        assert len(found) > (20 if h < 1 else 1)
        for count, time in found[:-1]:
            bounces = sum(e**k for k in range(1, count))
            assert time == near(t1 + 2 * g * t1 * bounces / g)
        (tolerance,) = read(instance, "effective_relative_tolerance")
        left_out = 2 * math.sqrt(2 * 1e-2 * tolerance / g) / (1 - e)
        rest = t1 * (1 + e) / (1 - e)
        early = rest - found[-1].time
        assert 0 < early <= (1.5 if method == "cvode_bdf" else 1) * left_out
        assert found[-1].count < 100
        assert read(instance, "q2", "dq2", "stop_force2") == [0.0, 0.0, pytest.approx(g)]
        assert modes(instance) == (0, 0)
        loss = 1.0 * g * height
        assert read(instance, "impact_loss") == [pytest.approx(loss, rel=1e-8)]


@each_method
@pytest.mark.parametrize("e", [0.0, 0.6, 1.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_an_impact_of_the_slide_turns_joint_1(
    plant: Fmu, method: str, e: float, side: float
) -> None:
    """Read 1 ns after it: dq2 jumps to -e dq2, dq1 by -(1 + e) dq2 (1/D)_12 / (1/D)_22, p1 is as
    before, and the energy is less by (1 - e^2) dq2^2 / (2 (1/D)_22)."""
    v, a, limit = 0.7, 0.15, 0.4
    D11 = inertia1(q2=side * limit) + a**2
    effective = inertia1(q2=side * limit) / D11  # 1 / (1/D)_22, with m2 = 1
    stops = {"stops2": RIGID, "lower2": -limit, "upper2": limit, "restitution2": e}
    with started(plant, method, g=0.0, a=a, dq2=side * v, **stops) as instance:
        instance.do_step(0.0, limit / v + 1e-9)
        assert last_event(instance) == (1, near(limit / v))
        expected = [-side * (1 + e) * v * a / D11, -side * e * v]
        assert read(instance, "dq1", "dq2") == pytest.approx(expected, rel=0, abs=1e-8)
        assert read(instance, "impact_loss", "stop_impulse2") == pytest.approx(
            [0.5 * (1 - e**2) * v**2 * effective, -side * (1 + e) * v * effective], rel=0, abs=1e-9
        )
        D11, D12, dq1, dq2, energy = read(instance, "D11", "D12", "dq1", "dq2", "total_energy")
        assert D11 * dq1 + D12 * dq2 == near(-side * a * v)
        assert energy == near(0.5 * v**2 * (1 - (1 - e**2) * effective))


@each_method
@pytest.mark.parametrize("e", [0.6, 1.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_an_impact_of_joint_1_knocks_the_slide_loose(
    plant: Fmu, method: str, e: float, side: float
) -> None:
    """The mirror image: p2 is as before, also where friction held the slide."""
    v, a, limit, F2 = 0.8, 0.15, 0.5, 2.0
    stops = {"stops1": RIGID, "lower1": -limit, "upper1": limit, "restitution1": e}
    with started(
        plant, method, g=0.0, a=a, dq1=side * v, coulomb_friction2=F2, **stops
    ) as instance:
        instance.do_step(0.0, limit / v / 2)
        assert modes(instance) == (2, 0)
        instance.do_step(limit / v / 2, limit / v / 2 + 1e-9)
        assert last_event(instance) == (1, near(limit / v))
        expected = [-side * e * v, -side * a * (1 + e) * v]
        assert read(instance, "dq1", "dq2") == pytest.approx(expected, rel=0, abs=2e-8)
        assert modes(instance)[1] == -side
        assert read(instance, "impact_loss", "stop_impulse1") == pytest.approx(
            [0.5 * (1 - e**2) * v**2 * inertia1(), -side * (1 + e) * v * inertia1()],
            rel=0,
            abs=1e-9,
        )


@each_method
@pytest.mark.parametrize("h", [1e-3, 1e-2, 1.0, 10.0])
def test_a_parabola_that_passes_a_stop_slightly_is_found(plant: Fmu, method: str, h: float) -> None:
    """By 1e-7 m, at any communication step."""
    g, v, excess = 9.81, 2.0, 1e-7
    top = v**2 / (2 * g)
    hit = (v - math.sqrt(2 * g * excess)) / g
    stops = {"stops2": RIGID, "lower2": -1e4, "upper2": top - excess, "restitution2": 0.5}
    values = {"a": 0.0, "q1": math.pi / 2, "dq2": v, "coulomb_friction1": FIRM}
    with started(plant, method, **stops, **values) as instance:
        found = events(instance, h, max(h, 0.35))
        assert found == [(1, pytest.approx(hit, rel=0, abs=1e-8))]
