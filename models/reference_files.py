"""What the scripts that make a model's references share: their command line and their files.

A reference is three files in the format of the FMI cross-check, in a folder of the scenario's name:
MODEL_ref.csv with the outputs, MODEL_in.csv with the inputs, MODEL_ref.opt with the times.
Scenarios are checked against the built FMU, and start values are those that it declares.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from rparm import files, project
from rparm.errors import UserError
from rparm.files import write_text
from rparm.fmi.fmu_file import read_model
from rparm.runs import scenario as scenarios
from rparm.runs.scenario import Scenario

# Writes the reference of a scenario to a folder.
Writer = Callable[[Scenario, Path], None]


def input_table(scenario: Scenario, names: Sequence[str]) -> np.ndarray:
    """Inputs at every communication point, (n + 1, names)."""
    table = np.empty((len(scenario.times), len(names)))
    for column, name in zip(table.T, names, strict=True):
        column[:] = scenario.input(name)
    return table


def write(
    scenario: Scenario,
    folder: Path,
    model: str,
    outputs: Sequence[str],
    values: np.ndarray,
    inputs: Sequence[str],
) -> None:
    """Write the reference of a scenario; `values` are at all points, (n + 1, outputs)."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = scenario.reference_rows
    tables = {
        "ref": (scenario.times[rows], outputs, values[rows]),
        "in": (scenario.times, inputs, input_table(scenario, inputs)),
    }
    for file, (times, names, table) in tables.items():
        rounded = table.astype(np.float64) + 0.0  # no negative zeros
        files.write_trajectory(folder / f"{model}_{file}.csv", times, names, rounded)
    options = {
        "StartTime": scenario.start,
        "StopTime": scenario.stop,
        "StepSize": scenario.steps[0] if len(scenario.steps) == 1 else 0.0,  # 0: variable
        "RelTol": scenario.tolerance,
    }
    text = "".join(f"{key},{value!r}\n" for key, value in options.items())
    write_text(folder / f"{model}_ref.opt", text)


def main(model_folder: Path, prepare: Callable[[], Writer]) -> None:
    """Command line: make the references of the scenarios named, or of all of the model's."""
    parser = argparse.ArgumentParser(description="Makes the reference trajectories.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="scenarios (default: all)")
    parser.add_argument("--output", type=Path, metavar="DIR", help="write to DIR/NAME instead")
    arguments = parser.parse_args()
    try:
        known = {
            name: path
            for name, path in project.scenario_files().items()
            if project.model_folder(path) == model_folder
        }
        for name in arguments.names:
            if name not in known:
                raise UserError(f"no scenario {name!r} of this model (known: {', '.join(known)})")
        model = read_model(project.built(model_folder, ".fmu"))
        write_one = prepare()
        for name in arguments.names or known:
            scenario = scenarios.load(known[name], model)
            write_one(
                scenario, arguments.output / name if arguments.output else scenario.reference_folder
            )
            print(f"{name}: {len(scenario.reference_rows)} rows")
    except UserError as error:
        sys.exit(f"error: {error}")
