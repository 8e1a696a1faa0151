"""Builds FMUs of one file with equations, for FMI 2.0 and 3.0; prints their paths.

Beside the file the lock file is written, which keeps the value references.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from equations import declaration, lock
from equations.building import PLACES, build
from equations.model_file import ModelFileError, read
from equations.runtime import Runtime
from generate import write_if_changed
from package import pack
from program import WrongInputError

MISTAKES = (ModelFileError, WrongInputError, OSError)


def main() -> int:
    """Build; 2 with a line on standard error where something is wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("file", type=Path, help="the file of the model")
    parser.add_argument("--output", type=Path, required=True, help="folder for the FMUs")
    parser.add_argument(
        "--runtime", type=Path, nargs="+", required=True, help="runtime.json of each platform"
    )
    parser.add_argument(
        "--of-this-machine", action="store_true", help="that is the platform: any compiler will do"
    )
    arguments = parser.parse_args()
    try:
        file = read(arguments.file, declaration.solver_names())
        lock_file = lock.path_of(arguments.file)
        references = lock.references(lock_file, declaration.keys(file))
        runtimes = [Runtime.load(path, arguments.of_this_machine) for path in arguments.runtime]
        with tempfile.TemporaryDirectory() as work:
            built = build(file, references, runtimes, Path(work).resolve())
            # all that can go wrong in the model has gone right: nothing is written before
            with _written(lock_file):
                write_if_changed(lock_file, lock.text(file.name, references))
            paths = []
            for version, entries in built.items():
                paths.append(arguments.output / PLACES[version] / f"{file.name}.fmu")
                with _written(paths[-1]):
                    pack(paths[-1], entries)
    except MISTAKES as error:
        print(f"{error!s:.2000}", file=sys.stderr)
        return 2
    print("\n".join(map(str, paths)))
    return 0


@contextmanager
def _written(path: Path) -> Iterator[None]:
    """Say that this file cannot be written where something of the system's fails."""
    try:
        yield
    except OSError as error:
        raise ModelFileError(f"{path}: cannot be written: {error.strerror}") from None


if __name__ == "__main__":
    sys.exit(main())
