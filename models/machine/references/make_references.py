"""Makes the references of the machine, without the code of the FMUs that they check.

For every variant ``sampled.csv``, the machine stepped in Jacobi order and read before inputs are
set, and ``ecos.csv``, the same read after inputs are set, as Ecos does. machine.py steps the
components, components.py has their equations.
"""

import argparse
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

FOLDER = Path(__file__).resolve().parent
ROOT = FOLDER.parents[2]
sys.path.insert(0, str(ROOT))

from cosim import trajectory_csv
from cosim.errors import UserError
from models.machine.experiment import STEPS_PER_SECOND, STOP
from models.machine.references.machine import COMPONENTS, DISCRETE, columns, sampled
from models.rp_plant.references.solver import Solver

RESOURCES = FOLDER.parent / "resources"  # the parameter sets, <component>_<variant>.ssv
NAMESPACE = {"ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues"}
FILES = {"sampled.csv": "before", "ecos.csv": "after"}
KEPT = 20  # every so many communication points go into the files


def variants() -> dict[str, dict[str, float]]:
    """Parameters of every variant, ``component.name``."""
    found: dict[str, dict[str, float]] = {}
    for component in COMPONENTS:
        for path in sorted(RESOURCES.glob(f"{component}_*.ssv")):
            parameters = found.setdefault(path.stem.removeprefix(f"{component}_"), {})
            for parameter in ElementTree.parse(path).iterfind(".//ssv:Parameter", NAMESPACE):
                parameters[f"{component}.{parameter.get('name')}"] = float(
                    parameter[0].get("value", "")
                )
    return found


def communication_points(stop: float = STOP, per_second: int = STEPS_PER_SECOND) -> np.ndarray:
    """Communication points from 0 to `stop` in s, each rounded once."""
    return np.arange(round(stop * per_second) + 1) / per_second


def make(
    solver: Solver, parameters: dict[str, float], stop: float = STOP
) -> tuple[np.ndarray, list[str], dict[str, np.ndarray]]:
    """Times (rows,), names of the columns, and values (rows, columns) of each file."""
    times = communication_points(stop)
    names = [*columns(), *DISCRETE]
    runs = sampled(solver, parameters, times)
    values = {
        file: np.array([[row[name] for name in names] for row in runs[read][::KEPT]])
        for file, read in FILES.items()
    }
    return times[::KEPT], names, values


def main() -> None:
    parser = argparse.ArgumentParser(description="Makes the references of the machine.")
    parser.add_argument("names", nargs="*", metavar="VARIANT", help="variants (default: all)")
    parser.add_argument("--output", type=Path, default=FOLDER, metavar="DIR", help="write there")
    arguments = parser.parse_args()
    try:
        known = variants()
        for name in arguments.names:
            if name not in known:
                raise UserError(f"no variant {name!r} (known: {', '.join(known)})")
        solver = Solver()
        for name in arguments.names or known:
            folder = arguments.output / name
            folder.mkdir(parents=True, exist_ok=True)
            times, names, files = make(solver, known[name])
            for file, values in files.items():
                rounded = values.astype(np.float64) + 0.0  # no negative zeros
                trajectory_csv.write(folder / file, times, names, rounded)
                print(f"{name}/{file}: {len(times)} rows")
    except UserError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()
