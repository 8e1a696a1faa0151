"""What the command `run` puts into a report."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from itertools import chain, count
from pathlib import Path

from rparm import project
from rparm.files import from_here
from rparm.report import assets, overview, scenario_page, studies_page
from rparm.report.overview import FILES, SCENARIOS, STUDIES
from rparm.runs.comparison import Failure, Run, Sweep
from rparm.runs.convergence import Convergence


class ReportWriter:
    """Writes pages of scenarios, of users' own files and of studies into a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.files: dict[str, Path] = {}  # pages of users' own files that were written, by name

    def begin(self) -> None:
        """Write what all pages share: fails now, not after all runs, if there is no room."""
        assets.write(self.folder)

    def forget(self, names: Collection[str] | None = None) -> None:
        """Take what an earlier run found of all scenarios, or of some, out of the overview."""
        overview.forget(self.folder, SCENARIOS, names)
        overview.forget(self.folder, STUDIES, None if names is None else [studies_page.ACCURACY])

    @staticmethod
    def grouped(runs: Sequence[Run]) -> dict[Path, list[Run]]:
        """Runs by scenario."""
        groups: dict[Path, list[Run]] = {}
        for run in runs:
            groups.setdefault(run.scenario.path, []).append(run)
        return groups

    def write(
        self,
        groups: Mapping[Path, Sequence[Run]],
        sweeps: Sequence[Sweep] = (),
        studies: Sequence[Convergence] = (),
        progress: Callable[[int], object] = lambda _: None,
        failures: Sequence[Failure] = (),
    ) -> Path:
        """Write all pages; return the one to open: that of a single file, or the overview.

        Of the runs of each scenario, the first one is drawn. `progress` is called with 1 after
        each.
        """
        failed: dict[Path, list[Failure]] = {}
        for failure in failures:
            failed.setdefault(failure.scenario.path, []).append(failure)
        scenarios: list[overview.Entry] = []
        files: list[overview.Entry] = []
        for path in dict.fromkeys((*groups, *failed)):
            group, others = groups.get(path, ()), failed.get(path, ())
            scenario = (group or others)[0].scenario
            ours = group[0].compared if group else project.is_ours(path)
            section, entries = (SCENARIOS, scenarios) if ours else (FILES, files)
            shown = scenario.name if ours else f"'{from_here(path)}'"
            again = f"{project.PROGRAM} {shown}"
            folder = self.folder / section
            name = scenario.name if ours else self._free_name(path)
            if group:
                entry = scenario_page.write(folder, name, group, again, others)
            else:
                entry = scenario_page.write_failed(folder, name, others[0], again)
            entries.append(entry if ours else replace(entry, source=str(path)))
            if not ours:
                self.files[name] = folder / entry.page
            progress(1)
        written = [studies_page.write_sweeps(self.folder / STUDIES, sweeps)] if sweeps else []
        written += [studies_page.write_convergence(self.folder / STUDIES, x) for x in studies]
        index = self._record(scenarios, files, written)
        return index if scenarios or len(files) != 1 else self.folder / FILES / files[0].page

    def _free_name(self, file: Path) -> str:
        """Name of the page of a user's file, unless that is the page of a file elsewhere."""
        sources = {entry.name: entry.source for entry in overview.read(self.folder, FILES)}
        names = chain([file.stem], (f"{file.stem} ({i})" for i in count(2)))
        return next(name for name in names if sources.get(name) in (None, str(file)))

    def _record(
        self,
        scenarios: Sequence[overview.Entry],
        files: Sequence[overview.Entry],
        studies: Sequence[overview.Entry],
    ) -> Path:
        """Put the entries into the overview; files of earlier runs stay there."""
        index = self.folder / "index.html"
        if scenarios or not files:
            index = overview.record(self.folder, SCENARIOS, scenarios)
            index = overview.record(self.folder, STUDIES, studies)
        if files:
            index = overview.record(self.folder, FILES, files)
        return index
