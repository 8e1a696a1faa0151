"""What the scripts that make a system's references share: variants, times, command line, files.

The parameters of a variant are in the system's folder, in resources/<component>_<variant>.ssv. A
reference is a folder of the variant's name with CSV files, which the script of the system makes.
"""

import argparse
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from rparm import files
from rparm.errors import UserError
from rparm.fmi.model import Value

NAMESPACE = {"ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues"}
KEPT = 20  # every 20th communication point goes into the files

Columns = Mapping[str, np.ndarray]
# Times (rows,) and columns (rows,) by name of each file of a variant, by the name of the file.
Files = Mapping[str, tuple[np.ndarray, Columns]]


def variants(system: Path, components: Iterable[str]) -> dict[str, dict[str, Value]]:
    """Parameters of every variant of the system in a folder, ``component.name``."""
    found: dict[str, dict[str, Value]] = {}
    for component in components:
        for path in sorted((system / "resources").glob(f"{component}_*.ssv")):
            parameters = found.setdefault(path.stem.removeprefix(f"{component}_"), {})
            for parameter in ElementTree.parse(path).iterfind(".//ssv:Parameter", NAMESPACE):
                kind, value = parameter[0].tag, parameter[0].get("value", "")
                is_number = kind.endswith(("}Real", "}Integer"))
                name = f"{component}.{parameter.get('name')}"
                parameters[name] = float(value) if is_number else value
    return found


def communication_points(stop: float, per_second: int) -> np.ndarray:
    """Communication points from 0 to `stop` in s, each rounded once."""
    return np.arange(round(stop * per_second) + 1) / per_second


def main(folder: Path, known: Iterable[str], make: Callable[[str], Files]) -> None:
    """Command line: `make` the files of the `known` variants that are named, or of all."""
    parser = argparse.ArgumentParser(description="Makes the references of the system.")
    parser.add_argument("names", nargs="*", metavar="VARIANT", help="variants (default: all)")
    parser.add_argument("--output", type=Path, default=folder, metavar="DIR", help="write there")
    arguments = parser.parse_args()
    known = list(known)
    try:
        for name in arguments.names:
            if name not in known:
                raise UserError(f"no variant {name!r} (known: {', '.join(known)})")
        for name in arguments.names or known:
            target = arguments.output / name
            target.mkdir(parents=True, exist_ok=True)
            for file, (times, columns) in make(name).items():
                values = np.column_stack([*columns.values()])
                rounded = values.astype(np.float64) + 0.0  # no negative zeros
                files.write_trajectory(target / file, times, list(columns), rounded)
                print(f"{name}/{file}: {len(times)} rows")
    except UserError as error:
        sys.exit(f"error: {error}")
