"""Lets an analyser read the C files of a build: analyse.py TOOL BUILD [--only REGEX] [OPTION ...].

TOOL: warnings (of clang), tidy or cppcheck; OPTIONs are passed on. Each own file is read once for
each set of macros with which targets compile it. Two processes work. Exit code 1: findings.
"""

import argparse
import json
import re
import shlex
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PROCESSES = 2
TIDY = "clang-tidy-14"  # others know other checks
ONLY_GCC = re.compile(r"-m\w+-strategy=")
# differ between targets only by what is loaded, which is the same to an analyser
OF_TARGET = re.compile(r"-D(\w+_EXPORTS$|FMU\w*_LIBRARY=|FMU_DESCRIPTION=|CONTINUE_STATE=)")
LEFT_OUT = re.compile(r"/build/deps/|_sources-src/|/unity\.c$")  # not the project's own

Commands = list[dict[str, str]]


def chosen(commands: Commands, only: str) -> Commands:
    """Of the commands of a build those that show an analyser something new."""
    found: dict[tuple[str, ...], dict[str, str]] = {}
    for entry in commands:
        words = [x for x in shlex.split(entry["command"]) if not ONLY_GCC.match(x)]
        macros = (x for x in words if x.startswith("-D") and not OF_TARGET.match(x))
        name = entry["file"].removeprefix(f"{ROOT}/")
        if re.match(only, name) and not LEFT_OUT.search(entry["file"]):
            key = (name, *sorted(macros))
            found.setdefault(key, entry | {"command": shlex.join(words)})
    return list(found.values())


def of_clang(entry: dict[str, str]) -> list[str]:
    """The command with clang's warnings in place of an object."""
    words = shlex.split(entry["command"])
    place = words.index("-o")
    return ["clang", "-fsyntax-only", *words[1:place], *words[place + 2 :]]


def calls(tool: str, commands: Commands, folder: Path, options: list[str]) -> list[list[str]]:
    """What to run; the folder has the commands."""
    if tool == "warnings":
        return [[*of_clang(entry), *options] for entry in commands]
    if tool == "tidy":
        files = sorted({entry["file"] for entry in commands})
        return [[TIDY, "--quiet", "-p", str(folder), *options, file] for file in files]
    project = folder / "compile_commands.json"
    return [["cppcheck", "--quiet", f"--project={project}", f"-j{PROCESSES}", *options]]


def run(call: list[str], folder: str) -> str:
    """Output of a call that finds something, or nothing."""
    done = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)
    return done.stdout + done.stderr if done.returncode != 0 else ""


def main() -> int:
    """1 where something is found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tool", choices=("warnings", "tidy", "cppcheck"))
    parser.add_argument("build", type=Path)
    parser.add_argument("--only", default="", help="files by their paths from the root")
    arguments, options = parser.parse_known_args()
    every = json.loads((arguments.build / "compile_commands.json").read_text())
    commands = chosen(every, arguments.only)
    print(f"{len(commands)} of {len(every)} commands")
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(PROCESSES) as pool:
        (Path(folder) / "compile_commands.json").write_text(json.dumps(commands))
        todo = calls(arguments.tool, commands, Path(folder), options)
        found = [text for text in pool.map(run, todo, [arguments.build] * len(todo)) if text]
    print(*found, sep="\n")
    return 1 if found or not commands else 0


if __name__ == "__main__":
    sys.exit(main())
