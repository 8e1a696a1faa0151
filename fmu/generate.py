"""Makes modelDescription.xml and the C tables of an FMU from the variables.toml of its model.

declaration/schema.py describes that file.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from atomic_write import atomic_write
from declaration.c_tables import value_references, variable_table
from declaration.load import DeclarationError, load
from fmi2.model_description import model_description
from provenance import Provenance, ProvenanceError, build_date, license_texts


def write_if_changed(path: Path, text: str) -> None:
    """Write a file unless it has this text already, so that nothing is rebuilt for it."""
    if not path.is_file() or path.read_bytes() != text.encode():
        with atomic_write(path) as temporary:
            temporary.write_bytes(text.encode())


def source_files(folder: Path) -> list[str]:
    """Names of the files that a source-code FMU is compiled from."""
    names = sorted(path.name for path in folder.glob("*.c"))
    if not names:
        raise FileNotFoundError(f"{folder}: has no C files")
    return names


def main() -> int:
    """Generate; 2 with a line on standard error where the declaration is wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("variables", type=Path, help="variables.toml of the model")
    parser.add_argument("--output", type=Path, required=True, help="folder for the files")
    parser.add_argument("--version", default="0.0.0", help="version of the project")
    parser.add_argument("--license", type=Path, help="LICENSE of the project")
    parser.add_argument(
        "--sources",
        type=Path,
        help="folder of the FMU's C files: write only a description that names them",
    )
    arguments = parser.parse_args()
    try:
        declaration = load(arguments.variables)
        texts = license_texts(arguments.license) if arguments.license else {}
        provenance = Provenance(arguments.version, **texts, date=build_date(os.environ))
        if arguments.sources:
            sources = source_files(arguments.sources)
            files = {"modelDescription.xml": model_description(declaration, provenance, sources)}
        else:
            files = {
                "modelDescription.xml": model_description(declaration, provenance),
                "value_references.h": value_references(declaration),
                "variables.c": variable_table(declaration),
            }
        arguments.output.mkdir(parents=True, exist_ok=True)
        for name, text in files.items():
            write_if_changed(arguments.output / name, text)
    except (DeclarationError, ProvenanceError, OSError) as error:
        print(f"generate.py: {error!s:.2000}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
