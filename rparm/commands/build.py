"""`build`: makes FMUs of a file with equations."""

import argparse
import subprocess
import sys
from pathlib import Path

from rparm import project
from rparm.command_line.options import add_output
from rparm.commands import Ended
from rparm.errors import UserError, one_line

DESCRIPTION = (
    "Makes FMUs of the equations in FILE.toml, for FMI 2.0 and 3.0: NAME.fmu and fmi3/NAME.fmu. "
    f"{project.page_of_models()} explains the file. Beside it FILE.lock.toml keeps the value "
    "references."
)
# what the program imports, beside this package
NEEDED = ("latex2mathml", "markdown_it", "mdit_py_plugins", "pydantic")


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", metavar="FILE.toml", type=Path, help="the file with the equations")
    parser.add_argument(
        "--platforms", action="store_true", help="for all platforms, by zig, not for this machine"
    )
    add_output(parser, "folder for the FMUs (default: the current one)")


def run(options: argparse.Namespace) -> Ended:
    project.check_installed(NEEDED, "build")
    tool = project.model_builder()
    command = [sys.executable, tool, options.file, "--output", options.output or Path()]
    command += ["--runtime", *project.runtimes(options.platforms)]
    command += [] if options.platforms else ["--of-this-machine"]
    # zig compiles its C library once
    environment = {"ZIG_GLOBAL_CACHE_DIR": str(project.cache_folder("zig"))}
    environment["PYTHONIOENCODING"] = "utf-8"
    ended = subprocess.run(
        command,
        capture_output=True,
        check=False,
        env=environment | project.child_environment(),
        encoding="utf-8",
        errors="replace",
    )
    if ended.returncode:
        lines = ended.stderr.strip().splitlines() or [f"{tool} ended with {ended.returncode}"]
        raise UserError(one_line(lines[-1]))
    paths = ended.stdout.splitlines()
    return Ended(0, f"{' and '.join(paths)}: built", {"fmus": [Path(p).absolute() for p in paths]})
