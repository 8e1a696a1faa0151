"""Opens systems by path or name: SSPs and loop files."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rparm import project
from rparm.errors import UserError, hint
from rparm.project import VERSIONS
from rparm.systems import loop_file, ssp
from rparm.systems.loop_file import SSP
from rparm.systems.structure import OpenedSystem

LOOP = ".toml"
SUFFIXES = (LOOP, SSP)  # of files with systems


def given_file(first: str | None, ssp: Path | None) -> Path | None:
    """Return the system's file: the first argument, if it names one, or the value of --ssp."""
    if first is None or Path(first).suffix.lower() not in SUFFIXES:
        return ssp
    if ssp:
        raise UserError(f"{first}: --ssp names another file, {ssp}")
    return Path(first)


def system_file(given: str | Path, version: str = VERSIONS[0], option: str = "--ssp") -> Path:
    """Return a system's file: a file itself, or the SSP of a system of the project."""
    if Path(given).suffix.lower() in SUFFIXES:
        return Path(given)
    name, known = str(given), project.systems()
    if name not in known:
        raise UserError(f"no system {name!r}{hint(name, known)}, expected a name or .toml or .ssp")
    return project.built(known[name], SSP, option, version)


@contextmanager
def opened(
    path: Path, step: float | None = None, version: str = VERSIONS[0]
) -> Iterator[OpenedSystem]:
    """Open a system until the end; a `step` in s replaces the file's. UserError if it is wrong.

    FMUs that a loop file takes from the project, or has built, are of this `version` of FMI.
    """
    path = Path(path)
    if step is not None and not step > 0:
        raise UserError(f"{path}: expected a step of more than 0 s, got {step!r} s")
    if path.suffix.lower() == LOOP:
        with loop_file.opened(path, step, version) as system:
            yield system
    else:
        with ssp.unpacked(path, step) as system:
            yield system
