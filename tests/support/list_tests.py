"""Lists the tests of a C file for test_main.c, so that every test in the file runs.

list_tests.py FILE.c HEADER writes a header that the compiler includes in front of FILE.c. It
declares every `static void test_...(void)` of FILE.c and puts them into a list, in their order.
The compiler refuses a test that is missing from the list (static and never used) and one that is
left out by `#if 0` (used and never defined).
"""

import re
import sys
from pathlib import Path
from typing import NamedTuple

# comments and literals, where nothing is code
NO_CODE = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'', re.DOTALL)
DEFINITION = re.compile(r"^([\w \t*\n]*?)\b(test_\w+)\s*\(([^()]*)\)\s*\{", re.MULTILINE)
KINDS = {
    "static void": "TEST_ONCE",
    "EACH_METHOD static void": "TEST_EACH_METHOD",
    "EACH_CVODE_METHOD static void": "TEST_EACH_CVODE_METHOD",
}


class Test(NamedTuple):
    """One test of a file; kind as in test_list.h."""

    name: str
    line: int
    kind: str


def tests_of(text: str) -> list[Test]:
    """Tests in C code; ValueError, with the line, for a function that only has such a name."""
    code = NO_CODE.sub(lambda match: " " + "\n" * match[0].count("\n"), text)
    tests = []
    for found in DEFINITION.finditer(code):
        kind = KINDS.get(" ".join(found[1].split()))
        line = 1 + code.count("\n", 0, found.start(2))
        if kind is None or found[3].strip() != "void":
            raise ValueError(f"{line}: error: {found[2]} is not a `static void test_...(void)`")
        tests.append(Test(found[2], line, kind))
    if not tests:
        raise ValueError("1: error: no `static void test_...(void)` in this file")
    return tests


def header(tests: list[Test], source: Path) -> str:
    """Text of the header."""
    declarations = "".join(f"static void {test.name}(void);\n" for test in tests)
    rows = "".join(f'    {{"{t.name}", {t.name}, {t.line}, {t.kind}}},\n' for t in tests)
    return (
        '/* Written by list_tests.py. */\n#include "test_list.h"\n\n'
        f'{declarations}\nconst char test_file[] = "{source.as_posix()}";\n'
        f"const struct test test_list[] = {{\n{rows}}};\n"
        f"const unsigned test_count = {len(tests)};\n"
    )


def main() -> None:
    if len(sys.argv) != 3:
        sys.exit(f"usage: {sys.argv[0]} FILE.c HEADER")
    source, target = map(Path, sys.argv[1:])
    try:
        tests = tests_of(source.read_text(encoding="utf-8"))
    except ValueError as error:
        sys.exit(f"{source}:{error}")
    target.write_text(header(tests, source), encoding="utf-8")


if __name__ == "__main__":
    main()
