"""Makes the reference trajectories of the plant, without the code that they check.

equations.py derives the equations of motion from positions, motion.py integrates them with heyoka
in long double from event to event, and automaton.py decides what follows an event.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

MODEL_FOLDER = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(MODEL_FOLDER.parents[1]))

from rparm.models.rp_plant.references.equations import INPUTS
from rparm.models.rp_plant.references.motion import Motion
from rparm.models.rp_plant.references.solver import Solver

from rparm.models import reference_files
from rparm.runs.scenario import Scenario

MODEL = "RPPlant"
ATTACHED = "payload_attached"


def simulate(solver: Solver, scenario: Scenario) -> tuple[list[str], np.ndarray, Motion]:
    """Names and values (n + 1, outputs) of the Real outputs, and the motion at its end.

    The inputs of row i are those of the step that ends there; row 0 has those of the start.
    """
    inputs = {name: scenario.input(name) for name in (*INPUTS, ATTACHED)}

    def at(i: int) -> dict[str, float]:
        return {name: values[i].item() for name, values in inputs.items()}

    # time counts from the start; the differences of the communication points are exact
    elapsed = scenario.times.astype(np.longdouble) - np.longdouble(scenario.start)
    motion = Motion(solver, scenario.start_values | at(0))
    rows = [motion.outputs()]
    for i in range(1, len(elapsed)):
        motion.advance(elapsed[i])
        rows.append(motion.outputs())
        if i < len(elapsed) - 1 and at(i) != at(i - 1):
            motion.set_inputs(at(i))
    names = list(rows[0])
    return names, np.array([[row[name] for name in names] for row in rows]), motion


def prepare() -> Callable[[Scenario, Path], None]:
    """Compile the equations; return what writes the reference of a scenario to a folder."""
    solver = Solver()

    def write(scenario: Scenario, folder: Path) -> None:
        names, values, _ = simulate(solver, scenario)
        inputs = (*INPUTS, ATTACHED)
        reference_files.write(scenario, folder, MODEL, names, values, inputs)

    return write


if __name__ == "__main__":
    reference_files.main(MODEL_FOLDER, prepare)
