"""A test that is written in C is run, or the build fails."""

import subprocess
import sys
from pathlib import Path

import pytest

LIST_TESTS = Path(__file__).with_name("list_tests.py")
FILE = """\
/* static void test_in_a_comment(void) { } */
// static void test_in_a_line_of_comment(void) {
static const char text[] = "\\"static void test_in_a_string(void) {";
static void test_first(void) {
}
static void helper(void) {}
EACH_METHOD static void test_with_methods(void) {
}
EACH_CVODE_METHOD static void
test_with_some(void) {
}
"""


def listed(folder: Path, text: str) -> subprocess.CompletedProcess[str]:
    """Run list_tests.py on a file with this text: folder/test.c and folder/test.h."""
    (folder / "test.c").write_text(text)
    command = [sys.executable, LIST_TESTS, folder / "test.c", folder / "test.h"]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_tests_are_listed_in_their_order_with_lines_and_methods(tmp_path: Path) -> None:
    assert listed(tmp_path, FILE).returncode == 0
    lines = (tmp_path / "test.h").read_text().splitlines()
    assert [line.strip() for line in lines if line.startswith("    {")] == [
        '{"test_first", test_first, 4, TEST_ONCE},',
        '{"test_with_methods", test_with_methods, 7, TEST_EACH_METHOD},',
        '{"test_with_some", test_with_some, 10, TEST_EACH_CVODE_METHOD},',
    ]


@pytest.mark.parametrize(
    ("addition", "message"),
    [
        ("static int test_of_a_type(void) { return 0; }", "test_of_a_type is not a"),
        ("static void test_with_an_argument(int i) { (void)i; }", "test_with_an_argument is not a"),
        ("static inline void test_inline(void) {}", "test_inline is not a"),
        ("void test_that_is_exported(void) {}", "test_that_is_exported is not a"),
        ("OFTEN static void test_often(void) {}", "test_often is not a"),
    ],
)
def test_a_test_that_cannot_be_run_is_an_error(tmp_path: Path, addition: str, message: str) -> None:
    result = listed(tmp_path, f"{FILE}{addition}\n")
    assert result.returncode == 1
    assert f"test.c:{1 + FILE.count(chr(10))}: error: {message}" in result.stderr


def test_a_file_without_tests_is_an_error(tmp_path: Path) -> None:
    result = listed(tmp_path, "/* static void test_nothing(void) {} */\n")
    assert result.returncode == 1
    assert result.stderr.startswith(f"{tmp_path / 'test.c'}:1: error: ")
    assert not (tmp_path / "test.h").exists()
