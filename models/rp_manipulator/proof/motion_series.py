"""Taylor coefficients of the arm's motion and its outputs in arb's intervals, for check.py.

With w = dq1, v = dq2, L = l1 + q2, P = L w and F = m1 lc1^2 + I1z + I2z, the momentum about the
joint over m2 and the velocity v - a w along the slide have simple rates:

    ((F / m2) w + L P)' = (tau1 + a f2) / m2 + a P w - g (m1 lc1 / m2 + L) cos q1
    (v - a w)'          = f2 / m2 + P w - g sin q1
"""

from collections.abc import Sequence

from flint import arb

Jet = list[arb]  # a value, then its derivatives along the directions
Series = dict[str, list[Jet]]  # coefficients of t^k (the step)^k, by the name of the row
STATES = ("q1", "q2", "w", "v")


def coefficients(
    states: Sequence[arb],
    parameters: Sequence[arb],
    efforts: Sequence[Sequence[arb]],
    step: arb,
    last: int,
    along: Sequence[int] | None = None,
) -> list[list[Jet]]:
    """Return coefficients of q1, q2, dq1, dq2 of the orders 0 to `last`.

    The `states` are the origin, `parameters` m1, m2, I1z, I2z, l1, lc1, a, g, `efforts` of tau1 and
    f2. Derivatives are by the states and the parameters `along`; None: there are none.
    """
    directions = 0 if along is None else 4 + len(along)
    arithmetic = _Jets(directions)
    given = [
        arithmetic.variable(x, 4 + list(along or ()).index(i) if i in (along or ()) else None)
        for i, x in enumerate(parameters)
    ]
    start = [arithmetic.variable(x, i if directions else None) for i, x in enumerate(states)]
    rows = _begin(arithmetic, start, given)
    for order in range(1, last + 1):
        effort = [arithmetic.constant(of[order - 1]) for of in efforts]
        _extend(arithmetic, rows, given, effort, step / order)
    return [rows[name] for name in STATES]


def outputs(states: Sequence[arb], parameters: Sequence[arb], efforts: Sequence[arb]) -> list[arb]:
    """Return outputs besides the states, as proof.toml has them, no wider than in arm_outputs.h."""
    q1, q2, w, v = states
    m1, m2, I1z, I2z, l1, lc1, a, g = parameters
    tau1, f2 = efforts
    s, c, length = q1.sin(), q1.cos(), l1 + q2
    moment1, moment2 = m1 * lc1, m2 * length
    fixed = moment1 * lc1 + (I1z + I2z)
    push = f2 + m2 * (length * w * w)
    weight = g * ((moment1 + moment2) * c)
    ddq1 = (tau1 + a * push - 2 * (m2 * (length * w * v)) - weight) / (fixed + moment2 * length)
    ddq2 = push / m2 - g * s + a * ddq1
    x, y = length * c - a * s, length * s + a * c
    vx, vy = v * c - w * y, v * s + w * x
    kinetic = (fixed * (w * w) + m2 * (vx * vx + vy * vy)) / 2
    potential = g * (moment1 * s + m2 * y)
    power = tau1 * w + f2 * v
    return [ddq1, ddq2, x, y, vx, vy, kinetic, potential, kinetic + potential, power]


class _Jets:
    """Values with derivatives, forward mode."""

    def __init__(self, directions: int) -> None:
        self.directions = directions

    def constant(self, value: arb) -> Jet:
        return [value] + [arb(0)] * self.directions

    def variable(self, value: arb, direction: int | None) -> Jet:
        return [value] + [arb(int(d == direction)) for d in range(self.directions)]

    def times(self, x: Jet, y: Jet) -> Jet:
        return [x[0] * y[0]] + [dx * y[0] + x[0] * dy for dx, dy in zip(x[1:], y[1:], strict=True)]

    def over(self, x: Jet, y: Jet) -> Jet:
        value = x[0] / y[0]
        return [value] + [(dx - value * dy) / y[0] for dx, dy in zip(x[1:], y[1:], strict=True)]

    def convolution(self, x: Sequence[Jet], y: Sequence[Jet]) -> Jet:
        """The sum of x_i y_(n - i) over i = 0 .. n."""
        pairs = list(zip(x, reversed(y), strict=True))
        return [sum((a[0] * b[0] for a, b in pairs), arb(0))] + [
            sum((a[d] * b[0] + a[0] * b[d] for a, b in pairs), arb(0))
            for d in range(1, self.directions + 1)
        ]


def _plus(*jets: Jet) -> Jet:
    return [sum(parts[1:], parts[0]) for parts in zip(*jets, strict=True)]


def _minus(x: Jet, y: Jet) -> Jet:
    return [a - b for a, b in zip(x, y, strict=True)]


def _scaled(factor: arb, x: Jet) -> Jet:
    return [factor * part for part in x]


def _begin(of: _Jets, states: Sequence[Jet], parameters: Sequence[Jet]) -> Series:
    q1, q2, w, v = states
    sine, cosine = q1[0].sin(), q1[0].cos()
    length = _plus(parameters[4], q2)
    return {
        "q1": [q1], "q2": [q2], "w": [w], "v": [v], "L": [length], "P": [of.times(length, w)],
        "sin": [[sine] + [cosine * d for d in q1[1:]]],
        "cos": [[cosine] + [-sine * d for d in q1[1:]]],
    }  # fmt: skip


def _extend(
    of: _Jets, row: Series, parameters: Sequence[Jet], effort: Sequence[Jet], h: arb
) -> None:
    """Append the next order. h: the step over that order."""
    m1, m2, I1z, I2z, _, lc1, a, g = parameters
    tau1, f2 = (of.over(x, m2) for x in effort)
    angular, sine, cosine = row["w"], row["sin"], row["cos"]
    share = of.over(of.times(m1, lc1), m2)
    push = _plus(f2, of.convolution(row["P"], angular))
    weight = _plus(of.times(share, cosine[-1]), of.convolution(row["L"], cosine))
    momentum = _scaled(h, _minus(_plus(tau1, of.times(a, push)), of.times(g, weight)))
    sliding = _scaled(h, _minus(push, of.times(g, sine[-1])))
    next_sine = _scaled(h, of.convolution(angular, cosine))
    next_cosine = _scaled(-h, of.convolution(angular, sine))

    row["q1"].append(_scaled(h, angular[-1]))
    row["q2"].append(_scaled(h, row["v"][-1]))
    row["L"].append(row["q2"][-1])
    # momentum of this order = (F / m2) w + L0 P + sum, P = L0 w + sum: solved for w
    first = row["L"][0]
    ahead_w = of.convolution(row["L"][1:], angular)
    ahead_P = of.convolution(row["L"][1:], row["P"])
    fixed = _plus(of.times(share, lc1), of.over(_plus(I1z, I2z), m2))
    known = _plus(of.times(first, ahead_w), ahead_P)
    next_w = of.over(_minus(momentum, known), _plus(fixed, of.times(first, first)))
    row["P"].append(_plus(of.times(first, next_w), ahead_w))
    row["v"].append(_plus(sliding, of.times(a, next_w)))
    row["w"].append(next_w)
    row["sin"].append(next_sine)
    row["cos"].append(next_cosine)
