"""Makes the references of the machine, without the code of the FMUs that they check.

For every variant ``sampled.csv``, the machine stepped in Jacobi order and read before inputs are
set, and ``ecos.csv``, the same read after inputs are set, as Ecos does. machine.py steps the
components, components.py has their equations; ``tightest.csv`` has the samples of the encoders that
were nearest to another count. ``pick_and_place`` and ``pick_and_place_untold`` have a
``monolithic.csv`` too, the solution in continuous time of monolithic.py.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np
from rparm.models.machine.experiment import STEPS_PER_SECOND, STOP
from rparm.models.machine.references.components import Sample
from rparm.models.machine.references.machine import DISCRETE, Machine, columns
from rparm.models.machine.references.monolithic import monolithic
from rparm.models.reference_files import KEPT, Files, communication_points
from rparm.models.rp_plant.references.solver import Solver

from rparm.fmi.model import Value
from rparm.models import reference_files

SYSTEM = Path(__file__).resolve().parents[1]
FILES = ("sampled.csv", "ecos.csv")  # read before inputs are set, and after it
TIGHTEST = 200  # samples of either joint that are kept
CONTINUOUS = ("pick_and_place", "pick_and_place_untold")  # variants with monolithic.csv

solver = cache(Solver)  # compiles the equations once


def variants() -> dict[str, dict[str, Value]]:
    """Return parameters of every variant, ``component.name``."""
    return reference_files.variants(SYSTEM)


def make(solver: Solver, parameters: Mapping[str, Value], stop: float = STOP) -> Files:
    """Return times and columns of the files of a machine in steps, by the name of the file."""
    times = communication_points(stop, STEPS_PER_SECOND)
    names = [*columns(), *DISCRETE]
    machine = Machine(solver, parameters, times)
    runs = dict(zip(FILES, machine.run(), strict=True))
    found: dict[str, tuple[np.ndarray, dict[str, np.ndarray]]] = {}
    for file, rows in runs.items():
        kept = {name: np.array([row[name] for row in rows[::KEPT]]) for name in names}
        found[file] = times[::KEPT], kept
    return found | {"tightest.csv": _tightest(machine.sensor.samples)}


def _tightest(samples: Sequence[Sample]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Times and columns of the samples with the least margins of either joint, in their order."""
    margins = np.array([sample.margins for sample in samples])
    positions = np.array([sample.positions for sample in samples])
    kept = np.unique(np.argsort(margins, axis=0, kind="stable")[:TIGHTEST])
    columns = {f"plant.q{i}": positions[kept, i - 1] for i in (1, 2)}
    columns |= {f"margin{i}": margins[kept, i - 1] for i in (1, 2)}
    return np.array([samples[k].time for k in kept]), columns


def names() -> tuple[str, ...]:
    return tuple(variants())


def files(name: str) -> Files:
    parameters = variants()[name]
    found = dict(make(solver(), parameters))
    if name in CONTINUOUS:
        times = communication_points(STOP, STEPS_PER_SECOND)[::KEPT]
        found["monolithic.csv"] = times, monolithic(parameters, times)
    return found
