"""Where the project is, and all FMUs and systems of its CMakeLists.txt: tests of one are of all."""

import importlib.util
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FMI_HEADERS = Path(importlib.util.find_spec("fmpy").origin).parent / "c-code"

_TEXT = (ROOT / "CMakeLists.txt").read_text()
_FMU = re.compile(
    r"^add_fmu\((\w+) FOLDER models/(\w+) EQUATIONS \S+?(?:\s+LIBRARY \w+)?"
    r"(?:\s+REFERENCES ([\w ]+))?\)",
    re.M,
)
_DECLARED = _FMU.findall(_TEXT)

NAMES = tuple(name for name, _, _ in _DECLARED)
EXAMPLES = dict(re.findall(r"^  add_fmu\((\w+) EQUATIONS (\S+)\)", _TEXT, re.M))  # their files
EVERY = (*NAMES, *EXAMPLES)
OF_FILES = dict(re.findall(r"^ *add_fmu\((\w+) (?:FOLDER \S+ )?EQUATIONS (\S+?)\)?$", _TEXT, re.M))
FOLDERS = {name: folder for name, folder, _ in _DECLARED}  # below models/
CARRIED = {name: scenarios.split() for name, _, scenarios in _DECLARED if scenarios}
SYSTEMS = tuple(re.findall(r"^add_ssp\((\w+)", _TEXT, re.MULTILINE))
