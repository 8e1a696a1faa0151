"""Packs all that is built for each platform but the FMUs, for an installed package: built.tar.xz.

PLATFORM.json        runtime.json of the platform (runtime.cmake), with paths that begin here
PLATFORM/            the objects and libraries it names
project/, musl/ ...  the sources it names, the same for all, and all that these include
playground/          the page for a browser
"""

import argparse
import io
import json
import lzma
import re
import sys
import tarfile
from collections.abc import Iterable
from pathlib import Path

from program import atomic_write, program
from source_code import SourceFolder, manifest


def collect(build: Path) -> dict[str, bytes]:
    """Return names and contents for the platform that this folder has been built for."""
    file = build / "runtime" / "runtime.json"
    text = file.read_text(encoding="utf-8")
    content = json.loads(text)
    platform = content["platform"]
    roots = {name: folder for name, folder in content["roots"].items() if folder}
    names = {folder: name for name, folder in roots.items()} | {roots["generated"]: platform}

    def named(path: str | Path) -> str:
        return re.sub(f"({found})(?=/)", lambda root: names[root[1]], str(path), count=1)

    # of a folder and one inside it, the inner one comes first
    found = "|".join(map(re.escape, sorted(names, key=len, reverse=True)))
    versions = content["versions"].values()
    entries = [*(version["sources"] for version in versions), *content["sources"]]
    sources = SourceFolder({name: Path(folder) for name, folder in roots.items()})
    libraries = manifest(entries, roots, build).libraries
    for library in libraries:
        sources.add_library(library)
    # some are for generated models only
    for header in sorted(Path(roots["project"], "src", "model").glob("*.h")):
        sources.add_header(header, libraries[-1])
    objects = [path for version in versions for path in version["objects"]]
    files = [*sources.origins.values(), *objects, *content["libraries"]]
    files += content["licenses"].values()
    content["compiler"][0] = Path(content["compiler"][0]).stem
    content["options"] = [o for o in content["options"] if not o.startswith("-ffile-prefix-map")]
    relative = re.sub(
        f'"({found})(?=[/"])', lambda root: f'"{names[root[1]]}', json.dumps(content, indent=0)
    )
    return {f"{platform}.json": relative.encode()} | {
        named(path): Path(path).read_bytes() for path in files
    }


def packed(files: Iterable[tuple[str, bytes]]) -> bytes:
    """The archive; its bytes depend on these names and contents only."""
    archive = io.BytesIO()
    with tarfile.open(fileobj=archive, mode="w") as target:
        for name, content in sorted(files):
            info = tarfile.TarInfo(name)
            info.size = len(content)
            target.addfile(info, io.BytesIO(content))
    return lzma.compress(archive.getvalue(), preset=9 | lzma.PRESET_EXTREME)


@program(ValueError)
def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("builds", type=Path, nargs="+", help="folder of a build for each platform")
    parser.add_argument("--page", type=Path, required=True, help="the playground")
    parser.add_argument("--output", type=Path, required=True, help="the archive")
    arguments = parser.parse_args()
    files = {"playground/index.html": arguments.page.read_bytes()}
    for build in arguments.builds:
        files |= collect(build)
    with atomic_write(arguments.output) as temporary:
        temporary.write_bytes(packed(files.items()))


if __name__ == "__main__":
    sys.exit(main())
