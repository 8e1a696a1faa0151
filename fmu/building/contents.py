"""Makes what FMUs of a file with equations consist of: compiles its C, links it to the runtime."""

from __future__ import annotations

import os
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from declaration.c_tables import value_references, variable_table
from declaration.files import check
from declaration.load import Declaration, assemble
from document import document
from equations import declaration, lock
from equations.model_file import ModelFile
from fmi2.model_description import model_description as fmi2_description
from fmi3.model_description import terminals_and_icons
from generate import release_files
from program import Provenance
from source_code import Library, collect, write

from building.runtime import Runtime

C_FILES = ("equations.c", "variables.c")
PLACES = {"fmi2": "", "fmi3": "fmi3"}  # below the folder of the output


def write_c(file: ModelFile, references: dict[lock.Key, int], folder: Path) -> Declaration:
    """Write all files that the FMUs are made of; its declaration."""
    _write(folder, declaration.generated(file))
    declared = assemble(file.path, check(file.path, declaration.declared(file, references)))
    tables = {"variables.c": variable_table, "value_references.h": value_references}
    _write(folder, {name: table(declared) for name, table in tables.items()})
    return declared


def _write(folder: Path, texts: dict[str, str]) -> None:
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")


def build(
    file: ModelFile, references: dict[lock.Key, int], runtimes: list[Runtime], work: Path
) -> dict[str, list[tuple[str, Path]]]:
    """Make all that the FMUs consist of, in the empty folder `work`.

    What they contain, by the version of FMI: names in the archive, and files.
    """
    declared = write_c(file, references, work)
    provenance = Provenance(runtimes[0].content["version"])
    texts = {
        "model.toml": file.text,
        "terminalsAndIcons.xml": terminals_and_icons(declared),
        "modelDescription.xml": fmi2_description(declared, provenance),
    }
    _write(work, texts)
    document([work / "README.md"], work / "modelDescription.xml", work / "documentation")
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        libraries = list(pool.map(lambda runtime: _libraries(file.name, runtime, work), runtimes))
    entries = {}
    for version in PLACES:
        folder = work / version
        folder.mkdir()
        _write_sources(version, runtimes[0], work, folder / "sources")
        _write(folder, release_files(version, declared, provenance, folder / "sources"))
        entries[version] = [
            *(built[version] for built in libraries),
            (f"resources/{file.name}.toml", work / "model.toml"),
            *_below(folder, ""),
            *_below(work / "documentation", "documentation/"),
            *_licenses(runtimes),
        ]
    terminals = work / "terminalsAndIcons.xml"
    entries["fmi3"].append((f"terminalsAndIcons/{terminals.name}", terminals))
    return entries


def _libraries(name: str, runtime: Runtime, work: Path) -> dict[str, tuple[str, Path]]:
    """The shared object for one platform, by the version of FMI, with its name in the archive."""
    folder = work / runtime.content["platform"]
    folder.mkdir()
    objects = runtime.compile([work / source for source in C_FILES], folder)
    built = {}
    for version in PLACES:
        library = folder / f"{name}{runtime.content['suffix']}"
        runtime.link(version, objects, library)
        kept = library.rename(folder / f"{version}{library.suffix}")
        built[version] = (f"{runtime.content['versions'][version]['folder']}/{library.name}", kept)
    return built


def _write_sources(version: str, runtime: Runtime, work: Path, output: Path) -> None:
    """The folder sources/ of an FMU: all that its shared object consists of."""
    own = Library("model", [work / name for name in C_FILES], [work], None)
    write(collect(runtime.sources(version, own, work)).texts, output)


def _licenses(runtimes: list[Runtime]) -> Iterable[tuple[str, Path]]:
    found = {
        f"documentation/licenses/{name}": runtime.folder / path
        for runtime in runtimes
        for name, path in runtime.content["licenses"].items()
    }
    return found.items()


def _below(folder: Path, name: str) -> list[tuple[str, Path]]:
    paths = (path for path in folder.rglob("*") if path.is_file())
    return [(f"{name}{path.relative_to(folder).as_posix()}", path) for path in paths]
