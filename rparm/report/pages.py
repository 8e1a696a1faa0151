"""Parts, assets and pictures that all pages of the report share."""

import base64
import functools
import gzip
import lzma
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rparm import project
from rparm.files import from_folder, whole, write_text
from rparm.report.run_data import RunData
from rparm.texts import rendered

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INDEX = "index.html"
ASSETS = "assets"  # in the report
ASSET_SOURCES = Path(__file__).parent / "assets"
PLOTLY = "plotly.js"
UNPACK = "unpack.js"  # becomes PLOTLY
INK, MUTED, GRID = "#22303c", "#6b7885", "#e3e8ec"
REFERENCE_COLOR, RUN_COLOR = "#a9c5de", "#1d4e79"
ERROR_COLORS = ("#d1793a", "#2f8f83", "#7a5195", "#8a8d3f")
CURVE_COLORS = (RUN_COLOR, *ERROR_COLORS)
DASHED = (0, (5, 3))
STYLE = Path(__file__).with_name("figures.mplstyle")  # of matplotlib


@dataclass(frozen=True)
class PageTable:
    """A table of a page."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[object]]  # numbers are aligned to the right
    note: str = ""
    folded: bool = False  # shown when it is asked for


@dataclass(frozen=True, eq=False)
class RunPage:
    """A page about one run, or one study, with plots."""

    title: str
    description: str
    status: str
    facts: Sequence[tuple[str, str]]
    data: RunData | None  # None: nothing was recorded
    tables: Sequence[PageTable]
    notes: Sequence[str] = ()
    failures: Sequence[str] = ()
    csv: str = ""  # file name beside the page, if there is one
    csv_note: str = ""
    diagram: tuple[str, str] | None = None  # file name beside the page, and its description
    again: str = ""  # the command that runs it again


def write_run(path: Path, page: RunPage, root: str = "../") -> Path:
    """Write a page of a report, whose folder `root` leads to; return its path."""
    return write_page(path, "run.html", root=root, page=page, data=page.data and page.data.json())


def root(report: Path, folder: Path) -> str:
    """Return how a page in a folder of a report leads to the report's own."""
    path = from_folder(report.absolute(), folder.absolute())
    return "" if path == "." else f"{path}/"


def write_alone(folder: Path, page: RunPage, root: str = "") -> Path:
    """Write a page into a folder of its own; without a start page, `root`, with what it loads."""
    if not root:
        write_assets(folder)
    folder.mkdir(parents=True, exist_ok=True)
    return write_run(folder / INDEX, page, root)


def write_page(path: Path, template: str, **values: object) -> Path:
    """Write a page, complete or not at all; return its path."""
    write_text(path, rendered(template, **values))
    return path


# ---- Assets --------------------------------------------------------------------------------------
def write_assets(report: Path) -> None:
    """Write the assets that a report does not have yet: all of them, or none if that fails."""
    folder = report / ASSETS
    folder.mkdir(parents=True, exist_ok=True)
    made: list[Path] = []
    try:
        for source in sorted(ASSET_SOURCES.iterdir()):
            name, content = source.name, source.read_bytes()
            if name == UNPACK:
                name, content = PLOTLY, _plotly()
            target = folder / name
            if not target.is_file() or target.read_bytes() != content:
                with whole(target) as path:
                    path.write_bytes(content)
                made.append(target)
    except OSError:
        for target in made:
            target.unlink(missing_ok=True)
        with suppress(OSError):  # not empty
            folder.rmdir()
        raise


@functools.cache
def _plotly() -> bytes:
    """Return the library, compressed, in a script that unpacks it."""
    file = project.plotly_script()
    bundle = file.read_bytes()
    bundle = lzma.decompress(bundle) if file.suffix == ".xz" else bundle
    version = re.search(rb"plotly\.js v(\S+)", bundle[:200])
    assert version is not None
    packed = base64.b64encode(gzip.compress(bundle, mtime=0)).decode("ascii")
    script = (ASSET_SOURCES / UNPACK).read_text(encoding="utf-8")
    script = script.replace("@VERSION@", version[1].decode("ascii"))
    return script.replace("@PACKED@", packed).encode("utf-8")


# ---- Pictures ------------------------------------------------------------------------------------
def save_figure(figure: "Figure", path: Path) -> None:
    """Write a picture in the style of all; complete or not at all."""
    import matplotlib as mpl  # takes long

    with whole(path) as temporary, mpl.rc_context(fname=STYLE):
        figure.savefig(temporary, metadata={"Software": None})
