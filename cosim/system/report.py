"""Results of a system's runs as files: a picture and the values of each variant, and a page."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from cosim import trajectory_csv
from cosim.report import pages
from cosim.report.style import save
from cosim.system.comparison import BOUND, Outcome
from cosim.system.ssp import Ssp
from cosim.system.study import Study


def remove(folder: Path, variants: Sequence[str]) -> None:
    """Remove what an earlier run left of these variants, and the page that shows it."""
    (folder / pages.INDEX).unlink(missing_ok=True)
    for variant in variants:
        for suffix in (".csv", ".png"):
            (folder / f"{variant}{suffix}").unlink(missing_ok=True)


def write_variant(folder: Path, figure: Figure, outcome: Outcome) -> None:
    """Write the picture and all recorded values of a run; a file is complete or not there."""
    folder.mkdir(parents=True, exist_ok=True)
    run = outcome.run
    save(figure, folder / f"{outcome.variant}.png")
    trajectory_csv.write(folder / f"{outcome.variant}.csv", run.times, run.names, run.values)


def write_page(folder: Path, ssp: Ssp, study: Study, outcomes: Sequence[Outcome]) -> Path:
    """Write index.html over the runs of `write_variant`; return its path."""
    versions = " and ".join(sorted({model.fmi_version for model in ssp.models.values()}))
    return pages.write_page(
        folder,
        "system.html",
        title=f"{ssp.path.stem} (FMI {versions}): runs against their references",
        step=ssp.system.step,
        bound=BOUND,
        measures=study.MEASURES,
        picture_text=study.PICTURE,
        outcomes=outcomes,
    )
