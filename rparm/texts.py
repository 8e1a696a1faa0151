"""Texts made of the files in templates/: pages, pictures, SSPs, and files to start from."""

import os
import re
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote
from xml.sax.saxutils import quoteattr

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from rparm import files, units

NUMERIC = re.compile(r"-?\d[\d.]*(e[+-]?\d+)?( m?s)?|nan|–")  # of cells aligned to the right
LISTED = 12  # names in a sentence


class Command(str):
    """Command to type, as a cell of a table."""


def listed(names: Sequence[str]) -> str:
    """Name the first of them, and how many more there are."""
    more = len(names) - LISTED
    return ", ".join(names[:LISTED]) + (f" and {more} more" if more > 0 else "")


_templates = Environment(
    loader=FileSystemLoader(Path(__file__).parent / "templates"),
    autoescape=lambda name: str(name).endswith((".html", ".svg")),
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)
_templates.filters |= {
    "address": lambda path: quote(os.fsencode(path)),
    "duration": units.duration,
    "exponents": units.exponents,
    "listed": listed,
    "minus": units.minus,
    "number": units.number,
    "quoted": lambda text: quoteattr(str(text)),
    "short": units.short,
    "toml": files.toml_value,
    "toml_key": files.toml_key,
    "unit": units.unit,
}
_templates.tests |= {
    "numeric": lambda cell: NUMERIC.fullmatch(str(cell)) is not None,
    "command": lambda cell: isinstance(cell, Command),
}


def rendered(template: str, **values: object) -> str:
    """Return the text that a template makes of values."""
    return _templates.get_template(template).render(values)
