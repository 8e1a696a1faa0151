"""Writes the folder sources/ of an FMU, which C compilers build without further options.

The build writes a manifest (source_code.cmake): the libraries in the FMU with their files, and the
folders that these come from. In sources/ lie the C files, in folders below it the headers that they
need. They differ from the originals in their includes, which are relative: no folder is searched.
Files of SUNDIALS keep the comment with their copyright only: the others are a third of their size.

The functions of musl get other names. Compilers know the standard ones and calculate some of them
in their own way, and a program that links the FMU statically has them already.
"""

import argparse
import functools
import json
import os
import posixpath
import re
import shutil
import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from program import WrongInputError, program

# of the root `project`: in front of all files
PRELUDE = Path("fmu", "source_code.h")
PLATFORM = Path("src", "model", "platform.h")

# the library whose functions get other names, and the header with these
ELEMENTARY = "elementary_functions"
RENAMES = "generated/elementary_functions.h"

# nothing that they define is used; the first two are not on every system
NOT_NEEDED = {"endian.h", "features.h", "sunmatrix/sunmatrix_sparse.h"}
# every importer has them, and an FMU does without (FMI 2.0, section 2.3; FMI 3.0, section 2.5)
OF_IMPORTERS = {"fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"}
OF_IMPORTERS |= {"fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"}
# behind conditions that never hold: options of SUNDIALS, and C++
NOT_REACHED = {"caliper/cali.h", "mpi.h", "sundials/sundials_context.hpp"}

# most of the sources, and read in the original by who needs its comments
WITHOUT_COMMENTS = {"sundials"}

# a comment, or a string or character, in which there is none
COMMENT_OR_LITERAL = re.compile(
    r"""/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*'""", re.DOTALL
)
COPYRIGHT = re.compile(r"copyright|licen[sc]e", re.IGNORECASE)
COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
WORD = re.compile(r"\b\w++(?=\s*+\(|\.h\")")  # called, or in a header's name: log_data.h
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*([<"])([^>"\n]+)[>"]', re.MULTILINE)


@dataclass(frozen=True)
class Library:
    """A static library of the build, or the shared object itself."""

    name: str
    sources: list[Path]
    include: list[Path]  # folders, in the order in which they are searched
    prelude: Path | None  # header in front of each file


@dataclass(frozen=True)
class Manifest:
    """What is in an FMU, and the folders that its files come from, by their names in sources/."""

    libraries: list[Library]
    roots: dict[str, Path]


@dataclass(frozen=True)
class Include:
    """One directive, at [start, end) of a text."""

    start: int
    end: int
    is_quoted: bool
    name: str


# FMUs of two versions have most of their files from the same texts
@functools.cache
def includes(text: str) -> list[Include]:
    """Return directives that are not in a comment."""
    code = COMMENT.sub(lambda comment: re.sub(r"[^\n]", " ", comment[0]), text)
    lines = INCLUDE.finditer(code)
    return [Include(line.start(), line.end(), line[1] == '"', line[2]) for line in lines]


@functools.cache
def words_of(text: str) -> frozenset[str]:
    """Return names of functions and headers that are not in a comment."""
    return frozenset(WORD.findall(COMMENT.sub("", text)))


@functools.cache
def without_comments(text: str) -> str:
    """Text whose comments are spaces, but those about its copyright."""

    def kept(found: re.Match[str]) -> str:
        is_comment = found[0].startswith(("/*", "//"))
        return " " if is_comment and not COPYRIGHT.search(found[0]) else found[0]

    text = re.sub(r"[ \t]+$", "", COMMENT_OR_LITERAL.sub(kept, text), flags=re.MULTILINE)
    return re.sub(r"\n{3,}", "\n\n", text)


def read(path: Path) -> str:
    """Return the text of a file in any encoding."""
    try:
        return path.read_bytes().decode("utf-8", "surrogateescape")
    except OSError as error:
        raise WrongInputError(f"{path}: cannot be read: {error.strerror}") from None


class SourceFolder:
    """The files of sources/: their texts by name."""

    def __init__(self, roots: dict[str, Path]) -> None:
        # of a folder and one inside it, the inner one comes first
        self.roots = sorted(roots.items(), key=lambda root: -len(root[1].parts))
        self.texts: dict[str, str] = {}
        self.origins: dict[str, Path] = {}
        prelude, platform = (roots["project"] / path for path in (PRELUDE, PLATFORM))
        self.system_headers = {
            line.name for path in (prelude, platform) for line in includes(read(path))
        }
        self.prelude = self.add_header(prelude, Library("", [], [platform.parent], None))

    def add_library(self, library: Library) -> None:
        """Add the files of a library, each behind its preludes."""
        preludes = [self.prelude, RENAMES]
        if library.prelude is not None:
            preludes.append(self.add_header(library.prelude, library))
        lines = "".join(f'#include "{name}"\n' for name in preludes)
        for source in library.sources:
            name = self.source_name(source)
            self.claim(name, source)
            self.texts[name] = lines + self.with_relative_includes(source, name, library)

    def add_renames(self, sources: list[Path]) -> None:
        """Add the header with the other names of the functions that these files define."""
        lines = ["/* Functions of musl, by other names than the standard ones. */\n"]
        for source in sources:
            function = source.stem
            if function.startswith("__") or function.endswith("_data"):
                continue
            pattern = rf"^[a-z]+ {function}(\([^)]*\))\s*\{{"
            definition = re.search(pattern, read(source), re.MULTILINE)
            if definition is None:
                raise WrongInputError(f"{source}: does not define {function}")
            head = definition[0].rstrip("{ \t\n")
            lines.append(f"#define {function} fmu_{function}\n{head};\n")
        self.texts[RENAMES] = "".join(lines)

    def add_header(self, header: Path, library: Library) -> str:
        """Add a header and all that it includes; its name."""
        root, below = self.root_of(header)
        name = f"{root}/{below}"
        self.claim(name, header)
        if name not in self.texts:
            self.texts[name] = ""  # headers may include each other
            self.texts[name] = self.with_relative_includes(header, name, library)
        return name

    def source_name(self, source: Path) -> str:
        """Of a foreign file with its root, which says where it is from: musl_sin.c."""
        root, _ = self.root_of(source)
        if root == "project" or source.name.startswith(f"{root}_"):
            return source.name
        return f"{root}_{source.name}"

    def root_of(self, path: Path) -> tuple[str, str]:
        """Return the name of the root that a file is from, and its path below."""
        for name, folder in self.roots:
            if path.is_relative_to(folder):
                return name, path.relative_to(folder).as_posix()
        raise WrongInputError(f"{path}: is in no folder of the manifest")

    def claim(self, name: str, origin: Path) -> None:
        """Refuse two files of one name; upper and lower case are the same on some systems."""
        other = self.origins.setdefault(name.lower(), origin)
        if other != origin:
            raise WrongInputError(f"{origin}: would be sources/{name}, as {other}")

    def with_relative_includes(self, path: Path, name: str, library: Library) -> str:
        """Return the text of a file that is called `name` in sources/."""
        text = read(path)
        if self.root_of(path)[0] in WITHOUT_COMMENTS:
            text = without_comments(text)
        parts = []
        end = 0
        for line in includes(text):
            parts += [text[end : line.start], self.directive(line, text, path, name, library)]
            end = line.end
        return "".join([*parts, text[end:]])

    def directive(self, line: Include, text: str, path: Path, name: str, library: Library) -> str:
        """What stands in sources/ instead of an include."""
        as_it_is = text[line.start : line.end]
        if line.name in NOT_NEEDED:
            return ""
        if line.name in NOT_REACHED | OF_IMPORTERS:
            return as_it_is
        searched = [path.parent, *library.include] if line.is_quoted else library.include
        for folder in searched:
            header = Path(os.path.normpath(folder / line.name))
            if header.is_file():
                included = self.add_header(header, library)
                return f'#include "{posixpath.relpath(included, posixpath.dirname(name))}"'
        if not line.is_quoted and line.name in self.system_headers:
            return as_it_is
        number = text.count("\n", 0, line.start) + 1
        raise WrongInputError(f"{path}:{number}: header {line.name} was not found")


def load(path: Path) -> Manifest:
    """Return the manifest that the build wrote."""
    try:
        content = json.loads(read(path))
        return manifest(content["libraries"], content["roots"], path.parent)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise WrongInputError(f"{path}: is not a manifest: {error!r:.200}") from None


def manifest(entries: list[dict[str, Any]], roots: dict[str, str], folder: Path) -> Manifest:
    """Libraries and roots of a file of JSON in this folder, which relative paths begin at."""
    libraries = [
        Library(
            entry["name"],
            [folder / source for source in entry["sources"]],
            [folder / include for include in entry["include"] if include],
            folder / entry["prelude"] if entry["prelude"] else None,
        )
        for entry in entries
    ]
    return Manifest(libraries, {name: folder / root for name, root in roots.items() if root})


def collect(manifest: Manifest) -> SourceFolder:
    folder = SourceFolder(manifest.roots)
    elementary = [library for library in manifest.libraries if library.name == ELEMENTARY]
    if not elementary:
        raise WrongInputError(f"the manifest has no library {ELEMENTARY}")
    for library in manifest.libraries:
        if library.name != ELEMENTARY:
            folder.add_library(library)
    for library in elementary:
        sources = named_in(folder.texts.values(), library.sources)
        folder.add_library(replace(library, sources=sources))
        folder.add_renames(sources)
    return folder


def named_in(texts: Iterable[str], sources: list[Path]) -> list[Path]:
    """Those of the sources that the texts need, by the names of functions and of data."""
    left = {source.stem: source for source in sources}
    todo = list(texts)
    while todo:
        todo += [read(left.pop(name)) for name in words_of(todo.pop()) & left.keys()]
    return [source for source in sources if source.stem not in left]


def write(texts: dict[str, str], output: Path) -> None:
    """Write a folder that has these files and no others."""
    temporary = output.with_name(f".{os.getpid()}.{output.name}")
    try:
        for name, text in texts.items():
            path = temporary / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(text.encode("utf-8", "surrogateescape"))
        shutil.rmtree(output, ignore_errors=True)
        temporary.replace(output)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def dependencies(target: str, files: list[Path]) -> str:
    """Rule of make: the target is made again when one of the files has changed."""
    names = [str(file).replace(" ", "\\ ") for file in files]
    return f"{target}:" + "".join(f" \\\n  {name}" for name in sorted(names)) + "\n"


@program()
def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("manifest", type=Path, help="what the FMU is built from, as JSON")
    parser.add_argument("--output", type=Path, required=True, help="the folder sources/")
    parser.add_argument("--depfile", type=Path, help="file for a rule of make: what was read")
    parser.add_argument("--target", help="target of this rule")
    arguments = parser.parse_args()
    folder = collect(load(arguments.manifest))
    write(folder.texts, arguments.output)
    if arguments.depfile:
        rule = dependencies(arguments.target, list(folder.origins.values()))
        arguments.depfile.write_text(rule)


if __name__ == "__main__":
    sys.exit(main())
