"""`playground`: the plant in a browser, on a page that needs no network."""

import argparse

from rparm import project
from rparm.command_line import Ended
from rparm.command_line.options import add_output
from rparm.files import copied, from_here

DESCRIPTION = "Says where the page with the plant is; --open shows it."


def add_options(parser: argparse.ArgumentParser) -> None:
    add_output(parser, "copy the page into this folder")


def run(options: argparse.Namespace) -> Ended:
    page = project.playground_page()
    if options.output:
        page = copied(page, options.output / "playground.html")
    return Ended(0, str(from_here(page)), {"page": page.absolute()}, page=page)
