"""What FMUs of own equations are linked with, and the compiler that does it.

runtime.json says what there is (runtime.cmake). Paths in it begin at its folder.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from equations_file.tables import ModelFileError
from source_code import Library, Manifest, manifest

SYSTEM_COMPILERS = ("gcc", "clang")
INSTALL = 'pip install "rparm[build]" installs zig'


@dataclass(frozen=True)
class Runtime:
    """A runtime.json."""

    content: dict[str, Any]
    folder: Path
    compiler: list[str]  # the words that start it

    @classmethod
    def load(cls, path: Path, of_this_machine: bool) -> Runtime:
        """ModelFileError if it is not there, or no compiler for it.

        For this machine, a compiler of its own comes before zig.
        """
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise ModelFileError(f"{path}: cannot be used: {error}") from None
        return cls(content, path.resolve().parent, _found(content["compiler"], of_this_machine))

    def paths(self, listed: list[str]) -> list[Path]:
        """Files or folders of a list in runtime.json."""
        return [self.folder / item for item in listed if item]

    def compile(self, sources: list[Path], work: Path) -> list[Path]:
        """The objects of source files, in the folder `work`."""
        # what warnings are about, the user has not written
        options = [o for o in self.content["options"] if o and not o.startswith("-W")]
        folders = [f"-I{path}" for path in self.paths(self.content["include"])]
        objects = []
        for source in sources:
            objects.append(work / f"{source.stem}.o")
            here = os.path.relpath(source, work)  # no folder's name gets into the object
            self.run(work, *options, *folders, "-c", here, "-o", objects[-1].name)
        return objects

    def link(self, version: str, objects: list[Path], target: Path) -> None:
        """The shared object of a version of FMI, in the folder of the objects."""
        options = [option.replace("@NAME@", target.stem) for option in self.content["link"]]
        parts = [*self.content["versions"][version]["objects"], *self.content["libraries"]]
        own = [path.name for path in objects]
        self.run(target.parent, *own, *self.paths(parts), *options, "-o", target.name)

    def run(self, folder: Path, *arguments: object) -> None:
        """Run the compiler in a folder; ModelFileError if it fails."""
        command = [*self.compiler, *map(str, arguments)]
        environment = os.environ | {"ZIG_LOCAL_CACHE_DIR": str(folder / "zig")}
        try:
            ended = subprocess.run(
                command,
                cwd=folder,
                env=environment,
                capture_output=True,
                encoding="utf-8",
                errors="replace",
                check=False,
            )
        except OSError as error:
            raise ModelFileError(
                f"{command[0]}: cannot be run: {error.strerror}; {INSTALL}"
            ) from None
        if ended.returncode:
            lines = [line for line in ended.stderr.splitlines() if "error" in line]
            reason = (lines or ended.stderr.splitlines() or ["no message"])[0]
            # the C is right: what fails is the compiler
            raise ModelFileError(
                f"{command[0]}: {reason:.300}; gcc and clang need binutils, {INSTALL}"
            )

    def sources(self, version: str, own: Library, root: Path) -> Manifest:
        """All that the shared object of a version consists of, with the model's own part."""
        content = self.content
        entries = [content["versions"][version]["sources"], *content["sources"]]
        shared = manifest(entries, content["roots"], self.folder)
        include = [*own.include, *self.paths(content["include"])]
        model = Library(own.name, own.sources, include, own.prelude)
        return Manifest([model, *shared.libraries], shared.roots | {own.name: root})


def _found(words: list[str], of_this_machine: bool) -> list[str]:
    """A compiler as runtime.json names it, or one of this machine, else zig."""
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
