"""Random motions of the built FMU by its Taylor series, against heyoka in long double.

An error is in requested tolerances: over tolerance times (largest value so far + 1/100), as the
integrator takes it. It passes if it is at most 2, or at most what a start error of one tolerance
grows to.
"""

from dataclasses import dataclass

import heyoka as hy
import numpy as np
import sympy as sp
from rparm.models.rp_manipulator.references.make_references import PARAMETERS, derive

from tests.support.instances import INPUTS, STATES, Instance, LoadedFmu

TAYLOR = 4
NOMINAL_FRACTION = 1e-2
ALLOWED = 2.0
MOST_STEPS = 100_000  # of the reference, to a communication point
real = np.longdouble


@dataclass(frozen=True)
class Case:
    """A motion over a few steps."""

    parameters: tuple[float, ...]
    start: tuple[float, ...]  # rad, m, rad/s, m/s
    tolerance: float
    steps: tuple[float, ...]  # s
    inputs: np.ndarray  # (steps, 2, 4): value and derivatives at the begin of each step

    @property
    def times(self) -> np.ndarray:
        """Communication points; steps on a grid make them exact."""
        return np.concatenate(([0.0], np.cumsum(self.steps)))

    def unit(self, states: np.ndarray) -> np.ndarray:
        """One requested tolerance of each state at each point, (n, 4)."""
        largest = np.maximum.accumulate(np.abs(states), axis=0)
        return self.tolerance * (largest + NOMINAL_FRACTION)


def random_case(random: np.random.Generator) -> Case:
    """Parameters, speeds and steps in wide ranges.

    In one case of ten next to nothing but link 2 has inertia, and it passes the joint closely.
    """

    def zero_or(value: float) -> float:
        return 0.0 if random.integers(8) == 0 else value

    def decades(low: float, high: float) -> float:
        return float(10 ** random.uniform(low, high))

    m1, I1z, I2z = zero_or(decades(-2, 1.5)), zero_or(decades(-3, 1)), zero_or(decades(-3, 1))
    m2, l1, lc1 = decades(-2, 1.5), zero_or(random.uniform(0, 2)), zero_or(random.uniform(0, 2))
    a, g = zero_or(random.uniform(-1.5, 1.5)), zero_or(random.uniform(-20, 20))
    q1, q2 = random.uniform(-np.pi, np.pi), random.uniform(-2, 2)
    dq1, dq2 = random.uniform(-30, 30), random.uniform(-10, 10)
    if random.integers(10) == 0:
        m1, I1z, I2z = 0.0, 1e-5, 0.0
        q2 = -l1 + random.uniform(-0.05, 0.05)
    elif m1 * lc1**2 + I1z + I2z < 1e-3:
        I1z = 1e-3

    # efforts that suit the inertia, changing within 0.1 s to 10 s
    count = 3
    inertia = m1 * lc1**2 + I1z + I2z + m2 * (l1 + q2) ** 2
    scale = np.array([inertia, m2])[:, None] * 50 * decades(-1, 1) ** np.arange(4)
    inputs = random.uniform(-1, 1, (count, 2, 4)) * scale
    if random.integers(4) == 0:
        inputs[:, :, 1:] = 0.0
    h = np.round(10 ** random.uniform(-4, 0) * random.uniform(0.5, 1, count) * 2**40) / 2**40
    return Case(
        parameters=(m1, m2, I1z, I2z, l1, lc1, a, g),
        start=(q1, q2, dq1, dq2),
        tolerance=decades(-13, -4),
        steps=tuple(h),
        inputs=inputs,
    )


class Exact:
    """The independent equations with inputs that are cubic in the time since the step began."""

    def __init__(self) -> None:
        names = {sp.Symbol(name): hy.par[i] for i, name in enumerate(PARAMETERS)}
        for i, name in enumerate(INPUTS):
            value, first, second, third = (hy.par[8 + 4 * i + k] for k in range(4))
            names[sp.Symbol(name)] = value + hy.time * (
                first + hy.time * (second / 2.0 + hy.time * (third / 6.0))
            )
        states = hy.make_vars(*STATES)
        accelerations = [hy.from_sympy(e, names) for e in derive().accelerations]
        self.integrator = hy.taylor_adaptive(
            list(zip(states, (states[2], states[3], *accelerations), strict=True)),
            np.zeros(4, dtype=real),
            pars=np.zeros(16, dtype=real),
            fp_type=real,
        )

    def states(self, case: Case, offset: np.ndarray | float = 0.0) -> np.ndarray:
        """States at the communication points, (steps + 1, 4), from the start plus an offset.

        Time is in a unit that makes speeds 1 at most: heyoka measures errors by the largest state.
        Its steps are limited: it takes their length from its last two orders, which may be zero.
        """
        start = np.array(case.start, real) + offset
        unit = np.exp2(-np.ceil(np.log2(np.maximum(np.max(np.abs(start[2:])), real(1)))))
        scale = np.array([1, 1, unit, unit], real)
        integrator = self.integrator
        integrator.pars[:8] = np.array(case.parameters, real) * np.array([1] * 7 + [unit**2], real)
        integrator.state[:] = start * scale
        found = [start]
        for h, inputs in zip(case.steps, case.inputs, strict=True):
            integrator.time = real(0)
            integrator.pars[8:] = (inputs * unit ** np.arange(2, 6, dtype=real)).reshape(-1)
            end = real(h) / unit
            outcome = integrator.propagate_until(end, max_delta_t=end / 8, max_steps=MOST_STEPS)[0]
            assert outcome == hy.taylor_outcome.time_limit, (outcome, case)
            found.append(integrator.state / scale)
        return np.array(found)

    def growth(self, case: Case, states: np.ndarray) -> np.ndarray:
        """What a start error of one tolerance in a state grows to, in tolerances, (steps,)."""
        units = case.unit(states)
        grown = []
        for i in range(4):
            offset = np.zeros(4, real)
            offset[i] = units[0, i]
            grown.append((np.abs(self.states(case, offset) - states) / units)[1:].max(axis=1))
        return np.max(grown, axis=0)


def simulate(loaded: LoadedFmu, case: Case) -> np.ndarray:
    """States of the FMU at the communication points, (steps + 1, 4)."""
    values = dict(zip(PARAMETERS, case.parameters, strict=True))
    values |= dict(zip(STATES, case.start, strict=True))
    with Instance(loaded) as instance:
        instance.fmi.setInteger([loaded.references["solver_method"]], [TAYLOR])
        instance.initialize(relative_tolerance=case.tolerance, **values)
        found = [instance.get(*STATES)]
        for t, h, inputs in zip(case.times[:-1], case.steps, case.inputs, strict=True):
            instance.set(**dict(zip(INPUTS, inputs[:, 0], strict=True)))
            instance.set_input_derivatives(**dict(zip(INPUTS, inputs[:, 1:], strict=True)))
            instance.step(t, h)
            found.append(instance.get(*STATES))
    return np.array(found)


@dataclass(frozen=True)
class Outcome:
    """The largest error of a case, and what it may be there, in requested tolerances."""

    case: Case
    error: float
    allowed: float


def judge(loaded: LoadedFmu, exact: Exact, case: Case) -> Outcome:
    """Compare a case at all its communication points."""
    expected = exact.states(case)
    errors = np.abs(simulate(loaded, case) - expected) / case.unit(expected)
    assert np.all(errors[0] <= 1e-3)
    largest = errors[1:].max(axis=1)
    allowed = np.full(len(largest), ALLOWED)
    if not np.all(largest <= ALLOWED):
        allowed = np.maximum(allowed, exact.growth(case, expected))
    worst = int(np.argmax(largest / allowed))
    return Outcome(case, float(largest[worst]), float(allowed[worst]))


def judge_all(loaded: LoadedFmu, exact: Exact, count: int, seed: int) -> list[Outcome]:
    """Outcomes of random cases."""
    random = np.random.default_rng(seed)
    return [judge(loaded, exact, random_case(random)) for _ in range(count)]
