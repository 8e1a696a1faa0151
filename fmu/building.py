"""Makes FMUs of a file with equations, outside CMake: generates, compiles, links to the runtime.

runtime.json says what there is to link (runtime.cmake). Paths in it begin at its folder.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from compiler.interface import Declaration
from compiler.names import OF_VALUES
from compiler.read.components import all_parts
from compiler.read.content import ModelFileError
from compiler.read.model_file import ModelFile
from compiler.write import declaration, lock
from compiler.write.c_tables import value_references, variable_table
from document import document
from fmi2.model_description import model_description as fmi2_description
from fmi3.model_description import terminals_and_icons
from generate import release_files
from program import Provenance
from source_code import Library, Manifest, collect, manifest, write

C_FILES = ("equations.c", "variables.c")
PLACES = {"fmi2": "", "fmi3": "fmi3"}  # below the folder of the output
SYSTEM_COMPILERS = ("gcc", "clang")
# bytes of C that a compiler optimizes with less time, and with much less
LONG, LONGER = 200_000, 1_000_000
INSTALL = 'pip install "rparm[build]" installs zig'


@dataclass(frozen=True)
class HookFiles:
    """C files beside a file with equations, with the headers that are made for them."""

    sources: list[Path]
    include: list[Path]
    root: Path | None  # folder of all that they include

    @classmethod
    def of(cls, file: ModelFile, work: Path) -> HookFiles:
        """Write the headers of a file with a hook; without one there is nothing."""
        if file.hook is None:
            return cls([], [], None)
        folder = file.path.resolve().parent
        headers = {header.folder.resolve(): header for header in file.header.all()}
        root = Path(os.path.commonpath([*headers, *(p.resolve().parent for p in file.files)]))
        for place, header in headers.items():
            made = work / "made" / place.relative_to(root)
            made.mkdir(parents=True, exist_ok=True)
            _write(made, {header.stem + OF_VALUES: header.text()})
        include = [work / "made" / place.relative_to(root) for place in headers]
        return cls([folder / name for name in file.hook.sources], [folder, *include], root)


def write_c(file: ModelFile, references: dict[lock.Key, int], folder: Path) -> Declaration:
    """Write all files that the FMUs are made of; its declaration."""
    _write(folder, declaration.generated(file))
    declared = declaration.declared(file, references)
    tables = {"variables.c": variable_table, "value_references.h": value_references}
    _write(folder, {name: table(declared) for name, table in tables.items()})
    return declared


def _write(folder: Path, texts: dict[str, str]) -> None:
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")


def build(
    file: ModelFile, references: dict[lock.Key, int], runtimes: list[Runtime], work: Path
) -> dict[str, list[tuple[str, Path]]]:
    """Make all parts of the FMUs in the empty folder `work`; names and files by version of FMI."""
    declared = write_c(file, references, work)
    provenance = Provenance(runtimes[0].content["version"])
    texts = {
        "model.toml": file.text,
        "terminalsAndIcons.xml": terminals_and_icons(declared),
        "modelDescription.xml": fmi2_description(declared, provenance),
    }
    _write(work, texts)
    document([work / "README.md"], work / "modelDescription.xml", work / "documentation")
    hook = HookFiles.of(file, work)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        libraries = list(pool.map(lambda one: _libraries(file.name, one, work, hook), runtimes))
    entries = {}
    for version in PLACES:
        folder = work / version
        folder.mkdir()
        _write_sources(version, runtimes[0], work, hook, folder / "sources")
        _write(folder, release_files(version, declared, provenance, folder / "sources"))
        entries[version] = [
            *(built[version] for built in libraries),
            (f"resources/{file.name}.toml", work / "model.toml"),
            *_component_texts(file),
            *_below(folder, ""),
            *_below(work / "documentation", "documentation/"),
            *_licenses(runtimes),
        ]
    terminals = work / "terminalsAndIcons.xml"
    entries["fmi3"].append((f"terminalsAndIcons/{terminals.name}", terminals))
    return entries


def _component_texts(file: ModelFile) -> Iterable[tuple[str, Path]]:
    """Return the files that components are made of, by their places in an FMU."""
    paths = dict.fromkeys(part.path for _, part in all_parts(file))
    names = Counter(path.name for path in paths)
    for number, path in enumerate(paths, 1):
        folder = f"{number}/" if names[path.name] > 1 else ""
        yield f"resources/components/{folder}{path.name}", path


def _libraries(
    name: str, runtime: Runtime, work: Path, hook: HookFiles
) -> dict[str, tuple[str, Path]]:
    """Link the shared object for one platform; return name and file by the version of FMI."""
    folder = work / runtime.content["platform"]
    folder.mkdir()
    sources = [*(work / source for source in C_FILES), *hook.sources]
    objects = runtime.compile(sources, folder, hook.include)
    file = f"{name}{runtime.content['suffix']}"
    for version in PLACES:
        (folder / version).mkdir()
    with ThreadPoolExecutor(len(PLACES)) as pool:
        [*pool.map(lambda version: runtime.link(version, objects, folder / version / file), PLACES)]
    places = {version: runtime.content["versions"][version]["folder"] for version in PLACES}
    return {x: (f"{place}/{file}", folder / x / file) for x, place in places.items()}


def _write_sources(
    version: str, runtime: Runtime, work: Path, hook: HookFiles, output: Path
) -> None:
    """Write the folder sources/ of an FMU: all that its shared object consists of."""
    sources = [*(work / name for name in C_FILES), *hook.sources]
    own = Library("model", sources, [work, *hook.include], None)
    roots = {own.name: work} | ({"hook": hook.root} if hook.root else {})
    write(collect(runtime.sources(version, own, roots)).texts, output)


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


@dataclass(frozen=True)
class Runtime:
    """A runtime.json."""

    content: dict[str, Any]
    folder: Path
    compiler: list[str]  # the words that start it

    @classmethod
    def load(cls, path: Path, of_this_machine: bool) -> Runtime:
        """Load runtime.json; ModelFileError without it or a compiler: gcc and clang before zig."""
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise ModelFileError(f"{path}: cannot be used: {error}") from None
        return cls(content, path.resolve().parent, _found(content["compiler"], of_this_machine))

    def paths(self, listed: list[str]) -> list[Path]:
        """Return the files or folders of a list in runtime.json."""
        return [self.folder / item for item in listed if item]

    def compile(self, sources: list[Path], work: Path, include: Iterable[Path] = ()) -> list[Path]:
        """Compile source files in the folder `work`, all at once; return their objects."""
        # what warnings are about, the user has not written
        options = [o for o in self.content["options"] if o and not o.startswith("-W")]
        options = [str(self.folder / o) if o.endswith(".h") else o for o in options]
        own = [os.path.relpath(path, work) for path in include]
        folders = [f"-I{path}" for path in (*own, *self.paths(self.content["include"]))]

        def compiled(source: Path) -> Path:
            here = os.path.relpath(source, work)  # no folder's name gets into the object
            size = source.stat().st_size
            long = [*filter(None, self.content["long"] if size > LONG else [])]
            long += ["-O1"] * (size > LONGER)
            self.run(work, *options, *long, *folders, "-c", here, "-o", f"{source.stem}.o")
            return work / f"{source.stem}.o"

        with ThreadPoolExecutor(len(sources)) as pool:
            return [*pool.map(compiled, sources)]

    def link(self, version: str, objects: list[Path], target: Path) -> None:
        """Link the shared object of a version of FMI."""
        options = [option.replace("@NAME@", target.stem) for option in self.content["link"]]
        parts = [*self.content["versions"][version]["objects"], *self.content["libraries"]]
        own = [os.path.relpath(path, target.parent) for path in objects]
        self.run(target.parent, *own, *self.paths(parts), *options, "-o", target.name)

    def run(self, folder: Path, *arguments: object) -> None:
        """Run the compiler in a folder; ModelFileError if it fails."""
        command = [*self.compiler, *map(str, arguments)]
        environment = os.environ | {"ZIG_LOCAL_CACHE_DIR": str(folder / "zig")}
        try:
            text = {"capture_output": True, "encoding": "utf-8", "errors": "replace"}
            ended = subprocess.run(command, cwd=folder, env=environment, check=False, **text)
        except OSError as error:
            why = f"{error.strerror}; {INSTALL}"
            raise ModelFileError(f"{command[0]}: cannot be run: {why}") from None
        if ended.returncode:
            raise ModelFileError(f"{command[0]}: {_reason(ended.stderr)}")

    def sources(self, version: str, own: Library, roots: dict[str, Path]) -> Manifest:
        """Return all sources of a version's shared object, with the model's own part."""
        content = self.content
        entries = [content["versions"][version]["sources"], *content["sources"]]
        shared = manifest(entries, content["roots"], self.folder)
        include = [*own.include, *self.paths(content["include"])]
        model = Library(own.name, own.sources, include, own.prelude)
        return Manifest([model, *shared.libraries], roots | shared.roots)


def _reason(text: str) -> str:
    """Return the line of a compiler or linker that says what is wrong, and the way out."""
    lines = text.splitlines() or ["no message"]
    of_linker = [x for x in lines if re.search(r"undefined (reference|symbol)|multiple def", x)]
    reason = [*of_linker, *(line for line in lines if "error" in line), *lines][0]
    place = re.search(r"([^/\\]*):\d+:\d+: (fatal )?error: ", reason)
    is_own = place is not None and place[1] in C_FILES
    if is_own and not place[2]:
        return f"{reason:.300}; the C that rparm wrote is wrong: please report this with the file"
    if of_linker or (place and not is_own):
        return f"{reason:.300}; the sources of [hook] are to be mended"
    # mostly the C is right: what fails is the compiler
    return f"{reason:.300}; gcc and clang need binutils, {INSTALL}"


def _found(words: list[str], of_this_machine: bool) -> list[str]:
    """Return a compiler as runtime.json names it, or one of this machine, else zig."""
    if Path(words[0]).is_absolute() and shutil.which(words[0]):
        return words
    if of_this_machine:
        for name in SYSTEM_COMPILERS:
            command = shutil.which(name)
            if command is not None:
                return [command]
    options = words[1:] if Path(words[0]).stem == "zig" else ["cc"]
    package = find_spec("ziglang")
    if package is not None and package.origin is not None:
        zig = Path(package.origin).with_name("zig.exe" if sys.platform == "win32" else "zig")
        return [str(zig), *options]
    command = shutil.which("zig")
    if command is None:
        compilers = "gcc, clang or zig" if of_this_machine else "zig"
        raise ModelFileError(f"{compilers}: not installed, {INSTALL}")
    return [command, *options]
