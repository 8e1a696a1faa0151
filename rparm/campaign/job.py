"""What workers need for the runs of a campaign: one picklable object, made from FMUs and a file."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rparm.campaign.measures import Measure
from rparm.fmi.compiled_loop import Part
from rparm.fmi.model import Value


@dataclass(frozen=True)
class Component:
    """An instance of an FMU."""

    name: str
    archive: str  # hash of its FMU
    values: dict[str, Value]  # set before initialization
    reals: Part
    switches: Part  # Booleans


@dataclass(frozen=True)
class HeldInputs:
    """Inputs with zero-order hold, as a scenario gives them: a row for each step."""

    names: tuple[str, ...]
    values: np.ndarray  # (n + 1, names)

    @staticmethod
    def of(inputs: Mapping[str, np.ndarray], count: int, kind: type) -> "HeldInputs":
        """Inputs by name, (count,) each."""
        columns = [values.astype(kind) for values in inputs.values()]
        rows = np.column_stack(columns) if columns else np.zeros((count, 0), kind)
        return HeldInputs(tuple(inputs), np.ascontiguousarray(rows))


@dataclass(frozen=True)
class Target:
    """Where a parameter of the campaign goes."""

    component: int
    variable: str
    held: int | None  # column of the held inputs; None: no input


@dataclass(frozen=True)
class Job:
    """All runs of a campaign, without their parameters."""

    components: tuple[Component, ...]
    start: float  # s
    stop: float  # s
    tolerance: float | None
    times: np.ndarray  # (n + 1,) communication points in s
    reals: HeldInputs
    switches: HeldInputs
    propagates: bool  # outputs feed inputs
    watched: tuple[str, ...]  # what is recorded
    columns: np.ndarray  # (watched,) of these, among the Reals of the loop
    integers: dict[str, tuple[int, str]]  # component and variable of those read at the end
    tangent: tuple[np.ndarray, ...] | None  # the first fields of loop.Tangent
    targets: tuple[tuple[str, Target], ...]  # by column of the table
    measures: tuple[Measure, ...]
    trajectories: frozenset[int]  # runs of which all that is recorded is kept
    hashes: dict[str, str]  # SHA-256 of the files that determine the runs

    @property
    def steps(self) -> int:
        return len(self.times) - 1
