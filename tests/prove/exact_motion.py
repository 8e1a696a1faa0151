"""The arm's motion to 60 digits, from the equations of the notes by Picard's iteration."""

from collections.abc import Sequence

import flint
from flint import arb, arb_series

BITS = 300
LENGTH = 32  # coefficients of a series
STEP = 0.02  # s
States = list[arb]


def integrate(
    states: Sequence[float],
    parameters: Sequence[float],
    cubics: Sequence[Sequence[float]],
    time: float,
) -> States:
    """q1, q2, dq1, dq2 after `time` s; each cubic has a value and its derivatives at the start."""
    flint.ctx.prec, precision = BITS, flint.ctx.prec
    flint.ctx.cap, cap = LENGTH, flint.ctx.cap
    try:
        return _integrate([arb(x) for x in states], [arb(p) for p in parameters], cubics, arb(time))
    finally:
        flint.ctx.prec, flint.ctx.cap = precision, cap


def outputs(states: Sequence[arb], parameters: Sequence[float], efforts: Sequence[arb]) -> States:
    """ddq1, ddq2, position and velocity of the end effector, energies, power of the efforts.

    Accelerations by (14) and (15), K = dq^T D dq / 2 by (6)-(8), the end effector in polar form.
    """
    flint.ctx.prec, precision = BITS, flint.ctx.prec
    try:
        exact = [arb(p) for p in parameters]
        m1, m2, _, _, l1, lc1, a, g = exact
        q1, q2, dq1, dq2 = states
        rates = _rates(states, exact, efforts)
        D11, D12, D22 = _inertia(q2, exact)
        reach = l1 + q2
        distance, angle = (reach**2 + a**2).sqrt(), q1 + arb.atan2(a, reach)
        x, y = distance * angle.cos(), distance * angle.sin()
        kinetic = (D11 * dq1**2 + 2 * D12 * dq1 * dq2 + D22 * dq2**2) / 2
        potential = m1 * g * lc1 * q1.sin() + m2 * g * y
        velocity = [-y * dq1 + q1.cos() * dq2, x * dq1 + q1.sin() * dq2]
        power = efforts[0] * dq1 + efforts[1] * dq2
        return [*rates[2:], x, y, *velocity, kinetic, potential, kinetic + potential, power]
    finally:
        flint.ctx.prec = precision


def _integrate(
    states: States, parameters: States, cubics: Sequence[Sequence[float]], time: arb
) -> States:
    steps = int(float(time) / STEP) + 1
    step = time / steps
    for i in range(steps):
        series = _expand(states, parameters, [_at(cubic, i * step) for cubic in cubics])
        states = [_value(x, step) for x in series]
    return states


def _value(series: arb_series, time: arb) -> arb:
    return arb(sum((series[k] * time**k for k in range(LENGTH)), arb(0)).mid())


def value_at(cubic: Sequence[float], time: float) -> arb:
    """A cubic, from its value and derivatives at the start, after `time` s."""
    flint.ctx.prec, precision = BITS, flint.ctx.prec
    try:
        return sum((arb(u) * arb(time) ** k / arb.fac_ui(k) for k, u in enumerate(cubic)), arb(0))
    finally:
        flint.ctx.prec = precision


def _at(cubic: Sequence[float], time: arb) -> arb_series:
    """A cubic as a series at a time."""
    u = [arb(x) for x in cubic]
    shifted = [
        sum((u[k + j] * time**j / arb.fac_ui(j) for j in range(4 - k)), arb(0)) / arb.fac_ui(k)
        for k in range(4)
    ]
    return arb_series(shifted)


def _expand(states: States, parameters: States, efforts: Sequence[arb_series]) -> list[arb_series]:
    """Taylor series by Picard's iteration, which gets an order right each time."""
    found = [arb_series([x]) for x in states]
    for order in range(1, LENGTH):
        flint.ctx.cap = order + 1
        rates = _rates(found, parameters, efforts)
        found = [rate.integral() + x for rate, x in zip(rates, states, strict=True)]
    return found


def _rates(states: Sequence, parameters: States, efforts: Sequence) -> tuple:
    """Rates of the states, numbers or series.

    Equations (14) and (15), as the notes have them, solved for the accelerations by Cramer's rule.
    """
    m1, m2, _, _, l1, lc1, a, g = parameters
    q1, q2, dq1, dq2 = states
    tau1, f2 = efforts
    reach = q2 + l1
    D11, D12, D22 = _inertia(q2, parameters)
    sine, cosine = q1.sin(), q1.cos()
    bias1 = 2 * m2 * reach * dq1 * dq2 + m1 * g * lc1 * cosine
    bias1 += m2 * g * (reach * cosine - a * sine)
    bias2 = -m2 * reach * dq1 * dq1 + m2 * g * sine
    r1, r2 = tau1 - bias1, f2 - bias2
    determinant = D11 * D22 - D12**2
    return dq1, dq2, (D22 * r1 - D12 * r2) / determinant, (D11 * r2 - D12 * r1) / determinant


def _inertia(q2: arb | arb_series, parameters: States) -> tuple:
    """D11, D12, D22."""
    m1, m2, I1z, I2z, l1, lc1, a, _ = parameters
    reach = q2 + l1
    return m1 * lc1**2 + I1z + I2z + m2 * (reach * reach + a**2), -a * m2, m2
