"""Makes the reference trajectories of the controller, without the code that they check.

The equations of motion are those of the plant's references, from positions in sympy; the laws are
those of the page. Between two communication points the inputs rest, and the integral parts obey
linear equations that change where an effort meets a limit: their Taylor series, with 40 digits, is
evaluated at the end of each piece, and the limit is located by bisection. The sampled form is the
same laws at the samples, with Euler's method from one to the next.
"""

from collections.abc import Callable
from functools import cache

import numpy as np
import sympy as sp
from mpmath import mp, mpf
from rparm.models.rp_plant.references import equations as plant

from rparm.models import reference_files
from rparm.runs.scenario import Scenario

REFERENCES = ("q1_ref", "q2_ref", "dq1_ref", "dq2_ref", "ddq1_ref", "ddq2_ref")
INPUTS = (*REFERENCES, "q1", "q2", "dq1", "dq2")
ATTACHED = "payload_attached"
OPTIONAL_INPUTS = (ATTACHED,)
OUTPUTS = ("tau1", "f2", "q1_error", "q2_error", "dq1_error", "dq2_error")
PD, PD_GRAVITY, COMPUTED_TORQUE = 1, 2, 3

LONGEST = mpf(1) / 50  # a piece, over the time constant of the anti-windup
DEGREE = 24  # of the series: the remainder is far below the digits
BISECTIONS = 110
PROBES = 8  # per piece, for a limit that is met and left within it

mp.dps = 40


@cache
def equations_of_the_arm() -> Callable[..., tuple]:
    """Make a function of parameters, q, dq for D, C(q, dq) dq, g(q); a payload above 0 counts."""
    e = plant.derive()
    unknown = [f"{name}{joint}" for name in plant.PER_JOINT for joint in (1, 2)]
    alone = dict.fromkeys((*unknown, *plant.INPUTS), 0) | {"attached": 1}
    forces = e.forces.subs(alone)
    gravity = -forces.subs({"dq1": 0, "dq2": 0})
    names = sp.symbols((*plant.ARM, *plant.PAYLOAD, *plant.STATES))
    terms = e.inertia.subs(alone), -forces - gravity, gravity
    return sp.lambdify(names, terms, "mpmath")


class Law:
    """Efforts u = offset + gain w of held inputs, and the rates of w."""

    def __init__(self, value: dict[str, mpf], arm: Callable[..., tuple]) -> None:
        self.limit = (value["tau1_max"], value["f2_max"])
        self.error = [value[f"q{i}_ref"] - value[f"q{i}"] for i in (1, 2)]
        self.derror = [value[f"dq{i}_ref"] - value[f"dq{i}"] for i in (1, 2)]
        both = zip((1, 2), self.error, self.derror, strict=True)
        correction = mp.matrix([value[f"Kp{i}"] * e + value[f"Kd{i}"] * de for i, e, de in both])
        payload = [value[name] if value[ATTACHED] else mpf(0) for name in plant.PAYLOAD]
        known = (value[name] for name in plant.ARM)
        state = (value[name] for name in plant.STATES)
        inertia, coriolis, gravity = arm(*known, *payload, *state)
        if value["mode"] == COMPUTED_TORQUE:
            self.gain = inertia
            asked = mp.matrix([value["ddq1_ref"], value["ddq2_ref"]]) + correction
            self.offset = inertia * asked + coriolis + gravity
        else:
            self.gain = mp.diag([value["inertia1"], value["inertia2"]])
            self.offset = self.gain * correction
            if value["mode"] == PD_GRAVITY:
                self.offset += gravity
        self.integrates = [value[f"Ki{i}"] > 0 for i in (1, 2)]
        self.push = [value[f"Ki{i}"] * self.error[i - 1] for i in (1, 2)]
        self.follow = [value[f"inertia{i}"] * value["tracking_time"] for i in (1, 2)]

    def unlimited(self, w: list[mpf]) -> list[mpf]:
        return [self.offset[i] + self.gain[i, 0] * w[0] + self.gain[i, 1] * w[1] for i in (0, 1)]

    def side(self, i: int, effort: mpf) -> int:
        """1 above the upper limit of joint i, -1 below the lower one, else 0."""
        return int(effort > self.limit[i]) - int(effort < -self.limit[i])

    def series(self, w: list[mpf], sides: list[int]) -> list[list[mpf]]:
        """Taylor coefficients of both integral parts while the sides stay."""
        rows = [list(w)]
        for k in range(DEGREE):
            last = rows[-1]
            rates = []
            for i in (0, 1):
                rate = self.push[i] if k == 0 else mpf(0)
                if sides[i]:
                    # u - side * limit; the offset of u is only in the first coefficient
                    excess = self.gain[i, 0] * last[0] + self.gain[i, 1] * last[1]
                    if k == 0:
                        excess += self.offset[i] - sides[i] * self.limit[i]
                    rate -= excess / self.follow[i]
                rates.append(rate if self.integrates[i] else mpf(0))
            rows.append([rate / (k + 1) for rate in rates])
        return [[row[i] for row in reversed(rows)] for i in (0, 1)]

    def advance(self, w: list[mpf], h: mpf) -> list[mpf]:
        """Return the integral parts after a time h with these inputs."""
        sides = [self.side(i, u) for i, u in enumerate(self.unlimited(w))]
        while h > 0:
            series = self.series(w, sides)

            def at(t: mpf, series: list = series) -> list[mpf]:
                return [mp.polyval(coefficients, t) for coefficients in series]

            def changed(t: mpf, at: Callable = at, sides: list = sides) -> list[int]:
                efforts = self.unlimited(at(t))
                return [i for i in (0, 1) if self.side(i, efforts[i]) != sides[i]]

            # at the start of a piece an effort may lie on its limit, to rounding
            probes = [h * k / PROBES for k in range(1, PROBES + 1)]
            hit = next((t for t in probes if changed(t)), None)
            if hit is None:
                return at(h)
            low, high = hit - h / PROBES, hit
            for _ in range(BISECTIONS):
                middle = (low + high) / 2
                low, high = (low, middle) if changed(middle) else (middle, high)
            w = at(high)
            efforts = self.unlimited(w)
            for i in changed(high):
                sides[i] = self.side(i, efforts[i])
            h -= high
        return w

    def limited(self, w: list[mpf]) -> list[mpf]:
        efforts = self.unlimited(w)
        return [max(-bound, min(bound, u)) for bound, u in zip(self.limit, efforts, strict=True)]

    def rates(self, w: list[mpf]) -> list[mpf]:
        pairs = zip(self.unlimited(w), self.limited(w), strict=True)
        excess = [u - effort for u, effort in pairs]
        return [
            self.push[i] - excess[i] / self.follow[i] if self.integrates[i] else mpf(0)
            for i in (0, 1)
        ]

    def outputs(self, w: list[mpf]) -> list[mpf]:
        return [*self.limited(w), *self.error, *self.derror]


class Laws:
    """Laws of a scenario; law i has the inputs of the step that ends at communication point i."""

    def __init__(self, scenario: Scenario) -> None:
        self.arm = equations_of_the_arm()
        self.start = {name: mpf(float(value)) for name, value in scenario.start_values.items()}
        self.names = (*INPUTS, ATTACHED) if ATTACHED in scenario.inputs else INPUTS
        self.held = reference_files.held_rows(scenario, self.names)
        # times of the communication points are exact, their differences need not be
        self.times = [mpf(float(t)) for t in scenario.times]

    def __getitem__(self, i: int) -> Law:
        held = (mpf(float(x)) for x in self.held[i])
        return Law({ATTACHED: 0} | self.start | dict(zip(self.names, held, strict=True)), self.arm)


def simulate(laws: Laws) -> np.ndarray:
    """Return the outputs, (n + 1, outputs)."""
    times = laws.times
    w = [mpf(0), mpf(0)]
    rows = []
    for i in range(len(times)):
        law = laws[i]
        if i > 0:
            length = times[i] - times[i - 1]
            pieces = int(mp.ceil(length / (LONGEST * laws.start["tracking_time"])))
            for _ in range(pieces):
                w = law.advance(w, length / pieces)
        rows.append([float(x) for x in law.outputs(w)])
    return np.array(rows)


def simulate_samples(laws: Laws) -> np.ndarray:
    """The same in the sampled form; after the start no sample is at a communication point."""
    times, period, delay = laws.times, laws.start["sample_time"], laws.start["delay"]
    w = [mpf(0), mpf(0)]
    rates = w
    in_effect: list[tuple[mpf, list[mpf]]] = []  # from a time on, the efforts
    rows, k = [], 0
    for i in range(len(times)):
        law = laws[i]
        while times[0] + k * period <= times[i]:
            w = [x + period * rate for x, rate in zip(w, rates, strict=True)]
            rates = law.rates(w)
            in_effect.append((times[0] + k * period + (delay if k > 0 else 0), law.limited(w)))
            k += 1
        efforts = next(u for t, u in reversed(in_effect) if t <= times[i])
        rows.append([float(x) for x in (*efforts, *law.error, *law.derror)])
    return np.array(rows)


def outputs(scenario: Scenario) -> dict[str, np.ndarray]:
    """Return the columns of OUTPUTS, (n + 1,) each."""
    laws = Laws(scenario)
    table = simulate_samples(laws) if laws.start["sample_time"] > 0 else simulate(laws)
    return dict(zip(OUTPUTS, table.T, strict=True))
