"""The models of models.toml: FMUs that are built once, and runs of them."""

from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

import numpy as np

from tests.equations.examples import METHODS, made, simulated
from tests.support.tables import tables

TEXTS = tables(__file__)
EXACT = "gradients_are_exact"


@cache
def fmus() -> dict[str, Path]:
    """FMUs of FMI 2.0 by name; those of 3.0 are in the folder fmi3 beside them."""
    with ThreadPoolExecutor(2) as pool:
        return dict(zip(TEXTS, pool.map(made, TEXTS.values()), strict=True))


def run(
    fmu: Path, method: str, stop: float, step: float, version: str = "2.0",
    tolerance: float = 1e-10, kind: str = "CoSimulation", **start: float | str,
) -> np.ndarray:  # fmt: skip
    """A run by fmpy: all outputs."""
    path = fmu if version == "2.0" else fmu.parent / "fmi3" / fmu.name
    if kind == "CoSimulation":
        start["solver_method"] = METHODS[method]
    return simulated(path, stop, step, start, relative_tolerance=tolerance, fmi_type=kind)


def by(name: str, parameter: str) -> str:
    """The name of a derivative."""
    return f"{name}_by_{parameter.replace('start(', 'start_').rstrip(')')}"
