"""A test that is written in C is run, or its file does not compile; tests that need programs of
./setup.sh --platforms have the label `more`."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.paths import ROOT

FILE = """\
/* static void test_in_a_comment(void) { } */
static const char text[] = "\\"static void test_in_a_string(void) {";

static void test_first(void) {
    (void)text;
}

EACH_METHOD static void test_with_methods(void) {}

EACH_CVODE_METHOD static void
test_with_some(void) {
}
"""


def listed(folder: Path, text: str) -> subprocess.CompletedProcess[str]:
    """Run list_tests.py on a file with this text: folder/test.c and folder/test.h."""
    (folder / "test.c").write_text(text)
    program = ROOT / "tests" / "support" / "list_tests.py"
    command = [sys.executable, program, folder / "test.c", folder / "test.h"]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_tests_are_listed_in_their_order_with_lines_and_methods(tmp_path: Path) -> None:
    assert listed(tmp_path, FILE).returncode == 0
    lines = (tmp_path / "test.h").read_text().splitlines()
    assert [line.strip() for line in lines if line.startswith("    {")] == [
        '{"test_first", test_first, 4, TEST_ONCE},',
        '{"test_with_methods", test_with_methods, 8, TEST_EACH_METHOD},',
        '{"test_with_some", test_with_some, 11, TEST_EACH_CVODE_METHOD},',
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("static int test_of_a_type(void) { return 0; }", "test_of_a_type is not a"),
        ("static void test_with_an_argument(int i) { (void)i; }", "test_with_an_argument is not a"),
        ("void test_that_is_exported(void) {}", "test_that_is_exported is not a"),
        ("OFTEN static void test_often(void) {}", "test_often is not a"),
        ("/* static void test_nothing(void) {} */", "no `static void test_...(void)`"),
    ],
)
def test_what_cannot_be_run_is_an_error(tmp_path: Path, text: str, message: str) -> None:
    result = listed(tmp_path, f"{text}\n")
    assert result.returncode == 1 and not (tmp_path / "test.h").exists()
    assert f"test.c:1: error: {message}" in result.stderr


# ---- Labels --------------------------------------------------------------------------------------

FIXTURES = {"browser", "firefox", "each_browser", "apart"}  # of tests/conftest.py
# they skip a test where something is missing
FUNCTIONS = {
    ("tests.support.missing", "missing"),
    ("tests.platforms.platforms", "runner"),
    ("tests.importers.osp", "libcosim"),
}


def is_needy(path: Path) -> bool:
    nodes = list(ast.walk(ast.parse(path.read_text())))
    arguments = {node.arg for node in nodes if isinstance(node, ast.arg)}
    imports = [node for node in nodes if isinstance(node, ast.ImportFrom)]
    imported = {(node.module, alias.name) for node in imports for alias in node.names}
    return bool(arguments & FIXTURES or imported & FUNCTIONS)


def labelled(folder: Path) -> set[Path]:
    text = (folder / "CMakeLists.txt").read_text()
    patterns = re.findall(r"add_python_tests\(MORE ([^)]+)\)", text)
    return {path for pattern in " ".join(patterns).split() for path in folder.glob(pattern)}


def test_needy_tests_are_labelled() -> None:
    files = {path for path in (ROOT / "tests").rglob("test_*.py") if is_needy(path)}
    assert len(files) > 10
    wrong = {path for path in files if path not in labelled(path.parent)}
    assert not wrong
