"""HTML pages, made from the templates beside this file."""

from collections.abc import Callable, Sequence
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from cosim import texts, trajectory_csv
from cosim.comparison import Run
from cosim.convergence import Convergence
from cosim.output_files import whole
from cosim.report.convergence_figure import convergence_figure
from cosim.report.scenario_figure import scenario_figure
from cosim.report.style import save
from cosim.report.tolerance_figure import tolerance_figure
from cosim.tolerance_sweep import Sweep

INDEX = "index.html"

_templates = Environment(
    loader=FileSystemLoader(Path(__file__).parent / "templates"),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
_templates.filters |= {
    "bits": texts.bits,
    "milliseconds": texts.milliseconds,
    "short": texts.short,
}


def write_page(folder: Path, template: str, **values: object) -> Path:
    """Write index.html of `folder`, complete or not at all; return its path."""
    index = folder / INDEX
    with whole(index) as path:
        text = _templates.get_template(template).render(values)
        path.write_text(text, encoding="utf-8", newline="\n")
    return index


def write_runs(
    folder: Path,
    runs: Sequence[Run],
    sweeps: Sequence[Sweep] = (),
    convergences: Sequence[Convergence] = (),
    progress: Callable[[int], object] = lambda _: None,
) -> Path:
    """Write the page of runs with all pictures and results; return the path of index.html.

    Parameters
    ----------
    folder : Path
        Made if it is missing; other files in it stay.
    runs : sequence of Run
        The first one of each scenario is drawn against the reference.
    sweeps : sequence of Sweep, optional
    convergences : sequence of Convergence, optional
    progress : callable, optional
        Called with 1 after each of `runs`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    grouped: dict[str, list[Run]] = {}
    for run in runs:
        grouped.setdefault(run.scenario.name, []).append(run)
    for name, group in grouped.items():
        save(scenario_figure(group), folder / f"{name}.png")
        result = group[0].result
        trajectory_csv.write(folder / f"{name}.csv", result.times, result.names, result.values)
        progress(len(group))
    if sweeps:
        save(tolerance_figure(sweeps), folder / "accuracy.png")
    named = {
        "convergence" if i == 0 else f"convergence_{study.scenario.name}": study
        for i, study in enumerate(convergences)
    }
    for name, study in named.items():
        save(convergence_figure(study), folder / f"{name}.png")
    models = [group[0].fmu.model for group in grouped.values()]
    names = ", ".join(dict.fromkeys(model.name for model in models))
    versions = " and ".join(dict.fromkeys(model.fmi_version for model in models))
    return write_page(
        folder,
        "runs.html",
        title=f"{names} (FMI {versions}): runs against their references",
        twin=next((run.twin.fmi_version for run in runs if run.twin), None),
        runs=[run for group in grouped.values() for run in group],
        sweeps=sweeps,
        convergences=named,
        scenarios=[group[0].scenario for group in grouped.values()],
    )
