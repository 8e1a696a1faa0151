"""Mistakes in [gradients]: one line with file, section and name, exit code 2."""

from pathlib import Path

import pytest

from tests.equations.compiled import ModelFileError, read_text
from tests.support.programs import RPARM, python

TEXT = """name = "Plain"
[sizes]
n = 2
[parameters]
m = { start = 2 }
whole = { type = "Integer", start = 3 }
on = { type = "Boolean", start = true }
kind = { type = ["slow", "fast"], start = "fast" }
twice = { value = "2 * m" }
"k[i]" = { for = "i = 1..n", start = 1 }
[inputs]
u = {}
[states]
x = { start = 1, derivative = "(u - m * x if on else k[1]) * twice" }
free = { derivative = "x" }
[where]
inner = "2 * x"
[outputs]
late = { type = "Boolean", value = "time > 3" }
count = { type = "Integer", value = "1 if time > 3 else 2" }
# more
[gradients]
by = ["m", "start(x)"]
of = ["x", "free"]
"""
BY, OF = 'by = ["m", "start(x)"]', 'of = ["x", "free"]'
ROWS = [
    (BY, 'by = ["nothing"]', "nothing"),
    (BY, 'by = ["m", "whole"]', "whole"),
    (BY, 'by = ["on"]', "on"),
    (BY, 'by = ["kind"]', "kind"),
    (BY, 'by = ["u"]', "u"),
    (BY, 'by = ["n"]', "n"),
    (BY, 'by = ["twice"]', "twice"),
    (BY, 'by = ["inner"]', "inner"),
    (BY, 'by = ["k[3]"]', "k[3]"),
    (BY, 'by = ["x"]', "x"),
    (BY, 'by = ["time"]', "time"),
    (BY, 'by = ["start(m)"]', "start(m)"),
    (BY, 'by = ["start(u)"]', "start(u)"),
    (BY, 'by = ["start(nothing)"]', "nothing"),
    (BY, 'by = ["m", "start(x)", "m"]', "m"),
    (BY, 'by = ["start(x)", "start(x)"]', "start(x)"),
    (BY, 'by = ["m + 1"]', "m + 1"),
    (BY, "by = [3]", "by"),
    (BY, 'by = "m"', "by"),
    (BY, "by = []", "by"),
    (BY, "", "by"),
    (OF, "of = []", "of"),
    (OF, 'of = "x"', "of"),
    (OF, 'of = ["nothing"]', "nothing"),
    (OF, 'of = ["late"]', "late"),
    (OF, 'of = ["count"]', "count"),
    (OF, 'of = ["m"]', "m"),
    (OF, 'of = ["x", "x"]', "x"),
    (OF, 'off = ["x"]', "off"),
    ("[where]", '[where]\nx_by_m = "x"', "x_by_m"),
    ("[where]", '[where]\nx_by_start_x = "x"', "x_by_start_x"),
    ("# more", 'gradients_are_exact = { value = "x" }', "gradients_are_exact"),
]


@pytest.mark.parametrize(("old", "new", "name"), ROWS, ids=[new for _, new, _ in ROWS])
def test_a_mistake_is_one_line(tmp_path: Path, old: str, new: str, name: str) -> None:
    assert TEXT.count(old) == 1
    read_text(tmp_path, TEXT)
    with pytest.raises(ModelFileError) as refused:
        read_text(tmp_path, TEXT.replace(old, new))
    text = str(refused.value)
    assert "\n" not in text and "[gradients]" in text and "model.toml" in text
    assert name in text.partition("[gradients]")[2], text


def test_the_command_says_so(tmp_path: Path) -> None:
    path = tmp_path / "plain.toml"
    path.write_text(TEXT.replace(BY, 'by = ["nothing"]'), encoding="utf-8")
    ended = python(*RPARM, "build", path, "--output", tmp_path)
    assert ended.returncode == 2 and ended.stdout == ""
    (line,) = ended.stderr.splitlines()
    assert "plain.toml" in line and "[gradients]" in line and "nothing" in line
