"""`list`: name the scenarios, without any FMU."""

import argparse
import textwrap

from rparm import project
from rparm.command_line.options import add_document
from rparm.commands import Ended
from rparm.output import console
from rparm.scenarios import scenario
from rparm.texts import shortened

DESCRIPTION = "Prints the name and the title of every scenario."


def add_options(parser: argparse.ArgumentParser) -> None:
    add_document(parser)


def run(_: argparse.Namespace) -> Ended:
    files = project.scenario_files()
    found = [
        {"name": name, "title": scenario.title(path), "model": project.model_folder(path).name}
        for name, path in files.items()
    ]
    room = console.width()
    width = min(max(map(len, files), default=0), room // 2)
    lines = []
    for entry in found:
        title = textwrap.wrap(entry["title"], room - width - 2) or [""]
        lines.append(f"{shortened(entry['name'], width):<{width}}  {title[0]}")
        lines += [" " * (width + 2) + more for more in title[1:]]
    return Ended(0, "\n".join(lines), {"scenarios": found})
