"""Measures from which damping of the wall on the tip of the machine does not chatter.

The slide, pushed by a constant force, rests in the wall and is moved a little out of its
equilibrium. Whether this dies out or grows is seen in the motion: the depth obeys
x_n+2 = s x_n+1 - p x_n + c, and p, the square of the factor of growth in a step, is 1 at the limit.
stability.py has the theory.

    build/venv/bin/python -m rparm.models.machine.wall_limit

measures it in Ecos and under rparm's master, and draws wall_limit.png beside this file.
"""

import math
from collections.abc import Callable, Mapping
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from rparm.models.machine.stability import Contact, exact_least_damping, least_damping
from rparm.models.machine.systems import SEQUENCE, direct, run_in_ecos, write_system

from rparm import project
from rparm.fmi.fmu_file import Fmu
from rparm.report.pages import ERROR_COLORS, RUN_COLOR, STYLE, save_figure
from rparm.systems import ssp
from rparm.systems.master import Master
from rparm.systems.ssp import Ssp

FOLDER = Path(__file__).resolve().parent

MASS = 1.0  # kg, of link 2
STEP = 1e-3  # s
STEPS = 200
IGNORED = 20  # first points, before the motion is that of the slowest eigenvalues
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


def in_ecos(opened: Ssp) -> Measure:

    def measure(stiffness: float, damping: float) -> np.ndarray:
        run = run_in_ecos(opened, pressed(stiffness, damping), STEPS * STEP, STEP, [DEPTH])
        return run[:, 0]

    return measure


def write_pressed(opened: Ssp, path: Path, stiffness: float, damping: float) -> None:
    """An SSP of the machine whose slide is pressed to the wall."""
    write_system(opened, path, pressed(stiffness, damping), STEPS * STEP, STEP)


# ---- rparm's master ------------------------------------------------------------------------------


def under_master(opened: Ssp, fmus: Mapping[str, Fmu], order: str, inputs: str) -> Measure:
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
    with mpl.rc_context(STYLE):
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
