"""Draws the picture of docs/gradients.md: a bouncing ball's derivative, and the least throw.

PYTHONPATH=. build/venv/bin/python examples/gradients.py [PICTURE]
"""

import re
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import minimize

import rparm

PAGE = Path(__file__).resolve().parents[1] / "docs" / "gradients.md"
MODEL = re.compile(r'^```toml\n(name = "(\w+)"\n.*?)^```', re.MULTILINE | re.DOTALL)
TARGET = np.array([1.0, 0.5])  # m
FIRST = np.array([3.0, 3.0, 2.0])  # m/s, m/s, s: meets floor and wall, and misses the target
OTHER = 0.03  # larger restitution of the dotted ball


class Throw:
    """Throws (vx, vy, T): the velocity at the start in m/s, and the time at the target in s."""

    def __init__(self, file: Path) -> None:
        self.file, self.runs = file, 0
        self._last = np.empty(0), np.empty(0), np.empty((0, 0))

    def run(self, throw: np.ndarray, step: float | None = None) -> rparm.Gradient:
        vx, vy, time = throw.tolist()
        self.runs += 1
        return rparm.gradient(
            self.file,
            of=["x", "y", "vx", "vy"],
            by=["start(vx)", "start(vy)"],
            start_values={"vx": vx, "vy": vy, "solver_method": "taylor"},
            stop_time=time,
            step=time if step is None else step,
        )

    def _at_target(self, throw: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance from the target (2,), and its derivatives (2, 3) by the throw: of one run."""
        if not np.array_equal(self._last[0], throw):
            run = self.run(throw)
            position, velocity = np.split(run.values[-1], 2)
            slopes = np.column_stack([run.gradients[-1, :2], velocity])
            self._last = throw.copy(), position - TARGET, slopes
        return self._last[1:]

    def least(self) -> np.ndarray:
        """The slowest throw that hits the target with as many impacts as `FIRST`."""
        found = minimize(
            lambda throw: throw[0] ** 2 + throw[1] ** 2,
            FIRST,
            jac=lambda throw: np.array([2 * throw[0], 2 * throw[1], 0.0]),
            constraints={
                "type": "eq",
                "fun": lambda throw: self._at_target(throw)[0],
                "jac": lambda throw: self._at_target(throw)[1],
            },
            method="SLSQP",
            options={"ftol": 1e-12},
        )
        assert found.success, found.message
        return found.x


with tempfile.TemporaryDirectory() as folder:
    files = {}
    for text, name in MODEL.findall(PAGE.read_text(encoding="utf-8")):
        files[name] = Path(folder) / f"{name}.toml"
        files[name].write_text(text, encoding="utf-8")
    given = {"of": ["h"], "by": ["e"], "stop_time": 2.0, "step": 0.002}
    ball = rparm.gradient(files["Ball"], **given)
    other = rparm.gradient(files["Ball"], start_values={"e": 0.8 + OTHER}, **given)
    throw = Throw(files["Throw"])
    least = throw.least()
    runs = throw.runs
    paths = [throw.run(each, each[2] / 400).values for each in (FIRST, least)]

figure, axes = plt.subplot_mosaic("ac;bc", figsize=(11, 4.2), layout="constrained")
axes["a"].plot(ball.time, ball.values, label="e = 0.8")
axes["a"].plot(other.time, other.values, ":", label=f"e = {0.8 + OTHER:g}")
axes["a"].set_ylabel("h (m)")
axes["a"].legend(loc="upper right", ncols=2)
axes["b"].plot(ball.time, ball.gradients[:, 0, 0], "C2")
axes["b"].set(xlabel="time (s)", ylabel="h_by_e (m)")
for path, style, label in zip(paths, ("--", "-"), ("first guess", "least effort"), strict=True):
    axes["c"].plot(path[:, 0], path[:, 1], style, label=label)
axes["c"].plot(*TARGET, "k*", markersize=12)
axes["c"].set(title="over floor and wall to the star", xlabel="x (m)", ylabel="y (m)")
axes["c"].legend(loc="upper left")
if len(sys.argv) > 1:
    figure.savefig(sys.argv[1], dpi=70)

print(f"h_by_e {ball.gradients[-1, 0, 0]:.6f} m after {ball.time[-1]:g} s, exact: {ball.are_exact}")
print(f"throw {least[0]:.6f}, {least[1]:.6f} m/s hits at {least[2]:.6f} s; {runs} runs")
