"""Filters that step measurements of many runs, and the runs: Runge-Kutta steps of the equations."""

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from scipy.stats import chi2

from rparm.building import build

EXAMPLES = Path(__file__).parents[2] / "examples" / "models"
Rates = Callable[[np.ndarray, np.ndarray], np.ndarray]
CONFIDENCE = 0.999


class Slave:
    """An FMU of FMI 2.0 for Co-Simulation."""

    def __init__(self, path: Path, folder: Path) -> None:
        description = read_model_description(path)
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        of = {"guid": description.guid, "modelIdentifier": description.coSimulation.modelIdentifier}
        self.fmu = FMU2Slave(unzipDirectory=str(folder), instanceName="slave", **of)
        self.fmu.instantiate()
        self.time = 0.0

    def start(
        self, inputs: Mapping[str, float], tolerance: float = 1e-8, method: int = 0, **starts: float
    ) -> None:
        """Initialize; method: `solver_method` by its number, if not 0."""
        self.fmu.reset()
        self.fmu.setupExperiment(tolerance=tolerance)
        if method:
            self.fmu.setInteger([self.references["solver_method"]], [method])
        self.set(starts)
        self.fmu.enterInitializationMode()
        self.set(inputs)
        self.fmu.exitInitializationMode()
        self.time = 0.0

    def set(self, values: Mapping[str, float]) -> None:
        references = [self.references[name] for name in values]
        self.fmu.setReal(references, [float(value) for value in values.values()])

    def get(self, *names: str) -> np.ndarray:
        return np.array(self.fmu.getReal([self.references[name] for name in names]))

    def step(self, length: float, inputs: Mapping[str, float]) -> None:
        self.set(inputs)
        self.fmu.doStep(self.time, length)
        self.time += length

    def covariance(self, *names: str) -> np.ndarray:
        """Return P of states, 0 where the filter has no element."""
        found = np.zeros((len(names), len(names)))
        for i, x in enumerate(names):
            for j, y in enumerate(names[i:], i):
                if f"P_{x}_{y}" in self.references:
                    found[i, j] = found[j, i] = self.get(f"P_{x}_{y}")[0]
        return found


@contextmanager
def opened(path: Path, folder: Path) -> Iterator[Slave]:
    """Yield an FMU."""
    unzipped = extract(path, unzipdir=folder / f"unzipped_{path.stem}")
    slave = Slave(path, unzipped)
    try:
        yield slave
    finally:
        slave.fmu.freeInstance()
        shutil.rmtree(unzipped)


@contextmanager
def filter_of(plant: str | Path, request: str, folder: Path) -> Iterator[Slave]:
    """Build the filter of a plant, a text or a file, and yield it."""
    file = folder / "plant.toml"
    text = plant.read_text(encoding="utf-8") if isinstance(plant, Path) else plant
    file.write_text(text, encoding="utf-8")
    estimator = folder / "estimator.toml"
    estimator.write_text(f'name = "Filter"\nestimator = "plant.toml"\n{request}', encoding="utf-8")
    path, _ = build(estimator, output=folder, lock=False)
    with opened(path, folder) as slave:
        yield slave


def ahead(rates: Rates, x: np.ndarray, u: np.ndarray, length: float, steps: int) -> np.ndarray:
    """Return states (states, runs) after a time with held inputs (inputs, runs)."""
    h = length / steps
    for _ in range(steps):
        a = rates(x, u)
        b = rates(x + h / 2 * a, u)
        c = rates(x + h / 2 * b, u)
        x = x + h / 6 * (a + 2 * b + 2 * c + rates(x + h * c, u))
    return x


def bounds(states: int, runs: int) -> tuple[float, float]:
    """Return between what the mean NEES of consistent runs is."""
    rest = (1 - CONFIDENCE) / 2
    low, high = chi2.ppf([rest, 1 - rest], states * runs) / runs
    return low, high


def nees(slave: Slave, names: Sequence[str], true: np.ndarray) -> float:
    """Return the squared error over its covariance."""
    wrong = slave.get(*names) - true
    return wrong @ np.linalg.solve(slave.covariance(*names), wrong)
