"""`build`: makes FMUs of a file with equations."""

import argparse
import errno
import os
import shutil
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

from rparm import project
from rparm.command_line.options import add_output
from rparm.commands import Ended
from rparm.errors import UserError, one_line
from rparm.interruption import run_group, temporary_folder, uninterrupted
from rparm.output_files import whole, written

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
    runtimes = project.runtimes(options.platforms)
    with temporary_folder() as work:
        lock, *fmus = _build(options, runtimes, work)
        output = options.output or Path()
        paths = [output / fmu for fmu in fmus]
        targets = [options.file.with_name(lock), *paths]
        _put(dict(zip(targets, (work / name for name in (lock, *fmus)), strict=True)))
    verdict = f"{' and '.join(map(str, paths))}: built"
    return Ended(0, verdict, {"fmus": [path.absolute() for path in paths]})


def _build(options: argparse.Namespace, runtimes: list[Path], work: Path) -> list[str]:
    """Make the lock file and the FMUs in the folder `work`; their names."""
    tool = project.model_builder()
    command = [sys.executable, tool, "--output", work, "--runtime", *runtimes]
    command += [] if options.platforms else ["--of-this-machine"]
    # zig compiles its C library once; what a program that is killed leaves is in `work`
    environment = {"ZIG_GLOBAL_CACHE_DIR": str(project.cache_folder("zig"))}
    environment |= dict.fromkeys(("TMPDIR", "TMP", "TEMP"), str(work))
    environment["PYTHONIOENCODING"] = "utf-8"
    ended = run_group(
        [*command, "--", options.file],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=project.child_environment() | environment,
        encoding="utf-8",
        errors="replace",
    )
    if ended.returncode:
        lines = ended.stderr.strip().splitlines() or [f"{tool} ended with {ended.returncode}"]
        raise UserError(one_line(lines[-1]))
    return ended.stdout.splitlines()


def _put(files: dict[Path, Path]) -> None:
    """Copy files to the places that are their keys: all, or none if one fails."""
    for place in files:
        with written(place):
            if place.is_dir():  # else the others would be there when it fails
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    with uninterrupted(), ExitStack() as stack:
        for place, file in files.items():
            with written(place):
                place.parent.mkdir(parents=True, exist_ok=True)
                if file.suffix == ".toml" and place.is_file() and _same(file, place):
                    continue  # a lock file that has all: its folder may be read-only
            stack.enter_context(written(place))
            shutil.copyfile(file, stack.enter_context(whole(place)))


def _same(file: Path, other: Path) -> bool:
    return file.read_bytes() == other.read_bytes()
