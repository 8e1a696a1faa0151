"""The archives of a release as an installed package has them: in pieces, each once.

FMUs share most of their sources, and systems contain FMUs. Archives are cut at the begin of each
entry and of its content, also within stored archives. `rparm.shipped` joins the pieces again.
"""

import hashlib
import json
import lzma
import zipfile
from itertools import pairwise
from pathlib import Path
from typing import IO

VERSIONS = {"2.0": "", "3.0": "fmi3"}  # of FMI, with the folder of the release
BETWEEN = b"PK"  # begins all that zip writes in front of contents and behind them


def write_pieces(release: Path, folder: Path) -> None:
    """Write `pieces` and `files.json.xz`: the bytes of all FMUs and systems, each piece once."""
    numbers: dict[bytes, int] = {}
    files: dict[str, dict[str, object]] = {}
    for version, below in VERSIONS.items():
        archives = (release / below).iterdir()
        for path in sorted(path for path in archives if path.suffix in (".fmu", ".ssp")):
            content = path.read_bytes()
            cuts = pairwise(sorted({0, *_beginnings(path, 0, content), len(content)}))
            pieces = [numbers.setdefault(content[a:b], len(numbers)) for a, b in cuts]
            digest = hashlib.sha256(content).hexdigest()
            files[f"{version}/{path.name}"] = {"sha256": digest, "pieces": pieces}
    if not files:
        raise FileNotFoundError(f"{release}: has no FMU")
    stored, between, places = bytearray(), bytearray(), []
    for piece in numbers:
        part = between if piece.startswith(BETWEEN) else stored
        places.append((len(part) if part is between else ~len(part), len(piece)))
        part += piece
    (folder / "pieces").write_bytes(stored)
    listed = json.dumps({"files": files, "places": places, "between": between.hex()})
    (folder / "files.json.xz").write_bytes(lzma.compress(listed.encode()))


def _beginnings(archive: Path | IO[bytes], offset: int, content: bytes) -> list[int]:
    """Return where files of an archive begin, and files of stored archives in it."""
    cuts = []
    with zipfile.ZipFile(archive) as opened:
        for entry in opened.infolist():
            head = offset + entry.header_offset
            cuts += [head, head + zipfile.sizeFileHeader + len(entry.filename)]
            if entry.compress_type == zipfile.ZIP_STORED and entry.filename.endswith(".fmu"):
                with opened.open(entry) as inner:
                    cuts += _beginnings(inner, cuts[-1], content)
        cuts.append(offset + opened.start_dir)
    return cuts
