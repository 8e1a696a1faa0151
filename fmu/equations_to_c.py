"""Writes the C of a file with equations and the variables.toml of its FMU, for the project's build.

Value references are those of its lock file, which has to have all: `rparm build` writes it.
"""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from compiler.names import OF_VALUES
from compiler.read.header import Header
from compiler.read.include import source_of
from compiler.read.model_file import ModelFileError, read
from compiler.write import declaration, lock
from generate import write_if_changed
from program import program
from source_code import dependencies


def toml(declared: dict[str, Any]) -> str:
    """Return the text of a variables.toml."""
    lines = []
    for title, content in declared.items():
        tables = {title: content} if title in ("model", "experiment") else {}
        if title in ("units", "variables", "terminals"):
            tables = {f"{title}.{value_of_toml(name)}": table for name, table in content.items()}
        elif not tables:
            lines.append(f"{title} = {value_of_toml(content)}")
        for header, table in tables.items():
            lines += ["", f"[{header}]"]
            lines += [f"{key} = {value_of_toml(value)}" for key, value in table.items()]
    return "\n".join(lines) + "\n"


def value_of_toml(value: object) -> str:
    """A value of TOML: JSON's texts, lists and numbers are the same, but for one character."""
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, dict):
        pairs = (f"{value_of_toml(key)} = {value_of_toml(entry)}" for key, entry in value.items())
        return f"{{ {', '.join(pairs)} }}"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


@program(ModelFileError)
def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("file", type=Path, help="the file of the model")
    parser.add_argument("--output", type=Path, required=True, help="folder for the files")
    parser.add_argument("--depfile", type=Path, help="file for a rule of make: what was read")
    text = "write NAME_values.h only: structs of its variables, for C files"
    parser.add_argument("--header", action="store_true", help=text)
    arguments = parser.parse_args()
    if arguments.header:
        texts, files = _header(arguments.file)
    else:
        texts, files = _model(arguments.file)
    arguments.output.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        write_if_changed(arguments.output / name, text)
    if arguments.depfile:
        rules = [dependencies(str(arguments.output / name), files) for name in texts]
        arguments.depfile.write_text("".join(rules), encoding="utf-8")


def _header(path: Path) -> tuple[dict[str, str], list[Path]]:
    """Return the header of a file, by its name, and what was read."""
    source = source_of(path)
    return {f"{path.stem}{OF_VALUES}": Header(source).text()}, [s.path for s in source.all()]


def _model(path: Path) -> tuple[dict[str, str], list[Path]]:
    """Return the files of a model, by their names, and what was read."""
    file = read(path, declaration.solver_names())
    lock_file = lock.path_of(path)
    references = lock.references(lock_file, [])
    for name, kind in declaration.keys(file):
        if (name, kind) not in references:
            raise ModelFileError(f"{lock_file}: has no {name}: build the model by rparm build")
    texts = declaration.generated(file)
    texts["variables.toml"] = toml(declaration.declared(file, references))
    return texts, file.files


if __name__ == "__main__":
    sys.exit(main())
