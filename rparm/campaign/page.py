"""The page of a campaign: distributions, worst cases, Sobol' indices, maps, failures."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from rparm.campaign import analysis, figures
from rparm.campaign.analysis import Index
from rparm.campaign.campaign_file import Campaign
from rparm.campaign.job import Job
from rparm.campaign.measures import LYAPUNOV
from rparm.campaign.planning import FAILURE, RUN
from rparm.campaign.results import MANIFEST, Results
from rparm.report import pages
from rparm.report.pages import INDEX, Command, Table, save_figure, write_page

MOST = 10**7  # runs, whose table is held in memory
DRAWN = 24  # columns in a picture at most
LISTED = 10  # reasons of failed runs at most
WIDE = 0.5  # half a confidence interval of an index that says little
NOTHING = "–"
NO_VALUE = {
    "settling": "does not settle",
    LYAPUNOV: "has no value, as a discrete output changes (an impact, friction that holds),",
}


class Page:
    """Written into the folder of the results; `command` makes it again."""

    def __init__(
        self,
        campaign: Campaign,
        job: Job,
        results: Results,
        units: Mapping[str, str],
        command: str,
    ) -> None:
        self.campaign, self.job, self.folder, self.again = campaign, job, results.folder, command
        self.table = results.table([*results.columns, FAILURE])
        self.kept = {measure.column: self.table[measure.column] for measure in job.measures}
        self.labels = {name: f"{name} [{unit}]" if unit else name for name, unit in units.items()}
        self.failures = analysis.failures(self.table[FAILURE].tolist())
        self.failed = sum(failure.count for failure in self.failures)

    def write(self, digest: str) -> Path:
        """Write the page, on a table with this digest; its path."""
        manifest = json.loads((self.folder / MANIFEST).read_text(encoding="utf-8"))
        found = self.indices()
        pages.write_assets(self.folder)
        return write_page(
            self.folder / INDEX,
            "campaign.html",
            root="",
            title=self.campaign.title,
            campaign=self.campaign,
            digest=digest,
            again=self.again,
            manifest=manifest,
            steps=self.job.steps,
            failed=self.failed,
            failures=self.failures_table(),
            distributions=self.distributions(),
            missing=self.missing(),
            indices=self.indices_table(found),
            doubts=self.doubts(found),
            worst=[self.worst(name) for name in self.campaign.worst],
            maps=[self.map(i) for i in range(len(self.campaign.maps))],
        )

    def command(self, run: int) -> Command:
        return Command(f"{self.again} --replay {run}")

    def drawn(self, columns: Iterable[str]) -> tuple[list[str], str]:
        """Columns that fit into a picture, and a note on the others."""
        columns = list(columns)
        left = columns[DRAWN:]
        text = (
            f"The picture leaves out {left[0]} and what is below it in the table." if left else ""
        )
        return columns[:DRAWN], text

    # ---- Distributions ---------------------------------------------------------------------------

    def distributions(self) -> Table | None:
        """Table and picture; None if no run has a value."""
        there = [name for name, values in self.kept.items() if np.isfinite(values).any()]
        if not there:
            return None
        drawn, note = self.drawn(there)
        picture = figures.distributions({self.labels[name]: self.kept[name] for name in drawn})
        save_figure(picture, self.folder / "distributions.png")
        head = ["kept", "smallest", "5 %", "median", "95 %", "largest", "runs without a value"]
        rows = [
            [self.labels[name], *map(_rounded, analysis.quantiles(values)), _lacking(values)]
            for name, values in self.kept.items()
        ]
        return Table("Distributions", head, rows, note)

    def missing(self) -> list[str]:
        """Which columns have no value in runs that did not fail."""
        texts = []
        for measure in self.job.measures:
            count = _lacking(self.kept[measure.column]) - self.failed
            what = NO_VALUE.get(measure.kind, "is no finite number")
            if count:
                texts.append(f"{measure.column} {what} in {count} of {self.campaign.count} runs.")
        return texts

    # ---- Sobol' indices --------------------------------------------------------------------------

    def indices(self) -> dict[str, list[Index]]:
        if self.campaign.sampling != "indices":
            return {}
        found = {name: analysis.indices(self.campaign, x) for name, x in self.kept.items()}
        return {name: rows for name, rows in found.items() if rows}

    def indices_table(self, found: Mapping[str, list[Index]]) -> Table | None:
        """Table and picture; None if there are none."""
        if not found:
            return None
        drawn, note = self.drawn(found)
        picture = figures.indices({self.labels[name]: found[name] for name in drawn})
        save_figure(picture, self.folder / "indices.png")
        head = ["kept", "parameter", "first order", "±", "total", "±", "groups of runs"]
        rows = [
            [
                name,
                row.parameter,
                *(f"{x:.3f}" for x in (row.first, row.first_confidence)),
                *(f"{x:.3f}" for x in (row.total, row.total_confidence)),
                len(analysis.groups(self.campaign, self.kept[name])),
            ]
            for name, rows in found.items()
            for row in rows
        ]
        return Table("Sobol' indices", head, rows, note)

    def doubts(self, found: Mapping[str, list[Index]]) -> list[str]:
        """Warnings about the indices."""
        if self.campaign.sampling != "indices":
            return []
        texts = []
        groups = {name: len(analysis.groups(self.campaign, self.kept[name])) for name in found}
        if any(count < self.campaign.runs for count in groups.values()):
            texts.append(
                f"There are {self.campaign.runs} groups of runs. One is left out where a run of it "
                "has no value: then the indices are not those of all that the file describes."
            )
        wide = [
            name
            for name, rows in found.items()
            if any(max(x.first_confidence, x.total_confidence) > WIDE for x in rows)
        ]
        if wide:
            texts.append(f"Too few runs: a ± is above {WIDE:g} for {', '.join(wide)}.")
        none = [name for name in self.kept if name not in found]
        if none:
            texts.append(f"No indices, as it does not vary or lacks values: {', '.join(none)}.")
        return texts

    # ---- Runs ------------------------------------------------------------------------------------

    def worst(self, column: str) -> Table:
        names = list(self.campaign.parameters)
        head = [RUN, *(self.labels[name] for name in (column, *names)), "run it again"]
        rows = [
            [
                run,
                *(_rounded(self.table[name][run]) for name in (column, *names)),
                self.command(run),
            ]
            for run in analysis.worst(self.table[column])
        ]
        return Table(f"Largest {column}", head, rows)

    def failures_table(self) -> Table:
        head = ["runs", "the first", "its reason", "run it again"]
        shown, left = self.failures[:LISTED], self.failures[LISTED:]
        rows = [[x.count, x.run, x.reason, self.command(x.run)] for x in shown]
        note = "Runs whose reasons differ only in numbers share a line."
        if left:
            count = sum(failure.count for failure in left)
            note += f" {count} runs with {len(left)} other reasons are not shown."
        return Table("Failed runs", head, rows, note)

    def map(self, number: int) -> tuple[object, list[str], int]:
        """A map as its file says, its labels, and the number of runs that are drawn."""
        drawn = self.campaign.maps[number]
        names = (drawn.colour, drawn.x, drawn.y)
        columns = [self.table[name] for name in (drawn.x, drawn.y, drawn.colour)]
        there = int(np.isfinite(columns).all(axis=0).sum())
        if there:
            labels = [self.labels[name] for name in (drawn.x, drawn.y, drawn.colour)]
            save_figure(figures.heat_map(labels, *columns), self.folder / f"map_{number}.png")
        return drawn, [self.labels[name] for name in names], there


def _rounded(value: float) -> float | str:
    return float(f"{value:.6g}") if np.isfinite(value) else NOTHING


def _lacking(values: np.ndarray) -> int:
    return int((~np.isfinite(values)).sum())
