"""Builds FMUs of one file with equations, for FMI 2.0 and 3.0; prints their paths.

Beside the file the lock file is written, which keeps the value references.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from declaration.load import DeclarationError
from document import DocumentError
from equations import declaration, lock
from equations.building import Runtime, build
from equations.model_file import ModelFileError, read
from generate import write_if_changed
from source_code import SourceCodeError

MISTAKES = (ModelFileError, DeclarationError, DocumentError, SourceCodeError, OSError)


def main() -> int:
    """Build; 2 with a line on standard error where something is wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("file", type=Path, help="the file of the model")
    parser.add_argument("--runtime", type=Path, required=True, help="runtime.json of the build")
    parser.add_argument("--output", type=Path, required=True, help="folder for the FMUs")
    arguments = parser.parse_args()
    try:
        file = read(arguments.file, declaration.solver_names())
        lock_file = lock.path_of(arguments.file)
        references = lock.references(lock_file, declaration.keys(file))
        runtime = Runtime.load(arguments.runtime)
        with tempfile.TemporaryDirectory() as work:
            paths = build(file, references, runtime, Path(work).resolve(), arguments.output)
        write_if_changed(lock_file, lock.text(file.name, references))
    except MISTAKES as error:
        print(f"{error!s:.2000}", file=sys.stderr)
        return 2
    print("\n".join(map(str, paths)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
