"""The page of a campaign: distributions, scatter, Sobol' indices, maps, worst cases, failures."""

import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from SALib.analyze import sobol
from scipy.stats import rankdata

from rparm import project, texts
from rparm.campaign.campaign_file import Campaign
from rparm.campaign.job import LYAPUNOV, Job
from rparm.campaign.planning import FAILURE, RUN, sampling_problem
from rparm.campaign.results import MANIFEST, Results
from rparm.report import charts, pages
from rparm.report.charts import Chart
from rparm.units import prefixed

QUANTILES = (0.0, 0.05, 0.5, 0.95, 1.0)
WORST = 10  # runs that are listed
RESAMPLES = 1000  # of the bootstrap
CONFIDENCE = 0.95
NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\.?\d[\d.]*(?:[eE][-+]?\d+)?|(?:inf|nan)\b)")
PAGE = "campaign.html"
MOST = 10**7  # runs, whose table is held in memory
DRAWN = 24  # columns in charts at most
POINTS = 1500  # runs in a scatter plot at most, besides the extreme ones
RANKED = 100_000  # runs for rank correlations at most
MOST_CELLS = 200  # of a map, in each direction
LISTED = 10  # reasons of failed runs at most
WIDE = 0.5  # half a confidence interval of an index that says little
NOTHING = "–"
NO_VALUE = {
    "settling": "does not settle",
    LYAPUNOV: "has no value, as a discrete output changes (an impact, friction that holds),",
}
BINS = 40
FLAT = 1e-12  # relative: a smaller variation is rounding


# ---- Statistics of the table ---------------------------------------------------------------------
@dataclass(frozen=True)
class Failure:
    """Runs that have failed for the same reason, whatever numbers it has."""

    reason: str  # of the first one
    count: int
    run: int  # the first one


@dataclass(frozen=True)
class Index:
    """Sobol' indices of a parameter, with half the width of their confidence intervals."""

    parameter: str
    first: float
    first_confidence: float
    total: float
    total_confidence: float


def is_wide(index: Index) -> bool:
    return max(index.first_confidence, index.total_confidence) > WIDE


def quantiles(values: np.ndarray) -> list[float]:
    """Return the quantiles of the numbers in `values`, (runs,); NaN if there are none."""
    numbers = values[np.isfinite(values)]
    return np.quantile(numbers, QUANTILES).tolist() if len(numbers) else [np.nan] * len(QUANTILES)


def worst(values: np.ndarray) -> list[int]:
    """Return the numbers of the runs with the largest of `values`, (runs,), the largest first."""
    numbers = np.flatnonzero(np.isfinite(values))
    order = np.argsort(-values[numbers], kind="stable")
    return numbers[order[:WORST]].tolist()


def failures(reasons: Iterable[str]) -> list[Failure]:
    """Count the reasons of failed runs, the most frequent first."""
    counts: Counter[str] = Counter()
    firsts: dict[str, tuple[str, int]] = {}
    for run, reason in enumerate(reasons):
        if reason:
            kind = NUMBER.sub("0", reason)
            counts[kind] += 1
            firsts.setdefault(kind, (reason, run))
    ordered = ((firsts[kind], count) for kind, count in counts.most_common())
    return [Failure(reason, count, run) for (reason, run), count in ordered]


def varies(values: np.ndarray) -> bool:
    """Say whether numbers, (runs,), differ by more than rounding, and not beyond all doubles."""
    numbers = values[np.isfinite(values)]
    with np.errstate(over="ignore"):
        width = np.ptp(numbers) if len(numbers) else 0.0
    return bool(np.isfinite(width) and width > FLAT * np.abs(numbers).max(initial=0.0))


def rank_correlation(one: np.ndarray, other: np.ndarray) -> float:
    """Return Spearman's correlation of runs that have both values; NaN if one does not vary."""
    there = np.isfinite(one) & np.isfinite(other)
    if not (varies(one[there]) and varies(other[there])):
        return math.nan
    return float(np.corrcoef(rankdata(one[there]), rankdata(other[there]))[0, 1])


def bars(values: np.ndarray) -> str:
    """Return a histogram of numbers, (runs,), as the path of an SVG, 1 wide and 10 high."""
    if not varies(values):
        return ""
    numbers = values[np.isfinite(values)]
    low, high = numbers.min(), numbers.max()
    different = len(np.unique(numbers))  # of a grid: its points must not share bins unevenly
    count = different if different < 2 * BINS else BINS
    places = np.minimum(((numbers - low) / (high - low) * count).astype(int), count - 1)
    counts = np.bincount(places, minlength=count)
    heights = 10 - 10 * counts / counts.max()
    return "M0 10" + "".join(f"V{height:.3g}h{1 / count:.5g}" for height in heights) + "V10z"


def saltelli_groups(campaign: Campaign, values: np.ndarray) -> np.ndarray:
    """Return rows of runs (groups, parameters + 2) that belong together, all complete."""
    rows = values.reshape(-1, len(campaign.parameters) + 2)
    return rows[np.isfinite(rows).all(axis=1)]


def sobol_indices(campaign: Campaign, values: np.ndarray) -> list[Index]:
    """Estimate first-order and total Sobol' indices of `values`, (runs,), if runs suffice."""
    rows = saltelli_groups(campaign, values)
    if len(rows) < 2 or np.ptp(rows) == 0:
        return []
    options = {"num_resamples": RESAMPLES, "conf_level": CONFIDENCE, "seed": campaign.seed}
    found: Mapping[str, np.ndarray] = sobol.analyze(
        sampling_problem(campaign), rows.ravel(), calc_second_order=False, **options
    )
    rows = np.column_stack([found[key] for key in ("S1", "S1_conf", "ST", "ST_conf")])
    return [Index(name, *row) for name, row in zip(campaign.parameters, rows.tolist(), strict=True)]


# ---- The page ------------------------------------------------------------------------------------
class Page:
    """Written into the folder of the results; `command` makes it again."""

    def __init__(
        self, campaign: Campaign, job: Job, results: Results, units: Mapping[str, str], command: str
    ) -> None:
        self.campaign, self.job, self.folder, self.again = campaign, job, results.folder, command
        self.report = project.results_folder(self.folder)
        self.table, units = results.table([*results.columns, FAILURE]), dict(units)
        for name in (measure.column for measure in job.measures):
            values = self.table[name]
            largest = np.abs(values[np.isfinite(values)]).max(initial=0.0)
            units[name], factor = prefixed(units.get(name, ""), largest)
            self.table[name] = factor * values
        self.kept = {measure.column: self.table[measure.column] for measure in job.measures}
        self.labels = {name: f"{name} [{unit}]" if unit else name for name, unit in units.items()}
        self.drawn = dict(list(self.kept.items())[:DRAWN])
        self.order = np.random.default_rng(campaign.seed).permutation(campaign.count)
        self.failures = failures(self.table[FAILURE].tolist())
        self.failed = sum(failure.count for failure in self.failures)

    def write(self, digest: str) -> Path:
        """Write the page, on a table with this digest; its path."""
        manifest = json.loads((self.folder / MANIFEST).read_text(encoding="utf-8"))
        found = self.indices()
        pages.write_assets(self.report)
        return pages.write_page(
            self.folder / PAGE,
            "campaign.html",
            root=pages.root(self.report, self.folder),
            home=True,
            title=self.campaign.title,
            campaign=self.campaign,
            digest=digest,
            again=self.again,
            manifest=manifest,
            steps=self.job.steps,
            failed=self.failed,
            failures=self.failures_table(),
            results=self.kept,
            inputs={name: self.table[name] for name in self.campaign.parameters},
            labels=self.labels,
            bars_of=bars,
            quantiles=quantiles,
            lacking=lambda values: int((~np.isfinite(values)).sum()),
            measures=self.job.measures,
            no_value=NO_VALUE,
            scatter=charts.script(self.scatter(found)),
            drawn=len(self.sample),
            note=self.note,
            indices=found,
            groups={x: len(saltelli_groups(self.campaign, self.kept[x])) for x in found},
            bars=[
                indices_chart(self.labels[name], found[name], i == 0)
                for i, name in enumerate(x for x in self.drawn if x in found)
            ],
            wide=[name for name, rows in found.items() if any(map(is_wide, rows))],
            worst=[self.worst(name) for name in self.campaign.worst],
            maps=[self.map(i) for i in range(len(self.campaign.maps))],
        )

    def command(self, run: int) -> texts.Command:
        return texts.Command(f"{self.again} --replay {run}")

    @property
    def note(self) -> str:
        """Say what charts leave out."""
        left = [*self.kept][DRAWN:]
        return f"Charts leave out {left[0]} and what is below it in the table." if left else ""

    # ---- Distributions and scatter ---------------------------------------------------------------

    @property
    def sample(self) -> np.ndarray:
        """Numbers of the runs in scatter plots: some at random, and those with extreme results."""
        there = [x for x in self.drawn.values() if np.isfinite(x).any()]
        ends = [f(np.where(np.isfinite(x), x, s * np.inf)) for x in there
                for f, s in ((np.argmin, 1), (np.argmax, -1))]  # fmt: skip
        listed = [run for name in self.campaign.worst for run in worst(self.table[name])]
        return np.unique([*self.order[:POINTS], *ends, *listed]).astype(int)

    def scatter(self, found: Mapping[str, list[Index]]) -> dict[str, Any]:
        """Return what `assets/campaign.js` draws: values of runs, and what orders the plots."""
        runs, parameters, some = self.sample, self.campaign.parameters, self.order[:RANKED]
        columns = {name: self.table[name] for name in (*parameters, *self.drawn)}
        ranked = {name: values[some] for name, values in columns.items()}
        return {
            "again": f"{self.again} --replay ",
            "count": self.campaign.count,
            "runs": runs,
            "values": {name: values[runs] for name, values in columns.items()},
            "labels": {name: self.labels.get(name, name) for name in columns},
            "parameters": [*parameters],
            "first": next((x for x in self.campaign.worst if x in self.drawn), ""),
            "results": {
                name: {
                    "ranks": [rank_correlation(ranked[x], ranked[name]) for x in parameters],
                    "totals": [x.total for x in found.get(name, [])],
                }
                for name in self.drawn
            },
        }

    # ---- Sobol' indices --------------------------------------------------------------------------

    def indices(self) -> dict[str, list[Index]]:
        if self.campaign.sampling != "indices":
            return {}
        found = {name: sobol_indices(self.campaign, x) for name, x in self.kept.items()}
        return {name: rows for name, rows in found.items() if rows}

    # ---- Runs ------------------------------------------------------------------------------------

    def worst(self, column: str) -> pages.PageTable:
        names = [column, *self.campaign.parameters]
        head = [RUN, *(self.labels[name] for name in names), "run it again"]
        rows = [
            [run, *(_rounded(self.table[name][run]) for name in names), self.command(run)]
            for run in worst(self.table[column])
        ]
        return pages.PageTable(f"Runs with the largest {column}", head, rows)

    def failures_table(self) -> pages.PageTable:
        head = ["runs", "the first", "its reason", "run it again"]
        shown, left = self.failures[:LISTED], self.failures[LISTED:]
        rows = [[x.count, x.run, x.reason, self.command(x.run)] for x in shown]
        note = "Runs whose reasons differ only in numbers share a line."
        if left:
            count = sum(failure.count for failure in left)
            note += f" {count} runs with {len(left)} other reasons are not shown."
        return pages.PageTable("Failed runs", head, rows, note)

    def map(self, number: int) -> tuple[object, Chart | None, str, int]:
        """Draw a map as its file says; return it, a chart, a note, and the number of runs in it."""
        drawn = self.campaign.maps[number]
        names = (drawn.x, drawn.y, drawn.colour)
        columns = [self.table[name] for name in names]
        there = np.isfinite(columns).all(axis=0)
        if not there.any():
            return drawn, None, "", 0
        labels = [self.labels[name] for name in names]
        chart, shown = map_chart(labels, *columns, some=self.order)
        note = "" if shown == there.sum() else f"{shown} of {there.sum()} runs are drawn."
        return drawn, chart, note, int(there.sum())


def _rounded(value: float) -> float | str:
    return float(f"{value:.6g}") if np.isfinite(value) else NOTHING


# ---- Charts -------------------------------------------------------------------------------------
def indices_chart(label: str, rows: Sequence[Index], legend: bool = True) -> Chart:
    """Draw Sobol' indices of a column as bars, with their confidence intervals."""
    text = f"Sobol' indices of {label}, as in the table"
    data = {"rows": [vars(row) for row in rows], "legend": legend}
    return Chart(label, text, "indices", data, height=7 + 3 * len(rows))


def map_chart(
    labels: Sequence[str], x: np.ndarray, y: np.ndarray, colour: np.ndarray, some: np.ndarray
) -> tuple[Chart, int]:
    """Draw columns (runs,): cells where x and y form a grid, else points of the first of `some`.

    Returns also how many runs with a value are drawn: of a large grid, every k-th each way.
    """
    xs, ys = np.unique(x), np.unique(y)
    is_grid = min(len(xs), len(ys)) > 1 and np.isfinite([*xs, *ys]).all()
    if is_grid and len(xs) * len(ys) == len(x) == len(set(zip(x, y, strict=True))):
        runs = np.empty((len(ys), len(xs)), int)
        runs[np.searchsorted(ys, y), np.searchsorted(xs, x)] = np.arange(len(x))
        every = -(-len(ys) // MOST_CELLS), -(-len(xs) // MOST_CELLS)
        runs, x, y = runs[:: every[0], :: every[1]], xs[:: every[1]], ys[:: every[0]]
    else:
        runs = some[np.isfinite([x, y, colour]).all(axis=0)[some]][: MOST_CELLS**2 // 8]
        x, y = x[runs], y[runs]
    data = {"runs": runs, "x": x, "y": y, "z": colour[runs], "labels": labels}
    text = f"Map of {labels[2]} over {labels[0]} and {labels[1]}"
    count = int(np.isfinite(colour[runs]).sum())
    return Chart(labels[2], text, "map", data, height=34), count
