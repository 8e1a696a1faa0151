"""Data that the player on a page animates: a mechanism's motion and its geometry.

Which variables these are is known to the folder of the model or system. Its module animation.py has
a function `animation` from `Recorded` to `Animation`; a folder without one has nothing to animate.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any, cast

import numpy as np

from rparm import project
from rparm.fmi.model import Value
from rparm.report.run_data import LINKS
from rparm.runs.comparison import Run
from rparm.runs.scenario import Scenario
from rparm.runs.simulation import Result
from rparm.systems.comparison import Outcome
from rparm.systems.structure import OpenedSystem

Rows = Sequence[int] | np.ndarray | slice  # of a run, that are shown
EVERY = slice(None)


@dataclass(frozen=True, eq=False)
class Recorded:
    """A run as `animation` reads it; all columns have the shape (rows,)."""

    times: np.ndarray  # (rows,) s
    columns: Mapping[str, np.ndarray]  # outputs and inputs, by name
    references: Mapping[str, np.ndarray]  # outputs in the reference of a scenario, by name
    values: Mapping[str, Value]  # of parameters, by name

    def component(self, name: str) -> "Recorded":
        """Return the columns of one component of a system, without its name in front."""
        named = self.columns, self.references, self.values
        return Recorded(self.times, *(_within(name, each) for each in named))


@dataclass(frozen=True, eq=False)
class Animation:
    """Motion and geometry under the names that the drawing gives them (assets/arm.js)."""

    columns: Mapping[str, np.ndarray | None]  # (rows,), or None: not there
    reference: Mapping[str, np.ndarray] | None  # (rows,): the motion that is drawn as a ghost
    arm: Mapping[str, Any]  # lengths in m, limits, surroundings
    links: np.ndarray  # (2, points, rows): x and y of the ends of the links in frame 0, m


def of_run(run: Run, rows: Rows = EVERY) -> dict | None:
    """Return the player's data of a scenario's run at `rows`; None: nothing to animate."""
    references = {name: run.reference.column(name) for name in run.result.names}
    return of_result(run.scenario, run.result, references, rows)


def of_result(
    scenario: Scenario, result: Result, references: Mapping[str, np.ndarray], rows: Rows = EVERY
) -> dict | None:
    """Return data for a run that may have stopped early, and may have no references."""
    # a row holds the outputs at the end of a step, so the inputs are of this step, too
    steps = scenario.input_rows[: len(result.times)]
    inputs = {name: values[steps] for name, values in scenario.inputs.items()}
    outputs = dict(zip(result.names, result.values.T, strict=True))
    columns = inputs | outputs | result.integers
    recorded = Recorded(result.times, columns, references, scenario.start_values)
    return of_recorded(scenario.model, recorded, rows)


def of_outcome(
    folder: str, ssp: OpenedSystem, outcome: Outcome, rows: Rows = EVERY, component: str = ""
) -> dict | None:
    """Return data for a run of a variant, by the folder of the system, or of one component."""
    given = ssp.system.parameter_sets[outcome.variant]
    values = {
        f"{owner}.{name}": value
        for owner, model in ssp.models.items()
        for name, value in (model.start_values | given.get(owner, {})).items()
    }
    columns = dict(zip(outcome.run.names, outcome.run.values.T, strict=True))
    recorded = Recorded(outcome.run.times, columns, {}, values)
    return of_recorded(folder, recorded.component(component) if component else recorded, rows)


def of_recorded(folder: str, recorded: Recorded, rows: Rows = EVERY) -> dict[str, Any] | None:
    """Return the data of the player for a folder below models/; None: nothing to animate."""
    animate = _animate(folder)
    if animate is None:
        return None
    animation = animate(recorded)

    def taken(values: np.ndarray | None) -> list | None:
        return None if values is None else values[rows].tolist()

    reference = animation.reference
    return {
        "time": taken(recorded.times),
        **{name: taken(values) for name, values in animation.columns.items()},
        "reference": reference and {name: taken(values) for name, values in reference.items()},
        "arm": dict(animation.arm),
        LINKS: animation.links[..., rows].tolist(),
    }


def can_animate(folder: str) -> bool:
    """Return whether a folder below models/ has an animation."""
    return _animate(folder) is not None


def _animate(folder: str) -> Callable[[Recorded], Animation] | None:
    """Return the function `animation` of a folder below models/."""
    if not folder.isidentifier():  # an FMU from elsewhere
        return None
    name = f"rparm.models.{folder}.{project.ANIMATION}"
    try:
        found = find_spec(name)
    except ModuleNotFoundError:  # no such folder
        found = None
    if found is None:
        return None
    return cast(Callable[[Recorded], Animation], import_module(name).animation)


def _within(component: str, named: Mapping[str, Any]) -> dict[str, Any]:
    start = f"{component}."
    return {name.removeprefix(start): x for name, x in named.items() if name.startswith(start)}
