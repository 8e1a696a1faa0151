"""Problems for the program that encloses the arm's motion, and its answers."""

import os
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tests.support.paths import ROOT

BUILD = Path(os.environ.get("RP_FMU", ROOT / "build" / "RPManipulator.fmu")).parent
PROGRAM = BUILD / "proof" / "rp_manipulator" / "prove"
SOURCES = ROOT / "models" / "rp_manipulator" / "proof"
COMPILE = ("cc", "-std=c17", "-O1", "-ffp-contract=off", "-w")
sys.path.insert(0, str(SOURCES))
import check as check  # noqa: E402
import check_operations as check_operations  # noqa: E402
import motion_series as motion_series  # noqa: E402
import operands as operands  # noqa: E402

PARAMETERS = (2.0, 1.0, 0.1, 0.05, 0.5, 0.25, 0.1, 9.81)  # m1 m2 I1z I2z l1 lc1 a g
Cubic = Sequence[float]  # value and derivatives, at the begin of a communication step


@dataclass(frozen=True)
class Problem:
    """What is asked of the program.

    Attributes
    ----------
    radii, parameter_radii : sequences of 4 and 8 floats
        Of the start's states and of the parameters.
    sines : tuple
        Effort (0 or 1), amplitude, frequency in Hz, phase in rad.
    steps : tuple
        End of each communication step in s, cubics of tau1 and f2 over it.
    """

    states: Sequence[float]
    steps: Sequence[tuple[float, Cubic, Cubic]]
    parameters: Sequence[float] = PARAMETERS
    radii: Sequence[float] = (0.0,) * 4
    parameter_radii: Sequence[float] = (0.0,) * 8
    sines: Sequence[tuple[int, float, float, float]] = field(default=())
    start: float = 0.0

    @property
    def text(self) -> str:
        """As the program reads it."""
        lines = [
            _line("start", [self.start]),
            _line("states", _balls(self.states, self.radii)),
            _line("parameters", _balls(self.parameters, self.parameter_radii)),
            *(_line("sine", sine) for sine in self.sines),
            *(_line("to", [end, *_four(tau1), *_four(f2)]) for end, tau1, f2 in self.steps),
        ]
        return "".join(lines)


def _line(name: str, numbers: Iterable[float]) -> str:
    return f"{name} {' '.join(float(x).hex() for x in numbers)}\n"


def _balls(middles: Sequence[float], radii: Sequence[float]) -> np.ndarray:
    return np.column_stack((middles, np.zeros(len(middles)), radii)).ravel()


def _four(cubic: Cubic) -> list[float]:
    return [*cubic, 0.0, 0.0, 0.0, 0.0][:4]


def run(
    problem: str, certificate: Path | None = None, program: Path = PROGRAM
) -> subprocess.CompletedProcess[str]:
    """Run the program on a problem's text."""
    arguments = [program] + ([certificate] if certificate else [])
    return subprocess.run(arguments, input=problem, capture_output=True, text=True, timeout=60)


def enclosures(problem: str, program: Path = PROGRAM) -> np.ndarray:
    """hi, lo and radius of states and outputs at all communication points, (points, 14, 3)."""
    answer = run(problem, program=program)
    assert answer.returncode == 0, answer.stdout[-80:] + answer.stderr
    rows = [line.split()[2:] for line in answer.stdout.splitlines()]
    return np.array([[float.fromhex(word) for word in row] for row in rows]).reshape(-1, 14, 3)


ZERO = (0.0,)
# Between them they take every branch: free motion in long steps, uncertain starts and parameters,
# sampled and smooth inputs, and a step that is far too long for what happens in it.
SMALL = {
    "free": Problem((0.3, 0.1, 0.5, -0.2), [(0.25, ZERO, ZERO)]),
    "held": Problem(
        (-1.43, 0.58, 1.97, 0.12),
        [(0.001 * (i + 1), (-0.7 + 0.01 * i,), (-12.0 - 0.02 * i,)) for i in range(8)],
        start=0.0,
    ),
    "smooth": Problem(
        (-1.43, 0.58, 1.97, 0.12),
        [(1.1, (0.5, -1.0, 3.0, -20.0), (-10.0, 2.0, 1.0, 5.0)), (1.25, (1.0,), (-8.0, 40.0))],
        sines=[(0, 2.28, 0.42, 0.03), (0, 2.5, 1.6, 0.4), (1, 2.09, 0.57, -1.77)],
        start=1.0,
    ),
    "uncertain": Problem(
        (-1.0, 0.3, 1.0, 0.5),
        [(0.2, (1.0,), (-9.0,)), (0.4, (0.5,), (-9.0,))],
        radii=(1e-3, 1e-4, 0.0, 1e-5),
        parameter_radii=(0.0, 1e-5, 0.0, 0.0, 1e-6, 0.0, 1e-6, 0.0),
    ),
    "vague": Problem(
        (-1.0, 0.3, 1.0, 0.5),
        [(0.02, (1.0,), (-9.0,))],
        parameter_radii=(0.1, 0.2, 0.01, 0.0, 0.05, 0.02, 0.05, 0.5),
    ),
    "sudden": Problem(
        (0.1, 0.4, 0.0, 0.0),
        [(0.1, ZERO, (0.98,)), (0.2, (0.0, 0.0, 0.0, 3e7), ZERO), (0.3, (8e3,), (-4e3,))],
        parameters=(*PARAMETERS[:7], 0.1),
    ),
}
# no box holds the motions of so many states over the step: the proof must stop
TOO_BROAD = Problem((-1.0, 0.3, 1.0, 0.5), [(0.1, (1.0,), (-9.0,))], radii=(0.4, 0.1, 0.6, 0.6))
