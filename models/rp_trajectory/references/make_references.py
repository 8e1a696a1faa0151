"""Makes the reference trajectories of the reference motions, without the code that they check.

The path and its rates come from sympy, the scaling law from the conditions at its ends; the joints
follow from the forward kinematics, x + i y = exp(i q1) (L + i a), and its first two derivatives by
time, solved in 40 digits and rounded once.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass

import mpmath as mp
import numpy as np
import sympy as sp

from rparm.runs.scenario import Scenario

INPUTS = ()
DIGITS = 40
JOINTS = ("q1_ref", "q2_ref", "dq1_ref", "dq2_ref", "ddq1_ref", "ddq2_ref")
OUTPUTS = (*JOINTS, "ee_x_ref", "ee_y_ref", "ee_vx_ref", "ee_vy_ref")
# items of the enumerations `motion` and `branch`
POINT_TO_POINT, LINE, CIRCLE = 1, 2, 3
FORWARD, BACKWARD = 1, 2
# parameters of the path of each motion
PATHS = {
    POINT_TO_POINT: ("duration", "q1_from", "q1_to", "q2_from", "q2_to"),
    LINE: ("duration", "ee_x_from", "ee_x_to", "ee_y_from", "ee_y_to"),
    CIRCLE: ("frequency", "turns", "ramp_time", "radius", "start_angle", "x_center", "y_center"),
}


@functools.cache
def scaling_law(x: sp.Expr) -> sp.Expr:
    """Quintic from 0 to 1 whose first and second derivatives are 0 at both ends."""
    c, z = sp.symbols("c:6"), sp.Symbol("z")
    quintic = sum(ck * z**k for k, ck in enumerate(c))
    conditions = [quintic.subs(z, 0), quintic.subs(z, 1) - 1]
    conditions += [quintic.diff(z, k).subs(z, end) for k in (1, 2) for end in (0, 1)]
    return quintic.subs(sp.solve(conditions, c)).subs(z, x)


@dataclass(frozen=True)
class Segment:
    """A piece of a motion, up to the elapsed time `end` (s)."""

    end: mp.mpf
    # elapsed time (s) -> both coordinates (rad and m, or m), their rates, their second rates
    evaluate: Callable[[mp.mpf], list[mp.mpf]]


def fraction(number: float | mp.mpf) -> sp.Rational:
    """The number as the fraction that it is."""
    magnitude, exponent = mp.mpf(abs(number)).man_exp
    return (-1 if number < 0 else 1) * sp.Integer(int(magnitude)) * sp.Integer(2) ** int(exponent)


def segments(value: dict[str, float | mp.mpf]) -> list[Segment]:
    """Both coordinates of the motion, joints of point_to_point or those of the end effector."""
    motion = value["motion"]
    return _segments(motion, *(value[name] for name in PATHS[motion]))


@functools.cache  # most parameters move nothing here
def _segments(motion: int, *values: float | mp.mpf) -> list[Segment]:
    """The same of the parameters that the path has."""
    u = sp.Symbol("u")

    def exact(name: str) -> sp.Expr:
        return fraction(values[PATHS[motion].index(name)])

    if motion == CIRCLE:
        rate, ramp = exact("frequency"), exact("ramp_time")
        full = exact("turns") / abs(rate)  # s: time that the turns take at full speed
        x = sp.Symbol("x")
        ramped = sp.integrate(scaling_law(x), (x, 0, u / ramp)) * ramp
        cruising = ramped.subs(u, ramp) + (u - ramp)
        braking = cruising.subs(u, full) + ramped.subs(u, ramp) - ramped.subs(u, full + ramp - u)
        times = [(0, 0), (ramp, ramped), (full, cruising), (full + ramp, braking), (sp.oo, full)]

        def position(time: sp.Expr) -> list[sp.Expr]:
            phase = exact("start_angle") + 2 * sp.pi * rate * time
            around = (sp.cos(phase), sp.sin(phase))
            centers = (exact("x_center"), exact("y_center"))
            return [c + exact("radius") * e for c, e in zip(centers, around, strict=True)]
    else:
        duration = exact("duration")
        times = [(0, 0), (duration, scaling_law(u / duration)), (sp.oo, 1)]
        joints = motion == POINT_TO_POINT
        names = ("q1", "q2") if joints else ("ee_x", "ee_y")

        def position(time: sp.Expr) -> list[sp.Expr]:
            ends = [(exact(f"{name}_from"), exact(f"{name}_to")) for name in names]
            return [begin + (end - begin) * time for begin, end in ends]

    result = []
    for end, time in times:
        path = position(sp.sympify(time))
        rates = [[c.diff(u, order) for c in path] for order in range(3)]
        flat = [expression for order in rates for expression in order]
        limit = mp.inf if end is sp.oo else mp.mpf(sp.Rational(end).p) / sp.Rational(end).q
        result.append(Segment(limit, sp.lambdify(u, flat, "mpmath")))
    return result


def joint_rates(
    q1: mp.mpf, L: mp.mpf, a: mp.mpf, velocity: mp.mpc, acceleration: mp.mpc
) -> tuple[mp.mpc, mp.mpc]:
    """Return first and second rates of the joints, q1 as real part and q2 as imaginary one.

    p = exp(i q1) (L + i a) has p' = exp(i q1) (L' + i q1' (L + i a)) and
    p'' = exp(i q1) (L'' + i q1'' (L + i a) + 2 i q1' L' - q1'^2 (L + i a)).
    """
    turn = mp.expj(-q1)
    v = turn * velocity
    dq1 = v.imag / L
    dL = v.real + a * dq1
    w = turn * acceleration - 2j * dq1 * dL + dq1**2 * mp.mpc(L, a)
    ddq1 = w.imag / L
    return mp.mpc(dq1, dL), mp.mpc(ddq1, w.real + a * ddq1)


class Motion:
    """One motion, with the parameters `value`; its times ascend, so that q1 stays continuous."""

    def __init__(self, value: dict[str, float | mp.mpf]) -> None:
        self.value = value
        self.segments = segments(self.value)
        self.q1: mp.mpf | None = None  # the last one

    def coordinates(self, t: float | mp.mpf) -> list[mp.mpc]:
        """Position, velocity, acceleration; where two segments meet, the later one's."""
        u = mp.mpf(t) - mp.mpf(self.value["start_time"])
        segment = next(segment for segment in self.segments if u < segment.end)
        x = segment.evaluate(u)
        return [mp.mpc(x[0], x[1]), mp.mpc(x[2], x[3]), mp.mpc(x[4], x[5])]

    def outputs(self, t: float | mp.mpf) -> list[mp.mpf]:
        """Values of OUTPUTS at `t` (s), which is less than half a turn after the one before."""
        l1, a = mp.mpf(self.value["l1"]), mp.mpf(self.value["a"])
        position, velocity, acceleration = self.coordinates(t)
        if self.value["motion"] == POINT_TO_POINT:
            L = l1 + position.imag
            q, dq, ddq = position, velocity, acceleration
            turn = mp.expj(q.real)
            position = turn * mp.mpc(L, a)
            velocity = turn * (dq.imag + 1j * dq.real * mp.mpc(L, a))
        else:
            sign = -1 if self.value["branch"] == BACKWARD else 1
            L = sign * mp.sqrt(abs(position) ** 2 - a**2)
            q1 = mp.arg(position / mp.mpc(L, a))
            if self.q1 is not None:
                q1 += 2 * mp.pi * mp.nint((self.q1 - q1) / (2 * mp.pi))
            self.q1 = q1
            q = mp.mpc(q1, L - l1)
            dq, ddq = joint_rates(q1, L, a, velocity, acceleration)
        pairs = (q, dq, ddq, position, velocity)
        return [part for pair in pairs for part in (pair.real, pair.imag)]


def outputs(scenario: Scenario) -> dict[str, np.ndarray]:
    """Return the columns of OUTPUTS, (n + 1,) each."""
    with mp.workdps(DIGITS):
        motion = Motion(scenario.start_values)
        rows = [motion.outputs(t) for t in scenario.times]
        table = np.array([[float(x) for x in row] for row in rows])
        return dict(zip(OUTPUTS, table.T, strict=True))
