"""Copies of SSPs and FMUs with something in them changed."""

import io
import re
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.support.paths import FMI_HEADERS, ROOT

SSP = ROOT / "build" / "ClosedLoop.ssp"
MACHINE = ROOT / "build" / "Machine.ssp"
# what an SSP may leave out
SETS = r"<ssd:ParameterBindings>.*?</ssd:ParameterBindings>"
EXPERIMENT = r"<ssd:DefaultExperiment.*</ssd:DefaultExperiment>"
ALGORITHM = r"<ssd:DefaultExperiment([^>]*)>.*</ssd:DefaultExperiment>"
FROM_TRAJECTORY = r'<ssd:Connection startElement="trajectory".*?/>'
TYPES = r"<ssc:(Real|Boolean|Integer)[^>]*/>"
Edit = Callable[[bytes], bytes | None]  # None: the file is left out


def read_csv(path: Path) -> dict[str, np.ndarray]:
    """Columns of a CSV file by name."""
    with path.open(encoding="utf-8") as file:
        names = [name.strip('"') for name in file.readline().strip().split(",")]
        return dict(zip(names, np.loadtxt(file, delimiter=",").T, strict=True))


def edited(source: Path, target: Path, edits: dict[str, Edit]) -> Path:
    """Copy an archive with some of its files changed; return `target`."""
    target.write_bytes(_edited(source.read_bytes(), edits))
    return target


def replace(old: str, new: str, count: int = 1) -> Edit:
    """Edit that replaces text, which has to be there."""

    def edit(content: bytes) -> bytes:
        assert old.encode() in content
        return content.replace(old.encode(), new.encode(), count)

    return edit


def without(path: Path, *patterns: str, more: dict[str, Edit] | None = None) -> Path:
    """Copy the closed loop without what matches `patterns`, and with `more` edits."""

    def edit(content: bytes) -> bytes:
        text = content.decode()
        for pattern in patterns:
            kept = r"<ssd:DefaultExperiment\1/>" if pattern == ALGORITHM else ""
            text, count = re.subn(pattern, kept, text, flags=re.DOTALL)
            assert count
        return text.encode()

    return edited(SSP, path, {"SystemStructure.ssd": edit} | (more or {}))


def edited_fmu(edits: dict[str, Edit]) -> Edit:
    """Edit of an FMU that lies in an SSP."""
    return lambda content: _edited(content, edits)


def _edited(archive: bytes, edits: dict[str, Edit]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(archive)) as old, zipfile.ZipFile(buffer, "w") as new:
        assert set(edits) <= set(old.namelist())
        for name in old.namelist():
            content: bytes | None = old.read(name)
            if name in edits:
                content = edits[name](content)
            if content is not None:
                new.writestr(name, content)
    return buffer.getvalue()


def not_a_number(reference: int, steps: int, folder: Path) -> Edit:
    """Edit that puts tests/support/not_a_number.c in the place of an FMU's shared object."""
    library = folder / f"not_a_number_{reference}_{steps}.so"
    command = ["gcc", "-std=c17", "-shared", "-fPIC", f"-DBROKEN={reference}", f"-DSTEPS={steps}"]
    command += ["-I", str(FMI_HEADERS), "-o", str(library)]
    subprocess.run([*command, str(Path(__file__).with_name("not_a_number.c"))], check=True)
    return lambda _: library.read_bytes()
