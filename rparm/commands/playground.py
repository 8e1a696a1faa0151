"""`playground`: the plant in a browser, on a page that needs no network."""

import argparse

from rparm import project
from rparm.commands import Ended
from rparm.options import add_open
from rparm.output_files import from_here
from rparm.report import browser

DESCRIPTION = (
    "Says where the page with the plant is; --open shows it. Exit code: 0 it is there, 2 it is not."
)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Whether a browser shows it."""
    add_open(parser)


def run(options: argparse.Namespace) -> Ended:
    """Name the page, and show it."""
    page = project.playground_page()
    if options.open:
        browser.show(page)
    return Ended(0, str(from_here(page)), {"page": page})
