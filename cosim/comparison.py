"""Runs of scenarios compared with their references."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cosim import reference, simulation
from cosim.fmu_file import Fmu
from cosim.reference import Reference
from cosim.scenario import Scenario
from cosim.simulation import Result


@dataclass(frozen=True, eq=False)
class Run:
    """One scenario at one tolerance, compared with its reference."""

    scenario: Scenario
    fmu: Fmu
    result: Result
    reference: Reference
    errors: dict[str, float]  # relative, per Real output

    @property
    def worst(self) -> str:
        """The variable with the largest error."""
        return list(self.errors)[int(np.argmax(list(self.errors.values())))]

    @property
    def error(self) -> float:
        """The largest relative error of all Real outputs; NaN if one of them is."""
        return self.errors[self.worst]

    @property
    def bound(self) -> float:
        """The largest error allowed at this tolerance."""
        return reference.bound(self.result.tolerance)

    @property
    def passed(self) -> bool:
        """Whether the error is within its bound."""
        return self.error <= self.bound


class Runs:
    """Runs scenarios on the FMUs of their models, each at a tolerance only once."""

    def __init__(self, fmus: Mapping[str, Fmu]) -> None:
        self._fmus = fmus  # by name of the model's folder
        self._runs: dict[tuple[str, float], Run] = {}
        self._references: dict[str, Reference] = {}

    def reference(self, scenario: Scenario) -> Reference:
        """Return the reference of `scenario`, read once."""
        if scenario.name not in self._references:
            model = self._fmus[scenario.model].model
            self._references[scenario.name] = reference.load(scenario, model)
        return self._references[scenario.name]

    def steps_ahead(self, scenario: Scenario, tolerances: Sequence[float]) -> int:
        """Communication steps that runs at `tolerances` still have to make."""
        missing = [t for t in tolerances if (scenario.name, t) not in self._runs]
        return len(missing) * (len(scenario.times) - 1)

    def run(
        self,
        scenario: Scenario,
        tolerance: float,
        progress: Callable[[int], object] | None = None,
    ) -> Run:
        """`scenario` at `tolerance`, simulated now unless it was before."""
        key = scenario.name, tolerance
        if key not in self._runs:
            expected, fmu = self.reference(scenario), self._fmus[scenario.model]
            result = simulation.simulate(fmu, scenario, tolerance, progress)
            errors = reference.errors(result, expected)
            self._runs[key] = Run(scenario, fmu, result, expected, errors)
        return self._runs[key]
