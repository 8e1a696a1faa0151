"""The archives of a release as an installed package has them: in pieces, each once.

FMUs share most of their sources, and systems contain FMUs: archives are cut where the files in them
begin, and those of stored archives in them. `rparm.shipped` puts them together again.
"""

import hashlib
import json
import lzma
import zipfile
from itertools import pairwise
from pathlib import Path
from typing import IO

VERSIONS = {"2.0": "", "3.0": "fmi3"}  # of FMI, with the folder of the release


def write_pieces(release: Path, folder: Path) -> None:
    """Write `pieces` and `files.json.xz`: the bytes of all FMUs and systems, each piece once."""
    places: dict[bytes, tuple[int, int]] = {}
    files: dict[str, dict[str, object]] = {}
    with (folder / "pieces").open("wb") as stored:
        for version, below in VERSIONS.items():
            archives = (release / below).iterdir()
            for path in sorted(path for path in archives if path.suffix in (".fmu", ".ssp")):
                content = path.read_bytes()
                pieces = []
                cuts = sorted({0, *_beginnings(path, 0, content), len(content)})
                for first, last in pairwise(cuts):
                    piece = content[first:last]
                    if piece not in places:
                        places[piece] = (stored.tell(), len(piece))
                        stored.write(piece)
                    pieces.append(places[piece])
                digest = hashlib.sha256(content).hexdigest()
                files[f"{version}/{path.name}"] = {"sha256": digest, "pieces": pieces}
    (folder / "files.json.xz").write_bytes(lzma.compress(json.dumps(files).encode()))
    if not files:
        raise FileNotFoundError(f"{release}: has no FMU")


def _beginnings(archive: Path | IO[bytes], offset: int, content: bytes) -> list[int]:
    """Return where files of an archive begin, and files of stored archives in it."""
    cuts = []
    with zipfile.ZipFile(archive) as opened:
        for entry in opened.infolist():
            cuts.append(offset + entry.header_offset)
            if entry.compress_type == zipfile.ZIP_STORED and entry.filename.endswith(".fmu"):
                first = content.index(b"PK\x03\x04", offset + entry.header_offset + 4)
                with opened.open(entry) as inner:
                    cuts += _beginnings(inner, first, content)
        cuts.append(offset + opened.start_dir)
    return cuts
