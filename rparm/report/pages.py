"""HTML pages, made from the templates beside this file."""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from rparm import units
from rparm.files import write_text
from rparm.report.run_data import RunData

INDEX = "index.html"
NUMERIC = re.compile(r"-?\d[\d.]*(e[+-]?\d+)?( m?s)?|nan|–")  # of cells aligned to the right

_templates = Environment(
    loader=FileSystemLoader(Path(__file__).parent / "templates"),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
_templates.filters |= {
    "address": lambda path: quote(os.fsencode(path)),
    "minus": units.minus,
    "number": units.number,
    "short": units.short,
}
_templates.tests |= {
    "numeric": lambda cell: NUMERIC.fullmatch(str(cell)) is not None,
    "command": lambda cell: isinstance(cell, Command),
}


class Command(str):
    """What to type, as a cell of a table."""


@dataclass(frozen=True)
class Table:
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
    tables: Sequence[Table]
    notes: Sequence[str] = ()
    failures: Sequence[str] = ()
    csv: str = ""  # file name beside the page, if there is one
    csv_note: str = ""
    diagram: tuple[str, str] | None = None  # file name beside the page, and what it shows
    again: str = ""  # the command that runs it again
    overview: bool = True  # whether there is one


def write_run(path: Path, page: RunPage) -> Path:
    """Write a page of a section of the report; return its path."""
    return write_page(path, "run.html", root="../", page=page, data=page.data and page.data.json())


def write_page(path: Path, template: str, **values: object) -> Path:
    """Write a page, complete or not at all; return its path."""
    write_text(path, _templates.get_template(template).render(values))
    return path
