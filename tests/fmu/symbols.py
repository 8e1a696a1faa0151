"""Functions of libraries: what nm lists, those of the standard, those of the system's libm."""

import ctypes
import re
import subprocess
from pathlib import Path

from tests.support.paths import FMI_HEADERS

COUNTS = {"fmi2": 44, "fmi3": 75}


def listed(*arguments: object, tools: str = "") -> set[str]:
    """Names that nm lists, without their versions and the names of these; `tools`: its prefix."""
    command = [f"{tools}nm", *map(str, arguments)]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    lines = (line.split() for line in text.splitlines())
    return {line[-1].partition("@")[0] for line in lines if len(line) > 1 and line[-2] != "A"}


def standard(version: str) -> set[str]:
    """Functions of "fmi2" or "fmi3", by its header."""
    header = (FMI_HEADERS / f"{version}Functions.h").read_text()
    names = set(re.findall(rf"{version}FullName\(({version}\w+)\)", header))
    assert len(names) == COUNTS[version]
    return names


def libm() -> set[str]:
    """Functions of the system's libm."""
    ctypes.CDLL("libm.so.6")
    path = re.search(r"/\S*/libm\.so\.6", Path("/proc/self/maps").read_text()).group()
    names = listed("--dynamic", "--defined-only", path)
    assert {"sin", "sincos", "pow", "sqrt", "fmin"} <= names
    return names
