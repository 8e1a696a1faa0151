"""The commands: what each is for, where its code is, and what has to be there before it runs.

`run.sh` asks this file before there is an environment: `python3 -P rparm/needs.py ARGUMENT ...`.
So it imports the standard library only, and little of it.
"""

import os
import stat
import sys
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple


class Command(NamedTuple):
    """A command of `rparm` or `run.sh`."""

    text: str  # for help
    module: str  # of rparm.commands
    extra: str = ""  # of the distribution, that has its packages
    lock: str = ""  # requirements/LOCK.txt, which setup.sh installs beside run.txt
    target: str = "all"  # of CMake, that is built before; empty: nothing
    builds: bool = False  # models, if its files ask for it
    description: str = ""  # for its help
    options: Mapping[str, Any] = MappingProxyType({})


with Path(__file__).with_name("commands.toml").open("rb") as file:
    DECLARED = tomllib.load(file)
SHARED = DECLARED.pop("shared")  # of the commands' options
COMMANDS = {name: Command(**declared) for name, declared in DECLARED.items()}
DEFAULT = "run"  # the command of names and options without one
COMMON = ("--json", "--quiet")  # may stand in front of the command
HELP = ("help", "--help", "-h")
VERSION = "--version"

NO_READER = 141  # 128 + SIGPIPE, which not every system has
EXIT_CODES = (
    "exit codes: 0 all well, 1 a result is bad, 2 wrong use or failure, 130 Ctrl-C,\n"
    f"{NO_READER} whoever read the output has left, as head does"
)
OVERVIEW = f"""usage: {{program}} [COMMAND] [OPTION ...]
       {{program}} help COMMAND

Simulates scenarios on co-simulation FMUs and checks them against references.

commands:
{{commands}}

options of all commands:
  --json        print one JSON document, and all else on standard error
  --quiet       print the last line only, and what is wrong
  --output DIR  write into this folder
  --open        then show what was written in a browser

{{program}} {VERSION} prints the version.
{EXIT_CODES}"""


def overview(program: str) -> str:
    """Return the help on everything: the commands in a line each."""
    width = max(map(len, COMMANDS))
    lines = (f"  {name:<{width}}  {command.text}" for name, command in COMMANDS.items())
    return OVERVIEW.format(program=program, commands="\n".join(lines))


def is_scenario(name: str, models: Path) -> bool:
    """Return whether it is an option, a file, or the name of a scenario: `run` takes these."""
    files = models.glob("*/scenarios/*.toml")
    return name.startswith("-") or name.lower().endswith(".toml") or name in {x.stem for x in files}


def plan(arguments: Sequence[str], models: Path) -> list[str]:
    """Return the words that run.sh reads first, "-" for none.

    They are the lock to install, the target to build ("overview": help on everything), "yes" or
    "no" for --quiet and for --json, and the command to put in front of the arguments.
    """
    end = arguments.index("--") if "--" in arguments else len(arguments)
    options = arguments[:end]
    first, *rest = [x for x in options if x not in COMMON] or [""]
    lock, target = "", ""
    if first in HELP:
        target = "" if rest or "--json" in options else "overview"
    elif first in COMMANDS or not first or is_scenario(first, models):
        known = COMMANDS.get(first or DEFAULT, COMMANDS[DEFAULT])
        is_list = first in ("--list", VERSION) or (first == DEFAULT and "--list" in rest)
        if not (is_list or {"--help", "-h"} & set(rest)):
            lock, target = known.lock, known.target
    flags = ["yes" if option in options else "no" for option in ("--quiet", "--json")]
    return [lock or "-", target or "-", *flags, "-" if first else DEFAULT]


# ---- What the set-up and a build depend on -------------------------------------------------------
SOURCES = ("CMakeLists.txt", "CMakePresets.json", "LICENSE", "README.md", "cmake", "fmu", "models")
SOURCES += ("playground", "pyproject.toml", "requirements", "rparm", "run.sh", "setup.sh", "src")
SYSTEM = ("/usr/include", "/usr/bin/cc", "/usr/bin/gcc", "/usr/bin/clang", "/usr/bin/cmake")
MADE = ("CMakeCache.txt", "Makefile", "deps/sundials/LICENSE", "deps/musl/COPYRIGHT", "fmi3", "fmu")
MADE += ("models", "musl", "playground", "proof", "runtime", "src", "sundials", "venv/bin/python")
MADE += ("CMakeFiles/elementary_functions.dir", "CMakeFiles/runtime_fmi2.dir")
MADE += ("CMakeFiles/runtime_fmi3.dir", "platforms/wasm32-wasi/runtime")
PATTERNS = ("*.a", "*.fmu", "*.ssp", "venv/*.installed")


def state(root: Path) -> tuple[str, str]:
    """Return hashes of names, times and sizes: of what is built from, and of what was built."""
    build = root / "build"
    made = [build / name for name in MADE]
    made += [path for pattern in PATTERNS for path in sorted(build.glob(pattern))]
    sources = [*(root / name for name in SOURCES), *map(Path, SYSTEM)]
    return _hash(root, sources), _hash(build, made)


def _hash(place: Path, paths: Sequence[Path]) -> str:
    from hashlib import sha256

    found = sha256(str(place).encode(errors="backslashreplace"))
    for path in paths:
        for line in _listed(str(path)):
            found.update(line.encode(errors="backslashreplace"))
    return found.hexdigest()


def _listed(path: str) -> Iterator[str]:
    try:
        status = os.stat(path)  # noqa: PTH116 (pathlib takes thrice as long)
        is_folder = stat.S_ISDIR(status.st_mode) and path not in SYSTEM
        if not is_folder:
            yield f"{path}\0{os.path.realpath(path)}\0{status.st_mtime_ns}\0{status.st_size}\n"
            return
        for name in sorted(os.listdir(path)):  # noqa: PTH208
            if name != "__pycache__":
                yield from _listed(f"{path}/{name}")
    except OSError:  # not there
        yield f"{path}\n"


if __name__ == "__main__":
    root = Path(__file__).absolute().parents[1]
    words = plan(sys.argv[1:], root / "models")
    print(*words, *(state(root) if "overview" not in words else ()))
    if "overview" in words:
        print(overview("./run.sh"))
