"""The start page of a folder of results: a line for each page, from the entry beside it.

A command writes its page, then the entry PAGE.entry.json. The list is made of the entries that are
found in the folder and below, so that commands that run at the same time lose nothing.
"""

import json
import shlex
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
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
from rparm.report.run_data import LINKS, Plot
from rparm.units import number

ENTRY = ".entry.json"
DEEPEST = 4  # levels of folders that are searched for entries, with the start page's own
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
IN_FOLDERS = LINEAR, IDENTIFICATIONS  # sections whose pages have a folder each
WIDTH, HEIGHT, MARGIN = 100.0, 60.0, 5.0  # of the view box
SPACE = "\N{NO-BREAK SPACE}"  # before a unit
THIN = 'vector-effect="non-scaling-stroke"'
COLUMNS = 60  # the curve's extremes in each are drawn
NOTHING = 1e-12  # SI: a curve on a linear axis that stays below is rounding
POSES, DOTS = 6, 300  # most in a thumbnail
CROSS = "M{:.4g} {:.4g}m-3-3l6 6m0-6l-6 6"


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
    difference: str = ""  # largest one from another result
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
        moving = (p for p in page.data.plots if p.log or len({*p.curves[0].values}) > 1)
        plot, x = next(moving, page.data.plots[0]), np.abs(page.data.x - page.data.x[:1])
        curve, values = plot.curves[0], plot.curves[0].values
        if plot.log:
            values = np.log10(np.where(values > 0, values, np.nan))
        elif np.abs(values[np.isfinite(values)]).max(initial=0.0) < NOTHING:
            values = np.zeros(len(x))
        shapes = poses(np.array(page.data.motion[LINKS])) if page.data.motion else []
        known |= {"line": sparkline(x, values), "shapes": shapes}
        known["line_text"] = "Motion of the arm; " * bool(known["shapes"]) + plot.text
        known["line_scale"] = sparkline_scale(page.data.x, plot, page.data.axis.unit)
        known["line_of"] = curve.name
    return Entry(**known | more)


def record(
    report: Path, section: str, entries: Sequence[Entry], folder: Path | None = None
) -> Path:
    """Keep the entries of pages in `folder`, by default the section's; write the start page."""
    now = datetime.now().astimezone().isoformat(timespec="seconds")
    for each in entries:
        stamp = {"date": now, "commit": project.commit(), "section": section}
        stamp["command"] = _whole(report, each.command)
        text = json.dumps(asdict(replace(each, **stamp)), ensure_ascii=False, indent=1)
        name = each.page.removesuffix(".html")
        write_text((folder or report / section) / f"{name}{ENTRY}", text + "\n")
    return write(report)


def _whole(report: Path, command: str) -> str:
    """Add the folder to a command that has none, unless it is the usual one."""
    if " --output " in command or report.absolute() == project.report_folder().absolute():
        return command
    return f"{command} --output {shlex.quote(str(project.from_root(report)))}"


def add(report: Path, section: str, entry: Entry, write: Callable[[Path, str], Path]) -> Path:
    """Write a page by `write(folder, root)`, and its `entry`; its path.

    A folder of its own has its name, unless that has the page of another command.
    """
    folder, root, name = report / section, "../", entry.name
    if section in IN_FOLDERS:
        taken = {file.parent.name: known.command for file, known in _found(folder)}
        whole = _whole(report, entry.command)
        names = (name if i == 1 else f"{name}_{i}" for i in count(1))
        name = next(each for each in names if taken.get(each, whole) == whole)
        folder, root = folder / name, "../../"
    folder.mkdir(parents=True, exist_ok=True)
    path = write(folder, root)
    record(report, section, [replace(entry, name=name, page=path.name)], folder)
    return path


def add_run(report: Path, section: str, name: str, page: RunPage, group: str) -> Path:
    """Write a page of a run or a study, called `name`, and its entry; its path."""
    entry = entry_of(name, page, group)
    return add(report, section, entry, lambda to, _: pages.write_run(to / entry.page, page))


def forget(report: Path, section: str, names: Collection[str] | None = None) -> None:
    """Remove pages of a section, all or some; and the start page if nothing is left in it."""
    for name in [entry.name for entry in read(report, section)] if names is None else names:
        for suffix in (ENTRY, ".html"):
            (report / section / f"{name}{suffix}").unlink(missing_ok=True)
    if _all(report):
        write(report)
    else:
        (report / pages.INDEX).unlink(missing_ok=True)


def read(report: Path, section: str) -> list[Entry]:
    """Read the entries of the pages in a section's folder."""
    folder = report / section
    return [entry for file, entry in _found(folder) if file.parent == folder]


def _all(report: Path) -> dict[str, Entry]:
    """Return all entries, by the addresses of their pages."""
    return {(f.parent / e.page).relative_to(report).as_posix(): e for f, e in _found(report)}


def _found(folder: Path) -> Iterator[tuple[Path, Entry]]:
    """Yield the entries whose pages are there, with their files; what is no entry is ignored."""
    texts = [field.name for field in fields(Entry) if field.type is str]
    for file in sorted(
        file for i in range(DEEPEST) for file in folder.glob("*/" * i + f"*{ENTRY}")
    ):
        with suppress(OSError, ValueError, TypeError, RecursionError):
            entry = Entry(**json.loads(file.read_text(encoding="utf-8")))
            _ = "".join(getattr(entry, name) for name in texts), entry.group.partition(" ")
            _ = [f"{kind}" + path for kind, path in entry.shapes]
            _ = abs(entry.error or 0), abs(entry.bound or 0)
            is_beside = Path(entry.page).name == entry.page and (file.parent / entry.page).is_file()
            if is_beside and entry.section in SECTIONS:
                yield file, entry


def write(report: Path) -> Path:
    """Write the start page, and what its pages load; again if an entry has come meanwhile."""
    pages.write_assets(report)
    while True:
        found = _all(report)
        _write(report, found)
        if _all(report) == found:
            return report / pages.INDEX


def _write(report: Path, found: Mapping[str, Entry]) -> None:
    scenarios = {
        name.replace("_", ""): len(list(folder.glob("scenarios/*")))
        for name, folder in project.models().items()
    }
    groups: dict[str, list[tuple[str, Entry]]] = {}
    kinds = list(SECTIONS)
    in_order = sorted(found.items(), key=lambda x: (kinds.index(x[1].section), x[1].name))
    for item in sorted(in_order, key=lambda x: (-scenarios.get(x[1].model.lower(), 0), x[1].model)):
        groups.setdefault(item[1].model, []).append(item)
    statuses = [entry.status for entry in found.values()]
    pages.write_page(
        report / pages.INDEX, "overview.html", root="", groups=groups, kinds=SECTIONS,
        statuses=statuses, version=project.version(), commit=project.commit(),
        width=WIDTH, height=HEIGHT,
    )  # fmt: skip


# ---- Thumbnails ----------------------------------------------------------------------------------
def poses(links: np.ndarray) -> list[list[str]]:
    """Draw the path of the end effector, and poses from the first to the last."""
    if not (there := np.isfinite(links).all(axis=(0, 1))).any():
        return []
    joints = _placed(links[0][:, there] + 1j * links[1][:, there])
    last = joints.shape[1] - 1
    shown, kept = (np.unique(np.linspace(0, last, n).astype(int)) for n in (POSES, DOTS))
    drawn = [_path(joints[:, i].real, joints[:, i].imag) for i in shown]
    trace = _path(joints[-1, kept].real, joints[-1, kept].imag)
    return [["trace", trace], *(["ghost", path] for path in drawn[:-1]), ["arm", drawn[-1]]]


def crosses(poles: np.ndarray) -> list[list[str]]:
    """Draw poles, and the imaginary axis."""
    zero, *points = _placed(np.array([0, *poles])).tolist()
    path = "".join(CROSS.format(p.real, p.imag) for p in points)
    return [["axis", f"M{zero.real:.4g} 0V{HEIGHT:g}"], ["curve", path]]


def _placed(points: np.ndarray) -> np.ndarray:
    """Place points x + i y in the view box, to scale; upwards is down there."""
    low, high = (f(points.real) + 1j * f(points.imag) for f in (np.min, np.max))
    size = high - low
    room = WIDTH - 2 * MARGIN, HEIGHT - 2 * MARGIN
    scale = min(room[0] / max(size.real, 1e-9), room[1] / max(size.imag, 1e-9))
    return np.conj(scale * (points - (low + high) / 2)) + (WIDTH + 1j * HEIGHT) / 2


def sparkline_scale(x: np.ndarray, plot: Plot, unit: str) -> str:
    """Say between which values the first curve of a plot runs, and how long `x` is (`unit`)."""
    values = plot.curves[0].values[np.isfinite(plot.curves[0].values)]
    if not len(values):
        return ""
    if not plot.log and np.abs(values).max() < NOTHING:
        values = np.zeros(1)
    low, high = (number(float(f"{value:.3g}")) for value in (values.min(), values.max()))
    between = low if low == high else f"{low} to {high}"
    span = f"{x[-1] - x[0]:.3g}" if unit == "s" else f"{x[0]:.3g} to {x[-1]:.3g}"
    parts = (f"{between} {plot.unit}".strip(), f"{span} {unit}")
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
    return "M" + "L".join(f"{a:.4g} {b:.4g}" for a, b in zip(x, y, strict=True)) + "h0"


def sparkline_svg(x: np.ndarray, y: np.ndarray) -> str:
    """Draw a sparkline as an element of any page."""
    line = f'<path d="{sparkline(x, y)}" fill="none" stroke="{pages.RUN_COLOR}" {THIN}/>'
    box = f'viewBox="0 0 {WIDTH:g} {HEIGHT:g}" preserveAspectRatio="none"'
    return f'<svg width="360" height="48" {box}>{line}</svg>'
