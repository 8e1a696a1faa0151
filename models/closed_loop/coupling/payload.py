"""Payload: what a payload costs that the controller does not know."""

from dataclasses import dataclass

import numpy as np
from rparm.models.closed_loop.coupling.delays import path_error
from rparm.models.closed_loop.coupling.loop import METHODS, VARIANTS, ClosedLoop, Columns

HOLD = 9.0  # s: the circle ends at 5.5 s, what is left of the motion has died out


@dataclass(frozen=True, eq=False)
class Payload:
    """Errors of the variants with the wrong payload in the controller."""

    largest: dict[str, float]  # m, end effector on the circle
    held: dict[str, np.ndarray]  # (2,) rad, m: errors of the joints at the end of the hold
    theory: np.ndarray  # (2,) of the one without integral action

    @property
    def passed(self) -> bool:
        """Whether the payload costs what theory gives, and integral action takes that away."""
        left, helped = self.held["heavy_payload"], self.held["heavy_payload_integral"]
        return bool(
            self.largest["heavy_payload"] > 10 * self.largest["nominal"]
            and np.abs(left - self.theory).max() <= 1e-6 * np.abs(self.theory).max()
            and np.abs(helped).max() <= 1e-6 * np.abs(left).max()
        )


def study_payload(loop: ClosedLoop, step: float = 1e-3) -> Payload:
    """A payload that the controller does not know, with and without integral action."""
    largest, held = {}, {}
    for variant in VARIANTS:
        columns = loop.run(METHODS[0], step, variant, stop=HOLD)[0]
        largest[variant] = float(path_error(columns).max())
        held[variant] = np.array(
            [columns[f"trajectory.q{i}_ref"][-1] - columns[f"arm.q{i}"][-1] for i in (1, 2)]
        )
        if variant == "heavy_payload":
            theory = _held_error(loop, columns)
    return Payload(largest, held, theory)


def _held_error(loop: ClosedLoop, columns: Columns) -> np.ndarray:
    """D^-1 (g_arm - g_controller) / Kp at the end, with the controller's D."""
    arm = {name: float(loop.fmus["arm"].model.variables[name].start) for name in ("m2", "a", "g")}
    excess = loop.parameters("heavy_payload")["arm"]["m2"] - arm["m2"]
    last = {name: float(column[-1]) for name, column in columns.items()}
    x, y, q1 = last["arm.ee_x"], last["arm.ee_y"], last["arm.q1"]
    mass = np.array([[last["arm.D11"], last["arm.D12"]], [last["arm.D12"], last["arm.D22"]]])
    mass -= excess * np.array([[x * x + y * y, -arm["a"]], [-arm["a"], 1.0]])
    weight = excess * arm["g"] * np.array([x, np.sin(q1)])
    return np.linalg.solve(mass, weight) / [loop.gain("Kp1"), loop.gain("Kp2")]
