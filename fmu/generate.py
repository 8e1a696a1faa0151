"""Makes the XML files and the C tables of an FMU from the variables.toml of its model.

declaration/schema.py describes that file.
"""

import argparse
import os
import sys
from pathlib import Path

from declaration.c_tables import value_references, variable_table
from declaration.load import Declaration, load
from fmi2.model_description import model_description as fmi2_description
from fmi3.model_description import build_description, terminals_and_icons
from fmi3.model_description import model_description as fmi3_description
from program import Provenance, atomic_write, build_date, license_texts, program


def write_if_changed(path: Path, text: str) -> None:
    """Write a file unless it has this text already, so that nothing is rebuilt for it."""
    if not path.is_file() or path.read_bytes() != text.encode():
        with atomic_write(path) as temporary:
            temporary.write_bytes(text.encode())


def source_files(folder: Path) -> list[str]:
    """Return the names of the files that a source-code FMU is compiled from."""
    names = sorted(path.name for path in folder.glob("*.c"))
    if not names:
        raise FileNotFoundError(f"{folder}: has no C files")
    return names


def release_files(
    version: str, declaration: Declaration, provenance: Provenance, folder: Path
) -> dict[str, str]:
    """Texts by name for an FMU with sources, which are in the folder."""
    sources = source_files(folder)
    if version == "fmi2":
        return {"modelDescription.xml": fmi2_description(declaration, provenance, sources)}
    return {
        "modelDescription.xml": fmi3_description(declaration, provenance),
        "sources/buildDescription.xml": build_description(declaration.model.name, sources),
    }


@program()
def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("variables", type=Path, help="variables.toml of the model")
    parser.add_argument("--output", type=Path, required=True, help="folder for the files")
    parser.add_argument("--version", default="0.0.0", help="version of the project")
    parser.add_argument("--license", type=Path, help="LICENSE of the project")
    text = "folder of the FMU's C files: write only a description that names them"
    parser.add_argument("--sources", type=Path, help=text)
    text = "its version, with --sources"
    parser.add_argument("--fmi", choices=["fmi2", "fmi3"], default="fmi2", help=text)
    arguments = parser.parse_args()
    declaration = load(arguments.variables)
    texts = license_texts(arguments.license) if arguments.license else {}
    provenance = Provenance(arguments.version, **texts, date=build_date(os.environ))
    if arguments.sources:
        files = release_files(arguments.fmi, declaration, provenance, arguments.sources)
    else:
        files = {
            "modelDescription.xml": fmi2_description(declaration, provenance),
            "fmi3/modelDescription.xml": fmi3_description(declaration, provenance),
            "terminalsAndIcons.xml": terminals_and_icons(declaration),
            "value_references.h": value_references(declaration),
            "variables.c": variable_table(declaration),
        }
    for name, text in files.items():
        (arguments.output / name).parent.mkdir(parents=True, exist_ok=True)
        write_if_changed(arguments.output / name, text)


if __name__ == "__main__":
    sys.exit(main())
