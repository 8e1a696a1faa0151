"""Makes the reference trajectories of the controller, without the code that they check.

sympy derives the arm's equations of motion from the positions of both centers of mass; the laws are
those of the page. Between two communication points the inputs rest, and the integral parts obey
linear equations that change where an effort meets a limit: their Taylor series, with 40 digits, is
evaluated at the end of each piece, and the limit is located by bisection.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import sympy as sp
from mpmath import mp, mpf

MODEL_FOLDER = Path(__file__).resolve().parents[1]
ROOT = MODEL_FOLDER.parents[1]
sys.path.insert(0, str(ROOT))

from cosim.scenario import Scenario
from models import reference_files

MODEL = "RPController"
ARM = ("m1", "m2", "I1z", "I2z", "l1", "lc1", "a", "g")
REFERENCES = ("q1_ref", "q2_ref", "dq1_ref", "dq2_ref", "ddq1_ref", "ddq2_ref")
INPUTS = (*REFERENCES, "q1", "q2", "dq1", "dq2")
OUTPUTS = ("tau1", "f2", "q1_error", "q2_error", "dq1_error", "dq2_error")
PD, PD_GRAVITY, COMPUTED_TORQUE = 1, 2, 3

LONGEST = mpf(1) / 50  # a piece, over the time constant of the anti-windup
DEGREE = 24  # of the series: the remainder is far below the digits
BISECTIONS = 110
PROBES = 8  # per piece, for a limit that is met and left within it

mp.dps = 40


def equations_of_the_arm() -> Callable[..., tuple]:
    """Function of parameters, q and dq that gives D, C(q, dq) dq and g(q), by Euler-Lagrange."""
    m1, m2, I1z, I2z, l1, lc1, a, g = sp.symbols(ARM)
    q = sp.Matrix(sp.symbols("q1 q2"))
    dq = sp.Matrix(sp.symbols("dq1 dq2"))
    along = sp.Matrix([sp.cos(q[0]), sp.sin(q[0])])  # long side of link 1
    across = sp.Matrix([-sp.sin(q[0]), sp.cos(q[0])])  # its short side
    centers = (lc1 * along, (l1 + q[1]) * along + a * across)

    kinetic = (I1z + I2z) * dq[0] ** 2 / 2
    potential = sp.Integer(0)
    for mass, center in zip((m1, m2), centers, strict=True):
        velocity = center.jacobian(q) * dq
        kinetic += mass * velocity.dot(velocity) / 2
        potential += mass * g * center[1]
    kinetic = sp.Matrix([sp.simplify(kinetic)])
    momenta = kinetic.jacobian(dq).T
    inertia = momenta.jacobian(dq)
    coriolis = momenta.jacobian(q) * dq - kinetic.jacobian(q).T
    gravity = sp.Matrix([potential]).jacobian(q).T
    return sp.lambdify((*sp.symbols(ARM), *q, *dq), (inertia, coriolis, gravity), "mpmath")


class Law:
    """Efforts u = offset + gain w of held inputs, and the rates of w."""

    def __init__(self, value: dict[str, mpf], arm: Callable[..., tuple]) -> None:
        self.limit = (value["tau1_max"], value["f2_max"])
        self.error = [value[f"q{i}_ref"] - value[f"q{i}"] for i in (1, 2)]
        self.derror = [value[f"dq{i}_ref"] - value[f"dq{i}"] for i in (1, 2)]
        correction = mp.matrix(
            [
                value[f"Kp{i}"] * self.error[i - 1] + value[f"Kd{i}"] * self.derror[i - 1]
                for i in (1, 2)
            ]
        )
        inertia, coriolis, gravity = arm(
            *(value[name] for name in (*ARM, "q1", "q2", "dq1", "dq2"))
        )
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
        """Integral parts after a time h with these inputs."""
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

    def outputs(self, w: list[mpf]) -> list[mpf]:
        efforts = self.unlimited(w)
        limited = [max(-bound, min(bound, u)) for bound, u in zip(self.limit, efforts, strict=True)]
        return [*limited, *self.error, *self.derror]


def input_table(scenario: Scenario) -> np.ndarray:
    """Inputs at every communication point, (n + 1, inputs)."""
    return np.stack([scenario.input(name) for name in INPUTS], 1)


def simulate(scenario: Scenario, arm: Callable[..., tuple]) -> np.ndarray:
    """Outputs at every communication point, (n + 1, outputs).

    The inputs of row i are those of the step that ends there; row 0 has those of the start.
    """
    start = {name: mpf(float(value)) for name, value in scenario.start_values.items()}
    inputs = input_table(scenario)
    # times of the communication points are exact, their differences need not be
    times = [mpf(float(t)) for t in scenario.times]
    w = [mpf(0), mpf(0)]
    rows = []
    for i in range(len(times)):
        held = inputs[max(i - 1, 0)]
        law = Law(start | {n: mpf(float(x)) for n, x in zip(INPUTS, held, strict=True)}, arm)
        if i > 0:
            length = times[i] - times[i - 1]
            pieces = int(mp.ceil(length / (LONGEST * start["tracking_time"])))
            for _ in range(pieces):
                w = law.advance(w, length / pieces)
        rows.append([float(x) for x in law.outputs(w)])
    return np.array(rows)


def prepare() -> Callable[[Scenario, Path], None]:
    """Derive the arm's equations; return what writes the reference of a scenario to a folder."""
    arm = equations_of_the_arm()

    def write(scenario: Scenario, folder: Path) -> None:
        outputs = simulate(scenario, arm)[scenario.reference_rows]
        inputs = input_table(scenario)
        reference_files.write(scenario, folder, MODEL, (OUTPUTS, outputs), (INPUTS, inputs))

    return write


if __name__ == "__main__":
    reference_files.main(MODEL_FOLDER, prepare)
