"""Problems for the program that encloses motions, without FMUs, and what it answers."""

import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import numpy as np
from flint import arb

from rparm import project
from rparm.proof import checker
from rparm.proof.enclosure import Enclosure, Prover
from rparm.proof.problem import Problem
from tests.support.paths import ROOT

sys.path.insert(0, str(ROOT / "fmu"))
from compiler.read.model_file import read  # noqa: E402
from compiler.write.motion import motion  # noqa: E402

SOURCES = ROOT / "rparm" / "proof"
COMPILE = ("cc", "-std=c17", "-O1", "-ffp-contract=off", "-w")
EXAMPLES = ROOT / "examples" / "models"
ARM = ROOT / "models" / "rp_manipulator" / "rp_manipulator.toml"


@cache
def model(given: str | Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """The motion of a file, or of a text, and the start values that it gives."""
    with TemporaryDirectory() as folder:
        path = given if isinstance(given, Path) else Path(folder) / "model.toml"
        if isinstance(given, str):
            path.write_text(given)
        file = read(path)
    return motion(file), {v.name: v.start for v in file.variables.values() if v.start is not None}


def scenario(
    given: str | Path,
    times: Sequence[float],
    initial: Mapping[str, float] | None = None,
    parameters: Mapping[str, float] | None = None,
    inputs: Mapping[str, Sequence[float]] | None = None,
) -> Any:
    """What a proof needs of a scenario: values of the file, but for these; inputs are held."""
    values = model(given)[1] | dict(parameters or {}) | dict(initial or {})
    return SimpleNamespace(
        path=Path("model.toml"), start=times[0], times=np.array(times), initial=initial or {},
        start_values=values,
        input=lambda name: np.array((inputs or {}).get(name, [values[name]] * len(times))),
    )  # fmt: skip


def enclose(
    given: str | Path,
    times: Sequence[float],
    within: Mapping[str, float] | None = None,
    **more: Any,
) -> Enclosure:
    """Enclose states and outputs at these times."""
    prover = Prover(model(given)[0], with_outputs=True)
    return prover.enclose(scenario(given, times, **more), within)


def holds(enclosure: Enclosure, row: int, exact: Mapping[str, arb]) -> bool:
    """Whether intervals contain values, which are known far better."""
    for name, x in exact.items():
        i = enclosure.names.index(name)
        high, low, radius = (
            float(part[row, i]) for part in (enclosure.high, enclosure.low, enclosure.radius)
        )
        if x.rad() > 1e-60 * max(1, abs(x).upper()) or abs(x - arb(high) - arb(low)) > arb(radius):
            return False
    return True


# ---- Certificates --------------------------------------------------------------------------------
class Certified:
    """A problem, what the program prints, and its certificate, in lines."""

    def __init__(
        self, given: str | Path, times: Sequence[float], within: float = 0.0, **more: Any
    ) -> None:
        problem = Problem(model(given)[0], scenario(given, times, **more), with_outputs=True)
        start = {name: (float(problem.known[name]), within) for name in problem.states}
        self.problem = [*problem.text(start)]

    def run(self, program: Path | None = None) -> subprocess.CompletedProcess[str]:
        """Run the program; its points and claims are kept."""
        with TemporaryDirectory() as folder:
            file = Path(folder) / "certificate"
            command = [program or project.proof_program(), file]
            text = "".join(self.problem)
            ended = subprocess.run(command, input=text, capture_output=True, text=True, timeout=60)
            self.points, self.claims = ended.stdout.splitlines(), file.read_text().splitlines()
        return ended

    def check(self) -> int:
        """Check it; the number of steps."""
        return checker.check(self.problem, self.points, self.claims)


PENDULUM = """
name = "Pendulum"
experiment = { stop = 10.0, step = 0.5 }
[parameters]
g = { start = 9.81 }
l = { start = 0.7 }
[states]
phi = { start = 2.5, derivative = "w" }
w = { derivative = "-g / l * sin(phi)" }
"""
# every function, and an input; each operation moves
FUNCTIONS = """
name = "Functions"
[inputs]
u = { start = 0.3 }
[states]
x = { start = 0.4, derivative = "y * exp(-x) + u" }
y = { start = 0.3, derivative = "sin(x) * sqrt(1 + y**2) - log(1.5 + x) + 0.1 * time" }
z = { start = 0.2, derivative = "atan(x * y) + tanh(y) - cos(time) / (2 + x) - z" }
[outputs]
sum = { value = "x + y / 3" }
product = { value = "(x / 3) * (y / 7)" }
quotient = { value = "(x / 3) / (y / 7)" }
angles = { value = "tan(x) + asin(y) + acos(x) + atan2(y, x)" }
powers = { value = "sinh(y) + cosh(x) + hypot(x, y) + x**2.5 + y**-3" }
late = { value = "time * x" }
"""
SMALL = {
    "arm": Certified(ARM, [0.0, 0.001, 0.1, 0.35], inputs={
        "tau1": [1.0, -0.7, 3.0, 0.0], "f2": [-9.0, -12.0, 2.0, 0.0],
    }),
    "uncertain": Certified(PENDULUM, [0.0, 0.1, 0.3], 1e-4),
    "functions": Certified(FUNCTIONS, [0.0, 0.2, 1.0]),
    "ball": Certified(EXAMPLES / "bouncing_ball.toml", [0.0, 0.3, 0.6]),
    "switch": Certified(
        'name = "S"\n[states]\nx = { derivative = "1 if time < 0.7 else 2" }', [0.0, 0.5, 1.0]
    ),
    "corner": Certified(
        'name = "C"\n[states]\nx = { derivative = "1 + abs(x)" }', [0.0, 0.4, 1.0]
    ),
    "lorenz": Certified(EXAMPLES / "lorenz.toml", [0.0, 2.0]),
}  # fmt: skip
# no box holds the motions of so many states over the step: the proof must stop
TOO_BROAD = Certified(EXAMPLES / "lorenz.toml", [0.0, 1.0], 5.0)
