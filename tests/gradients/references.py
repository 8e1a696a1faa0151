"""Runs of the models beside this file in 60 digits, and their gradients by central differences.

A run returns (t, name) -> value at given times, from closed forms between events, whose times are
roots in the same digits; Lorenz and Van der Pol by Taylor series. It shares nothing with FMUs.
"""

import math
from collections.abc import Callable, Sequence

from mpmath import MPContext

mp = MPContext()
mp.dps = 60
mpf, sqrt, sin, cos, exp, log, fdot = mp.mpf, mp.sqrt, mp.sin, mp.cos, mp.exp, mp.log, mp.fdot
DELTA = mpf(10) ** -20  # of relative changes: errors are about 1e-40

Values = list[list[mpf]]  # a row for each time
Run = Callable[..., Values]
G = mpf("9.81")


def gradient(
    run: Run, times: Sequence[float], start: dict[str, float], by: Sequence[str]
) -> list[Values]:
    """By each parameter the rows of a run's derivatives; `start` holds what the FMU is given."""
    found, exact = [], {name: mpf(value) for name, value in start.items()}
    for name in by:
        step = DELTA * max(1, abs(exact[name]))
        ends = [run(times, **exact | {name: exact[name] + sign * step}) for sign in (1, -1)]
        found.append([
            [(above - below) / (2 * step) for above, below in zip(*rows, strict=True)]
            for rows in zip(*ends, strict=True)
        ])  # fmt: skip
    return found


def pieces(times: Sequence[float], begins: list, values: list[Callable]) -> Values:
    """What holds from each time on, as a function of the time since."""
    rows = []
    for t in map(mpf, times):
        k = max(k for k, begin in enumerate(begins) if begin <= t or k == 0)
        rows.append(values[k](t - begins[k]))
    return rows


def ball(times: Sequence[float], g: mpf, e: mpf, h: mpf) -> Values:
    """h, v, energy."""
    begins, values, t, v = [], [], mpf(0), mpf(0)
    while t < times[-1]:
        begins.append(t)
        values.append(lambda s, h=h, v=v: [h + v * s - g * s**2 / 2, v - g * s,
                                           v**2 / 2 + g * h])  # fmt: skip
        end = (v + sqrt(v**2 + 2 * g * h)) / g
        t, h, v = t + end, mpf(0), -e * (v - g * end)
    return pieces(times, begins, values)


def floor(times: Sequence[float], A: mpf, w: mpf, e: mpf) -> Values:
    """h, v."""
    begins, values, t, h, v = [], [], mpf(0), mpf(1), mpf(0)
    while t < times[-1]:
        begins.append(t)
        values.append(lambda s, h=h, v=v: [h + v * s - G * s**2 / 2, v - G * s])

        def gap(s: mpf, t: mpf = t, h: mpf = h, v: mpf = v) -> mpf:
            return h + v * s - G * s**2 / 2 - A * sin(w * (t + s))

        high = mpf("0.01")
        while gap(high) > 0:
            high += mpf("0.01")
        end = mp.findroot(gap, (high - mpf("0.01"), high), solver="anderson", tol=1e-110)
        t, h, v = t + end, h + v * end - G * end**2 / 2, v - G * end
        v = -e * v + (1 + e) * A * w * cos(w * t)
    return pieces(times, begins, values)


def belt(times: Sequence[float], belt: mpf, most: mpf, slides: mpf) -> Values:
    """x, v, force."""
    k, begins, values, t, x = mpf(8), [], [], mpf(0), mpf(0)
    w = sqrt(k)
    while t < times[-1]:
        begins.append(t)
        values.append(lambda s, x=x: [x + belt * s, belt, k * (x + belt * s)])
        t += (most / k - x) / belt
        begins.append(t)
        a, b = (most - slides) / k, belt / w  # about slides / k

        def slip(s: mpf, a: mpf = a, b: mpf = b) -> list[mpf]:
            c, d = cos(w * s), sin(w * s)
            return [slides / k + a * c + b * d, w * (b * c - a * d), slides]

        values.append(slip)
        # the same velocity on the other side, at the same distance
        t, x = t + 2 * (mp.pi - mp.atan2(a, b)) / w, slides / k - a
    return pieces(times, begins, values)


def thermostat(times: Sequence[float], low: mpf, high: mpf, tau: mpf, T: mpf) -> Values:
    """T."""
    begins, values, t, to, limit = [], [], mpf(0), 10, low
    while t < times[-1]:
        begins.append(t)
        values.append(lambda s, T=T, to=to: [to + (T - to) * exp(-s / tau)])
        t, T = t + tau * log((T - to) / (limit - to)), limit
        to, limit = (30, high) if to == 10 else (10, low)
    return pieces(times, begins, values)


def pulses(times: Sequence[float], period: mpf, duty: mpf, R: mpf) -> Values:
    """i, begin."""
    begins, values, i, k, L = [], [], mpf("0.2"), 0, mpf("0.1")
    while k * period < times[-1]:
        for begin, length, to in ((0, duty * period, 12 / R), (duty, (1 - duty) * period, 0)):
            begins.append((k + begin) * period)
            values.append(lambda s, i=i, to=to, k=k: [to + (i - to) * exp(-R * s / L), k * period])
            i = values[-1](length)[0]
        k += 1
    return pieces(times, begins, values)


def pid(times: Sequence[float], Ts: mpf, Kp: mpf, Ki: mpf, Kd: mpf) -> Values:
    """y, v, u, sum, last."""
    y, v, sums, last, a, b, begins, values = *[mpf(0)] * 4, mpf("1.5"), mpf(4), [], []
    while len(begins) * Ts < times[-1]:
        sums += Ki * Ts * (1 - y)
        u, last = Kp * (1 - y) + sums - Kd * (y - last) / Ts, y

        def moves(s: mpf, y: mpf = y, v: mpf = v, u: mpf = u, of: tuple = (sums, last)) -> list:
            end, decay = b * u / a, exp(-a * s)
            return [y + end * s + (v - end) * (1 - decay) / a, end + (v - end) * decay, u, *of]

        begins.append(len(begins) * Ts)
        values.append(moves)
        y, v = moves(Ts)[:2]
    return pieces(times, begins, values)


def by_series(
    times: Sequence[float], x: list[mpf], extend: Callable, order: int = 40, most: float = 0.05
) -> Values:
    """States at equidistant times; `extend` appends the next coefficients to rows of them."""
    rows, step = [x], mpf(times[1] - times[0])
    parts = math.ceil(step / most)
    for _ in times[1:]:
        for _ in range(parts):
            series = [[value] for value in x]
            for k in range(order):
                extend(series, k)
            x = [mp.polyval(row[::-1], step / parts) for row in series]
        rows.append(x)
    return rows


def lorenz(
    times: Sequence[float], sigma: mpf, rho: mpf, beta: mpf, x: mpf, y: mpf, z: mpf
) -> Values:
    """x, y, z."""

    def extend(series: list[list[mpf]], k: int) -> None:
        x, y, z = series
        rates = (
            sigma * (y[k] - x[k]), rho * x[k] - y[k] - fdot(x, z[::-1]),
            fdot(x, y[::-1]) - beta * z[k],
        )  # fmt: skip
        for row, rate in zip(series, rates, strict=True):
            row.append(rate / (k + 1))

    return by_series(times, [x, y, z], extend)


def van_der_pol(times: Sequence[float], mu: mpf, x: mpf) -> Values:
    """x."""

    squares: list[mpf] = []

    def extend(series: list[list[mpf]], k: int) -> None:
        x, v = series
        del squares[k:]
        squares.append(fdot(x, x[::-1]))
        rate = mu * (v[k] - fdot(squares, v[::-1])) - x[k]
        x.append(v[k] / (k + 1))
        v.append(rate / (k + 1))

    return [row[:1] for row in by_series(times, [x, mpf(0)], extend)]
