"""Makes the reference trajectories of the plant, without the code that they check.

equations.py derives the equations of motion from positions, motion.py integrates them with heyoka
in long double from event to event, and automaton.py decides what follows an event.
"""

from functools import cache

import numpy as np
from rparm.models.rp_plant.references.equations import INPUTS as FORCES
from rparm.models.rp_plant.references.motion import Motion
from rparm.models.rp_plant.references.solver import Solver

from rparm.runs.scenario import Scenario

INPUTS = (*FORCES, "payload_attached")

solver = cache(Solver)  # compiles the equations once


def outputs(scenario: Scenario) -> dict[str, np.ndarray]:
    """Return the Real outputs' columns (n + 1,), with the inputs of the step before each row."""
    inputs = {name: scenario.input(name) for name in INPUTS}

    def at(i: int) -> dict[str, float]:
        return {name: values[i].item() for name, values in inputs.items()}

    # time counts from the start; the differences of the communication points are exact
    elapsed = scenario.times.astype(np.longdouble) - np.longdouble(scenario.start)
    motion = Motion(solver(), scenario.start_values | at(0))
    rows = [motion.outputs()]
    for i in range(1, len(elapsed)):
        motion.advance(elapsed[i])
        rows.append(motion.outputs())
        if i < len(elapsed) - 1 and at(i) != at(i - 1):
            motion.set_inputs(at(i))
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}
