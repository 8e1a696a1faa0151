"""`build`: makes FMUs of a file with equations."""

import argparse
from pathlib import Path

from rparm import building, project
from rparm.command_line import Ended
from rparm.command_line.options import add_output

DESCRIPTION = (
    "Makes FMUs of the equations in FILE.toml, for FMI 2.0 and 3.0: NAME.fmu and fmi3/NAME.fmu. "
    f"{project.page_of_models()} explains the file. Beside it FILE.lock.toml keeps the value "
    "references."
)


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", metavar="FILE.toml", type=Path, help="the file with the equations")
    parser.add_argument(
        "--platforms", action="store_true", help="for all platforms, by zig, not for this machine"
    )
    add_output(parser, "folder for the FMUs (default: the current one)")


def run(options: argparse.Namespace) -> Ended:
    paths = building.build(
        options.file, output=options.output or Path(), platforms=options.platforms
    )
    verdict = f"{' and '.join(map(str, paths))}: built"
    return Ended(0, verdict, {"fmus": [path.absolute() for path in paths]})
