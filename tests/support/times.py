"""Where the time of ./test.sh went: build/times.csv and build/times/*.xml as a table.

    build/venv/bin/python -m tests.support.times [--readme]

--readme puts it into tests/README.md: after ./test.sh --all under "Where the time goes", after
./test.sh --long with its figures under "The last long run".
"""

import argparse
import csv
import datetime
import re
import subprocess
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

from tests.support.paths import ROOT

BUILD = ROOT / "build"
SLOWEST = 8  # groups that a row of its own names
# names of ctest by their groups: tests/CMakeLists.txt
GROUPS = {
    r"(?:python|more)_([a-z]\w*?)(_\d+)?": r"\1",
    r"long_memcheck_.*": "valgrind",
    r"long_(fuzz|soak|identification_coverage).*": r"\1",
    r"((?:long|analysis)_.*)": r"\1",
    r".*": "C",
}
# of the rows: the tests in a file of ctest
FILES = {
    "tests: sanitizers, C": "asan",
    "tests: all but those that --all adds": "default",
    "tests: releases, playground, analysers, importers, browsers": "more",
    "tests: fuzzing": "long_fuzz",
    "tests: long campaigns, mutants": "long",
}

ENDS = {
    "tests: all but those that --all adds": "./test.sh",
    "tests: releases, playground, analysers, importers, browsers": "./test.sh --all",
    "tests: long campaigns, mutants": "./test.sh --long",
}


def group_of(name: str) -> str:
    """The group of a test of ctest."""
    for pattern, group in GROUPS.items():
        if found := re.fullmatch(pattern, name):
            return found.expand(group)
    raise AssertionError(name)


def slowest(file: Path) -> str:
    """The groups of a run of ctest that take longest, with their seconds, one process each."""
    seconds: Counter[str] = Counter()
    for case in ElementTree.parse(file).iter("testcase"):
        seconds[group_of(case.get("name", ""))] += float(case.get("time", "0"))
    return ", ".join(f"{name} {time:.0f}" for name, time in seconds.most_common(SLOWEST))


def table(rows: list[list[str]]) -> list[str]:
    """Lines of Markdown: each part, and the sums so far where a form of ./test.sh ends."""
    lines = ["| part | s | processor s | longest, s |", "|---|--:|--:|---|"]
    clock = processors = 0.0
    for name, *numbers in rows:
        seconds, user, system = map(float, numbers)
        clock, processors = clock + seconds, processors + user + system
        file = BUILD / "times" / f"{FILES.get(name)}.xml"
        longest = slowest(file) if file.is_file() else ""
        lines.append(f"| {name} | {seconds:.0f} | {user + system:.0f} | {longest} |")
        if name in ENDS:
            lines.append(f"| **{ENDS[name]}** | {clock:.0f} | {processors:.0f} | |")
    return lines


def section(rows: list[list[str]]) -> tuple[str, list[str]]:
    """Heading of the section of tests/README.md that these rows belong to, and its lines."""
    commit = ["git", "log", "-1", "--format=%h"]
    about = subprocess.run(commit, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    today = datetime.datetime.now(datetime.UTC).date().isoformat()
    lines = [f"{today}, commit {about.strip()}, two processes:", "", *table(rows)]
    figures = BUILD / "times" / "figures.txt"
    if not figures.is_file():
        return "Where the time goes", lines
    kept = [line.removeprefix("figures: ") for line in figures.read_text().splitlines()]
    return "The last long run", [*lines, "", *(f"- {line}" for line in kept)]


def replaced(page: str, heading: str, lines: list[str]) -> str:
    """The page with these lines from the first table, or list, of a section to its end."""
    before, title, after = page.partition(f"\n## {heading}\n")
    assert title, f"tests/README.md has no section {heading}"
    text, following, rest = after.partition("\n## ")
    kept = re.split(r"^(?=\d{4}-\d\d-\d\d, commit )", text, maxsplit=1, flags=re.MULTILINE)[0]
    new = "\n".join([kept.rstrip("\n"), "", *lines, ""])
    return f"{before}{title}{new}{following}{rest}"


def main() -> None:
    """Print the table, or put it into the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--readme", action="store_true")
    with (BUILD / "times.csv").open(newline="") as file:
        # a name may have commas, its numbers have none
        rows = [[",".join(row[:-3]), *row[-3:]] for row in csv.reader(file)]
    heading, lines = section(rows)
    if parser.parse_args().readme:
        page = ROOT / "tests" / "README.md"
        page.write_text(replaced(page.read_text(), heading, lines))
    print(*lines, sep="\n")


if __name__ == "__main__":
    main()
