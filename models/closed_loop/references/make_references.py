"""Makes the references of the closed loop, without the code that they check.

For every variant ``monolithic.csv``, the solution in continuous time; ``sampled.csv``, that of the
system stepped in Jacobi order, read before inputs are set; ``ecos.csv``, the same read after inputs
are set, as Ecos does. closed_loop.py says what they mean, equations.py where they come from.
"""

import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).resolve().parent
sys.path.insert(0, str(FOLDER.parents[2]))

from rparm.models.closed_loop.experiment import STEPS_PER_SECOND, STOP
from rparm.models.closed_loop.references.closed_loop import (
    COMPONENTS,
    Columns,
    monolithic,
    sampled,
)
from rparm.models.system_references import KEPT, communication_points

from rparm.fmi.model import Value
from rparm.models import system_references


def variants() -> dict[str, dict[str, Value]]:
    """Parameters of every variant of the system, ``component.name``."""
    return system_references.variants(FOLDER.parent, COMPONENTS)


def make(
    parameters: Mapping[str, Value], stop: float = STOP
) -> dict[str, tuple[np.ndarray, Columns]]:
    """Times and columns of the files of a variant, by the name of the file."""
    times = communication_points(stop, STEPS_PER_SECOND)
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


if __name__ == "__main__":
    found = variants()
    system_references.main(FOLDER, found, lambda name: make(found[name]))
