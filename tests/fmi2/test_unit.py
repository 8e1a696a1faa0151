"""The arm's values against sympy, long runs, masters that are a little off, and what the solver
says of itself."""

import math
import random
from ctypes import c_double
from types import SimpleNamespace

import heyoka as hy
import mpmath
import numpy as np
import pytest
import sympy as sp
from fmpy import fmi2
from rparm.models.rp_manipulator.references.make_references import integrator

from tests.support.instances import INPUTS, STATES, Instance, LoadedFmu
from tests.support.rparm_project import declared
from tests.support.symbolic import KNOWNS, arm_expressions, random_arm

START = {"q1": -1.43, "q2": 0.58, "dq1": 1.97, "dq2": 0.12}
# In the horizontal plane a constant force draws link 2 in, the spin drives it out: bounded for
# ever, not chaotic, with two quantities that are conserved.
WHIRL = {"g": 0.0, "q2": 0.1, "dq1": 4.0, "f2": -5.0}


def reference(values: dict[str, float]) -> hy.taylor_adaptive:
    """The motion from `values`, the inputs being heyoka's parameters; in long double."""
    case = SimpleNamespace(start_values=declared("rp_manipulator").start_values | values)
    inputs = {name: hy.par[i] for i, name in enumerate(INPUTS)}
    motion = integrator(case, inputs, pars=len(INPUTS))
    motion.pars[:] = [np.longdouble(values.get(name, 0.0)) for name in INPUTS]
    return motion


# ---- Values --------------------------------------------------------------------------------------


def test_every_output_and_local_has_its_symbolic_value(loaded: LoadedFmu) -> None:
    """At points without zeros, the slide on both sides of the axis."""
    expressions = arm_expressions()
    names = tuple(expressions)
    assert {
        variable.name
        for variable in loaded.description.modelVariables
        if variable.causality in ("output", "local") and variable.variability == "continuous"
    } == {*names, "der_q1", "der_q2"}
    symbolic = sp.lambdify(sp.symbols(KNOWNS), list(expressions.values()), "mpmath", cse=True)
    for seed in range(6):
        source = random.Random(seed)
        point = random_arm(source)
        point |= {name: source.uniform(-30.0, 30.0) for name in INPUTS}
        point |= {name: source.uniform(-3.0, 3.0) for name in STATES}
        with Instance(loaded).begin(**point) as instance:
            expected = [float(x) for x in symbolic(*map(mpmath.mpf, instance.get(*KNOWNS)))]
            scale = max(abs(value) for value in expected)
            assert instance.get(*names) == pytest.approx(expected, rel=1e-11, abs=1e-14 * scale)


# ---- Ten minutes -------------------------------------------------------------------------------


def conserved(instance: Instance) -> tuple[float, float]:
    """Of the whirl: energy without the work of f2 (J), angular momentum about z0 (kg m2/s)."""
    q2, dq1, dq2, energy, f2, D11, D12 = instance.get(
        "q2", "dq1", "dq2", "total_energy", "f2", "D11", "D12"
    )
    return energy - f2 * q2, D11 * dq1 + D12 * dq2


def whirl(
    loaded: LoadedFmu, times: list[float], lengths: list[float], stop: float | None
) -> tuple[list[float], float]:
    """Final states, and the largest relative change of what is conserved at every 1000th step."""
    change = 0.0
    with Instance(loaded) as instance:
        instance.initialize(times[0], stop, 1e-10, **WHIRL)
        component, step = instance.fmi.component, instance.fmi.fmi2DoStep
        first = conserved(instance)
        for i, (t, h) in enumerate(zip(times, lengths, strict=False)):
            step(component, t, h, fmi2.fmi2True)
            if i % 1000 == 0 or i == len(lengths) - 1:
                now = conserved(instance)
                change = max(
                    change, *(abs(a - b) / abs(b) for a, b in zip(now, first, strict=True))
                )
        assert not instance.messages
        return instance.get(*STATES), change


@pytest.mark.parametrize("accumulated", [False, True])
def test_ten_minutes_in_steps_of_a_sixtieth(loaded: LoadedFmu, accumulated: bool) -> None:
    """Points i / 60 s, and points that a master adds up: 36 000 steps are followed."""
    h, count = 1 / 60, 36_000
    times = [i / 60 for i in range(count + 1)]
    if accumulated:
        for i in range(count):
            times[i + 1] = times[i] + h
    motion = reference(WHIRL)
    motion.propagate_until(np.longdouble(times[-1]))
    states, change = whirl(loaded, times, [h] * count, 600.0)
    assert change < 1e-8
    assert np.max(np.abs(np.array(states) - motion.state.astype(float))) < 1e-5


def control(t: float, states: list[float]) -> tuple[float, float]:
    """A sampled controller that swings the arm and holds link 2: tau1 (N.m), f2 (N)."""
    q1, q2, dq1, dq2 = states
    tau1 = 4.0 * math.cos(q1) - 20.0 * (q1 - 0.8 * math.sin(0.7 * t)) - 4.0 * dq1
    f2 = 9.81 * math.sin(q1) - 30.0 * (q2 - 0.2 * math.sin(1.1 * t)) - 8.0 * dq2
    return tau1, f2


def test_ten_minutes_under_control(loaded: LoadedFmu) -> None:
    """Both inputs change at each of 36 000 steps of 1/60 s: the controller is in the master."""
    h, count = 1 / 60, 36_000
    motion = reference(START)
    expected = np.empty((count, len(STATES)))
    for i in range(count):
        motion.pars[:] = control(i / 60, motion.state.astype(float).tolist())
        motion.time = np.longdouble(0)
        motion.propagate_until(np.longdouble((i + 1) / 60) - np.longdouble(i / 60))
        expected[i] = motion.state
    found = np.empty_like(expected)
    with Instance(loaded) as instance:
        instance.initialize(stop=600.0, tolerance=1e-8, **START)
        fmi, component = instance.fmi, instance.fmi.component
        inputs = (fmi2.fmi2ValueReference * 2)(*(loaded.references[name] for name in INPUTS))
        states = (fmi2.fmi2ValueReference * 4)(*(loaded.references[name] for name in STATES))
        u, x = (c_double * 2)(), (c_double * 4)(*START.values())
        for i in range(count):
            u[:] = control(i / 60, list(x))
            fmi.fmi2SetReal(component, inputs, 2, u)
            fmi.fmi2DoStep(component, i / 60, h, fmi2.fmi2True)
            fmi.fmi2GetReal(component, states, 4, x)
            found[i] = x
        assert instance.count("solver_restarts") == count
    assert np.max(np.abs(expected)) < 5 and np.ptp(expected[-3000:, 0]) > 0.5  # still moving
    assert np.max(np.abs(found - expected)) < 1e-8


# ---- Solver insight ----------------------------------------------------------------------------


COUNTERS = ("solver_steps", "solver_rhs_evaluations", "solver_restarts", "solver_failed_steps")


def counters(instance: Instance) -> dict[str, int]:
    return {name: instance.count(name) for name in (*COUNTERS, "solver_last_order")}


def test_before_the_first_step_nothing_is_counted(loaded: LoadedFmu) -> None:
    with Instance(loaded) as instance:
        for _ in range(2):
            instance.initialize(**START)
            assert set(counters(instance).values()) == {0}
            assert instance.get("solver_last_step") == [0.0]
            instance.step(0.0, 0.1)
            assert min(counters(instance)[name] for name in COUNTERS[:3]) > 0
            instance.fmi.reset()


def test_restarts_are_those_that_changes_ask_for(loaded: LoadedFmu) -> None:
    """One at the start, one for each change of an input or a parameter, one for each polynomial."""
    with Instance(loaded) as instance:
        instance.initialize(**START, tau1=0.5)
        t, expected = 0.0, 1
        for i in range(60):
            if i % 10 == 5:
                instance.set(tau1=float(i))
                expected += 1
            if i % 10 == 7:
                instance.set(tau1=99.0, f2=3.0)
                instance.set(tau1=float(i - 2), f2=0.0)  # back again: no change
            if i == 38:
                instance.set(m1=2.5)
                expected += 1
            if i == 51:
                instance.set_input_derivatives(f2=[1.0])
                expected += 1  # with the polynomial
            if i == 52:
                expected += 1  # and without, from its last value
            t = instance.step(t, 0.01)
            assert instance.count("solver_restarts") == expected


def test_numbers_of_the_solver_are_plausible(loaded: LoadedFmu) -> None:
    with Instance(loaded) as instance:
        instance.initialize(tolerance=1e-10, **WHIRL)
        before, t = counters(instance), 0.0
        highest = 0
        for _ in range(2000):
            t = instance.step(t, 0.01)
            now = counters(instance)
            assert all(now[name] >= before[name] for name in COUNTERS)
            assert 1 <= now["solver_last_order"] <= 12  # Adams
            assert 0 < instance.get("solver_last_step")[0] < 1
            highest = max(highest, now["solver_last_order"])
            before = now
        assert highest > 4
        assert t / now["solver_steps"] > 1e-3  # the mean step
        assert now["solver_rhs_evaluations"] > now["solver_steps"]
        assert 0 < now["solver_failed_steps"] < now["solver_steps"] / 10
        # nothing changed: only the history's length asks for restarts
        assert 1 <= now["solver_restarts"] <= 1 + now["solver_steps"] / 500


def test_model_exchange_counts_nothing(loaded: LoadedFmu) -> None:
    with Instance(loaded, fmi2.FMU2Model) as model:
        model.initialize(**START)
        model.fmi.newDiscreteStates()
        model.fmi.enterContinuousTimeMode()
        model.fmi.getDerivatives((c_double * 4)(), 4)
        assert set(counters(model).values()) == {0}
