"""What the scripts that make a model's references share: their command line and their files.

A reference is three files in the format of the FMI cross-check, in a folder of the scenario's name:
UNIT_ref.csv with the outputs, UNIT_in.csv with the inputs, UNIT_ref.opt with the times.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from cosim import scenario as scenarios
from cosim.errors import UserError
from cosim.files import write_csv
from cosim.outputs import whole
from cosim.scenario import Scenario

ROOT = Path(__file__).resolve().parents[1]

# Writes the reference of a scenario to a folder.
Writer = Callable[[Scenario, Path], None]


def write(
    scenario: Scenario,
    folder: Path,
    unit: str,
    outputs: tuple[Sequence[str], np.ndarray],
    inputs: tuple[Sequence[str], np.ndarray],
) -> None:
    """Write the reference of one scenario.

    Parameters
    ----------
    scenario : Scenario
    folder : Path
        Made where it is missing.
    unit : str
        Name of the model's FMU.
    outputs : names and ndarray, shape (rows, names)
        At the communication points of the reference.
    inputs : names and ndarray, shape (n + 1, names)
        At every communication point.
    """
    folder.mkdir(parents=True, exist_ok=True)
    times = {"ref": scenario.times[scenario.reference_rows], "in": scenario.times}
    for file, (names, values) in (("ref", outputs), ("in", inputs)):
        rounded = values.astype(np.float64) + 0.0  # no negative zeros
        write_csv(folder / f"{unit}_{file}.csv", times[file], names, rounded)
    options = {
        "StartTime": scenario.start,
        "StopTime": scenario.stop,
        "StepSize": scenario.steps[0] if len(scenario.steps) == 1 else 0.0,  # 0: variable
        "RelTol": scenario.tolerance,
    }
    with whole(folder / f"{unit}_ref.opt") as path:
        text = "".join(f"{key},{value!r}\n" for key, value in options.items())
        path.write_text(text, encoding="utf-8", newline="\n")


def main(model_folder: Path, prepare: Callable[[], Writer]) -> None:
    """Command line: make the references of the scenarios named, or of all of the model's.

    `prepare` is called once, after the names have been checked, for what writes them.
    """
    parser = argparse.ArgumentParser(description="Makes the reference trajectories.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="scenarios (default: all)")
    parser.add_argument("--output", type=Path, metavar="DIR", help="write to DIR/NAME instead")
    arguments = parser.parse_args()
    try:
        known = {
            name: path
            for name, path in scenarios.find_all(ROOT).items()
            if path.parent.parent == model_folder
        }
        for name in arguments.names:
            if name not in known:
                raise UserError(f"no scenario {name!r} of this model (known: {', '.join(known)})")
        write_one = prepare()
        for name in arguments.names or known:
            scenario = scenarios.load(known[name])
            write_one(
                scenario, arguments.output / name if arguments.output else scenario.reference_folder
            )
            print(f"{name}: {len(scenario.reference_rows)} rows")
    except UserError as error:
        sys.exit(f"error: {error}")
