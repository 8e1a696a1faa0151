"""What the drivers of this folder share: the co-simulation to run, and where its result goes.

    run_TOOL.py [what the tool needs more] FMU PLAN RESULT

runs under the interpreter of the tool's own environment. PLAN and RESULT are JSON files; Python
writes floating-point numbers to JSON with all their digits.
"""

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

Rows = list[list[float]]


@dataclass(frozen=True)
class Plan:
    """A co-simulation with inputs that change at every communication point."""

    fmu: str
    start: float  # s
    step: float  # s
    steps: int
    parameters: dict[str, float]
    initial: dict[str, float]  # states at the start
    inputs: dict[str, list[float]]  # values at the communication points 0 to `steps`
    outputs: list[str]

    @property
    def stop(self) -> float:
        """Time of the last communication point in s."""
        return self.time(self.steps)

    def time(self, i: int) -> float:
        """Time of communication point `i` in s."""
        return self.start + i * self.step

    def inputs_at(self, i: int) -> dict[str, float]:
        """Inputs at communication point `i`."""
        return {name: values[i] for name, values in self.inputs.items()}

    def start_values(self) -> dict[str, float]:
        """All that is set before the first step."""
        return self.parameters | self.initial | self.inputs_at(0)


def main(run: Callable[[Plan], Rows]) -> None:
    """Run the plan of the command line; row i of the result holds the outputs at point i."""
    fmu, plan, result = sys.argv[-3:]
    rows = run(Plan(fmu=fmu, **json.loads(Path(plan).read_text(encoding="utf-8"))))
    Path(result).write_text(json.dumps(rows), encoding="utf-8")
