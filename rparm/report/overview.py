"""The overview of a report: what ran, section by section, whichever command ran it.

Each section has a folder in the report, and in it the file `ENTRIES`, which the overview is made
from: so scenarios, systems and files of users show up together though different commands run them.
"""

import json
from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from rparm.files import write_text
from rparm.report import assets, pages
from rparm.report.pages import RunPage
from rparm.report.sparkline import HEIGHT, WIDTH, scale_of
from rparm.report.sparkline import path as sparkline

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
    line_text: str = ""  # what it shows
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
        fields |= {"line": sparkline(x, curve.values), "line_text": plot.text}
        fields |= {"line_of": curve.name, "line_scale": scale_of(x, plot, page.data.axis.unit)}
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
    """Entries of a section; those of a file that nobody can read do not count."""
    with suppress(OSError, ValueError, TypeError, RecursionError):
        content = json.loads((report / section / ENTRIES).read_text(encoding="utf-8"))
        return [Entry(**item) for item in content]
    return []


def write(report: Path) -> Path:
    """Write the overview, and what its pages load."""
    assets.write(report)
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
    return pages.write_page(
        report / pages.INDEX,
        "overview.html",
        root="",
        sections=sections,
        failed=statuses.count(FAILED),
        count=len(statuses),
        width=WIDTH,
        height=HEIGHT,
    )


def _summary(entries: Sequence[Entry]) -> dict[str, object]:
    """How many of a section passed, and which is worst."""
    compared = [entry for entry in entries if entry.status != RAN]
    known = [entry for entry in compared if entry.error is not None]
    return {
        "count": len(entries),
        "compared": len(compared),
        "passed": sum(entry.status == PASSED for entry in compared),
        "worst": max(known, key=lambda entry: entry.error, default=None),
    }
