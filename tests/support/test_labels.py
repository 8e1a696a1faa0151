"""Tests that need what ./setup.sh --platforms installs have the label `more`."""

import ast
import re
from pathlib import Path

from tests.support.paths import ROOT

FIXTURES = {"browser", "firefox", "each_browser", "apart"}  # of tests/conftest.py
# they skip a test for want of something
FUNCTIONS = {
    ("tests.support.missing", "missing"),
    ("tests.platforms.platforms", "runner"),
    ("tests.support.libcosim", "libcosim"),
}
NEEDS_NOTHING = {"tests/platforms/test_missing.py"}  # it tests what they say


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
    assert {path.relative_to(ROOT).as_posix() for path in wrong} == NEEDS_NOTHING
