"""The page of a campaign: distributions, worst cases, Sobol' indices, maps, failures."""

import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from SALib.analyze import sobol

from rparm import project
from rparm.campaign.campaign_file import Campaign
from rparm.campaign.job import LYAPUNOV, Job
from rparm.campaign.planning import FAILURE, RUN, sampling_problem
from rparm.campaign.results import MANIFEST, Results
from rparm.report import pages
from rparm.units import minus

QUANTILES = (0.0, 0.05, 0.5, 0.95, 1.0)
WORST = 10  # runs that are listed
RESAMPLES = 1000  # of the bootstrap
CONFIDENCE = 0.95
NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\.?\d[\d.]*(?:[eE][-+]?\d+)?|(?:inf|nan)\b)")
PAGE = "campaign.html"
MOST = 10**7  # runs, whose table is held in memory
DRAWN = 24  # columns in a picture at most
LISTED = 10  # reasons of failed runs at most
WIDE = 0.5  # half a confidence interval of an index that says little
NOTHING = "–"
NO_VALUE = {
    "settling": "does not settle",
    LYAPUNOV: "has no value, as a discrete output changes (an impact, friction that holds),",
}
BINS = 50
COLUMNS = 3
LONGEST_LINE = 40  # characters of a label below a column
FEWEST = 6  # of these, below many bars
COLOURS = "viridis"  # in order of brightness, also for the colour-blind
NARROW = 1e-3  # of a value: a smaller variation is drawn as a difference, to be written short
# names come from a user's file: no mathematics
TEXTS = pages.STYLE | {"text.parse_math": False}


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
        self.table = results.table([*results.columns, FAILURE])
        self.kept = {measure.column: self.table[measure.column] for measure in job.measures}
        self.labels = {name: f"{name} [{unit}]" if unit else name for name, unit in units.items()}
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
            distributions=self.distributions(),
            missing=self.missing(),
            indices=self.indices_table(found),
            doubts=self.doubts(found),
            worst=[self.worst(name) for name in self.campaign.worst],
            maps=[self.map(i) for i in range(len(self.campaign.maps))],
        )

    def command(self, run: int) -> pages.Command:
        return pages.Command(f"{self.again} --replay {run}")

    def drawn(self, columns: Iterable[str]) -> tuple[list[str], str]:
        """Return the columns that fit into a picture, and a note on the others."""
        columns = list(columns)
        left = columns[DRAWN:]
        rest = "and what is below it in the table."
        return columns[:DRAWN], f"The picture leaves out {left[0]} {rest}" if left else ""

    # ---- Distributions ---------------------------------------------------------------------------

    def distributions(self) -> pages.Table | None:
        """Return table and picture; None if no run has a value."""
        there = [name for name, values in self.kept.items() if np.isfinite(values).any()]
        if not there:
            return None
        drawn, note = self.drawn(there)
        picture = distributions_figure({self.labels[name]: self.kept[name] for name in drawn})
        pages.save_figure(picture, self.folder / "distributions.png")
        head = ["kept", "smallest", "5 %", "median", "95 %", "largest", "runs without a value"]
        rows = [
            [self.labels[name], *map(_rounded, quantiles(values)), _lacking(values)]
            for name, values in self.kept.items()
        ]
        return pages.Table("Distributions", head, rows, note)

    def missing(self) -> list[str]:
        """Say which columns have no value in runs that did not fail."""
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
        found = {name: sobol_indices(self.campaign, x) for name, x in self.kept.items()}
        return {name: rows for name, rows in found.items() if rows}

    def indices_table(self, found: Mapping[str, list[Index]]) -> pages.Table | None:
        """Return table and picture; None if there are none."""
        if not found:
            return None
        drawn, note = self.drawn(found)
        picture = indices_figure({self.labels[name]: found[name] for name in drawn})
        pages.save_figure(picture, self.folder / "indices.png")
        head = ["kept", "parameter", "first order", "±", "total", "±", "groups of runs"]
        rows = []
        for name, indices in found.items():
            groups = len(saltelli_groups(self.campaign, self.kept[name]))
            for x in indices:
                numbers = (x.first, x.first_confidence, x.total, x.total_confidence)
                rows.append([name, x.parameter, *(f"{number:.3f}" for number in numbers), groups])
        return pages.Table("Sobol' indices", head, rows, note)

    def doubts(self, found: Mapping[str, list[Index]]) -> list[str]:
        """Warn about indices that say little."""
        if self.campaign.sampling != "indices":
            return []
        texts = []
        groups = {name: len(saltelli_groups(self.campaign, self.kept[name])) for name in found}
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

    def worst(self, column: str) -> pages.Table:
        names = [column, *self.campaign.parameters]
        head = [RUN, *(self.labels[name] for name in names), "run it again"]
        rows = [
            [run, *(_rounded(self.table[name][run]) for name in names), self.command(run)]
            for run in worst(self.table[column])
        ]
        return pages.Table(f"Largest {column}", head, rows)

    def failures_table(self) -> pages.Table:
        head = ["runs", "the first", "its reason", "run it again"]
        shown, left = self.failures[:LISTED], self.failures[LISTED:]
        rows = [[x.count, x.run, x.reason, self.command(x.run)] for x in shown]
        note = "Runs whose reasons differ only in numbers share a line."
        if left:
            count = sum(failure.count for failure in left)
            note += f" {count} runs with {len(left)} other reasons are not shown."
        return pages.Table("Failed runs", head, rows, note)

    def map(self, number: int) -> tuple[object, list[str], int]:
        """Draw a map as its file says; return it, its labels, and the number of runs in it."""
        drawn = self.campaign.maps[number]
        names = (drawn.colour, drawn.x, drawn.y)
        columns = [self.table[name] for name in (drawn.x, drawn.y, drawn.colour)]
        there = int(np.isfinite(columns).all(axis=0).sum())
        if there:
            labels = [self.labels[name] for name in (drawn.x, drawn.y, drawn.colour)]
            pages.save_figure(heat_map_figure(labels, *columns), self.folder / f"map_{number}.png")
        return drawn, [self.labels[name] for name in names], there


def _rounded(value: float) -> float | str:
    return float(f"{value:.6g}") if np.isfinite(value) else NOTHING


def _lacking(values: np.ndarray) -> int:
    return int((~np.isfinite(values)).sum())


# ---- Pictures ------------------------------------------------------------------------------------
def distributions_figure(table: Mapping[str, np.ndarray]) -> Figure:
    """Draw histograms of columns, (runs,) each, by their labels."""
    rows = math.ceil(len(table) / COLUMNS)
    with mpl.rc_context(TEXTS):
        figure = Figure(figsize=(11, 2.6 * rows), layout="constrained")
        axes = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
        for one, (label, values) in zip(axes, table.items(), strict=False):
            _histogram(one, values[np.isfinite(values)], label)
        for one in axes[len(table) :]:
            one.set_visible(False)
        return figure


def _histogram(axes: Axes, values: np.ndarray, label: str) -> None:
    """Draw a histogram, or write a text if the numbers do not vary, or too much to be drawn."""
    smallest, largest = float(values.min()), float(values.max())
    if 0 < largest - smallest < math.inf:
        values, label = _centred(values, label)
        axes.hist(values, bins=BINS, color=pages.RUN_COLOR)
        axes.xaxis.set_major_locator(MaxNLocator(4))
        axes.xaxis.set_major_formatter(_tick)
        axes.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    else:
        ends = f"from {smallest:g} to {largest:g}" if smallest < largest else f"{smallest:g}"
        axes.text(0.5, 0.5, f"all runs: {ends}", transform=axes.transAxes, ha="center")
        axes.set_xticks([])
        axes.set_yticks([])
    axes.set_xlabel(fill(label, LONGEST_LINE))
    axes.set_ylabel("runs")


def _centred(values: np.ndarray, label: str) -> tuple[np.ndarray, str]:
    """Return the label and values; rounded differences from one value if they vary little."""
    there = values[np.isfinite(values)]
    middle = float(np.median(there))
    spread = float(np.max(there) - np.min(there))
    if not 0 < spread < NARROW * abs(middle):
        return values, label
    texts = (f"{middle:.{digits}g}" for digits in range(1, 18))
    text = next(text for text in texts if abs(float(text) - middle) <= spread)
    sign = "+" if text.startswith("-") else "\N{MINUS SIGN}"
    return values - float(text), f"{label} {sign} {minus(text.lstrip('-'))}"


def _tick(value: float, _: int) -> str:
    """Write a number with its exponent, for which there is no room at the end of a short axis."""
    return minus(f"{value:g}")


def indices_figure(found: Mapping[str, Sequence[Index]]) -> Figure:
    """Draw Sobol' indices of columns as bars, with their confidence intervals, by their labels."""
    with mpl.rc_context(TEXTS):
        figure = Figure(figsize=(11, 2.8 * len(found)), layout="constrained")
        axes = figure.subplots(len(found), 1, squeeze=False)[:, 0]
        for one, (label, rows) in zip(axes, found.items(), strict=True):
            middle = np.arange(len(rows))
            kinds = (
                ("first order", [x.first for x in rows], [x.first_confidence for x in rows]),
                ("total", [x.total for x in rows], [x.total_confidence for x in rows]),
            )
            for i, (kind, values, half) in enumerate(kinds):
                color = (pages.RUN_COLOR, pages.ERROR_COLORS[0])[i]
                style = {"color": color, "ecolor": pages.MUTED, "capsize": 4, "label": kind}
                one.bar(middle + 0.36 * (i - 0.5), values, 0.34, yerr=half, **style)
            width = max(COLUMNS * LONGEST_LINE // len(rows), FEWEST)
            one.set_xticks(middle, [fill(row.parameter, width) for row in rows])
            one.set_ylabel("Sobol' index")
            one.set_title(label, loc="left")
            one.legend()
        return figure


def heat_map_figure(
    labels: Sequence[str], x: np.ndarray, y: np.ndarray, colour: np.ndarray
) -> Figure:
    """Draw columns (runs,) of complete runs: cells where x and y form a grid, else points."""
    there = np.isfinite([x, y, colour]).all(axis=0)
    with mpl.rc_context(TEXTS):
        figure = Figure(figsize=(10, 7), layout="constrained")
        axes = figure.subplots()
        centred = (_centred(*column) for column in zip((x, y, colour), labels, strict=True))
        (x, y, colour), labels = zip(*centred, strict=True)
        xs, ys = np.unique(x), np.unique(y)
        is_grid = min(len(xs), len(ys)) > 1 and np.isfinite([*xs, *ys]).all()
        if is_grid and len(xs) * len(ys) == len(x) == len(set(zip(x, y, strict=True))):
            cells = np.full((len(ys), len(xs)), np.nan)
            cells[np.searchsorted(ys, y), np.searchsorted(xs, x)] = colour
            shown = axes.pcolormesh(xs, ys, cells, cmap=COLOURS, shading="nearest")
        else:
            shown = axes.scatter(x[there], y[there], c=colour[there], cmap=COLOURS, s=14)
        axes.grid(False)
        axes.set_xlabel(labels[0])
        axes.set_ylabel(labels[1])
        figure.colorbar(shown, ax=axes).set_label(labels[2])
        return figure
