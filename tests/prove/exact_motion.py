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


def _at(cubic: Sequence[float], time: arb) -> arb_series:
    """A cubic as a series at a time."""
    u = [arb(x) for x in cubic]
    shifted = [
        sum((u[k + j] * time**j / arb.fac_ui(j) for j in range(4 - k)), arb(0)) / arb.fac_ui(k)
        for k in range(4)
    ]
    return arb_series(shifted)


def _expand(states: States, parameters: States, efforts: Sequence[arb_series]) -> list[arb_series]:
    """Taylor series by Picard's iteration, which gets an order right each time.

    Equations (14) and (15), as the notes have them, solved for the accelerations by Cramer's rule.
    """
    m1, m2, I1z, I2z, l1, lc1, a, g = parameters
    tau1, f2 = efforts
    q1, q2, dq1, dq2 = (arb_series([x]) for x in states)
    for order in range(1, LENGTH):
        flint.ctx.cap = order + 1
        reach = q2 + l1
        D11 = m1 * lc1**2 + I1z + I2z + m2 * (reach * reach + a**2)
        D12, D22 = -a * m2, m2
        sine, cosine = q1.sin(), q1.cos()
        bias1 = 2 * m2 * reach * dq1 * dq2 + m1 * g * lc1 * cosine
        bias1 += m2 * g * (reach * cosine - a * sine)
        bias2 = -m2 * reach * dq1 * dq1 + m2 * g * sine
        r1, r2 = tau1 - bias1, f2 - bias2
        determinant = D11 * D22 - D12**2
        rates = dq1, dq2, (D22 * r1 - D12 * r2) / determinant, (D11 * r2 - D12 * r1) / determinant
        q1, q2, dq1, dq2 = (rate.integral() + x for rate, x in zip(rates, states, strict=True))
    return [q1, q2, dq1, dq2]
