"""`list`: name the scenarios, without any FMU."""

import argparse

from rparm import console, project
from rparm.command_line import Ended
from rparm.command_line.options import add_document
from rparm.runs import scenario

DESCRIPTION = "Prints the name and the title of every scenario."


def add_options(parser: argparse.ArgumentParser) -> None:
    add_document(parser)


def run(_: argparse.Namespace) -> Ended:
    files = project.scenario_files()
    found = [
        {"name": name, "title": scenario.title(path), "model": project.model_folder(path).name}
        for name, path in files.items()
    ]
    return Ended(0, console.titles(found), {"scenarios": found})
