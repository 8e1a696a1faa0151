"""Builds FMUs of one file with equations, for FMI 2.0 and 3.0, and its lock file.

Prints the names of the files in the folder of the output: first the lock file, which is to replace
the one beside the file with equations.
"""

import argparse
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from building import PLACES, Runtime, build
from compiler.read import gradients
from compiler.read.model_file import ModelFile, ModelFileError, read
from compiler.write import declaration, lock
from package import pack
from program import WrongInputError

# absolute tolerance of a state over its nominal value, at the default relative tolerance
TOLERANCE = 1e-10
MOST_SHOWN = 20  # entries of a block
MISTAKES = (ModelFileError, WrongInputError, OSError)


def main() -> int:
    """Build; 2 with a line on standard error where something is wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("file", type=Path, help="the file of the model")
    parser.add_argument("--output", type=Path, required=True, help="folder for the files")
    text = "runtime.json of each platform"
    parser.add_argument("--runtime", type=Path, nargs="+", required=True, help=text)
    text = "that is the platform: any compiler will do"
    parser.add_argument("--of-this-machine", action="store_true", help=text)
    text = "by which there are gradients, in place of those in the file"
    parser.add_argument("--gradients", nargs="+", metavar="NAME", help=text)
    arguments = parser.parse_args()
    try:
        file = read(arguments.file, arguments.gradients)
        lock_file = lock.path_of(arguments.file)
        references = lock.references(lock_file, declaration.keys(file))
        runtimes = [Runtime.load(path, arguments.of_this_machine) for path in arguments.runtime]
        with tempfile.TemporaryDirectory() as work:
            built = build(file, references, runtimes, Path(work).resolve())
            text = lock.text(file.name, references)
            (arguments.output / lock_file.name).write_text(text, encoding="utf-8", newline="\n")
            names = [lock_file.name]
            for version, entries in built.items():
                names.append((Path(PLACES[version]) / f"{file.name}.fmu").as_posix())
                pack(arguments.output / names[-1], entries)
    except MISTAKES as error:
        print(f"{error!s:.2000}", file=sys.stderr)
        return 2
    for warning in _warnings(file):
        print(f"warning: {warning}", file=sys.stderr)
    for note in _notes(file):
        print(f"note: {note}", file=sys.stderr)
    print("\n".join(names))
    return 0


def _warnings(file: ModelFile) -> Iterator[str]:
    """Yield warnings: allowed, but hardly meant."""
    yield from file.code.warnings if file.code else ()
    if file.gradients:
        yield from gradients.warnings(file)
    for state in file.of("states"):
        start, nominal = abs(state.start or 0.0), state.nominal or 1.0
        if 0.0 < start < TOLERANCE * nominal:
            yield (
                f"[states]: {state.name}: starts at {state.start:g}, but its tolerance is "
                f"{TOLERANCE * nominal:g}: a nominal value of its usual size makes it smaller"
            )


def _notes(file: ModelFile) -> Iterator[str]:
    """Yield the blocks of entries that need each other: some of them may not be meant."""
    for block in dict.fromkeys(file.blocks.values()):
        names = block.names
        more = f", ... ({len(names)})" if len(names) > MOST_SHOWN else ""
        together = "solved together" if len(names) > 1 else "solved"
        yield f"{', '.join(names[:MOST_SHOWN])}{more}: {together}, {block.kind}"


if __name__ == "__main__":
    sys.exit(main())
