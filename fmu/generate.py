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
from fmi2.model_description import model_description as fmi2_description
from fmi3.model_description import model_description as fmi3_description
from provenance import Provenance, ProvenanceError, build_date, license_texts


def write_if_changed(path: Path, text: str) -> None:
    """Write a file unless it has this text already, so that nothing is rebuilt for it."""
    if not path.is_file() or path.read_bytes() != text.encode():
        with atomic_write(path) as temporary:
            temporary.write_bytes(text.encode())


def main() -> int:
    """Generate; 2 with a line on standard error where the declaration is wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("variables", type=Path, help="variables.toml of the model")
    parser.add_argument("--output", type=Path, required=True, help="folder for the files")
    parser.add_argument("--version", default="0.0.0", help="version of the project")
    parser.add_argument("--license", type=Path, help="LICENSE of the project")
    arguments = parser.parse_args()
    try:
        declaration = load(arguments.variables)
        texts = license_texts(arguments.license) if arguments.license else {}
        provenance = Provenance(arguments.version, **texts, date=build_date(os.environ))
        files = {
            "modelDescription.xml": fmi2_description(declaration, provenance),
            "fmi3/modelDescription.xml": fmi3_description(declaration, provenance),
            "value_references.h": value_references(declaration),
            "variables.c": variable_table(declaration),
        }
        for name, text in files.items():
            (arguments.output / name).parent.mkdir(parents=True, exist_ok=True)
            write_if_changed(arguments.output / name, text)
    except (DeclarationError, ProvenanceError, OSError) as error:
        print(f"generate.py: {error!s:.2000}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
