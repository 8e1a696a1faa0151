"""The start page of a folder of results: a line for each page, from the entry beside it.

A command writes its page, then the entry PAGE.entry.json. The list is made of the entries that are
found in the folder and below, so that commands that run at the same time lose nothing.
"""

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, fields, replace
from datetime import datetime
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from rparm import project
from rparm.files import write_text
from rparm.report import pages
from rparm.report.pages import RunPage
from rparm.report.run_data import Plot
from rparm.units import number

ENTRY = ".entry.json"
DEEPEST = 4  # folders below that of the start page in which entries are looked for
PASSED, FAILED, RAN = "passed", "FAILED", "completed"  # RAN: there was nothing to compare with
SCENARIOS, STUDIES, SYSTEM, FILES = "scenarios", "studies", "system", "files"
LINEAR, COUPLING, CAMPAIGNS = "linearize", "coupling", "campaigns"
IDENTIFICATIONS, PROOFS, REPLAYS = "identify", "proofs", "replays"
# section -> its kind of result; in the order of the start page
SECTIONS = {
    FILES: "own scenario",
    SCENARIOS: "scenario",
    SYSTEM: "system",
    LINEAR: "linear model",
    IDENTIFICATIONS: "identification",
    CAMPAIGNS: "campaign",
    REPLAYS: "run of a campaign",
    COUPLING: "coupling study",
    PROOFS: "proof",
    STUDIES: "accuracy study",
}
WIDTH, HEIGHT, MARGIN = 100.0, 60.0, 4.0  # of the view box
SPACE = "\N{NO-BREAK SPACE}"  # before a unit
THIN = 'vector-effect="non-scaling-stroke"'
COLUMNS = 60  # the curve's extremes in each are drawn
NOTHING = 1e-12  # SI: a curve on a linear axis that stays below is rounding
INSET = 8.0  # of points
POSES, DOTS = 6, 300  # most in a thumbnail


@dataclass(frozen=True)
class Entry:
    """A line of the start page."""

    name: str
    title: str
    group: str  # model or system, with its version of FMI
    page: str  # file name, beside the entry
    status: str  # PASSED, FAILED or RAN
    error: float | None = None  # the worst one; None if it is NaN or unknown
    bound: float | None = None
    detail: str = ""  # which output is worst, or why the run failed
    line: str = ""  # path of the sparkline
    line_text: str = ""  # its description
    line_of: str = ""  # the variable of the sparkline
    source: str = ""  # file of a user
    line_scale: str = ""  # its smallest and largest value, and how long it is
    shapes: Sequence[Sequence[str]] = ()  # drawn in place of the line: class and path of each
    command: str = ""  # that makes the page again
    section: str = ""  # one of SECTIONS
    date: str = ""  # ISO 8601, of the entry
    commit: str = ""  # of the project, in a checkout

    @property
    def model(self) -> str:
        """The model without its version of FMI."""
        return self.group.partition(" (")[0]


def write_page(folder: Path, name: str, page: RunPage, group: str, **more: Any) -> Entry:
    """Write a page of a section; its entry, with `more` in place of what follows from the page."""
    folder.mkdir(parents=True, exist_ok=True)
    pages.write_run(folder / f"{name}.html", page)
    return entry_of(name, page, group, **more)


def entry_of(name: str, page: RunPage, group: str, **more: Any) -> Entry:
    """Return the entry of a page that has been written as NAME.html."""
    known = {"name": name, "title": page.title, "group": group, "status": page.status}
    known |= {"page": f"{name}.html", "command": page.again}
    if page.data is not None:
        plot, x = page.data.plots[0], page.data.x
        values = plot.curves[0].values
        if plot.log:
            values = np.log10(np.where(values > 0, values, np.nan))
        elif np.abs(values[np.isfinite(values)]).max(initial=0.0) < NOTHING:
            values = np.zeros(len(x))
        scale = sparkline_scale(x, plot, page.data.axis.unit)
        shapes = poses(page.data.motion or {})
        known |= {"line": sparkline(x, values), "shapes": shapes}
        known["line_text"] = f"Motion of the arm; {plot.text}" if shapes else plot.text
        known |= {"line_of": plot.curves[0].name, "line_scale": scale}
    return Entry(**known | more)


def record(
    report: Path, section: str, entries: Sequence[Entry], folder: Path | None = None
) -> Path:
    """Keep the entries of pages in `folder`, by default the section's; write the start page."""
    stamp = {"date": datetime.now().astimezone().isoformat(timespec="seconds"), "section": section}
    stamp["commit"] = project.commit()
    for entry in entries:
        text = json.dumps(asdict(replace(entry, **stamp)), ensure_ascii=False, indent=1)
        write_text(_file(folder or report / section, entry), text + "\n")
    return write(report)


def _file(folder: Path, entry: Entry) -> Path:
    return folder / f"{entry.page.removesuffix('.html')}{ENTRY}"


def free_name(folder: Path, name: str, command: str) -> str:
    """Return the name of a folder in `folder` that has no page yet, or that of the same command."""
    taken = {file.parent.name: entry.command for file, entry in _found(folder)}
    names = (name if i == 1 else f"{name}_{i}" for i in count(1))
    return next(each for each in names if taken.get(each, command) == command)


def forget(report: Path, section: str, names: Collection[str] | None = None) -> None:
    """Remove entries of a section, all or some; and the start page if nothing is left in it."""
    for name in [entry.name for entry in read(report, section)] if names is None else names:
        (report / section / f"{name}{ENTRY}").unlink(missing_ok=True)
    if _all(report):
        write(report)
    else:
        (report / pages.INDEX).unlink(missing_ok=True)


def read(report: Path, section: str) -> list[Entry]:
    """Read the entries of the pages in a section's folder."""
    there = report / section
    return [entry for file, entry in _found(report, section) if file.parent == there]


def _all(report: Path) -> dict[str, Entry]:
    """Return all entries, by the addresses of their pages."""
    found = {(f.parent / e.page).relative_to(report).as_posix(): e for f, e in _found(report)}
    return dict(sorted(found.items()))


def _found(folder: Path, below: str = "") -> Iterator[tuple[Path, Entry]]:
    """Yield the entries whose pages are there, with their files; what is no entry is ignored."""
    for depth in range(DEEPEST):
        for file in sorted((folder / below).glob("*/" * depth + f"*{ENTRY}")):
            with suppress(OSError, ValueError, TypeError, RecursionError):
                entry = Entry(**json.loads(file.read_text(encoding="utf-8")))
                if _is_sound(entry) and (file.parent / entry.page).is_file():
                    yield file, entry


def _is_sound(entry: Entry) -> bool:
    """Return whether an entry of a file has values of its types, and a page beside it."""
    texts = [getattr(entry, field.name) for field in fields(Entry) if field.type == "str"]
    numbers = entry.error, entry.bound
    return (
        all(isinstance(text, str) for text in (*texts, *(x for s in entry.shapes for x in s)))
        and all(isinstance(x, float | int | None) for x in numbers)
        and all(len(shape) == 2 for shape in entry.shapes)
        and entry.section in SECTIONS
        and Path(entry.page).name == entry.page
    )


def write(report: Path) -> Path:
    """Write the start page, and what its pages load; again if an entry has come meanwhile."""
    pages.write_assets(report)
    while True:
        found = _all(report)
        path = _write(report, found)
        if _all(report) == found:
            return path


def _write(report: Path, found: Mapping[str, Entry]) -> Path:
    ranks = {name.replace("_", ""): len(list((folder / "scenarios").iterdir()))
             for name, folder in project.models().items()}  # fmt: skip
    kinds = list(SECTIONS)

    def rank(item: tuple[str, Entry]) -> tuple:
        entry = item[1]
        known = ranks.get(entry.model.lower(), 0)  # models with many scenarios first
        return -known, entry.model, kinds.index(entry.section), entry.name

    groups: dict[str, list[tuple[str, Entry]]] = {}
    for item in sorted(found.items(), key=rank):
        groups.setdefault(item[1].model, []).append(item)
    statuses = [entry.status for entry in found.values()]
    return pages.write_page(
        report / pages.INDEX, "overview.html", root="", groups=groups, kinds=SECTIONS,
        count=len(statuses), failed=statuses.count(FAILED), passed=statuses.count(PASSED),
        statuses=[x for x in (FAILED, PASSED, RAN) if x in statuses],
        version=project.version(), commit=project.commit(), width=WIDTH, height=HEIGHT,
    )  # fmt: skip


# ---- Thumbnails ----------------------------------------------------------------------------------
def poses(moving: Mapping[str, Any]) -> list[list[str]]:
    """Draw the path of an arm's end effector, and poses from the first to the last."""
    if not {"q1", "q2", "arm"} <= set(moving):
        return []
    arm, q1, q2 = moving["arm"], np.array(moving["q1"]), np.array(moving["q2"])
    there = np.isfinite(q1) & np.isfinite(q2)
    along, across = np.exp(1j * q1[there]), 1j * np.exp(1j * q1[there])
    sleeve = arm["l1"] * along
    tip = (arm["l1"] + q2[there]) * along + arm["a"] * across
    joints = np.array([0 * tip, sleeve, sleeve + arm["a"] * across, tip])
    if not joints.size:
        return []
    low, high = (complex(f(joints.real), f(joints.imag)) for f in (np.min, np.max))
    size = high - low
    room = WIDTH - 2 * MARGIN, HEIGHT - 2 * MARGIN
    scale = min(room[0] / max(size.real, 1e-9), room[1] / max(size.imag, 1e-9))
    middle = (low + high) / 2

    def path(points: np.ndarray) -> str:
        placed = scale * (points - middle)
        return _path(WIDTH / 2 + placed.real, HEIGHT / 2 - placed.imag)

    shown = np.unique(np.linspace(0, len(tip) - 1, POSES).astype(int))
    kept = np.unique(np.linspace(0, len(tip) - 1, DOTS).astype(int))
    ghosts = [["ghost", path(joints[:, i])] for i in shown[:-1]]
    return [["trace", path(tip[kept])], *ghosts, ["arm", path(joints[:, shown[-1]])]]


def dots(x: np.ndarray, y: np.ndarray, cross: bool = False) -> list[list[str]]:
    """Draw points (n,), or poles as crosses with the axis of the imaginary ones."""
    there = np.isfinite(x) & np.isfinite(y)
    x, y = x[there][:DOTS], y[there][:DOTS]
    if not len(x):
        return []
    ends = [(min(v.min(), 0.0), max(v.max(), 0.0)) if cross else (v.min(), v.max()) for v in (x, y)]
    placed = []
    for values, (low, high), room in zip((x, y), ends, (WIDTH, HEIGHT), strict=True):
        share = (values - low) / (high - low) if high > low else np.full(len(values), 0.5)
        placed.append(INSET + share * (room - 2 * INSET))
    across, up = placed[0], HEIGHT - placed[1]
    mark = "M{0:.4g} {1:.4g}m-3-3l6 6m0-6l-6 6" if cross else "M{0:.4g} {1:.4g}h0"
    path = "".join(mark.format(a, b) for a, b in zip(across, up, strict=True))
    if not cross:
        return [["dots", path]]
    low, high = ends[0]
    zero = INSET - low / (high - low) * (WIDTH - 2 * INSET) if high > low else WIDTH / 2
    return [["axis", f"M{zero:.4g} 0V{HEIGHT:g}"], ["curve", path]]


def sparkline_scale(x: np.ndarray, plot: Plot, unit: str) -> str:
    """Say between which values the first curve of a plot runs, and how long `x` is (`unit`)."""
    values = plot.curves[0].values[np.isfinite(plot.curves[0].values)]
    if not len(values):
        return ""
    if not plot.log and np.abs(values).max() < NOTHING:
        values = np.zeros(1)
    low, high = (number(float(f"{value:.3g}")) for value in (values.min(), values.max()))
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
    return _path(MARGIN + x, HEIGHT - MARGIN - y)


def _path(x: np.ndarray, y: np.ndarray) -> str:
    return "M" + "L".join(f"{a:.4g} {b:.4g}" for a, b in zip(x, y, strict=True))


def sparkline_svg(x: np.ndarray, y: np.ndarray) -> str:
    """Draw a sparkline as an element of any page."""
    line = f'<path d="{sparkline(x, y)}" fill="none" stroke="{pages.RUN_COLOR}" {THIN}/>'
    box = f'viewBox="0 0 {WIDTH:g} {HEIGHT:g}" preserveAspectRatio="none"'
    return f'<svg width="360" height="48" {box}>{line}</svg>'
