"""Results of systems' runs as files: a picture and the values of each variant, and a page."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from cosim import project, trajectory_csv
from cosim.output_files import whole
from cosim.report import pages
from cosim.report.style import save
from cosim.system.comparison import BOUND, Outcome
from cosim.system.ssp import Ssp
from cosim.system.study import Study


@dataclass(frozen=True)
class Section:
    """Runs of one system, for the page."""

    folder: Path
    ssp: Ssp
    study: Study
    outcomes: Sequence[Outcome]

    @property
    def name(self) -> str:
        """Name of the system."""
        return self.folder.name


def remove(folder: Path, system: str, variants: Sequence[str]) -> None:
    """Remove what an earlier run left of these variants, and the page that shows it."""
    (folder / pages.INDEX).unlink(missing_ok=True)
    (folder / f"{system}.svg").unlink(missing_ok=True)
    for variant in variants:
        for suffix in (".csv", ".png"):
            (folder / f"{variant}{suffix}").unlink(missing_ok=True)


def write_variant(folder: Path, figure: Figure, outcome: Outcome) -> None:
    """Write the picture and all recorded values of a run; a file is complete or not there."""
    folder.mkdir(parents=True, exist_ok=True)
    run = outcome.run
    save(figure, folder / f"{outcome.variant}.png")
    trajectory_csv.write(folder / f"{outcome.variant}.csv", run.times, run.names, run.values)


def write_page(folder: Path, sections: Sequence[Section]) -> Path:
    """Write index.html over the runs of `write_variant`, and the diagrams; return its path."""
    for section in sections:
        with whole(folder / f"{section.name}.svg") as path:
            path.write_bytes((section.folder / project.DIAGRAM).read_bytes())
    versions = {model.fmi_version for section in sections for model in section.ssp.models.values()}
    names = ", ".join(section.ssp.path.stem for section in sections)
    return pages.write_page(
        folder,
        "system.html",
        title=f"{names} (FMI {' and '.join(sorted(versions))}): runs against their references",
        bound=BOUND,
        sections=sections,
    )
