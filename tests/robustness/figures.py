"""Prints the figures of the campaigns that ran last as a table: ./test.sh --long ends with it.

A campaign prints one line, `figures: WHAT; executions N; seconds N; findings N; ...`, of which
ctest keeps a copy in its log.
"""

import re
import sys
from pathlib import Path

COLUMNS = ("executions", "calls", "instances", "cycles", "seconds", "findings")
PREFIX = "figures: "
TEST = re.compile(r"^\d+/\d+ Test: (\S+)$")


def parse(line: str) -> tuple[str, dict[str, str], list[str]]:
    """Name, figures of COLUMNS by their name, and the rest of the line."""
    what, *fields = (field.strip() for field in line.removeprefix(PREFIX).split(";"))
    known: dict[str, str] = {}
    others = []
    for field in fields:
        name, _, value = field.partition(" ")
        if name in COLUMNS:
            known[name] = value
        else:
            others.append(field)
    return what, known, others


def failures(text: str) -> list[str]:
    """Tests of a log that did not pass: after a crash they may have no figures."""
    names: dict[str, bool] = {}
    name = ""
    for line in text.splitlines():
        if match := TEST.match(line):
            name = match[1]
            names[name] = False
        elif line == "Test Passed.":
            names[name] = True
    return [name for name, passed in names.items() if not passed]


def table(lines: list[str]) -> str:
    rows = [("", *COLUMNS, "")]
    for line in lines:
        what, known, others = parse(line)
        rows.append((what, *(known.get(name, "") for name in COLUMNS), ", ".join(others)))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(
            [row[0].ljust(widths[0])]
            + [cell.rjust(width) for cell, width in zip(row[1:-1], widths[1:-1], strict=True)]
            + [row[-1]]
        ).rstrip()
        for row in rows
    )


def main() -> None:
    if len(sys.argv) < 2:
        sys.exit(f"usage: {sys.argv[0]} build/Testing/Temporary/LastTest.log ...")
    texts = [Path(name).read_text(encoding="utf-8", errors="replace") for name in sys.argv[1:]]
    lines = [
        line.strip() for text in texts for line in text.splitlines() if line.startswith(PREFIX)
    ]
    if not lines:
        sys.exit("the logs contain no campaign")
    print(table(lines))
    for text in texts:
        for name in failures(text):
            print(f"FAILED: {name}")


if __name__ == "__main__":
    main()
