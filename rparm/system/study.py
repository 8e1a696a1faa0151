"""What is specific to a system: the module study.py of its folder, with names of `Study`."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast

from rparm import project
from rparm.errors import UserError
from rparm.files import is_file
from rparm.system.comparison import Outcome
from rparm.system.ssp import Ssp

if TYPE_CHECKING:  # only pictures need it
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Measure:
    """A number that a run is measured by, for the tables."""

    name: str
    unit: str
    meaning: str  # explains it on the page, after its name and a colon
    value: Callable[[Outcome], float]


@dataclass(frozen=True)
class Diagram:
    """Variables of one unit to draw together, each ``component.variable``."""

    title: str
    curves: Sequence[str]
    references: Mapping[str, str] = field(default_factory=dict)  # what a curve should follow


@dataclass(frozen=True)
class Rest:
    """Where a system rests, to find its largest stable steps; names are ``component.variable``."""

    variant: str
    moved: Sequence[str]  # states to begin a little off
    signals: Sequence[str]  # that show whether the deviation dies out
    values: Mapping[str, float] = field(default_factory=dict)  # besides those of the variant
    without: Sequence[str] = ()  # components to take as ideal
    sequence: Sequence[str] = ()  # order of stepping; default: that of the SSP


class Study(Protocol):
    """The module study.py of a system's folder."""

    EXPERIMENT: tuple[float, float, float]  # start, stop and step in s that the references are for
    MEASURES: Sequence[Measure]
    DIAGRAMS: Sequence[Diagram]  # of the page of a variant

    def figure(self, ssp: Ssp, outcome: Outcome) -> "Figure":
        """Picture of a run of one variant, for READMEs."""
        ...


class CouplingStudy(Study, Protocol):
    """The module of a system that has a study of what the coupling costs."""

    COUPLING_PICTURE: str  # file name of what it draws

    def study_coupling(self, ssp: Path, report: Path) -> dict[str, dict[str, object]]:
        """Print tables, write the picture; numbers by part, whether all is well is ``passed``."""
        ...


def load(folder: Path) -> Study:
    """The module of a system's folder; UserError if there is none."""
    file = folder / f"{project.STUDY}.py"
    if not is_file(file):
        raise UserError(f"{file}: no such file, rparm/system/study.py says what belongs in it")
    return cast(Study, import_module(f"rparm.models.{folder.name}.{project.STUDY}"))


def of_coupling() -> tuple[Path, CouplingStudy]:
    """Folder and module of the one system that has a study of its coupling; else UserError."""
    found = _having("study_coupling")
    if len(found) != 1:
        names = ", ".join(folder.name for folder in found) or "none"
        raise UserError(f"expected one system with a study of its coupling, found {names}")
    (folder, known), *_ = found.items()
    return folder, cast(CouplingStudy, known)


def rests() -> dict[Path, Rest]:
    """Where systems rest, by folder, of those that define ``REST``."""
    return {folder: cast(Rest, known.REST) for folder, known in _having("REST").items()}


def _having(name: str) -> dict[Path, Any]:
    """Modules of systems that have this name, by folder."""
    loaded = {folder: load(folder) for folder in project.systems().values()}
    return {folder: known for folder, known in loaded.items() if hasattr(known, name)}
