"""Style, scripts and the plotting library, once in a report for all its pages."""

import base64
import functools
import gzip
import re
from contextlib import suppress
from pathlib import Path

from rparm import project
from rparm.files import whole

FOLDER = "assets"  # in the report
SOURCES = Path(__file__).parent / "assets"
PLOTLY = "plotly.js"
TEMPLATE = "unpack.js"  # becomes PLOTLY


def write(report: Path) -> None:
    """Write the assets that a report does not have yet: all of them, or none if that fails."""
    folder = report / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    made: list[Path] = []
    try:
        for source in sorted(SOURCES.iterdir()):
            name, content = source.name, source.read_bytes()
            if name == TEMPLATE:
                name, content = PLOTLY, _plotly()
            target = folder / name
            if not target.is_file() or target.read_bytes() != content:
                with whole(target) as path:
                    path.write_bytes(content)
                made.append(target)
    except OSError:
        for target in made:
            target.unlink(missing_ok=True)
        with suppress(OSError):  # not empty
            folder.rmdir()
        raise


@functools.cache
def _plotly() -> bytes:
    """The library, compressed, in a script that unpacks it."""
    file = project.plotly_script()
    bundle = file.read_bytes()
    bundle = gzip.decompress(bundle) if file.suffix == ".gz" else bundle
    version = re.search(rb"plotly\.js v(\S+)", bundle[:200])
    assert version is not None
    packed = base64.b64encode(gzip.compress(bundle, mtime=0)).decode("ascii")
    script = (SOURCES / TEMPLATE).read_text(encoding="utf-8")
    return (
        script.replace("@VERSION@", version[1].decode("ascii"))
        .replace("@PACKED@", packed)
        .encode("utf-8")
    )
