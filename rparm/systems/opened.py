"""The door of all commands to systems: SSPs and loop files."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rparm.errors import UserError
from rparm.project import VERSIONS
from rparm.systems import loop_file, ssp
from rparm.systems.structure import OpenedSystem

LOOP, SSP = ".toml", ".ssp"  # suffixes of files with systems
SUFFIXES = (LOOP, SSP)


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
