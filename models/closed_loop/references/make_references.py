"""Makes the references of the closed loop, without the code that they check.

For every variant ``monolithic.csv``, the solution in continuous time; ``sampled.csv``, the solution
of the system stepped in Jacobi order, read before inputs are set; ``ecos.csv``, the same read after
inputs are set, as Ecos does. closed_loop.py says what they mean, equations.py where they come from.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from rparm.models.closed_loop.coupling.loop import STATES
from rparm.models.closed_loop.coupling.study import FAST, FAST_AND_SLOW, FAST_STOP
from rparm.models.closed_loop.experiment import STEPS_PER_SECOND, STOP
from rparm.models.closed_loop.references.closed_loop import Columns, monolithic, sampled
from rparm.models.reference_files import KEPT, Files, communication_points

from rparm.fmi.model import Value
from rparm.models import reference_files

SYSTEM = Path(__file__).resolve().parents[1]
FAST_ROWS_PER_SECOND = 50


def variants() -> dict[str, dict[str, Value]]:
    """Return parameters of every variant of the system, ``component.name``."""
    return reference_files.variants(SYSTEM)


def make(
    parameters: Mapping[str, Value], stop: float = STOP
) -> dict[str, tuple[np.ndarray, Columns]]:
    """Return times and columns of the files of a variant, by the name of the file."""
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


def fast_and_slow() -> Files:
    """Return times and states of the motion of the study of the coupling."""
    times = communication_points(FAST_STOP, FAST_ROWS_PER_SECOND)
    values = {f"{c}.{name}": value for c, of in FAST.items() for name, value in of.items()}
    columns = monolithic(values, times)
    return {FAST_AND_SLOW.name: (times, {name: columns[name] for name in STATES})}


def names() -> tuple[str, ...]:
    return (*variants(), FAST_AND_SLOW.parent.name)


def files(name: str) -> Files:
    return fast_and_slow() if name == FAST_AND_SLOW.parent.name else make(variants()[name])
