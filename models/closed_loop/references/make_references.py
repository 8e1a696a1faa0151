"""Makes the references of the closed loop, without the code that they check.

For every variant ``monolithic.csv``, the solution in continuous time; ``sampled.csv``, that of the
system stepped in Jacobi order, read before inputs are set; ``ecos.csv``, the same read after inputs
are set, as Ecos does. closed_loop.py says what they mean, equations.py where they come from.
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
from models.closed_loop.experiment import STEPS_PER_SECOND, STOP
from models.closed_loop.references.closed_loop import (
    COLUMNS,
    COMPONENTS,
    Columns,
    monolithic,
    sampled,
)

RESOURCES = FOLDER.parent / "resources"  # the parameter sets, <component>_<variant>.ssv
NAMESPACE = {"ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues"}
KEPT = 20  # every so many communication points go into the files


def variants() -> dict[str, dict[str, float | str]]:
    """Parameters of every variant of the system, ``component.name``."""
    found: dict[str, dict[str, float | str]] = {}
    for component in COMPONENTS:
        for path in sorted(RESOURCES.glob(f"{component}_*.ssv")):
            parameters = found.setdefault(path.stem.removeprefix(f"{component}_"), {})
            parsed = ElementTree.parse(path)
            for parameter in parsed.iterfind(".//ssv:Parameter", NAMESPACE):
                kind, value = parameter[0].tag, parameter[0].get("value")
                number = kind.endswith(("}Real", "}Integer"))
                parameters[f"{component}.{parameter.get('name')}"] = (
                    float(value) if number else value
                )
    return found


def communication_points(stop: float = STOP, per_second: int = STEPS_PER_SECOND) -> np.ndarray:
    """Communication points from 0 to `stop` in s, each rounded once."""
    return np.arange(round(stop * per_second) + 1) / per_second


def make(
    parameters: dict[str, float | str], stop: float = STOP
) -> dict[str, tuple[np.ndarray, Columns]]:
    """Times and columns of the files of a variant, by the name of the file."""
    times = communication_points(stop)
    kept = times[::KEPT]
    stepped = {"sampled.csv": sampled(parameters, times)}
    stepped["ecos.csv"] = sampled(parameters, times, read="after")
    return {
        "monolithic.csv": (kept, monolithic(parameters, kept)),
        **{
            file: (kept, {name: column[::KEPT] for name, column in columns.items()})
            for file, columns in stepped.items()
        },
    }


def main() -> None:
    parser = argparse.ArgumentParser(description="Makes the references of the closed loop.")
    parser.add_argument("names", nargs="*", metavar="VARIANT", help="variants (default: all)")
    parser.add_argument("--output", type=Path, default=FOLDER, metavar="DIR", help="write there")
    arguments = parser.parse_args()
    try:
        known = variants()
        for name in arguments.names:
            if name not in known:
                raise UserError(f"no variant {name!r} (known: {', '.join(known)})")
        for name in arguments.names or known:
            folder = arguments.output / name
            folder.mkdir(parents=True, exist_ok=True)
            for file, (times, columns) in make(known[name]).items():
                values = np.column_stack([columns[name] for name in COLUMNS])
                rounded = values.astype(np.float64) + 0.0  # no negative zeros
                trajectory_csv.write(folder / file, times, COLUMNS, rounded)
                print(f"{name}/{file}: {len(times)} rows")
    except UserError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()
