"""Writes the report of a command: pages of scenarios, studies over tolerances and steps."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import chain, count
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from rparm import project
from rparm.files import from_here
from rparm.report import overview, pages, scenario_page
from rparm.report.overlay import Others
from rparm.report.overview import FAILED, FILES, PASSED, SCENARIOS, STUDIES, Entry
from rparm.report.overview import sparkline as sparkline
from rparm.report.pages import PageTable, RunPage
from rparm.report.run_data import Axis, Curve, Plot, RunData
from rparm.runs import comparison
from rparm.runs.comparison import Failure, Run, Sweep
from rparm.runs.convergence import Convergence
from rparm.units import duration, short, verdict

ACCURACY = "accuracy"  # name of the page over the tolerance
UPDATE = "intermediate update"
UPDATE_NOTE = (
    "With intermediate update of FMI 3.0, the FMU asks for the inputs at four times of a step and "
    "uses the cubic through them. The error then falls with the fourth power of the step, without "
    "input derivatives, and is smaller than with three of them."
)


def _by(items: Iterable[Any], key: Callable[[Any], Any]) -> dict[Any, list[Any]]:
    groups: dict[Any, list[Any]] = {}
    for item in items:
        groups.setdefault(key(item), []).append(item)
    return groups


class ReportWriter:
    """Writes pages of scenarios, of users' own files and of studies into a folder."""

    def __init__(
        self, folder: Path, options: str = "", others: Others = MappingProxyType({})
    ) -> None:
        """`options`: the command's, for its pages; `others`: results to draw over the runs."""
        self.folder, self.options, self._others = folder, options, others
        self.files: dict[str, Path] = {}  # pages of users' own files that were written, by name
        self.entries: list[Entry] = []  # of scenarios and files

    def begin(self) -> None:
        """Write what all pages share: fails now, not after all runs, if there is no room."""
        pages.write_assets(self.folder)

    def forget(self, names: Collection[str] | None, studies: bool) -> None:
        """Remove what an earlier run found of all scenarios, or of some, and of their studies."""
        overview.forget(self.folder, SCENARIOS, names)
        if studies:
            overview.forget(self.folder, STUDIES, None if names is None else [ACCURACY])

    @staticmethod
    def grouped(runs: Sequence[Run]) -> dict[Path, list[Run]]:
        """Return runs by scenario."""
        return _by(runs, lambda run: run.scenario.path)

    def write(
        self,
        groups: Mapping[Path, Sequence[Run]],
        sweeps: Sequence[Sweep] = (),
        studies: Sequence[Convergence] = (),
        progress: Callable[[int], object] = lambda _: None,
        failures: Sequence[Failure] = (),
    ) -> Path:
        """Write all pages; return the one to open: a single file's, or the overview."""
        failed = _by(failures, lambda failure: failure.scenario.path)
        scenarios: list[Entry] = []
        files: list[Entry] = []
        for path in dict.fromkeys((*groups, *failed)):
            group, others = groups.get(path, ()), failed.get(path, ())
            scenario = (group or others)[0].scenario
            ours = group[0].compared if group else project.is_ours(path)
            section, entries = (SCENARIOS, scenarios) if ours else (FILES, files)
            shown = scenario.name if ours else f"'{from_here(path)}'"
            again = f"{project.PROGRAM} {shown}{self.options}"
            folder = self.folder / section
            name = scenario.name if ours else self._free_name(path)
            if group:
                over = self._others.get((section, scenario.name))
                entry = scenario_page.write(folder, name, group, again, others, over)
            else:
                entry = scenario_page.write_failed(folder, name, others[0], again)
            entries.append(entry if ours else replace(entry, source=str(path)))
            if not ours:
                self.files[name] = folder / entry.page
            progress(1)
        whole = f"{project.PROGRAM} run{self.options}"
        swept = dict.fromkeys(sweep.scenario.name for sweep in sweeps)
        some = whole if studies else " ".join((whole, *swept))
        self.entries = [*scenarios, *files]
        written = [write_sweeps(self.folder / STUDIES, sweeps, some)] if sweeps else []
        written += [write_convergence(self.folder / STUDIES, x, whole) for x in studies]
        index = self.folder / pages.INDEX
        for section, entries in ((SCENARIOS, scenarios), (STUDIES, written), (FILES, files)):
            if entries:
                overview.record(self.folder, section, entries)
        return index if scenarios or len(files) != 1 else self.folder / FILES / files[0].page

    def _free_name(self, file: Path) -> str:
        """Name of the page of a user's file, unless that is the page of a file elsewhere."""
        sources = {entry.name: entry.source for entry in overview.read(self.folder, FILES)}
        names = chain([file.stem], (f"{file.stem} ({i})" for i in count(2)))
        return next(name for name in names if sources.get(name) in (None, str(file)))


def write_sweeps(folder: Path, sweeps: Sequence[Sweep], again: str) -> Entry:
    """Write the page of errors over the tolerance; its line in the overview."""
    x = np.array(sweeps[0].tolerances)
    models = _by(sweeps, lambda sweep: sweep.scenario.model)
    factor = comparison.ERROR_PER_TOLERANCE
    limit = Curve(f"{factor:g} × tolerance", factor * x, limit=True)
    plots = [
        Plot(
            f"largest error, scenarios of {model}",
            "",
            [*(Curve(sweep.scenario.name, np.asarray(sweep.errors)) for sweep in own), limit],
            log=True,
        )
        for model, own in models.items()
    ]
    rows = [
        [sweep.scenario.name, *(short(error, 1) for error in sweep.errors), verdict(sweep.passed)]
        for sweep in sweeps
    ]
    passed = all(sweep.passed for sweep in sweeps)
    data = RunData(ACCURACY, "", x, plots, Axis("relative tolerance", "", log=True, reversed=True))
    page = RunPage(
        title="Error against tolerance",
        description="Each scenario at eight tolerances: the largest relative error of all outputs.",
        status=PASSED if passed else FAILED,
        facts=[("scenarios", str(len(sweeps)))],
        data=data,
        tables=[PageTable("Errors", ["scenario", *map(short, x), "result"], rows)],
        failures=[f"{s.scenario.name}: {text}" for s in sweeps for text in s.violations],
        again=again,
    )
    worst = max(sweeps, key=lambda sweep: np.nan_to_num(sweep.errors[-1], nan=np.inf))
    return _write_study(folder, page, worst.errors[-1], f"at {short(x[-1])}, {worst.scenario.name}")


def write_convergence(folder: Path, study: Convergence, again: str) -> Entry:
    """Write the page of errors over the communication step; its line in the overview."""
    scenario, steps = study.scenario, np.asarray(study.problem.steps, float)
    model = project.model_folder(scenario.path).name
    curves = [Curve(row.name, np.asarray(row.errors)) for row in study.rows]
    plot = Plot("error of the final state", "", curves, log=True)
    axis = Axis("communication step", "ms", log=True)
    rows = [
        [row.name, *(short(e, 1) for e in row.errors), f"{row.slope:.2f}", verdict(row.holds)]
        for row in study.rows
    ]
    head = ["known of the inputs", *map(duration, steps), "slope", "result"]
    updated = any(row.name == UPDATE for row in study.rows)
    page = RunPage(
        title="Error against communication step",
        description=f"{scenario.title}: {scenario.description}",
        status=PASSED if study.passed else FAILED,
        facts=[("model", model), ("tolerance", short(scenario.tolerance))],
        data=RunData(scenario.name, "", 1e3 * steps, [plot], axis),
        tables=[PageTable("Errors", head, rows)],
        notes=[UPDATE_NOTE] if updated else [],
        failures=study.violations,
        again=again,
    )
    worst = max(study.rows, key=lambda row: row.errors[-1])
    where = f"at {duration(steps[-1])}, {worst.name}"
    return _write_study(folder, page, worst.errors[-1], where)


def _write_study(folder: Path, page: RunPage, error: float, detail: str) -> Entry:
    x, errors = page.data.x, page.data.plots[0].curves[0].values
    with np.errstate(divide="ignore"):
        line = sparkline(-np.log10(x), np.log10(errors))
    axis = f"{short(x[0])} to {short(x[-1])} {page.data.axis.unit}".strip()
    return overview.write_page(  # without error and bound, which cannot be compared
        folder,
        page.data.name,
        page,
        "Errors over all scenarios",
        title=f"{page.title}: {short(error, 1)} {detail}",
        detail=detail,
        line=line,
        line_scale=f"{short(errors[0])} to {short(errors[-1])}, {page.data.axis.title} {axis}",
    )
