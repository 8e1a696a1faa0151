"""`fmu`: copy an FMU to where another tool finds it."""

import argparse
from pathlib import Path

from rparm import project
from rparm.command_line import Ended
from rparm.command_line.options import add_fmi, add_output
from rparm.files import copied
from rparm.project import VERSIONS

DESCRIPTION = "Copies the FMU of a model, for another tool."


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("name", metavar="NAME", help="name of the FMU, or of its model")
    add_fmi(parser, VERSIONS[0], "its version of FMI (default: 2)")
    add_output(parser, "copy it into this folder (default: the current one)")


def run(options: argparse.Namespace) -> Ended:
    """Copy the FMU; a file that has its name is replaced."""
    file = project.built(project.model(options.name), ".fmu", version=options.fmi)
    path = copied(file, (options.output or Path()) / file.name)
    verdict = f"{path}: FMI {options.fmi}, {path.stat().st_size} bytes"
    return Ended(0, verdict, {"file": path.absolute(), "fmi_version": options.fmi})
