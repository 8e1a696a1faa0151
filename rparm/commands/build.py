"""`build`: makes FMUs of a file with equations."""

import argparse
import os
import subprocess
import sys
from pathlib import Path

from rparm import project
from rparm.commands import Ended
from rparm.errors import UserError, one_line
from rparm.options import add_output

DESCRIPTION = (
    "Makes FMUs of the equations in FILE.toml, for FMI 2.0 and 3.0: NAME.fmu and fmi3/NAME.fmu. "
    "examples/models/README.md explains the file. Beside it FILE.lock.toml keeps the value "
    "references."
)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Which file, and where to."""
    parser.add_argument("file", metavar="FILE.toml", type=Path, help="the file with the equations")
    add_output(parser, "folder for the FMUs (default: the current one)")


def run(options: argparse.Namespace) -> Ended:
    """Build."""
    tool, runtime = project.model_builder()
    folder = options.output or Path()
    command = [sys.executable, tool, options.file, "--runtime", runtime, "--output", folder]
    environment = os.environ | {"PYTHONPATH": str(project.PACKAGE.parent)}
    ended = subprocess.run(
        command,
        capture_output=True,
        check=False,
        env=environment,
        encoding="utf-8",
        errors="replace",
    )
    if ended.returncode:
        lines = ended.stderr.strip().splitlines() or [f"{tool} ended with {ended.returncode}"]
        raise UserError(one_line(lines[-1]))
    paths = ended.stdout.splitlines()
    return Ended(0, f"{' and '.join(paths)}: built", {"fmus": [Path(p).absolute() for p in paths]})
