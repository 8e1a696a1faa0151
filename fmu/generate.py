"""Writes what an FMU is made of from the file of its model: C, XML files and the page.

Value references are those of its lock file, which has to have all: `rparm build` writes it.
"""

import argparse
import os
import sys
from pathlib import Path

from compiler.interface import Declaration
from compiler.names import OF_VALUES
from compiler.read import by_hand, model_file
from compiler.read.content import ModelFile, ModelFileError
from compiler.read.header import Header
from compiler.read.include import source_of
from compiler.write import declaration, lock
from compiler.write.c_tables import value_references, variable_table
from fmi2.model_description import model_description as fmi2_description
from fmi3.model_description import build_description, terminals_and_icons
from fmi3.model_description import model_description as fmi3_description
from program import Provenance, build_date, license_texts, program, write_if_changed
from source_code import dependencies


def source_files(folder: Path) -> list[str]:
    """Return the names of the files that a source-code FMU is compiled from."""
    names = sorted(path.name for path in folder.glob("*.c"))
    if not names:
        raise FileNotFoundError(f"{folder}: has no C files")
    return names


def release_files(
    version: str, declared: Declaration, provenance: Provenance, folder: Path
) -> dict[str, str]:
    """Texts by name for an FMU with sources, which are in the folder."""
    sources = source_files(folder)
    if version == "fmi2":
        return {"modelDescription.xml": fmi2_description(declared, provenance, sources)}
    return {
        "modelDescription.xml": fmi3_description(declared, provenance),
        "sources/buildDescription.xml": build_description(declared.name, sources),
    }


@program(ModelFileError)
def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("file", type=Path, help="the file of the model")
    parser.add_argument("--output", type=Path, required=True, help="folder for the files")
    parser.add_argument("--depfile", type=Path, help="file for a rule of make: what was read")
    text = "the file has no equations: NAME.h beside it declares the model by hand"
    parser.add_argument("--by-hand", action="store_true", help=text)
    text = "write NAME_values.h only: structs of its variables, for C files"
    parser.add_argument("--header", action="store_true", help=text)
    parser.add_argument("--icon", type=Path, help="picture of the model")
    parser.add_argument("--version", default="0.0.0", help="version of the project")
    parser.add_argument("--license", type=Path, help="LICENSE of the project")
    text = "folder of the FMU's C files: write only a description that names them"
    parser.add_argument("--sources", type=Path, help=text)
    text = "its version, with --sources"
    parser.add_argument("--fmi", choices=["fmi2", "fmi3"], default="fmi2", help=text)
    arguments = parser.parse_args()
    if arguments.header:
        source = source_of(arguments.file)
        texts = {f"{arguments.file.stem}{OF_VALUES}": Header(source).text()}
        files = [each.path for each in source.all()]
    else:
        texts, files = _model(arguments)
    for name, text in texts.items():
        (arguments.output / name).parent.mkdir(parents=True, exist_ok=True)
        write_if_changed(arguments.output / name, text)
    if arguments.depfile:
        rules = [dependencies(str(arguments.output / name), files) for name in texts]
        arguments.depfile.write_text("".join(rules), encoding="utf-8")


def _model(arguments: argparse.Namespace) -> tuple[dict[str, str], list[Path]]:
    """Return the texts of the files of a model, by names, and the files that were read."""
    file = (by_hand if arguments.by_hand else model_file).read(arguments.file)
    texts = _texts(_declared(file), arguments)
    if not (arguments.sources or arguments.by_hand):
        texts |= declaration.generated(file)
    return texts, file.files


def _texts(declared: Declaration, arguments: argparse.Namespace) -> dict[str, str]:
    """Return the texts of the interface's files, or of those that --sources is about, by names."""
    texts = license_texts(arguments.license) if arguments.license else {}
    provenance = Provenance(arguments.version, **texts, date=build_date(os.environ))
    if arguments.sources:
        return release_files(arguments.fmi, declared, provenance, arguments.sources)
    return {
        "modelDescription.xml": fmi2_description(declared, provenance),
        "fmi3/modelDescription.xml": fmi3_description(declared, provenance),
        "terminalsAndIcons.xml": terminals_and_icons(declared, arguments.icon),
        "value_references.h": value_references(declared),
        "variables.c": variable_table(declared),
    }


def _declared(file: ModelFile) -> Declaration:
    """Return the declaration of a model with the value references of its lock file."""
    lock_file = lock.path_of(file.path)
    references = lock.references(lock_file, [])
    for name, kind in declaration.keys(file):
        if (name, kind) not in references:
            what_to_do = "give it a value" if file.is_by_hand else "build the model by rparm build"
            raise ModelFileError(f"{lock_file}: has no {name}: {what_to_do}")
    return declaration.declared(file, references)


if __name__ == "__main__":
    sys.exit(main())
