"""Damping that a wall needs under a master that steps it and the arm: theory, and measured.

A mass m moves along the normal of a wall with stiffness k and damping d and stays in contact. The
master steps mass and wall with the communication step h. The force on the mass changes only at
communication points ("held"), or is a straight line between them ("extrapolated"). So it is late,
which acts as a negative damping; from a damping of the wall on, the motion dies out.
README.md derives these limits.

rparm/systems/master.py explains `order` and `inputs`. In Gauss-Seidel order with extrapolated
inputs the mass steps first; with held inputs either may.

    build/venv/bin/python -m rparm.models.machine.wall_limit

measures the limits on the tip of the machine, in Ecos and under rparm's master, and draws
wall_limit.png beside this file.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from rparm.models.machine.systems import SEQUENCE, direct, run_in_ecos

from rparm import project
from rparm.fmi.fmu_file import Fmu
from rparm.report.pages import ERROR_COLORS, RUN_COLOR, STYLE, save_figure
from rparm.systems import ssp
from rparm.systems.master import Master
from rparm.systems.structure import OpenedSystem

FOLDER = Path(__file__).resolve().parent

# ---- Theory --------------------------------------------------------------------------------------
State = tuple[float, ...]
Step = Callable[["Contact", float, State], State]

# Held inputs: mean age of the force in steps. Ecos steps in Jacobi order.
AGE = {"jacobi": 3 / 2, "gauss_seidel": 1 / 2}
# Extrapolated inputs: the limit of the damping, in k^2 h^3 / m.
EXTRAPOLATED = {"jacobi": 5 / 4, "gauss_seidel": 1 / 12}

GRID = 400  # dampings that are tried for one that is stable
BISECTIONS = 60


@dataclass(frozen=True)
class Contact:
    """A mass (kg) in contact with the wall: stiffness (N/m) and damping (N.s/m)."""

    mass: float
    stiffness: float
    damping: float = 0.0

    @property
    def period(self) -> float:
        """Period of the undamped vibration, s. The theory holds for steps far below it."""
        return 2 * math.pi * math.sqrt(self.mass / self.stiffness)


def least_damping(
    contact: Contact, step: float, order: str = "jacobi", inputs: str = "held"
) -> float:
    """Return the damping (N.s/m) above which a contact is stable, to leading order of a step."""
    if inputs == "held":
        return AGE[order] * step * contact.stiffness
    return EXTRAPOLATED[order] * contact.stiffness**2 * step**3 / contact.mass


# ---- The discrete loop, exactly ------------------------------------------------------------------
def _moved(contact: Contact, h: float, x: float, v: float, f: float, df: float) -> State:
    """Return position, velocity and acceleration after a step with the force f + df t against x."""
    m = contact.mass
    return (
        x + h * v - (f / 2 + df * h / 6) * h**2 / m,
        v - (f + df * h / 2) * h / m,
        -(f + df * h) / m,
    )


def _force(contact: Contact, x: float, v: float) -> float:
    return contact.stiffness * x + contact.damping * v


def _jacobi_held(contact: Contact, h: float, state: State) -> State:
    # the wall answers with the motion at the beginning of its step
    x, v, f = state
    return *_moved(contact, h, x, v, f, 0.0)[:2], _force(contact, x, v)


def _gauss_seidel_held(contact: Contact, h: float, state: State) -> State:
    x, v = state
    return _moved(contact, h, x, v, _force(contact, x, v), 0.0)[:2]


def _jacobi_extrapolated(contact: Contact, h: float, state: State) -> State:
    # the wall follows lines with the slopes of position and velocity at the beginning of its step
    x, v, a, f, df = state
    answer = _force(contact, x + h * v, v + h * a), _force(contact, v, a)
    return *_moved(contact, h, x, v, f, df), *answer


def _gauss_seidel_extrapolated(contact: Contact, h: float, state: State) -> State:
    x, v, f, df = state
    x, v, a = _moved(contact, h, x, v, f, df)
    return x, v, _force(contact, x, v), _force(contact, v, a)


_STEPS: dict[tuple[str, str], tuple[Step, int]] = {
    ("jacobi", "held"): (_jacobi_held, 3),
    ("gauss_seidel", "held"): (_gauss_seidel_held, 2),
    ("jacobi", "extrapolated"): (_jacobi_extrapolated, 5),
    ("gauss_seidel", "extrapolated"): (_gauss_seidel_extrapolated, 4),
}


def transition(
    contact: Contact, step: float, order: str = "jacobi", inputs: str = "held"
) -> np.ndarray:
    """Return the matrix from one communication point to the next, shape (n, n).

    It acts on depth (m) and velocity (m/s) from the equilibrium, then on the past: in Jacobi order
    the force (N) on the mass; with extrapolated inputs force and slope (N/s), in Jacobi order after
    the acceleration (m/s2).
    """
    function, size = _STEPS[order, inputs]
    return np.array([function(contact, step, tuple(unit)) for unit in np.eye(size).tolist()]).T


def eigenvalues(
    contact: Contact, step: float, order: str = "jacobi", inputs: str = "held"
) -> np.ndarray:
    """Return eigenvalues of `transition`, the largest first, shape (n,)."""
    found = np.linalg.eigvals(transition(contact, step, order, inputs))
    return found[np.argsort(-np.abs(found))]


def growth(contact: Contact, step: float, order: str = "jacobi", inputs: str = "held") -> float:
    """Factor by which the motion grows in a step in the long run; the contact is stable below 1."""
    return float(abs(eigenvalues(contact, step, order, inputs)[0]))


def exact_least_damping(
    contact: Contact, step: float, order: str = "jacobi", inputs: str = "held"
) -> float:
    """Least damping (N.s/m) from the eigenvalues; ValueError if the step is too long for any."""

    def is_stable(damping: float) -> bool:
        return growth(replace(contact, damping=damping), step, order, inputs) < 1.0

    # in one step, a larger damping reverses the velocity of the free mass and more
    most = 2 * contact.mass / step
    tried = np.linspace(0.0, most, GRID + 1)[1:].tolist()
    high = next((damping for damping in tried if is_stable(damping)), None)
    if high is None:
        raise ValueError(
            f"step = {step!r} s: no damping makes the contact stable, whose period is "
            f"{contact.period!r} s"
        )
    low = high - most / GRID
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        low, high = (low, middle) if is_stable(middle) else (middle, high)
    return high


# ---- The machine ---------------------------------------------------------------------------------
# The slide, pushed by a constant force, rests in the wall and is moved a little out of its
# equilibrium. The depth then obeys x_n+2 = s x_n+1 - p x_n + c, and p, the square of the factor of
# growth in a step, is 1 at the limit.

MASS = 1.0  # kg, of link 2
STEP = 1e-3  # s
STEPS = 200
IGNORED = 20  # first points, where faster eigenvalues still count
PUSH = 0.05  # N
FAR = 50.0  # m, to where the controller wants the slide
MOVED = 2e-7  # m, out of equilibrium
STIFFNESSES = (2e3, 5e3, 1e4, 2e4)  # N/m, of the picture
CASES = tuple((o, i) for i in ("held", "extrapolated") for o in ("jacobi", "gauss_seidel"))
DEPTH = "environment.penetration"

Measure = Callable[[float, float], np.ndarray]  # stiffness, damping -> depths (rows,) m


def pressed(stiffness: float, damping: float) -> dict[str, dict[str, float]]:
    """Parameters: the slide at q1 = 0, a = 0, g = 0, and the wall across its path."""
    depth = PUSH / stiffness
    straight = {"a": 0.0, "g": 0.0}
    # the controller pushes by m2 Kp2 times an error, so large that the motion does not change it
    aim = {"a": 0.0, "x_center": FAR + 0.4, "y_center": 0.0, "radius": 0.1, "start_time": 10.0}
    return {
        "trajectory": aim,
        "controller": straight | {"m2": MASS, "Kp2": PUSH / (FAR * MASS), "Kd2": 0.0},
        "actuator": {"current2": PUSH / (0.05 * 200 * math.pi)},
        "plant": straight | {"m2": MASS, "q2": MOVED, "relative_tolerance": 5e-12},
        "sensor": {"sample_time": 1.0001e-3},
        "environment": {
            "stiffness": stiffness,
            "damping": damping,
            "angle": math.pi,
            "position": depth - 0.5,
        },
    }


def limit(theory: float, measure: Measure, stiffness: float) -> float:
    """Damping at the limit of stability, N.s/m, from runs at 10 % to both sides of the theory."""
    products = [_product(measure(stiffness, share * theory)) for share in (0.9, 1.1)]
    return theory * (0.9 + 0.2 * (products[0] - 1) / (products[0] - products[1]))


def _product(depth: np.ndarray) -> float:
    """The square of the factor of growth."""
    x = (depth[IGNORED:] - depth[IGNORED:].mean()) / MOVED
    columns = np.column_stack([x[1:-1], x[:-2], np.ones(len(x) - 2)])
    return -float(np.linalg.lstsq(columns, x[2:], rcond=None)[0][1])


# ---- Ecos ----------------------------------------------------------------------------------------
def in_ecos(opened: OpenedSystem) -> Measure:

    def measure(stiffness: float, damping: float) -> np.ndarray:
        run = run_in_ecos(opened, pressed(stiffness, damping), STEPS * STEP, STEP, [DEPTH])
        return run[:, 0]

    return measure


# ---- rparm's master ------------------------------------------------------------------------------
def under_master(opened: OpenedSystem, fmus: Mapping[str, Fmu], order: str, inputs: str) -> Measure:
    """Runs the machine under rparm's master; the controller sees the joints themselves."""
    connections = direct(opened.system.connections)

    def measure(stiffness: float, damping: float) -> np.ndarray:
        with Master(fmus, connections, order, inputs) as master:
            parameters = pressed(stiffness, damping)
            del parameters["sensor"]
            master.initialize(0.0, STEPS * STEP, parameters)
            rows = master.run(np.arange(STEPS + 1) / round(1 / STEP))
            return rows[:, master.names.index(DEPTH)]

    return measure


# ---- the picture ---------------------------------------------------------------------------------
def draw(measured: Mapping[str, list[float]], in_engine: list[float]) -> Figure:
    """Limits over the stiffness: theory, exact eigenvalues, and what has been measured."""
    with mpl.rc_context(fname=STYLE):
        picture = Figure(figsize=(9, 6), layout="constrained")
        axes = picture.subplots()
        line = np.geomspace(0.8 * STIFFNESSES[0], 1.25 * STIFFNESSES[-1], 60)
        for color, (order, inputs) in zip((RUN_COLOR, *ERROR_COLORS[:3]), CASES, strict=True):
            name = f"{order.replace('_', '-').title()}, inputs {inputs}"
            contacts = [Contact(MASS, k) for k in line]
            theory = [least_damping(c, STEP, order, inputs) for c in contacts]
            exact = [exact_least_damping(c, STEP, order, inputs) for c in contacts]
            axes.loglog(line, theory, color=color, linewidth=4, alpha=0.3)
            axes.loglog(line, exact, color=color, linewidth=1.2, label=name)
            points = measured[f"{order}, {inputs}"]
            axes.loglog(STIFFNESSES, points, "o", color=color, markersize=7)
        axes.loglog(
            STIFFNESSES, in_engine, "s", color="none", markeredgecolor=RUN_COLOR, markersize=13,
            label="measured in Ecos",
        )  # fmt: skip
        axes.loglog([], [], "o", color="#6b7885", label="measured under rparm's master")
        axes.set_xlabel("stiffness of the wall (N/m)")
        axes.set_ylabel("least damping of the wall (N·s/m)")
        axes.set_title(
            "Damping that a wall needs: theory (broad), eigenvalues (thin), measured; "
            f"steps of {1e3 * STEP:g} ms, {MASS:g} kg",
            loc="left", fontsize=11,
        )  # fmt: skip
        axes.legend()
    return picture


def main() -> None:
    path = project.built(FOLDER, ".ssp")
    measured = {f"{order}, {inputs}": [] for order, inputs in CASES}
    with ssp.unpacked(path) as opened, opened.unpacked_fmus(SEQUENCE) as fmus:
        engine = in_ecos(opened)
        in_engine = []
        for stiffness in STIFFNESSES:
            contact = Contact(MASS, stiffness)
            in_engine.append(limit(least_damping(contact, STEP), engine, stiffness))
            for order, inputs in CASES:
                theory = least_damping(contact, STEP, order, inputs)
                measure = under_master(opened, fmus, order, inputs)
                found = limit(theory, measure, stiffness)
                measured[f"{order}, {inputs}"].append(found)
                print(f"{stiffness:g} N/m, {order}, {inputs}: {found:.5g}, theory {theory:.5g}")
            print(f"{stiffness:g} N/m, Ecos: {in_engine[-1]:.5g}")
    save_figure(draw(measured, in_engine), FOLDER / "wall_limit.png")


if __name__ == "__main__":
    main()
