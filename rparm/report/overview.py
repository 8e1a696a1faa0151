"""The overview of the report: a line for each page, with a sparkline of its error or motion."""

import json
from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from rparm.files import write_text
from rparm.report import pages
from rparm.report.pages import RunPage
from rparm.report.run_data import Plot

ENTRIES = "entries.json"
PASSED, FAILED, RAN = "passed", "FAILED", "ran"  # RAN: there was nothing to compare with
SCENARIOS, STUDIES, SYSTEM, FILES = "scenarios", "studies", "system", "files"
# folder -> title; in the order of the overview
SECTIONS = {
    FILES: "Your scenarios",
    SCENARIOS: "Scenarios",
    SYSTEM: "Variants of the systems",
    STUDIES: "Studies",
}
WIDTH, HEIGHT, MARGIN = 100.0, 24.0, 2.0  # of the view box
SPACE = "\N{NO-BREAK SPACE}"  # before a unit
THIN = 'vector-effect="non-scaling-stroke"'
COLUMNS = 60  # the curve's extremes in each are drawn


@dataclass(frozen=True)
class Entry:
    """A line of the overview."""

    name: str
    title: str
    group: str  # model or system, with its version of FMI
    page: str  # file name in the section's folder
    status: str  # PASSED, FAILED or RAN
    error: float | None = None  # the worst one; None if it is NaN or unknown
    bound: float | None = None
    detail: str = ""  # which output is worst, or why the run failed
    line: str = ""  # path of the sparkline
    line_text: str = ""  # its description
    line_of: str = ""  # the variable of the sparkline
    source: str = ""  # file of a user
    line_scale: str = ""  # its smallest and largest value, and how long it is


def write_page(folder: Path, name: str, page: RunPage, group: str, **more: object) -> Entry:
    """Write a page of a section; its entry, with `more` in place of what follows from the page."""
    folder.mkdir(parents=True, exist_ok=True)
    pages.write_run(folder / f"{name}.html", page)
    fields = {"name": name, "title": page.title, "group": group, "status": page.status}
    fields["page"] = f"{name}.html"
    if page.data is not None:
        plot, x = page.data.plots[0], page.data.x
        curve = plot.curves[0]
        scale = sparkline_scale(x, plot, page.data.axis.unit)
        fields |= {"line": sparkline(x, curve.values), "line_text": plot.text}
        fields |= {"line_of": curve.name, "line_scale": scale}
    return Entry(**fields | more)


def record(report: Path, section: str, entries: Sequence[Entry]) -> Path:
    """Put `entries` before the others of a section, and write the overview; return its path."""
    names = {entry.name for entry in entries}
    others = [entry for entry in read(report, section) if entry.name not in names]
    _keep(report, section, [*entries, *others])
    return write(report)


def _keep(report: Path, section: str, entries: Sequence[Entry]) -> None:
    text = json.dumps([asdict(entry) for entry in entries], ensure_ascii=False, indent=1)
    write_text(report / section / ENTRIES, text + "\n")


def forget(report: Path, section: str, names: Collection[str] | None = None) -> None:
    """Remove entries of a section, all or some; and the overview if nothing is left in it."""
    others = [] if names is None else [e for e in read(report, section) if e.name not in names]
    if others:
        _keep(report, section, others)
    else:
        (report / section / ENTRIES).unlink(missing_ok=True)
    if any(read(report, name) for name in SECTIONS):
        write(report)
    else:
        (report / pages.INDEX).unlink(missing_ok=True)


def read(report: Path, section: str) -> list[Entry]:
    """Read the entries of a section; a file that nobody can read has none."""
    with suppress(OSError, ValueError, TypeError, RecursionError):
        content = json.loads((report / section / ENTRIES).read_text(encoding="utf-8"))
        return [Entry(**item) for item in content]
    return []


def write(report: Path) -> Path:
    """Write the overview, and what its pages load."""
    pages.write_assets(report)
    sections = []
    for folder, title in SECTIONS.items():
        entries = read(report, folder)
        if entries:
            groups: dict[str, list[Entry]] = {}
            for entry in entries:
                groups.setdefault(entry.group, []).append(entry)
            section = {"folder": folder, "title": title, "summary": _summary(entries)}
            sections.append(section | {"groups": groups})
    statuses = [entry.status for folder in SECTIONS for entry in read(report, folder)]
    shown = {"root": "", "sections": sections, "width": WIDTH, "height": HEIGHT}
    shown |= {"failed": statuses.count(FAILED), "count": len(statuses)}
    return pages.write_page(report / pages.INDEX, "overview.html", **shown)


def _summary(entries: Sequence[Entry]) -> dict[str, object]:
    """Say how many of a section passed, and which is worst."""
    compared = [entry for entry in entries if entry.status != RAN]
    known = [entry for entry in compared if entry.error is not None]
    return {
        "count": len(entries),
        "compared": len(compared),
        "passed": sum(entry.status == PASSED for entry in compared),
        "worst": max(known, key=lambda entry: entry.error, default=None),
    }


def sparkline_scale(x: np.ndarray, plot: Plot, unit: str) -> str:
    """Say between which values the first curve of a plot runs, and how long `x` is (`unit`)."""
    values = plot.curves[0].values[np.isfinite(plot.curves[0].values)]
    if not len(values):
        return ""
    low, high = (f"{value:.3g}" for value in (values.min(), values.max()))
    between = low if low == high else f"{low} to {high}"
    parts = (f"{between} {plot.unit}".strip(), f"{x[-1] - x[0]:.3g} {unit}")
    return ", ".join(SPACE.join(part.rsplit(" ", 1)) for part in parts)


def sparkline(x: np.ndarray, y: np.ndarray) -> str:
    """Draw an SVG path of `WIDTH` by `HEIGHT` through points (rows,), if any, `x` ascending."""
    finite = np.isfinite(y)
    x, y = x[finite], y[finite]
    if not len(x):
        return ""
    column = np.zeros(len(x), int)
    length = x[-1] - x[0]
    if length > 0:
        column = np.minimum((x - x[0]) / length * COLUMNS, COLUMNS - 1).astype(int)
    rows = {0, len(x) - 1}
    for i in np.unique(column):
        members = np.flatnonzero(column == i)
        rows |= {int(members[np.argmin(y[members])]), int(members[np.argmax(y[members])])}
    kept = sorted(rows)
    across = (x[kept] - x[0]) / length if length > 0 else np.zeros(len(kept))
    height = np.ptp(y)
    up = (y[kept] - y.min()) / height if height > 0 else np.full(len(kept), 0.5)
    x, y = across * (WIDTH - 2 * MARGIN), up * (HEIGHT - 2 * MARGIN)
    points = zip(MARGIN + x, HEIGHT - MARGIN - y, strict=True)
    return "M" + "L".join(f"{a:.4g} {b:.4g}" for a, b in points)


def sparkline_svg(x: np.ndarray, y: np.ndarray) -> str:
    """Draw a sparkline as an element of any page."""
    line = f'<path d="{sparkline(x, y)}" fill="none" stroke="{pages.RUN_COLOR}" {THIN}/>'
    box = f'viewBox="0 0 {WIDTH:g} {HEIGHT:g}" preserveAspectRatio="none"'
    return f'<svg width="360" height="48" {box}>{line}</svg>'
