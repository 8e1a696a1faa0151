"""Directional and output derivatives of the FMU against a sympy model that starts from positions.

Every derivative must agree within 1e-11 of its exact value; where that is tiny or zero, within
1e-14 of the largest in its row (symbolic.Exact).
"""

import ctypes
import itertools
import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import mpmath
import pytest
import sympy as sp
from fmpy.fmi2 import FMU2Model, FMU2Slave

from tests.support.instances import INPUTS, STATES, Instance, LoadedFmu
from tests.support.symbolic import KNOWNS, Model, Values, random_arm


@pytest.fixture(scope="module")
def model() -> Model:
    return Model()


# ---- Instances at random points ------------------------------------------------------------------


def generic_point(seed: int) -> Values:
    """Parameters, inputs and states, none of them zero; the slide on both sides of the axis."""
    source = random.Random(seed)
    moving = dict(
        tau1=source.uniform(-30.0, 30.0),
        f2=source.uniform(-30.0, 30.0),
        q1=source.uniform(-3.0, 3.0),
        q2=source.uniform(-3.0, 2.0),
        dq1=source.uniform(-4.0, 4.0),
        dq2=source.uniform(-3.0, 3.0),
    )
    return random_arm(source) | moving


SEEDS = range(6)
ALIASES = {"der_q1": "dq1", "der_q2": "dq2"}  # state derivatives that are states


def some(point: Values, names: tuple[str, ...]) -> Values:
    return {name: point[name] for name in names}


def in_initialization_mode(loaded: LoadedFmu, seed: int, kind: type = FMU2Slave) -> Instance:
    return Instance(loaded, kind).begin(**generic_point(seed))


@contextmanager
def between_steps(loaded: LoadedFmu, seed: int) -> Iterator[Instance]:
    with in_initialization_mode(loaded, seed) as instance:
        instance.fmi.exitInitializationMode()
        instance.step(0.0, 0.01)
        instance.set(**some(generic_point(seed + 1000), INPUTS))
        yield instance


@contextmanager
def in_event_mode(loaded: LoadedFmu, seed: int) -> Iterator[Instance]:
    with in_initialization_mode(loaded, seed, FMU2Model) as instance:
        instance.fmi.exitInitializationMode()
        instance.set(**some(generic_point(seed + 1000), INPUTS))
        yield instance


@contextmanager
def in_continuous_time_mode(loaded: LoadedFmu, seed: int) -> Iterator[Instance]:
    with in_event_mode(loaded, seed) as instance:
        instance.fmi.newDiscreteStates()
        instance.fmi.enterContinuousTimeMode()
        point = generic_point(seed + 2000)
        instance.fmi.setTime(0.25)
        instance.fmi.setContinuousStates((ctypes.c_double * 4)(*(point[s] for s in STATES)), 4)
        instance.set(**some(point, INPUTS))
        yield instance


MODES = {
    "initialization": in_initialization_mode,
    "steps": between_steps,
    "event": in_event_mode,
    "continuous time": in_continuous_time_mode,
}
each_mode = pytest.mark.parametrize("enter", MODES.values(), ids=MODES)
each_seed = pytest.mark.parametrize("seed", SEEDS)


def point_of(instance: Instance) -> Values:
    return dict(zip(KNOWNS, instance.get(*KNOWNS), strict=True))


def directional(instance: Instance, unknowns: tuple[str, ...], seed: Values) -> Values:
    """Derivatives of `unknowns` in the direction of `seed`, in one call."""
    references = instance.loaded.references
    result = instance.fmi.getDirectionalDerivative(
        [references[name] for name in unknowns], [references[name] for name in seed], seed.values()
    )
    return dict(zip(unknowns, result, strict=True))


# ---- Directional derivatives ---------------------------------------------------------------------


def test_the_symbolic_model_has_every_output_and_local_of_the_arm(
    loaded: LoadedFmu, model: Model
) -> None:
    of_the_arm = [
        variable.name
        for variable in loaded.description.modelVariables
        if variable.causality in ("output", "local")
        and variable.variability == "continuous"
        and variable.name not in ALIASES
    ]
    assert set(model.expressions) == set(of_the_arm)
    assert [name for name in of_the_arm if name in model.outputs] == list(model.outputs)


@each_seed
def test_the_symbolic_model_has_the_values_of_the_unit(
    loaded: LoadedFmu, model: Model, seed: int
) -> None:
    with in_initialization_mode(loaded, seed) as instance:
        at = {sp.Symbol(name): mpmath.mpf(value) for name, value in point_of(instance).items()}
        names = tuple(model.expressions)
        expected = [float(model.expressions[name].evalf(40, subs=at)) for name in names]
        scale = max(abs(value) for value in expected)
        assert instance.get(*names) == pytest.approx(expected, rel=1e-11, abs=1e-14 * scale)


@each_mode
@each_seed
def test_directional_derivatives_are_exact(
    loaded: LoadedFmu, model: Model, enter: Callable, seed: int
) -> None:
    """Every output, local and state derivative with respect to every input and state."""
    unknowns, knowns = tuple(model.expressions), (*INPUTS, *STATES)
    with enter(loaded, seed) as instance:
        exact = model.jacobian(point_of(instance), knowns)
        for known in knowns:
            for unknown, value in directional(instance, unknowns, {known: 1.0}).items():
                exact[unknown, known].assert_is(value, (unknown, known))


@pytest.mark.parametrize("kind", [FMU2Slave, FMU2Model])
@each_seed
def test_parameters_are_knowns_of_the_initialization(
    loaded: LoadedFmu, model: Model, kind: type, seed: int
) -> None:
    unknowns = tuple(model.expressions)
    with in_initialization_mode(loaded, seed, kind) as instance:
        exact = model.jacobian(point_of(instance), KNOWNS)
        for known in KNOWNS:
            for unknown, value in directional(instance, unknowns, {known: 1.0}).items():
                exact[unknown, known].assert_is(value, (unknown, known))


def test_asking_changes_nothing(loaded: LoadedFmu, model: Model) -> None:
    with between_steps(loaded, 1) as instance, between_steps(loaded, 1) as other:
        directional(instance, tuple(model.expressions), dict.fromkeys(STATES, 1.0))
        assert instance.everything() == other.everything()
        instance.step(0.01, 0.01)
        other.step(0.01, 0.01)
        assert instance.everything() == other.everything()


# ---- Output derivatives --------------------------------------------------------------------------


def output_derivatives(instance: Instance, names: tuple[str, ...]) -> dict[tuple[str, int], float]:
    """Derivatives of orders 1 and 2, in one call."""
    wanted = list(itertools.product(names, (1, 2)))
    references = [instance.loaded.references[name] for name, _ in wanted]
    values = instance.fmi.getRealOutputDerivatives(references, [order for _, order in wanted])
    return dict(zip(wanted, values, strict=True))


def assert_output_derivatives(
    instance: Instance, model: Model, inputs: Values, rates: list[list]
) -> None:
    """Compare with the motion of the state that the FMU reports, under the given inputs."""
    exact = model.along_the_motion(point_of(instance) | inputs, rates)
    for key, value in output_derivatives(instance, model.outputs).items():
        exact[key].assert_is(value, key)


NO_RATES = [[0.0, 0.0], [0.0, 0.0]]


@each_seed
def test_output_derivatives_with_held_inputs(loaded: LoadedFmu, model: Model, seed: int) -> None:
    with in_initialization_mode(loaded, seed) as instance:
        instance.fmi.exitInitializationMode()
        assert_output_derivatives(instance, model, {}, NO_RATES)
        t = 0.0
        for i, h in enumerate((0.01, 0.003, 0.02)):
            t = instance.step(t, h)
            assert_output_derivatives(instance, model, {}, NO_RATES)
            instance.set(**some(generic_point(seed + i), INPUTS))
            assert_output_derivatives(instance, model, {}, NO_RATES)


@pytest.mark.parametrize("order", [1, 2, 3])
@each_seed
def test_output_derivatives_with_input_derivatives(
    loaded: LoadedFmu, model: Model, order: int, seed: int
) -> None:
    """At the end of a step they are those of the polynomials from its beginning."""
    source = random.Random(seed)
    with in_initialization_mode(loaded, seed) as instance:
        instance.fmi.exitInitializationMode()
        t = 0.0
        for h in (0.01, 0.004, 0.02):
            start = {name: source.uniform(-20.0, 20.0) for name in INPUTS}
            slopes = {
                name: [source.uniform(-1.0, 1.0) * 50.0**k for k in range(1, order + 1)]
                for name in INPUTS
            }
            instance.set(**start)
            instance.set_input_derivatives(**slopes)
            polynomials = {name: [start[name], *slopes[name], 0.0, 0.0] for name in INPUTS}
            # before the step, at its beginning
            rates = [[polynomials[name][k] for name in INPUTS] for k in (1, 2)]
            assert_output_derivatives(instance, model, {}, rates)

            t = instance.step(t, h)
            at_end = {
                name: [
                    mpmath.fsum(
                        mpmath.mpf(c) * mpmath.mpf(h) ** (n - k) / mpmath.factorial(n - k)
                        for n, c in enumerate(polynomials[name])
                        if n >= k
                    )
                    for k in (0, 1, 2)
                ]
                for name in INPUTS
            }
            inputs = {name: at_end[name][0] for name in INPUTS}
            rates = [[at_end[name][k] for name in INPUTS] for k in (1, 2)]
            assert_output_derivatives(instance, model, inputs, rates)
