"""Inputs, variants of systems and files, for the modules that make references.

The reference of a scenario is three files in the format of the FMI cross-check, in a folder of its
name: MODEL_ref.csv with the outputs, MODEL_in.csv with the inputs, MODEL_ref.opt with the times.
The reference of a system's variant is a folder of its name with CSV files; the variant's parameters
are in loop.toml of the system's folder.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from rparm.files import read_toml, write_text, write_trajectory
from rparm.fmi.model import Value
from rparm.runs.scenario import Scenario

KEPT = 20  # every 20th communication point of a system goes into its files

Columns = Mapping[str, np.ndarray]
# Times (rows,) and columns (rows,) by name of each file of a variant, by the name of the file.
Files = Mapping[str, tuple[np.ndarray, Columns]]


# ---- Scenarios -----------------------------------------------------------------------------------
def input_table(scenario: Scenario, names: Sequence[str]) -> np.ndarray:
    """Return the inputs at every communication point, (n + 1, names)."""
    table = np.empty((len(scenario.times), len(names)))
    for column, name in zip(table.T, names, strict=True):
        column[:] = scenario.input(name)
    return table


def held_rows(scenario: Scenario, names: Sequence[str]) -> np.ndarray:
    """Return the inputs of the step that ends at each point, (n + 1, names); at 0 the first."""
    table = input_table(scenario, names)
    return np.concatenate((table[:1], table[:-1]))


def write_scenario(
    scenario: Scenario, folder: Path, model: str, inputs: Sequence[str], outputs: Columns
) -> None:
    """Write the reference of a scenario; `outputs` are at all points, (n + 1,) each."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = scenario.reference_rows
    kept = np.column_stack([*outputs.values()])[rows]
    _write_table(folder / f"{model}_ref.csv", scenario.times[rows], list(outputs), kept)
    table = input_table(scenario, inputs)
    _write_table(folder / f"{model}_in.csv", scenario.times, list(inputs), table)
    options = {
        "StartTime": scenario.start,
        "StopTime": scenario.stop,
        "StepSize": scenario.steps[0] if len(scenario.steps) == 1 else 0.0,  # 0: variable
        "RelTol": scenario.tolerance,
    }
    text = "".join(f"{key},{value!r}\n" for key, value in options.items())
    write_text(folder / f"{model}_ref.opt", text)


def _write_table(path: Path, times: np.ndarray, names: Sequence[str], table: np.ndarray) -> None:
    rounded = table.astype(np.float64) + 0.0  # no negative zeros
    write_trajectory(path, times, names, rounded)


# ---- Systems -------------------------------------------------------------------------------------
def variants(system: Path) -> dict[str, dict[str, Value]]:
    """Return the parameters of every variant of the system in a folder, ``component.name``."""
    content = read_toml(system / "loop.toml")
    found = {}
    for name, given in content["variants"].items():
        values = content["parameters"] | given
        del values["description"]
        # a number, or a text with it and the variable's own unit
        found[name] = {key: float(str(value).split()[0]) for key, value in values.items()}
    return found


def communication_points(stop: float, per_second: int) -> np.ndarray:
    """Return the communication points from 0 to `stop` in s, each rounded once."""
    return np.arange(round(stop * per_second) + 1) / per_second


def write_variant(folder: Path, files: Files) -> None:
    """Write the files of a variant to a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for file, (times, columns) in files.items():
        _write_table(folder / file, times, list(columns), np.column_stack([*columns.values()]))
