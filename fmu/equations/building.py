"""Makes FMUs of a file with equations: compiles its C, links it to what is compiled once.

runtime.json (runtime.cmake) says with which compiler, options and objects.
"""

from __future__ import annotations

import json
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from declaration.c_tables import value_references, variable_table
from declaration.load import Declaration
from declaration.load import load as load_declaration
from document import document
from fmi2.model_description import model_description as fmi2_description
from fmi3.build_description import build_description
from fmi3.model_description import model_description as fmi3_description
from fmi3.terminals import terminals_and_icons
from package import pack
from provenance import Provenance
from source_code import Library, Manifest, collect, write

from equations import c_model, declaration, lock
from equations.model_file import ModelFile, ModelFileError

C_FILES = ("equations.c", "variables.c")
PLACES = {"fmi2": "", "fmi3": "fmi3"}  # below the folder of the output


@dataclass(frozen=True)
class Runtime:
    """What runtime.json says."""

    content: dict[str, Any]

    @classmethod
    def load(cls, path: Path) -> Runtime:
        """ModelFileError if the project has not been built."""
        try:
            return cls(json.loads(path.read_text(encoding="utf-8")))
        except (OSError, ValueError) as error:
            raise ModelFileError(
                f"{path}: cannot be used, build the project first: {error}"
            ) from None

    def listed(self, key: str) -> list[str]:
        """Options or paths."""
        return [item for item in self.content[key] if item]

    def compile(self, source: Path, folder: Path) -> Path:
        """The object of a source file."""
        target = source.with_suffix(".o")
        # what warnings are about, the user has not written
        options = [option for option in self.listed("options") if not option.startswith("-W")]
        folders = [f"-I{path}" for path in (folder, *self.listed("include"))]
        self.run(*options, f"-ffile-prefix-map={folder}=.", *folders, "-c", source, "-o", target)
        return target

    def link(self, version: str, objects: list[Path], target: Path) -> None:
        """The shared object of a version of FMI."""
        own = self.content["versions"][version]["objects"]
        parts = [*objects, *own, *self.listed("elementary"), *self.listed("libraries")]
        self.run("-shared", *self.listed("link"), *parts, "-o", target)

    def run(self, *arguments: object) -> None:
        """Run the compiler; ModelFileError if it fails."""
        command = [self.content["compiler"], *map(str, arguments)]
        try:
            ended = subprocess.run(command, capture_output=True, text=True, check=False)
        except OSError as error:
            raise ModelFileError(f"{command[0]}: cannot be run: {error.strerror}") from None
        if ended.returncode:
            lines = [line for line in ended.stderr.splitlines() if "error" in line]
            reason = (lines or ended.stderr.splitlines() or ["no message"])[0]
            raise ModelFileError(f"{command[0]}: {reason:.300}")


def write_c(file: ModelFile, references: dict[lock.Key, int], folder: Path) -> Declaration:
    """Write all files that the FMUs are made of; its declaration."""
    texts = {
        "equations.h": c_model.header(file),
        "equations.c": c_model.source(file),
        "variables.toml": declaration.variables_toml(file, references),
        "README.md": declaration.page(file),
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    declared = load_declaration(folder / "variables.toml")
    (folder / "variables.c").write_text(variable_table(declared), encoding="utf-8")
    (folder / "value_references.h").write_text(value_references(declared), encoding="utf-8")
    return declared


def build(
    file: ModelFile, references: dict[lock.Key, int], runtime: Runtime, work: Path, output: Path
) -> list[Path]:
    """Write the FMUs of both versions to the output, all else to the empty folder `work`."""
    declared = write_c(file, references, work)
    objects = [runtime.compile(work / name, work) for name in C_FILES]
    (work / "terminalsAndIcons.xml").write_text(terminals_and_icons(declared), encoding="utf-8")
    provenance = Provenance(runtime.content["version"])
    (work / "modelDescription.xml").write_text(fmi2_description(declared, provenance))
    document([work / "README.md"], work / "modelDescription.xml", work / "documentation")
    return [
        _pack(version, file, declared, provenance, runtime, objects, work, output / place)
        for version, place in PLACES.items()
    ]


def _pack(
    version: str,
    file: ModelFile,
    declared: Declaration,
    provenance: Provenance,
    runtime: Runtime,
    objects: list[Path],
    work: Path,
    output: Path,
) -> Path:
    folder = work / version
    folder.mkdir()
    library = folder / f"{file.name}{runtime.content['suffix']}"
    runtime.link(version, objects, library)
    _write_sources(version, runtime, work, folder / "sources")
    names = sorted(path.name for path in (folder / "sources").glob("*.c"))
    if version == "fmi2":
        description = fmi2_description(declared, provenance, names)
    else:
        description = fmi3_description(declared, provenance)
        (folder / "sources" / "buildDescription.xml").write_text(
            build_description(file.name, names), encoding="utf-8"
        )
    (folder / "modelDescription.xml").write_text(description, encoding="utf-8")
    entries = {
        "modelDescription.xml": folder / "modelDescription.xml",
        f"{runtime.content['versions'][version]['folder']}/{library.name}": library,
        f"resources/{file.name}.toml": work / "model.toml",
    }
    (work / "model.toml").write_text(file.text, encoding="utf-8")
    if version == "fmi3":
        entries["terminalsAndIcons/terminalsAndIcons.xml"] = work / "terminalsAndIcons.xml"
    licenses = {
        f"documentation/licenses/{name}": Path(path)
        for name, path in runtime.content["licenses"].items()
    }
    archive = output / f"{file.name}.fmu"
    files = _below(folder / "sources", "sources") | _below(work / "documentation", "documentation")
    pack(archive, entries | licenses | files)
    return archive


def _below(folder: Path, name: str) -> dict[str, Path]:
    paths = (path for path in folder.rglob("*") if path.is_file())
    return {f"{name}/{path.relative_to(folder).as_posix()}": path for path in paths}


def _write_sources(version: str, runtime: Runtime, work: Path, output: Path) -> None:
    """The folder sources/ of an FMU: all that its shared object consists of."""
    content = runtime.content
    entries = [content["versions"][version]["sources"], *content["sources"]]
    libraries = [
        Library(
            entry["name"],
            [Path(source) for source in entry["sources"]],
            [Path(folder) for folder in entry["include"] if folder],
            Path(entry["prelude"]) if entry["prelude"] else None,
        )
        for entry in entries
    ]
    include = [work, *map(Path, runtime.listed("include"))]
    own = Library("model", [work / name for name in C_FILES], include, None)
    roots = {name: Path(path) for name, path in content["roots"].items() if path}
    write(collect(Manifest([own, *libraries], roots | {"model": work})).texts, output)
